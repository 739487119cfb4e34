"""``terrapath reproduce``: the paper's figures and tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .._support.watching import Watch
from .resumable import run_resumable


def reproduce_command(
    what: Annotated[
        str,
        typer.Argument(
            metavar="[WHAT]",
            help="all, one-peak, three-peaks, six-peaks, comparative, repeat, convergence, "
            "sensitivity or smoothing.",
        ),
    ] = "all",
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer samples and runs: about a minute.")
    ] = False,
    output: Annotated[
        Path, typer.Option(metavar="DIR", help="Directory for pictures, trials and report.")
    ] = Path("reproduction"),
    workers: Annotated[
        int | None, typer.Option(metavar="N", help="Processes [default: one for each core].")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="K", help="Seed of the first trial.")] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bars.")] = False,
) -> int:
    """Reproduce the figures and tables of the paper's section 5.

    A run that was stopped continues when the same command is given again.
    Exit codes: 0 done, 2 bad input, 130 interrupted (the finished trials are kept).
    """

    def work(watch: Watch) -> Path:
        from ..paper.reproduce import reproduce

        return reproduce(what, output, quick=quick, seed=seed, workers=workers, watch=watch)

    return run_resumable(work, output, quiet)
