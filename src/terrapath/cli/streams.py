"""Standard output and standard error: what goes there, and where it can go nowhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO


@contextmanager
def without_broken_messages() -> Iterator[None]:
    """Silence where a message of GDAL is no text, as of a damaged file that it quotes.

    Rasterio decodes messages in a callback of GDAL, whatever its log's level. Where that fails
    Python prints it, by both hooks of the interpreter. They are the process's: only the command,
    whose process it is, sets them.
    """
    uncaught, unraisable = sys.excepthook, sys.unraisablehook

    def of_uncaught(kind: Any, error: Any, trace: Any) -> None:
        if not issubclass(kind, UnicodeDecodeError):
            uncaught(kind, error, trace)

    def of_unraisable(what: Any) -> None:
        if "rasterio" not in str(what.object):
            unraisable(what)

    sys.excepthook, sys.unraisablehook = of_uncaught, of_unraisable
    try:
        yield
    finally:
        sys.excepthook, sys.unraisablehook = uncaught, unraisable


def settle(*streams: TextIO | None) -> None:
    """Flush for the last time; what a stream does not take goes nowhere.

    Python flushes once more at its end: what fails then is a complaint, and another exit code.
    """
    for stream in streams:
        if stream is None:  # closed from the beginning
            continue
        try:
            stream.flush()
        except OSError:
            with suppress(OSError):  # one that is no file
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
