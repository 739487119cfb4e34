"""Progress bars on standard error, where somebody is watching."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from .._support.watching import Watch, watch_nothing

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


def is_watched(quiet: bool) -> bool:
    """Does somebody see what is drawn?"""
    return not quiet and sys.stderr.isatty()


def make_bars(prefix: str = "", *, transient: bool = True) -> Progress:
    """Bars with what is done of how much, and the time. transient : they vanish at the end."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn(f"[bold]{prefix}{{task.description}}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    return Progress(*columns, console=Console(stderr=True), transient=transient)


@contextmanager
def bar_for_all(what: str, quiet: bool) -> Iterator[Watch]:
    """A watcher that draws one bar, which names what is done and the stage it is at."""
    if not is_watched(quiet):
        yield watch_nothing
        return
    with make_bars(f"{what}: ") as bar:
        task = bar.add_task("", total=None)

        def show(stage: str, done: int, total: int) -> None:
            bar.update(task, description=stage, completed=done, total=total)

        yield show


@contextmanager
def bar_for_each(quiet: bool) -> Iterator[Watch]:
    """A watcher that draws one bar a stage; they stay."""
    if not is_watched(quiet):
        yield watch_nothing
        return
    with make_bars(transient=False) as bars:
        tasks: dict[str, TaskID] = {}

        def show(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done)

        yield show
