"""Standard output and standard error where nobody reads them, or no disk takes them."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import TextIO


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
