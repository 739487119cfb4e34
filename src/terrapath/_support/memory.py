"""Memory: the peak of a process, and work on large arrays in blocks, which keeps it low."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def peak_memory() -> int | None:
    """The most memory that this process has used, bytes; None where the system does not know.

    Where there is ``/proc``, ``ru_maxrss`` is not used: it includes the peak of the parent process.
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
    """Reset the peak, where the system can, so that the memory for compiling is not counted."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


BLOCK = 2**20  # values that are processed at once


def blocks(count: int, width: int) -> Iterator[slice]:
    """Slices of ``count`` lines of ``width`` values; each slice has about one block of values."""
    size = max(1, BLOCK // max(width, 1))
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))
