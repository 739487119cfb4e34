"""The shortest path on flat ground among obstacles, by a search over their corners.

Where the metric is constant, geodesics are straight lines of the plane, and a shortest path bends
only at corners that obstacles turn to free ground. As obstacles may not be touched, the path bends
at places beside the corners, at a tiny clearance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from .._kernels.geodesics import sight, visibility as kernels
from .._kernels.space.free_space import list_edges
from .._kernels.surface.cells import range_in_box
from .._kernels.surface.surfaces import Spline
from .._support.watching import WatchCount
from ..errors import InputError
from ..problem import Path, Problem
from ..space.free_space import (
    POLYGON,
    Circle,
    FreeSpace,
    Geometries,
    Indices,
    cell_margin,
    index_grid,
    listed,
)
from ..space.reachability import merged_masks, runs
from ..surface import Mask, metric
from ..surface.bounds import Bounds
from ..validation import Array

# The distance between a path and the corners that it bends round: a share of the region's side, but
# not below the rounding of the largest coordinate.
CLEARANCE = 1e-11
ROUNDING = 2.0**-49
# Free space widens the cells of masks by a margin; corners stand away by twice that.
CELL_MARGINS = 2.0
# The corners of a cell from its upper right one on: outwards, and along the walls that meet there,
# with the cell to the left.
CELL_CORNERS = np.array(
    [
        [(1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)],
        [(-1.0, 1.0), (-1.0, 0.0), (0.0, -1.0)],
        [(1.0, -1.0), (1.0, 0.0), (0.0, 1.0)],
        [(-1.0, -1.0), (0.0, -1.0), (1.0, 0.0)],
    ]
)
# A corner that turns by less than this, radians, is straight; one that turns back by as little is
# the end of a line.
LEAST_TURN = 1e-9
# The test of discs rounds more.
DISC_ROUNDING = 2.0**-45

# Discs become polygons around them, of so many corners for all, within these limits for each.
DISC_CORNERS = 65_536
FEWEST_SIDES, MOST_SIDES = 64, 4096

# So many corners are settled before the search may be stopped.
CHUNK = 256


class Taut(NamedTuple):
    """What the search found.

    path : the shortest one; None where there is none, or where the search was stopped before.
    is_finished : was the search not stopped? least : no path is shorter, map units, but for
    rounding and the clearance; infinite where there is no path.
    """

    path: Path | None
    is_finished: bool
    least: float


def is_flat(problem: Problem) -> bool:
    """Is the metric h the same in all of the bounds: planes as layers, and constant costs?"""
    data, bounds = problem.surface.data, problem.bounds
    if isinstance(data, Spline):
        costs = range_in_box(data.cells, bounds.x1_min, bounds.x1_max, bounds.x2_min, bounds.x2_max)
        if costs.low < costs.high:
            return False
    return metric.is_flat(problem.surface, bounds)


def shortest_taut_path(problem: Problem, *, watch: WatchCount | None = None) -> Taut:
    """The shortest path of a problem on flat ground, to 1e-7 relative.

    Discs are replaced by polygons around them: the path is longer by less than 3e-7, relative,
    where there are up to 16 discs, and by less than 1e-3 where there are more than 1,000.
    watch : may stop the search. Raises InputError where the ground is not flat.

    Source: A* over the taut part of the visibility graph; what is seen from a corner is found when
    the corner is settled.
    """
    if not is_flat(problem):
        raise InputError("the ground is not flat, so straight lines are not shortest; use optimal")
    if problem.start == problem.goal:
        return Taut(problem.path([problem.start, problem.goal]), True, 0.0)
    scene = _scene(problem)
    search, view = _empty_search(scene), _empty_view(scene)
    settled, state = 0, kernels.RUNNING
    while state == kernels.RUNNING:
        state = kernels.advance(scene, search, view, CHUNK)
        settled += CHUNK
        if state == kernels.RUNNING and watch is not None and watch(settled):
            return Taut(None, False, float(search.key[search.heap[0]]))
    if state == kernels.EXHAUSTED:
        return Taut(None, True, math.inf)
    return Taut(problem.path(_points(scene, search)), True, float(search.cost[-1]))


def _points(scene: sight.Scene, search: kernels.Search) -> Array:
    """The path (m, 2) that the search ended with."""
    chain = [len(search.parent) - 1]
    while search.parent[chain[-1]] >= 0:
        chain.append(int(search.parent[chain[-1]]))
    return scene.corners[chain[::-1], :2].copy()


def _empty_search(scene: sight.Scene) -> kernels.Search:
    """A search that has only reached the start."""
    count = len(scene.corners)
    start = count - 2
    cost, key, slot = np.full(count, np.inf), np.empty(count), np.full(count, kernels.UNSEEN)
    heap = np.empty(count, np.int64)
    cost[start], key[start], slot[start], heap[0] = 0.0, 0.0, 0, start
    return kernels.Search(cost, np.full(count, -1), key, slot, heap, np.ones(1, np.int64))


def _empty_view(scene: sight.Scene) -> sight.View:
    count, most = len(scene.corners), len(scene.wall_ids) + 2
    low, high, row = np.empty(most), np.empty(most), np.empty(most, np.int64)
    return sight.View(np.empty(count, np.int64), np.full(count, -1), low, high, row)


# What can be run into


class _Outline(NamedTuple):
    """walls (e, 4) and corners (n, 7), as in ``Scene``."""

    walls: Array
    corners: Array


def _scene(problem: Problem) -> sight.Scene:
    """The obstacles of a problem, and the corners to bend round; then its start and its goal."""
    space, bounds = problem.free_space, problem.bounds
    parts = list(_outlines(space))
    walls = np.concatenate([np.empty((0, 4)), *(part.walls for part in parts)])
    corners = np.concatenate([np.empty((0, 7)), *(part.corners for part in parts)])
    ends = np.zeros((2, 7))
    ends[:, :2] = problem.start, problem.goal
    corners = np.concatenate([corners[bounds.contains(corners[:, :2])], ends])
    grid = index_grid(bounds, len(walls))
    wall_first, wall_ids = listed(list_edges, grid, walls)
    places = np.tile(corners[:, :2], 2)
    corner_first, corner_ids = listed(list_edges, grid, places)
    centre = (0.5 * (bounds.x1_min + bounds.x1_max), 0.5 * (bounds.x2_min + bounds.x2_max))
    h = metric.metric_tensor(problem.surface, centre)
    return sight.Scene(
        space.data,
        grid,
        walls,
        wall_first,
        wall_ids,
        corners,
        corner_first,
        corner_ids,
        h[[0, 0, 1], [0, 1, 1]],
    )


def _outlines(space: FreeSpace) -> list[_Outline]:
    """The outlines of all kinds of obstacles."""
    bounds = space.bounds
    largest = float(np.abs(bounds).max())
    clearance = max(CLEARANCE * bounds.side, ROUNDING * largest)
    geometries = np.array(space.geometries, np.object_)
    parts = [_mask(mask, bounds, clearance) for mask in merged_masks(space.masks)]
    if len(geometries):
        parts.append(_rings(_closed(geometries), clearance))
    if space.circles:
        discs = _discs(space.circles)
        parts.append(_rings(discs, clearance + DISC_ROUNDING * largest))
    return parts


def _closed(geometries: Geometries) -> Geometries:
    """The outlines of polygons and lines as lines with free ground to their right.

    The first point comes again as the last one. A line is followed there and back.
    """
    is_polygon = shapely.get_type_id(geometries) == POLYGON
    rings = shapely.get_rings(shapely.orient_polygons(geometries[is_polygon]))
    lines = [shapely.get_coordinates(line) for line in geometries[~is_polygon]]
    around = [shapely.LineString(np.concatenate([line, line[-2::-1]])) for line in lines]
    outlines = np.concatenate([rings, np.array(around, np.object_)])
    return np.asarray(shapely.remove_repeated_points(outlines))


def _discs(circles: list[Circle]) -> Geometries:
    """Polygons around discs, as closed lines."""
    sides = min(max(DISC_CORNERS // len(circles), FEWEST_SIDES), MOST_SIDES)
    angles = np.arange(sides + 1) % sides * (2.0 * math.pi / sides)
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) / math.cos(math.pi / sides)
    around = [(disc.x1, disc.x2) + disc.radius * ring for disc in circles]
    return np.asarray(shapely.linestrings(around))


def _rings(outlines: Geometries, clearance: float) -> _Outline:
    """Walls and corners of closed lines with free ground to their right.

    A corner that turns by more than a right angle is cut off, into two. Otherwise the corner of a
    spike would lie far from its tip.
    """
    points, ring = shapely.get_coordinates(outlines, return_index=True)
    is_wall = ring[1:] == ring[:-1]
    first, last, ring = points[:-1][is_wall], points[1:][is_wall], ring[:-1][is_wall]
    along = _units(last - first)
    before = along[_previous(ring)]
    turn = np.arctan2(_cross(before, along), (before * along).sum(axis=1))
    turn[turn < LEAST_TURN - math.pi] = math.pi  # the end of a line
    is_corner, is_cut = turn > 0.0, turn > 0.5 * math.pi + LEAST_TURN
    reach = np.tan(np.where(is_cut, 0.25, 0.5) * np.maximum(turn, 0.0))[:, None]
    arriving = _right_of(before) + reach * before
    leaving = _right_of(along) - reach * along
    cut = _units(leaving - arriving)
    plain = is_corner & ~is_cut
    corners = [
        _corners(first[plain], clearance * arriving[plain], before[plain], along[plain]),
        _corners(first[is_cut], clearance * arriving[is_cut], before[is_cut], cut[is_cut]),
        _corners(first[is_cut], clearance * leaving[is_cut], cut[is_cut], along[is_cut]),
    ]
    return _Outline(np.hstack([first, last]), np.concatenate(corners))


def _previous(ring: Indices) -> Indices:
    """(m,), the number of the wall before each in its ring. ring : (m,), increasing."""
    starts = np.flatnonzero(np.diff(ring, prepend=-1))
    previous = np.arange(len(ring)) - 1
    previous[starts] = np.append(starts[1:], len(ring)) - 1
    return previous


def _corners(at: Array, outwards: Array, before: Array, along: Array) -> Array:
    """Corners (n, 7), moved outwards."""
    return np.hstack([at + outwards, before, along, np.hypot(*outwards.T)[:, None]])


def _units(vectors: Array) -> Array:
    """Vectors (m, 2) made 1 long; those of length 0 stay so."""
    return np.asarray(vectors / np.maximum(np.hypot(*vectors.T), 1e-300)[:, None])


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _right_of(along: Array) -> Array:
    return np.column_stack([along[:, 1], -along[:, 0]])


def _mask(mask: Mask, bounds: Bounds, clearance: float) -> _Outline:
    """Walls and corners of a mask's blocked cells."""
    (dx, dy), blocked = mask.spacing, mask.blocked
    x = mask.x[0] + dx * (np.arange(blocked.shape[1] + 1) - 0.5)
    y = mask.y[0] + dy * (np.arange(blocked.shape[0] + 1) - 0.5)
    row, first, last = runs(blocked)
    along_x = np.column_stack([x[first], y[row], x[last], y[row]])
    column, first, last = runs(blocked.T)
    along_y = np.column_stack([x[column], y[first], x[column], y[last]])
    padded = np.pad(blocked, 1)
    quarters = np.stack([padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]])
    j, i = np.nonzero(quarters.sum(axis=0) == 1)
    which = quarters[:, j, i].argmax(axis=0)
    margins = CELL_MARGINS * cell_margin(mask, bounds) * np.array(mask.spacing)
    outwards, before, along = CELL_CORNERS[which].transpose(1, 0, 2)
    corners = _corners(
        np.column_stack([x[i], y[j]]), (clearance + margins) * outwards, before, along
    )
    return _Outline(np.concatenate([along_x, along_y]), corners)
