"""Shortest routes where costs are constant in cells: searched on the cells' sides, and polished.

Within a cell a shortest path is straight, or nearly so on hills. It bends on the sides of cells,
as light does. ``shortest_through_cells`` searches points on the sides of all cells;
``polished`` searches ever denser ones near a path, and moves its bends to where Snell's law holds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .._kernels.geodesics import cell_routes as kernels
from .._kernels.geodesics.visibility import UNSEEN, Search
from .._kernels.surface.surfaces import Spline
from .._support.watching import MustStop, never
from ..problem import Path, Problem
from ..space.lattice import Lattice, Spacing
from ..surface import metric
from ..surface.metric import curve_length, segment_lengths
from ..validation import Array
from .snell import ON_SIDE, obeying_snell

Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Points settled between two looks at whether to stop.
CHUNK = 20_000

# Points on each side, besides its ends, in a search of the whole map: as many as make no more than
# this many points in all. Where even one makes more than the second number, only cells are searched
# where a path leads that is at most so much longer than the shortest, by distance fields from both
# ends; these have a node for each so many cells.
POINTS_PER_SIDE, MANY_POINTS, MOST_POINTS = 3, 1_000_000, 6_000_000
SLACKS, MOST_NODES = (0.06, 0.02, 0.005), 1_500_000

# The distances of the points near a path, as shares of a side, in one search after the other.
SHARES = (0.25, 0.1, 0.04, 0.015, 0.006)
# Searches reach so many cells to either side: the first ones, and the others. One follows another
# of the same distances while the path gets shorter by more than this share, and at most so often.
REACHES, GAIN, MOST_SEARCHES = (3, 1), 1e-6, 50
# On rough ground a path gets more bends with each search, and these more points. Searches with more
# than so many times the points of the first one gain 1e-5 and take most of the time.
CROWD = 2.0
# All that is repeated, too, because a path without its needless bends can move as a whole.
MOST_CYCLES = 10
# So many points lie on either side of a bend.
BESIDE = 2

# On hills the path between two sides is not quite straight: cells are cut into parts of at most
# this share of a feature of the ground.
FEATURES_PER_PART = 0.5

# A bend is left out where that lengthens the path by no more than this share of it.
STRAIGHT = 1e-12


class CellGrid(NamedTuple):
    """The cells within a problem's bounds: those at the edge are cut off there."""

    x: Array  # (nx + 1,): where the sides are
    y: Array
    costs: Array  # (ny, nx)
    sides: Array  # (2,): their typical lengths
    is_flat: bool  # planes as layers, and no smooth cost


def grid_of(problem: Problem) -> CellGrid | None:
    """The cells that a problem's cost is constant in; None where there are none."""
    surface, bounds = problem.surface, problem.bounds
    if surface.cost_cells is None or not isinstance(surface.data, Spline):
        return None
    cells = surface.data.cells
    is_flat = surface.cost_data is None and metric.is_flat(surface, bounds)
    rows, columns = cells.costs.shape
    # On flat ground cells stay whole.
    longest = math.inf if is_flat else FEATURES_PER_PART * surface.resolution
    x = _sides(bounds.x1_min, bounds.x1_max, cells.x0, cells.dx, columns, longest)
    y = _sides(bounds.x2_min, bounds.x2_max, cells.y0, cells.dy, rows, longest)
    i, j = (
        np.clip(np.floor((0.5 * (at[1:] + at[:-1]) - origin) / step).astype(int), 0, count - 1)
        for at, origin, step, count in (
            (x, cells.x0, cells.dx, columns),
            (y, cells.y0, cells.dy, rows),
        )
    )
    sides = np.array([np.median(np.diff(x)), np.median(np.diff(y))])
    return CellGrid(x, y, cells.costs[np.ix_(j, i)], sides, is_flat)


def _sides(
    low: float, high: float, origin: float, step: float, count: int, longest: float
) -> Array:
    """Where the sides of cells are between two bounds, and these bounds.

    Cells are cut into parts of equal length, no longer than ``longest``.
    """
    parts = max(math.ceil(step / longest - 1e-9), 1)
    places = origin + step * np.arange(count * parts + 1) / parts
    inside = (places > low + ON_SIDE * step) & (places < high - ON_SIDE * step)
    return np.concatenate([[low], places[inside], [high]])


# Points on sides


