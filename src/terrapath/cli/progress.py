"""A progress bar on standard error, with the best length so far."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from ..planners.base import Callback, Progress
from ..problem import Problem


@contextmanager
def progress_bar(problem: Problem, quiet: bool) -> Iterator[Callback | None]:
    """A callback that draws the bar; None where nobody is watching."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("[bold]{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    unit = problem.surface.unit
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        # Until the first report the kernels are loaded, or compiled where they are new.
        task = bar.add_task("preparing kernels", total=None)

        def show(progress: Progress) -> None:
            best = "no path yet"
            if math.isfinite(progress.best_cost):
                best = f"best {progress.best_cost:,.6g} {unit}".rstrip()
            bar.update(task, description=best, total=progress.total, completed=progress.samples)

        yield show
