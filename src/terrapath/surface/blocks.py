"""Large grids are worked on block by block, so that what is made on the way stays small."""

from __future__ import annotations

from collections.abc import Iterator

BLOCK = 2**20  # values that are worked on at once


def blocks(count: int, width: int) -> Iterator[slice]:
    """Slices of ``count`` lines, each of ``width`` values, that hold a block together."""
    size = max(1, BLOCK // max(width, 1))
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))