def _touched(grid: CellGrid, points: Array) -> Integers:
    """(n, 4): the cells that hold or touch points (n, 2); -1 for none, at the end."""
    pairs = []
    for places, at in ((grid.x, points[:, 0]), (grid.y, points[:, 1])):
        slack = ON_SIDE * float(np.diff(places).max())
        last = len(places) - 2
        before = np.clip(np.searchsorted(places, at - slack, "right") - 1, 0, last)
        after = np.clip(np.searchsorted(places, at + slack, "right") - 1, 0, last)
        pairs.append((before, after))
    (i0, i1), (j0, j1) = pairs
    columns = grid.costs.shape[1]
    cells = np.stack([j0 * columns + i0, j0 * columns + i1, j1 * columns + i0, j1 * columns + i1])
    cells[1, i0 == i1] = -1
    cells[2, j0 == j1] = -1
    cells[3, (i0 == i1) | (j0 == j1)] = -1
    # Those that are none come last.
    return np.ascontiguousarray(np.take_along_axis(cells, np.argsort(cells < 0, axis=0), 0).T)


def _sides_with(problem: Problem, grid: CellGrid, points: Array) -> kernels.Sides:
    """Cells, and points (n, 2) on their sides; start and goal are added at the end."""
    points = np.ascontiguousarray(np.vstack([points, problem.start, problem.goal]))
    touched = _touched(grid, points)
    known = touched >= 0
    cells, labels = np.unique(touched[known], return_inverse=True)
    touched[known] = labels
    held = np.nonzero(known)[0][np.argsort(labels, kind="stable")]
    first = np.concatenate([[0], np.cumsum(np.bincount(labels, minlength=len(cells)))])
    surface = problem.surface
    heights = np.empty((len(points), len(surface.layers)))
    kernels.fill_heights(surface.data, points, heights)
    return kernels.Sides(
        costs=grid.costs.ravel()[cells],
        points=points,
        heights=heights,
        touched=touched,
        first=first.astype(np.int64),
        held=held.astype(np.int64),
        floor=surface.least_cost,
        is_flat=grid.is_flat,
        has_obstacles=problem.free_space.has_obstacles,
    )


def _points_on(grid: CellGrid, cells: Flags, per_side: int) -> Array:
    """The corners of some cells (ny, nx) and points between them on their sides (n, 2)."""
    shares = np.arange(1, per_side + 1) / (per_side + 1)
    x, y = ((at[:-1, None] + np.diff(at)[:, None] * shares).ravel() for at in (grid.x, grid.y))
    below_or_above, beside = (
        np.logical_or(np.pad(cells, before), np.pad(cells, after))
        for before, after in (
            (((1, 0), (0, 0)), ((0, 1), (0, 0))),
            (((0, 0), (1, 0)), ((0, 0), (0, 1))),
        )
    )
    corners = np.pad(beside, ((1, 0), (0, 0))) | np.pad(beside, ((0, 1), (0, 0)))
    chosen = (
        (grid.x, grid.y, corners),
        (x, grid.y, below_or_above.repeat(per_side, axis=1)),
        (grid.x, y, beside.repeat(per_side, axis=0)),
    )
    return np.concatenate([np.stack(np.meshgrid(x, y), axis=-1)[held] for x, y, held in chosen])


def _cells_between(problem: Problem, grid: CellGrid, must_stop: MustStop) -> Iterator[Flags]:
    """Ever fewer cells (ny, nx) that paths lead through that are nearly the shortest, by fields."""
    from ..distance.field import march_both
    from ..distance.medium import Medium

    size = math.sqrt(max(grid.costs.size / MOST_NODES, 1.0))
    lattice = Lattice.spanning(problem.bounds, Spacing(*(size * grid.sides).tolist()))
    medium = Medium(problem.surface, lattice, problem.free_space, must_stop)
    one, other = march_both(medium, problem.start, problem.goal, watch=lambda _: must_stop())
    through = one.values + other.values
    rows, columns = (
        np.clip(np.searchsorted(nodes, places) - 1, 0, len(nodes) - 2)
        for nodes, places in ((lattice.y, _middles(grid.y)), (lattice.x, _middles(grid.x)))
    )
    corners = [
        through[j : j + lattice.ny - 1, i : i + lattice.nx - 1] for j in (0, 1) for i in (0, 1)
    ]
    least = np.minimum.reduce(corners)[np.ix_(rows, columns)]
    for slack in SLACKS:
        yield np.asarray(least <= (1.0 + slack) * through.min())


