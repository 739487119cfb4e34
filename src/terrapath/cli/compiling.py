"""What the first run waits for, said where somebody is waiting."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from .bars import is_watched
from .remarks import remark

if TYPE_CHECKING:
    from ..planners.base import Callback, Progress

# Where `_kernels/cache.py` logs each kernel that the cache lacks.
LOGGER = "terrapath.kernels"


@contextmanager
def compiling_told(quiet: bool = False) -> Iterator[None]:
    """Say once on standard error that kernels are compiled, if any are and somebody watches."""
    if not is_watched(quiet):
        yield
        return
    import logging

    class Teller(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            logger.removeHandler(self)
            remark("compiling kernels, once; `terrapath warmup` does it for all commands")

    logger, teller = logging.getLogger(LOGGER), Teller()
    before = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(teller)
    try:
        yield
    finally:
        logger.removeHandler(teller)
        logger.setLevel(before)


@contextmanager
def bound_compiled_beside(
    surface_class: str, wanted: bool = True
) -> Iterator[Callable[[Callback | None], Callback | None]]:
    """Compile what proves the bound on a second core, while the planner's kernels are compiled.

    Gives what a planner's callback is handed through: it waits for them when the bound is begun.
    """
    from ..planners.base import PROVING
    from ..second_core import SecondCore, rehearsal_name

    if not wanted:
        yield lambda callback: callback
        return
    with SecondCore(rehearsal_name("lower bounds", surface_class)) as second:

        def joined(callback: Callback | None) -> Callback:
            def watch(progress: Progress) -> bool:
                if progress.stage == PROVING:
                    second.wait()
                return callback is not None and bool(callback(progress))

            return watch

        yield joined
