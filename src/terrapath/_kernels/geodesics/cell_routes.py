"""Shortest paths where costs are constant in cells: through points on the sides of the cells.

Within a cell a path is straight; on its sides it may bend, as light does (Snell's law). So the
shortest path through points on the sides is as near to the shortest of all as these points are
dense. A segment along a side is an edge of both cells, and the cheaper one counts.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..space.free_space import segment_is_free
from ..surface.speeds import speed_at
from ..surface.surfaces import spot_at, value_at
from .visibility import DONE, pop, push


class Sides(NamedTuple):
    """Cells of a rectilinear grid and points on their sides. The last two are start and goal."""

    costs: np.ndarray  # (cells,) float64
    points: np.ndarray  # (n, 2) float64
    heights: np.ndarray  # (n, layers) float64: weighted, map units
    touched: np.ndarray  # (n, 4) int64: the cells that hold each point, -1 for none
    first: np.ndarray  # (cells + 1,) int64: where the points of each cell begin in ``held``
    held: np.ndarray  # int64: the points on the sides of each cell
    floor: float  # no cost is below it
    is_flat: bool  # planes as layers, and no smooth cost
    has_obstacles: bool


# Where Gauss' rule of two points has its first node.
_NEAR = 0.5 - 0.5 / math.sqrt(3.0)


@kernel
def fill_heights(surface, points, heights):
    """The weighted heights (n, layers) of points (n, 2)."""
    for m in range(points.shape[0]):
        spot = spot_at(surface, points[m, 0], points[m, 1])
        for layer in range(heights.shape[1]):
            heights[m, layer] = surface.weights[layer] * value_at(surface, layer, spot)


@inner_kernel
def chord_between(sides, u, v):
    """The chord between two points, without costs."""
    dx, dy = sides.points[v, 0] - sides.points[u, 0], sides.points[v, 1] - sides.points[u, 1]
    squared = dx * dx + dy * dy
    for layer in range(sides.heights.shape[1]):
        rise = sides.heights[v, layer] - sides.heights[u, layer]
        squared += rise * rise
    return math.sqrt(squared)


@inner_kernel
def inside_cell(surface, sides, u, v, chord):
    """The length of the segment between two points of a cell, without the cell's cost."""
    if sides.is_flat:
        return chord
    x, y = sides.points[u, 0], sides.points[u, 1]
    dx, dy = sides.points[v, 0] - x, sides.points[v, 1] - y
    near = speed_at(surface, x + _NEAR * dx, y + _NEAR * dy, dx, dy)
    far = speed_at(surface, x + (1.0 - _NEAR) * dx, y + (1.0 - _NEAR) * dy, dx, dy)
    return 0.5 * (near + far)


@kernel
def relax(surface, space, sides, search, u, v, cost):
    """Go on from point u to point v of one cell, where that is shorter."""
    if u == v or search.slot[v] == DONE:
        return
    chord = chord_between(sides, u, v)
    # The chord is no more than the length, but for a smooth cost.
    if search.cost[u] + sides.floor * chord >= search.cost[v]:
        return
    length = search.cost[u] + cost * inside_cell(surface, sides, u, v, chord)
    if not length < search.cost[v]:
        return
    p, q = sides.points[u], sides.points[v]
    if sides.has_obstacles and not segment_is_free(space, p[0], p[1], q[0], q[1]):
        return
    goal = sides.points.shape[0] - 1
    push(search, v, length, u, length + sides.floor * chord_between(sides, v, goal))


@kernel
def search_sides(surface, space, sides, search, most):
    """Settle up to ``most`` points; returns how many, fewer where the goal is settled."""
    goal = sides.points.shape[0] - 1
    for settled in range(most):
        if search.size[0] == 0 or search.slot[goal] == DONE:
            return settled
        u = pop(search)
        for k in range(4):
            cell = sides.touched[u, k]
            if cell < 0:
                break
            for e in range(sides.first[cell], sides.first[cell + 1]):
                relax(surface, space, sides, search, u, sides.held[e], sides.costs[cell])
    return most


@kernel
def begin(search, start):
    """Queue the start."""
    push(search, start, 0.0, -1, 0.0)
