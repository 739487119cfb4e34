"""What the command's exit code means."""

from __future__ import annotations

import enum


class ExitCode(enum.IntEnum):
    """The documented codes."""

    SOLVED = 0
    BAD_INPUT = 2
    NOT_FOUND = 3
    UNREACHABLE = 4
    NOT_SHOWN = 5  # standard output is closed or full; files are written
    INTERRUPTED = 130
