"""What the first run waits for, said where somebody is waiting."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from .bars import is_watched
from .remarks import remark

# Where `_kernels/compiler.py` logs each kernel that the cache lacks.
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
