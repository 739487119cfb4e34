"""``python -m benchmarks``: against the clock, the truth and the peers."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from terrapath._support.watching import Watch
from terrapath.cli.main import run
from terrapath.cli.resumable import run_resumable

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def benchmark_command(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[WHAT]...",
            help="Any of bound, fast-marching, path, large-maps, startup, trees, grids, growth "
            "and edges [default: all].",
        ),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Fewer repetitions, smaller lattices: some minutes."),
    ] = False,
    output: Annotated[
        Path, typer.Option(metavar="DIR", help="Directory for pictures, measures and report.")
    ] = Path("benchmark"),
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bars.")] = False,
) -> int:
    """Measure Terrapath against the clock, true lengths, and other programs (peers).

    Peers that are not installed are named and left out. A run that was stopped continues when
    the same command is given again. Nothing else should run on the machine.
    Exit codes: 0 done, whatever was measured, 2 bad input, 130 interrupted.
    """

    def work(watch: Watch) -> Path:
        from .run import benchmark

        return benchmark(what or (), output, quick=quick, watch=watch)

    return run_resumable(work, output, quiet)


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:], app))
