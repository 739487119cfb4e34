"""Obstacles inflated by a vehicle's radius.

A point that is disjoint from the inflated obstacles is at least the radius away from those given.
A buffer of GEOS lies inside the true one. So each buffer is made larger and measured, and grown
where it is still too small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from ..errors import InputError
from ..surface import Mask
from ..surface.bounds import Bounds
from ..validation import Array
from .free_space import CELL_MARGIN, Circle, Geometries, Obstacle, are_points, sort_obstacles
from .reachability import merged_masks

# A quarter of a circle becomes this many edges. GEOS rounds their number along an arc, so an edge
# may span 1.5 times its share of the angle. Buffers are made wider by that: 0.5 % at most.
QUARTER_EDGES = 12
WIDEST_EDGE = 1.5 * 0.5 * math.pi / QUARTER_EDGES

# The clearance is larger than the radius by this share of it, and of the largest coordinate:
# far above rounding, far below anything on a map.
EXCESS, ROUNDING = 1e-9, 2.0**-46

# A buffer that is too small is grown by this share, which doubles with each attempt.
GROWTH, ATTEMPTS = 0.002, 9

# Inflated obstacles are joined where they have no more corners than this. A corner takes about
# 5 microseconds.
MOST_JOINED = 300_000

# A cell is blocked where it is nearer than the radius by at least this share of a cell. Free space
# widens blocked cells by more than that, so a path is never nearer than the radius.
CELL_DOUBT = 0.5 * CELL_MARGIN
MOST_CELLS_AT_ONCE = 2**22


def inflated(obstacles: Sequence[Obstacle], radius: float, bounds: Bounds) -> list[Obstacle]:
    """Obstacles such that what is disjoint from them is at least a radius from those given.

    radius : map units. Discs and points become discs. A cell of a mask becomes blocked
    where its rectangle is nearer than the radius to that of a blocked cell. What is too far away
    to matter within the bounds is left out.
    """
    if radius == 0.0:
        return list(obstacles)
    parts = sort_obstacles(obstacles)
    extents = shapely.bounds(parts.geometries).reshape(-1, 4)
    largest = float(np.abs(np.concatenate([extents.ravel(), bounds])).max())
    reach = radius * (1.0 + EXCESS) + ROUNDING * largest
    near = _are_near(extents, bounds, 2.0 * reach)
    geometries = parts.geometries[near]
    is_point = are_points(geometries)
    corners = shapely.get_coordinates(geometries[is_point])
    discs = [Circle(float(x), float(y), reach) for x, y in corners]
    discs += [Circle(disc.x1, disc.x2, disc.radius + reach) for disc in parts.circles]
    masks = [_inflated_mask(mask, radius, bounds) for mask in merged_masks(parts.masks)]
    return [*_joined(geometries[~is_point], radius, reach), *discs, *masks]


def _are_near(extents: Array, bounds: Bounds, reach: float) -> npt.NDArray[np.bool_]:
    west, south, east, north = extents.T
    in_x = (east >= bounds.x1_min - reach) & (west <= bounds.x1_max + reach)
    in_y = (north >= bounds.x2_min - reach) & (south <= bounds.x2_max + reach)
    return np.asarray(in_x & in_y)


def _joined(given: Geometries, radius: float, reach: float) -> Geometries:
    """Lines and polygons inflated, and made one where they overlap."""
    if len(given) == 0:
        return given
    grown = _grown(given, radius, reach)
    if shapely.get_num_coordinates(grown).sum() > MOST_JOINED:
        return grown
    merged = shapely.get_parts(shapely.union_all(grown))
    # Where outlines cross, joining moves corners by rounding. So the result is measured, too.
    return merged if _is_clear(given, merged, reach) else grown


def _grown(given: Geometries, radius: float, reach: float) -> Geometries:
    """Each geometry inflated, until its outline is ``reach`` away from what was given."""
    shapely.prepare(given)
    inside = shapely.point_on_surface(given)
    grown = np.empty(len(given), np.object_)
    todo = np.arange(len(given))
    distance = reach / math.cos(0.5 * WIDEST_EDGE)
    for attempt in range(ATTEMPTS):
        grown[todo] = shapely.buffer(given[todo], distance, quad_segs=QUARTER_EDGES)
        clear = shapely.covers(grown[todo], inside[todo])
        clear &= ~shapely.dwithin(given[todo], shapely.boundary(grown[todo]), reach)
        todo = todo[~clear]
        if len(todo) == 0:
            return grown
        distance *= 1.0 + GROWTH * 2.0**attempt
    raise InputError(
        f"radius={radius:g} is too small or too large to inflate obstacles near "
        f"{given[todo[0]].centroid.coords[0]} by; give coordinates nearer to the origin"
    )


def _is_clear(given: Geometries, grown: Geometries, reach: float) -> bool:
    """Are all outlines at least ``reach`` away from all that was given, which they hold?"""
    held, _ = shapely.STRtree(grown).query(shapely.point_on_surface(given), predicate="within")
    if len(np.unique(held)) < len(given):
        return False
    near = shapely.STRtree(given).query(
        shapely.boundary(grown), predicate="dwithin", distance=reach
    )
    return bool(near.shape[1] == 0)


# Masks


def _inflated_mask(mask: Mask, radius: float, bounds: Bounds) -> Mask:
    """The cells whose rectangle is nearer than the radius to that of a blocked cell."""
    if not mask.blocked.any():
        return mask
    dx, dy = mask.spacing
    from scipy import ndimage

    x, (left, right) = _widened(mask.x, dx, radius, bounds.x1_min, bounds.x1_max)
    y, (below, above) = _widened(mask.y, dy, radius, bounds.x2_min, bounds.x2_max)
    blocked = np.pad(mask.blocked, ((below, above), (left, right)))
    largest = float(np.abs([*bounds, x[0], x[-1], y[0], y[-1]]).max())
    limit = radius - CELL_DOUBT * min(dx, dy) + ROUNDING * largest
    # With its neighbours blocked, too, the distance between centres is that of rectangles.
    touching = ndimage.binary_dilation(blocked, np.ones((3, 3), np.bool_))
    halo = math.ceil(min(radius / dy, len(y))) + 1
    rows = max(MOST_CELLS_AT_ONCE // len(x), 2 * halo, 1)
    for first in range(0, len(y), rows):
        low, high = max(first - halo, 0), min(first + rows + halo, len(y))
        if not touching[low:high].any():
            continue
        gaps = ndimage.distance_transform_edt(~touching[low:high], sampling=(dy, dx))
        blocked[first : first + rows] = gaps[first - low :][:rows] < limit
    return Mask(blocked | np.pad(mask.blocked, ((below, above), (left, right))), x, y)


def _widened(
    axis: Array, step: float, radius: float, low: float, high: float
) -> tuple[Array, tuple[int, int]]:
    """Cell centres with as many more at both ends as the bounds and the radius ask for."""
    most = math.ceil(radius / step) + 1
    before = min(max(math.ceil((axis[0] - low) / step), 0), most)
    after = min(max(math.ceil((high - axis[-1]) / step), 0), most)
    first = axis[0] - step * np.arange(before, 0, -1)
    last = axis[-1] + step * np.arange(1, after + 1)
    return np.concatenate([first, axis, last]), (before, after)
