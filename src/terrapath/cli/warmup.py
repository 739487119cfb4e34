"""``terrapath warmup``: compile the kernels before they are needed."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from .exit_codes import ExitCode

if TYPE_CHECKING:
    from ..warmup import Watch


@contextmanager
def _bar(quiet: bool) -> Iterator[Watch]:
    """One bar on standard error, where somebody is watching."""
    from ..warmup import watch_nothing

    if quiet or not sys.stderr.isatty():
        yield watch_nothing
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("[bold]compiling kernels: {task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)

        def show(stage: str, done: int, total: int) -> None:
            bar.update(task, description=stage, completed=done, total=total)

        yield show


def warmup_command(
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing.")] = False,
) -> int:
    """Compile all kernels now, so that no later run has to wait for them.

    They are kept on disk; NUMBA_CACHE_DIR says where. Exit codes: 0 done, 2 they cannot be
    compiled or kept, 130 interrupted (what was compiled is kept).
    """
    from ..warmup import warm_up

    started = time.perf_counter()
    with _bar(quiet) as watch:
        warmth = warm_up(watch)
    if quiet:
        return ExitCode.SOLVED
    what = "all kernels are there"
    if warmth.compiled:
        seconds = time.perf_counter() - started
        what = f"compiled {warmth.compiled} kernels in {seconds:.0f} s"
    typer.echo(f"{what}: {warmth.size / 1e6:.1f} MB in {warmth.directory}")
    return ExitCode.SOLVED
