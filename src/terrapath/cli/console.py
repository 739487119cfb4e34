"""What the command shows besides the answer: lines, progress bars, exit codes."""

from __future__ import annotations

import _thread
import enum
import errno
import io
import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

from .._support.watching import Watch, watch_nothing
from ..errors import TerrapathWarning, told_to

if TYPE_CHECKING:
    from rich.progress import Progress as Bars, TaskID

    from ..planners.base import Callback, Progress


class ExitCode(enum.IntEnum):
    """The exit codes of the command."""

    SOLVED = 0
    BAD_INPUT = 2
    NOT_FOUND = 3
    UNREACHABLE = 4
    NOT_SHOWN = 5  # standard output is closed or full; files are written
    INTERRUPTED = 130


# Lines


LONGEST_WORD = 400  # letters; the middle of longer ones is left out, for nobody reads it


class Closed(io.TextIOBase):
    """Standard output that was closed from the beginning: what is written to it is an error."""

    def write(self, text: str, /) -> int:
        """Raise OSError."""
        raise OSError(errno.EBADF, "it is closed")


def remark(message: object) -> None:
    """Print one line on standard error, unless that is closed."""
    words = (
        word if len(word) <= LONGEST_WORD else f"{word[:60]}...{word[-60:]}"
        for word in str(message).split()
    )
    with suppress(OSError):
        print("terrapath:", " ".join(words), file=sys.stderr)


@contextmanager
def remarks() -> Iterator[None]:
    """Show the project's warnings as remarks, each once."""
    shown = set[str]()

    def show(warning: TerrapathWarning) -> None:
        if str(warning) not in shown:
            shown.add(str(warning))
            remark(warning)

    with told_to(show):
        yield


def _is_of_reader(what: object) -> bool:
    """Is it of a library that reads files, which may be damaged?"""
    module = getattr(what, "__module__", None) or ""
    return "rasterio" in str(what) or module.startswith("h5netcdf")


@contextmanager
def without_broken_messages() -> Iterator[None]:
    """Print nothing where a message of GDAL is not text, because it quotes a damaged file.

    Rasterio decodes messages in a callback of GDAL, whatever the level of its log. Where that
    fails, Python prints the error through two hooks of the interpreter. The hooks belong to the
    process, so only the command may set them.
    """
    uncaught, unraisable = sys.excepthook, sys.unraisablehook

    def of_uncaught(
        kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        if not issubclass(kind, UnicodeDecodeError):
            uncaught(kind, error, trace)

    def of_unraisable(what: sys.UnraisableHookArgs) -> None:
        if issubclass(what.exc_type, KeyboardInterrupt):
            # Ctrl-C while a callback of a library ran, which cannot raise it: raise it again.
            _thread.interrupt_main()
        elif not _is_of_reader(what.object):
            unraisable(what)

    sys.excepthook, sys.unraisablehook = of_uncaught, of_unraisable
    try:
        yield
    finally:
        sys.excepthook, sys.unraisablehook = uncaught, unraisable


def settle(*streams: TextIO | None) -> None:
    """Flush for the last time; drop what a stream cannot take.

    Python flushes once more when it ends. Where that failed, it would print an error and change
    the exit code.
    """
    for stream in streams:
        if stream is None:  # closed from the beginning
            continue
        try:
            stream.flush()
        except OSError:
            with suppress(OSError):  # the stream is no file
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


# Bars


def is_watched(quiet: bool) -> bool:
    """Are progress bars to be drawn? Only on a terminal, and not with --quiet."""
    return not quiet and sys.stderr.isatty()


def make_bars(prefix: str = "", *, transient: bool = True) -> Bars:
    """Progress bars with the count and the time. transient : they are removed at the end."""
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
    """A watcher that draws one bar, with the name of the work and its present stage."""
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
    """A watcher that draws one bar for each stage; the bars stay."""
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


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Callback | None]:
    """A callback that draws a planner's progress; None where no bar is to be drawn."""
    if not is_watched(quiet):
        yield None
        return
    from ..planners.base import SEARCHING

    with make_bars() as bar:
        # Before the first report, kernels are loaded, or compiled if they are not in the cache.
        task = bar.add_task("preparing kernels", total=None)

        def show(progress: Progress) -> None:
            total = progress.total if progress.stage == SEARCHING else None
            bar.update(
                task, description=_describe(progress), total=total, completed=progress.samples
            )

        yield show


def _describe(progress: Progress) -> str:
    """The leg, the stage, and how good the best path is."""
    from ..planners.base import SEARCHING

    leg = f"{progress.leg}: " if progress.leg else ""
    if math.isfinite(progress.gap):
        return f"{leg}{progress.stage}, gap {percent(progress.gap)}"
    if progress.stage != SEARCHING:
        return leg + progress.stage
    if math.isfinite(progress.best_cost):
        return f"{leg}best {progress.best_cost:,.6g} {progress.unit}".rstrip()
    return f"{leg}no path yet"


def percent(share: float) -> str:
    """A share in percent, to three digits."""
    return f"{100.0 * share:.3g} %"


# Compiling


# Where `_kernels/compiler.py` logs each kernel that the cache lacks.
LOGGER = "terrapath.kernels"


@contextmanager
def compiling_announced(quiet: bool = False) -> Iterator[None]:
    """Say once on standard error that kernels are compiled, if any are and bars are drawn."""
    if not is_watched(quiet):
        yield
        return
    import logging

    class Announcer(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            logger.removeHandler(self)
            remark("compiling kernels, once; `terrapath warmup` does it for all commands")

    logger, announcer = logging.getLogger(LOGGER), Announcer()
    before = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(announcer)
    try:
        yield
    finally:
        logger.removeHandler(announcer)
        logger.setLevel(before)
