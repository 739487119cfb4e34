"""``terrapath reproduce``: the paper's figures and tables."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from .exit_codes import ExitCode


@contextmanager
def stages(quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """A watcher that draws one bar a stage on standard error, where somebody is watching."""
    from ..experiments.runner import watch_nothing

    if quiet or not sys.stderr.isatty():
        yield watch_nothing
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskID,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (
        TextColumn("[bold]{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bars:
        tasks: dict[str, TaskID] = {}

        def show(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done)

        yield show


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
        int | None, typer.Option(metavar="N", help="Processes [default: one a core].")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="K", help="Seed of the first trial.")] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bars.")] = False,
) -> int:
    """Reproduce the figures and tables of the paper's section 5.

    A run that was stopped goes on where it was when the same command is given again.
    Exit codes: 0 done, 2 bad input, 130 interrupted (the finished trials are kept).
    """
    try:
        from ..experiments.reproduce import reproduce

        with stages(quiet) as watch:
            report = reproduce(what, output, quick=quick, seed=seed, workers=workers, watch=watch)
    except KeyboardInterrupt:
        print(
            f"terrapath: interrupted; the finished trials are kept in {output / 'trials'}, and "
            "the same command goes on from there",
            file=sys.stderr,
        )
        return ExitCode.INTERRUPTED
    typer.echo(report)
    return ExitCode.SOLVED
