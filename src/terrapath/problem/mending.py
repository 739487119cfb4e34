"""A path that touches an obstacle by rounding, led round the place.

Planners test what they join, so this is the last resort. It keeps the rule that no path leaves a
planner untested.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..space.free_space import FreeSpace
from ..validation import Array

# A detour leaves a segment by these shares of its length, a point its place by these of the side.
SHARES = 10.0 ** np.arange(-12.0, -1.0)
# A segment is halved at most so often, each half with a detour of its own.
MOST_HALVINGS = 6
DIRECTIONS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)])


def mended(space: FreeSpace, points: Array) -> Array | None:
    """A path (k, 2) near the one given that touches nothing; None where none is found.

    Its ends stay where they are.
    """
    x0, y0, x1, y1 = space.bounds
    inside = np.clip(points, (x0, y0), (x1, y1))
    moved = [inside[0], *(_freed(space, point) for point in inside[1:-1]), inside[-1]]
    path = [moved[0]]
    for a, b in pairwise(moved):
        between = _detour(space, a, b, MOST_HALVINGS)
        if between is None:
            return None
        path += [*between, b]
    found = np.array(path)
    return found if space.allows(found) else None


def _freed(space: FreeSpace, point: Array) -> Array:
    """The nearest free point that is tried; the point itself where none is found."""
    shifts = (space.bounds.side * SHARES[:, None, None] * DIRECTIONS).reshape(-1, 2)
    tried = np.concatenate([point[None], point + shifts])
    free = space.segments_are_free(tried, tried) & space.bounds.contains(tried)
    return np.asarray(tried[int(np.argmax(free))])


def _detour(space: FreeSpace, a: Array, b: Array, halvings: int) -> list[Array] | None:
    """The points to pass between a and b; None where none are found."""
    if space.allows(np.array([a, b])):
        return []
    middle, across = 0.5 * (a + b), np.array([a[1] - b[1], b[0] - a[0]])
    for share in SHARES:
        for side in (share, -share):
            point = middle + side * across
            if space.allows(np.array([a, point, b])):
                return [point]
    if halvings == 0:
        return None
    middle = _freed(space, middle)
    first = _detour(space, a, middle, halvings - 1)
    second = None if first is None else _detour(space, middle, b, halvings - 1)
    return None if first is None or second is None else [*first, middle, *second]