def _middles(places: Array) -> Array:
    return np.asarray(0.5 * (places[1:] + places[:-1]))


def _points_to_search(problem: Problem, grid: CellGrid, must_stop: MustStop) -> Array | None:
    """Points on the sides of all cells, or where these are too many, of those that matter."""
    if per_side := _most_per_side(grid.costs.size):
        return _points_on(grid, np.ones(grid.costs.shape, bool), per_side)
    for cells in _cells_between(problem, grid, must_stop):
        if per_side := _most_per_side(int(np.count_nonzero(cells))):
            return _points_on(grid, cells, per_side)
    return None


def _most_per_side(cells: int) -> int:
    """How many points a side may have; 0 where there are too many cells."""
    for per_side in range(POINTS_PER_SIDE, 0, -1):
        if (1 + 2 * per_side) * cells <= (MANY_POINTS if per_side > 1 else MOST_POINTS):
            return per_side
    return 0


def _search(problem: Problem, sides: kernels.Sides, must_stop: MustStop) -> Array | None:
    """The shortest path through points on sides (m, 2); None where none is found."""
    count = len(sides.points)
    search = Search(
        cost=np.full(count, math.inf),
        parent=np.full(count, -1, np.int64),
        key=np.empty(count),
        slot=np.full(count, UNSEEN, np.int64),
        heap=np.empty(count, np.int64),
        size=np.zeros(1, np.int64),
    )
    kernels.begin(search, count - 2)
    given = (problem.surface.data, problem.free_space.data, sides, search, CHUNK)
    while kernels.search_sides(*given) == CHUNK:
        if must_stop():
            return None
    if math.isinf(search.cost[-1]):
        return None
    visited = [count - 1]
    while (parent := int(search.parent[visited[-1]])) >= 0:
        visited.append(parent)
    return np.asarray(sides.points[visited[::-1]])


def shortest_through_cells(problem: Problem, must_stop: MustStop = never) -> Path | None:
    """The shortest path through a few points on each side of all cells.

    On a large map they are on the sides of those cells alone where a short path is likely. None
    where costs are not constant in cells, where it must stop, and where obstacles leave no path
    through such points.
    """
    grid = grid_of(problem)
    if grid is None:
        return None
    places = _points_to_search(problem, grid, must_stop)
    if places is None or must_stop():
        return None
    sides = _sides_with(problem, grid, places)
    points = _search(problem, sides, must_stop)
    return None if points is None else problem.path(points)


# Polishing


def polished(problem: Problem, path: Path, must_stop: MustStop = never) -> Path:
    """The locally shortest path near a path: its bends move along the sides of cells.

    Searches through ever denser points on the sides near the path, then Newton's method in the
    places of the bends. The path is never longer than the one given, and stays in free space.
    """
    grid = grid_of(problem)
    assert grid is not None
    for _ in range(MOST_CYCLES):
        better = _polished_once(problem, grid, path, must_stop)
        is_at_rest = better.length >= path.length * (1.0 - GAIN)
        path = better
        if is_at_rest or must_stop():
            break
    return path


def _polished_once(problem: Problem, grid: CellGrid, path: Path, must_stop: MustStop) -> Path:
    """A path after searches near it, Newton's method, and without bends that do nothing."""
    best, most = path, math.inf
    for share in SHARES:
        reach = REACHES[0] if share == SHARES[0] else REACHES[1]
        for _ in range(MOST_SEARCHES):
            if must_stop():
                return best
            points, before = _crossings(grid, best.points), best.length
            sides = _sides_with(problem, grid, _points_near(grid, points, share, reach))
            if len(sides.points) > most:
                break
            most = min(most, CROWD * len(sides.points))
            best = _shorter(problem, best, _search(problem, sides, must_stop))
            if best.length >= before * (1.0 - GAIN):
                break
    if must_stop():
        return best
    best = _shorter(problem, best, _without_bends(problem, best.points))
    for first in range(2):
        bent = obeying_snell(problem.surface, grid.x, grid.y, best.points, first)
        best = _shorter(problem, best, bent)
    return _shorter(problem, best, _without_bends(problem, best.points))


def _shorter(problem: Problem, best: Path, points: Array | None) -> Path:
    """The better of two paths; of two that are equally long, the one with fewer points."""
    if points is None or len(points) < 2 or not problem.allows(points):
        return best
    other = problem.path(points)
    slack = len(best.points) * STRAIGHT if len(points) < len(best.points) else 0.0
    return other if other.length <= best.length * (1.0 + slack) else best


