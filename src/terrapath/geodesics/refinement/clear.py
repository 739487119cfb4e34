"""Moving a path clear of what it grazes, before it is pulled taut.

Walls and corners stand a clearance away from obstacles. A path through free space may lead through
the strip between, however near it comes to an obstacle. Its points there are moved out of the
strip, and where a segment cuts a corner, the path is bent round that corner. Nothing moves farther
than about the clearance, so the path passes each obstacle on the same side as before.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import shapely

from ..._kernels.geodesics import contacts as kernels
from ..._kernels.space import free_space as grids
from ...space.free_space import FreeSpace, Indices
from ...validation import Array
from .walls import SLACK, Surroundings

# A point in a narrow place is moved out of the strips of several walls, one after another.
MOST_MOVES = 8
# Corners lie at most sqrt(2) clearances away from their obstacles.
REACH_OF_CORNERS = 1.5


def moved_clear(space: FreeSpace, around: Surroundings, points: Array) -> Array | None:
    """A path (k, 2) near the one given, outside all strips; None where there is no room for it.

    The ends, too, are moved out of strips; the segments from where they were are free.
    """
    outside = _moved_out(around, points)
    if outside is None or not space.segments_are_free(points, outside).all():
        return None
    cutting = np.flatnonzero(~_are_clear(around, outside))
    at, corners = _corners_cut(around, outside, cutting)
    bent = np.insert(outside, at + 1, around.corners[corners], axis=0)
    return bent if _are_clear(around, bent).all() and space.allows(bent) else None


def is_clear(around: Surroundings, points: Array) -> bool:
    """Does a path stay outside all strips?"""
    return bool((_walls_behind(around, points)[0] < 0).all() and _are_clear(around, points).all())


def _are_clear(around: Surroundings, points: Array) -> npt.NDArray[np.bool_]:
    """(m - 1,), which segments of a path cross no wall."""
    free = np.empty(len(points) - 1, np.uint8)
    grids.fill_free(around.space, points[:-1], points[1:], free)
    return free.astype(bool)


def _walls_behind(around: Surroundings, points: Array) -> tuple[Indices, Array]:
    """The wall in whose strip each point is, -1 for none, and how deep, map units."""
    hits, depths = np.empty(len(points), np.int64), np.empty(len(points))
    strips = around.strips
    kernels.fill_strips(around.walls, strips, strips.max(), points, hits, depths)
    return hits, depths


def _moved_out(around: Surroundings, points: Array) -> Array | None:
    """The points, moved straight out of the strips; None where one cannot leave them."""
    points = points.copy()
    for _ in range(MOST_MOVES):
        hits, depths = _walls_behind(around, points)
        inside = np.flatnonzero(hits >= 0)
        if len(inside) == 0:
            return points
        walls = hits[inside]
        steps = depths[inside] + SLACK * around.clearance[walls]
        points[inside] += steps[:, None] * around.walls.normals[walls]
    return None


def _corners_cut(around: Surroundings, points: Array, cutting: Indices) -> tuple[Indices, Indices]:
    """The corners that segments cut, in their order along the path, and the segment of each.

    cutting (k,) : the segments that cross walls.
    """
    if len(cutting) == 0 or len(around.corners) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    segments = shapely.linestrings(np.stack([points[cutting], points[cutting + 1]], axis=1))
    # How far a corner may be from a segment that cuts it.
    reaches = REACH_OF_CORNERS * around.clearance.max() + around.sags[around.discs[:-1]]
    places = shapely.points(around.corners)
    which, corners = shapely.STRtree(places).query(
        segments, predicate="dwithin", distance=reaches.max()
    )
    near = shapely.dwithin(segments[which], places[corners], reaches[corners])
    which, corners = which[near], corners[near]
    at = cutting[which]
    ahead = points[at + 1] - points[at]
    along = ((around.corners[corners] - points[at]) * ahead).sum(axis=1)
    order = np.lexsort((along, at))
    return at[order], corners[order]
