"""A progress bar on standard error, with the best length so far."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

from ..planners.base import SEARCHING, Callback, Progress
from ..problem import Problem
from .bars import is_watched, make_bars
from .report import percent


@contextmanager
def progress_bar(problem: Problem | None, quiet: bool) -> Iterator[Callback | None]:
    """A callback that draws the bar; None where nobody is watching.

    problem : tells the unit, where it is known beforehand.
    """
    if not is_watched(quiet):
        yield None
        return
    unit = "" if problem is None else problem.surface.unit
    with make_bars() as bar:
        # Until the first report the kernels are loaded, or compiled where they are new.
        task = bar.add_task("preparing kernels", total=None)

        def show(progress: Progress) -> None:
            total = progress.total if progress.stage == SEARCHING else None
            shown = _describe(progress, unit)
            bar.update(task, description=shown, total=total, completed=progress.samples)

        yield show


def _describe(progress: Progress, unit: str) -> str:
    """Which leg it is, what is being done, and how good the best is."""
    leg = f"{progress.leg}: " if progress.leg else ""
    if math.isfinite(progress.gap):
        return f"{leg}{progress.stage}, gap {percent(progress.gap)}"
    if progress.stage != SEARCHING:
        return leg + progress.stage
    if math.isfinite(progress.best_cost):
        return f"{leg}best {progress.best_cost:,.6g} {unit}".rstrip()
    return f"{leg}no path yet"