def _crossings(grid: CellGrid, points: Array) -> Array:
    """A path's points (m, 2), with those where it crosses sides of cells."""
    pieces = [points[:1]]
    for a, b in pairwise(points):
        shares = [np.ones(1)]
        for axis, places in enumerate((grid.x, grid.y)):
            low, high = sorted((a[axis], b[axis]))
            first, last = np.searchsorted(places, low, "right"), np.searchsorted(places, high)
            if last > first:
                shares.append((places[first:last] - a[axis]) / (b[axis] - a[axis]))
        pieces.append(a + np.unique(np.concatenate(shares))[:, None] * (b - a))
        pieces[-1][-1] = b
    return np.concatenate(pieces)


def _points_near(grid: CellGrid, points: Array, share: float, reach: int) -> Array:
    """Points on sides near a path (m, 2) and the path's own; they lie close around its bends.

    share : their distance, as a share of a side. reach : in cells to either side of the path.
    """
    steps = share * grid.sides
    offsets = np.arange(-BESIDE, BESIDE + 1.0)
    found = [points]
    are_on = []
    for axis, places in enumerate((grid.x, grid.y)):
        nearest = np.clip(np.searchsorted(places, points[:, axis]), 1, len(places) - 1)
        before = points[:, axis] - places[nearest - 1] < places[nearest] - points[:, axis]
        side = places[nearest - before]
        are_on.append(np.abs(points[:, axis] - side) <= ON_SIDE * grid.sides[axis])
        here, at = points[are_on[-1]], side[are_on[-1]]
        moved = np.repeat(here[:, None], len(offsets), axis=1)
        moved[..., axis] = at[:, None]
        moved[..., 1 - axis] += offsets * steps[1 - axis]
        found.append(moved.reshape(-1, 2))
    inner = points[~(are_on[0] | are_on[1])]
    around = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2) * steps
    found.append((inner[:, None] + around).reshape(-1, 2))
    found.append(_corners_and_middles(grid, points, reach))
    return np.clip(np.concatenate(found), (grid.x[0], grid.y[0]), (grid.x[-1], grid.y[-1]))


def _corners_and_middles(grid: CellGrid, points: Array, reach: int) -> Array:
    """The corners, and the middles of sides, of the cells near a path's points (m, 2)."""
    rows, columns = grid.costs.shape
    cells = _touched(grid, points)
    cells = np.unique(cells[cells >= 0])
    j, i = np.divmod(cells, columns)
    near = np.zeros((rows + 2 * reach, columns + 2 * reach), bool)
    for down in range(2 * reach + 1):
        for east in range(2 * reach + 1):
            near[j + down, i + east] = True
    j, i = np.nonzero(near[reach : reach + rows, reach : reach + columns])
    x = np.stack([grid.x[i], 0.5 * (grid.x[i] + grid.x[i + 1]), grid.x[i + 1]], axis=1)
    y = np.stack([grid.y[j], 0.5 * (grid.y[j] + grid.y[j + 1]), grid.y[j + 1]], axis=1)
    places = [
        np.column_stack([x[:, a], y[:, b]]) for a in range(3) for b in range(3) if (a, b) != (1, 1)
    ]
    return np.unique(np.concatenate(places), axis=0)


def _without_bends(problem: Problem, points: Array) -> Array:
    """A path's points (m, 2) without those whose leaving out does not lengthen it."""
    surface, space = problem.surface, problem.free_space
    moved = np.append(True, (np.diff(points, axis=0) != 0.0).any(axis=1))
    points = points[moved] if moved.sum() > 1 else points[[0, -1]]
    allowed = STRAIGHT * curve_length(surface, points)
    parity, unchanged = 1, 0
    while len(points) > 2 and unchanged < 2:
        k = np.arange(parity, len(points) - 1, 2)
        if len(k) == 0:
            parity, unchanged = 3 - parity, unchanged + 1
            continue
        before, here, after = points[k - 1], points[k], points[k + 1]
        bent = segment_lengths(surface, before, here) + segment_lengths(surface, here, after)
        leave = segment_lengths(surface, before, after) <= bent + allowed
        if space.has_obstacles:
            leave &= space.segments_are_free(before, after)
        points = np.delete(points, k[leave], axis=0)
        unchanged = 0 if leave.any() else unchanged + 1
        parity = 3 - parity
    return points
