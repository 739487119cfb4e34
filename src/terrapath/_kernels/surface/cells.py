"""A cost that is constant in each cell of a grid, as cost rasters are.

On a side between cells, and at a corner, the lowest cost there counts: a path may run along the
cheaper cell as near to the side as it likes.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel


class CostCells(NamedTuple):
    """The costs of the cells of a grid; the outermost cells reach on beyond its edge."""

    costs: np.ndarray  # (ny, nx) float64, above 0; (0, 0) where there are none
    x0: float  # corner of the first cell
    y0: float
    dx: float
    dy: float
    least: float  # the least of the costs; 1 where there are none


NO_CELLS = CostCells(np.empty((0, 0)), 0.0, 0.0, 1.0, 1.0, 1.0)


class Stretch(NamedTuple):
    """What is left of a segment in one cell: the share of the segment where it ends, its cost."""

    end: float
    cost: float


# A place this near to a side lies on it, in cells. It is above the rounding of coordinates.
ON_SIDE = 1e-7


@inner_kernel
def any_cells(cells):
    """Is there a cost that is constant in cells?"""
    return cells.costs.shape[0] > 0


@inner_kernel
def clamped(k, count):
    return min(max(k, 0), count - 1)


@inner_kernel
def touched(low, high, count):
    """The first and the last of so many cells that hold or touch [low, high], given in cells."""
    first, last = math.floor(low - ON_SIDE), math.floor(high + ON_SIDE)
    return clamped(first, count), clamped(last, count)


@inner_kernel
def lowest(cells, s, t):
    """The lowest cost of the cells that hold or touch a place, given in cells."""
    ny, nx = cells.costs.shape
    (i0, i1), (j0, j1) = touched(s, s, nx), touched(t, t, ny)
    c = cells.costs
    return min(c[j0, i0], c[j0, i1], c[j1, i0], c[j1, i1])


@inner_kernel
def cost_in_cells(cells, x, y):
    """The cost at a point; 1 where there are no cells."""
    if not any_cells(cells):
        return 1.0
    return lowest(cells, (x - cells.x0) / cells.dx, (y - cells.y0) / cells.dy)


@inner_kernel
def ahead(begin, step, share):
    """The nearest side ahead along one axis, in cells, and a place before it.

    The segment goes from ``begin`` on by ``step``, and a share of it is done. One that runs along
    an axis has no side ahead, and the place is its middle, which may lie on a side.
    """
    if abs(step) <= 2.0 * ON_SIDE:
        return math.inf, begin + 0.5 * step
    at = begin + share * step
    if step > 0.0:
        side = math.floor(at + ON_SIDE) + 1.0
        return side, side - 0.5
    side = math.ceil(at - ON_SIDE) - 1.0
    return side, side + 0.5


@inner_kernel
def stretch(cells, ax, ay, dx, dy, share):
    """The stretch of the segment from a to a + d that begins at a share of it.

    Cells are met in the order of Amanatides and Woo (1987).
    """
    s0, t0 = (ax - cells.x0) / cells.dx, (ay - cells.y0) / cells.dy
    sx, sy = dx / cells.dx, dy / cells.dy
    x_side, s = ahead(s0, sx, share)
    y_side, t = ahead(t0, sy, share)
    end = 1.0
    if x_side < math.inf:
        end = min(end, (x_side - s0) / sx)
    if y_side < math.inf:
        end = min(end, (y_side - t0) / sy)
    return Stretch(max(end, share), lowest(cells, s, t))


@kernel
def mean_in_cells(cells, ax, ay, bx, by):
    """The mean of the cost along the segment a-b, by length on the plane."""
    dx, dy = bx - ax, by - ay
    total, share = 0.0, 0.0
    while share < 1.0:
        here = stretch(cells, ax, ay, dx, dy, share)
        total += (here.end - share) * here.cost
        share = here.end
    return total


@kernel
def least_inside(cells, x0, x1, y0, y1):
    """The lowest cost of the cells that hold a part of a box; 1 where there are none.

    Cells that the box merely touches do not count. Whoever proves something of closed boxes, each
    by the cost inside it, has proven it for both costs on the sides between them.
    """
    if not any_cells(cells):
        return 1.0
    ny, nx = cells.costs.shape
    i0 = math.floor((x0 - cells.x0) / cells.dx + ON_SIDE)
    i1 = max(math.ceil((x1 - cells.x0) / cells.dx - ON_SIDE) - 1, i0)
    j0 = math.floor((y0 - cells.y0) / cells.dy + ON_SIDE)
    j1 = max(math.ceil((y1 - cells.y0) / cells.dy - ON_SIDE) - 1, j0)
    found = math.inf
    for j in range(clamped(j0, ny), clamped(j1, ny) + 1):
        for i in range(clamped(i0, nx), clamped(i1, nx) + 1):
            found = min(found, cells.costs[j, i])
    return found


@kernel
def fill_least_costs(cells, grid, costs):
    """The least cost of the cells that hold a part of each cell of a lattice (ny - 1, nx - 1)."""
    for j in range(costs.shape[0]):
        y = grid.y0 + j * grid.dy
        for i in range(costs.shape[1]):
            x = grid.x0 + i * grid.dx
            costs[j, i] = least_inside(cells, x, x + grid.dx, y, y + grid.dy)


class Range(NamedTuple):
    """The lowest and the highest cost of some cells."""

    low: float
    high: float


@kernel
def range_in_box(cells, x0, x1, y0, y1):
    """The costs of the cells that hold or touch a closed box; 1 where there are none."""
    if not any_cells(cells):
        return Range(1.0, 1.0)
    ny, nx = cells.costs.shape
    i0, i1 = touched((x0 - cells.x0) / cells.dx, (x1 - cells.x0) / cells.dx, nx)
    j0, j1 = touched((y0 - cells.y0) / cells.dy, (y1 - cells.y0) / cells.dy, ny)
    low, high = math.inf, 0.0
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            low, high = min(low, cells.costs[j, i]), max(high, cells.costs[j, i])
    return Range(low, high)
