"""Memory: how much was in use at most, and blocks of large arrays, so that it is little."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def peak_memory() -> int | None:
    """The most memory that this process has had, bytes; None where the system does not tell.

    Not by ``ru_maxrss`` where there is ``/proc``: a process inherits its parent's there.
    """
    try:
        lines = Path("/proc/self/status").read_text(errors="replace").splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
    except (OSError, StopIteration):
        return _peak_memory_elsewhere()


def _peak_memory_elsewhere() -> int | None:
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def forget_peak() -> None:
    """Let the peak start anew from here, where the system can; compiling had one of its own."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


BLOCK = 2**20  # values that are worked on at once


def blocks(count: int, width: int) -> Iterator[slice]:
    """Slices of ``count`` lines, each of ``width`` values, that hold a block together."""
    size = max(1, BLOCK // max(width, 1))
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))
