"""Does a segment stay in free space?

A segment is called free only where this is certain despite rounding errors. A doubtful case
counts as a hit, so no path that is returned touches an obstacle. The answer does not depend on
which end comes first.
Obstacles are closed sets: touching one is a hit.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import kernel


class Grid(NamedTuple):
    """A uniform grid of cells over a rectangle."""

    x0: float
    y0: float
    dx: float
    dy: float
    nx: int
    ny: int


class Space(NamedTuple):
    """Obstacles, indexed by the cells they touch.

    The boundary edges and circles of cell c = j * nx + i are
    ``edge_ids[edge_first[c]:edge_first[c + 1]]`` and likewise for circles.
    """

    grid: Grid
    edges: np.ndarray  # (e, 4) float64: x1, y1, x2, y2
    edge_first: np.ndarray  # (cells + 1,) int64
    edge_ids: np.ndarray  # int64
    circles: np.ndarray  # (c, 3) float64: centre and radius
    circle_first: np.ndarray
    circle_ids: np.ndarray
    mask_frames: np.ndarray  # (k, 5) float64: x0, y0, dx, dy of a mask's first cell, and its margin
    mask_shapes: np.ndarray  # (k, 3) int64: nx, ny and the offset in ``blocked``
    blocked: np.ndarray  # uint8, the cells of all masks one after another, row by row


class Span(NamedTuple):
    """A closed range of cells."""

    first: int
    last: int


# Cells are widened by a margin, a share of their size that is above rounding errors, so that a
# segment along a cell's border counts as crossing the cells on both sides. For the cells of an
# index it may be generous, because an item listed too often is only tested once more.
INDEX_MARGIN = 1e-7


@kernel
def span(low, high, origin, size, count, margin):
    """Cells of one axis that [low, high] touches, limited to the grid."""
    first = math.floor(max((low - origin) / size - margin, 0.0))
    last = math.floor(min((high - origin) / size + margin, count - 1.0))
    return Span(first, last)


@kernel
def rows_crossed(grid, ay, by, margin):
    """Rows of the grid that a segment touches."""
    return span(min(ay, by), max(ay, by), grid.y0, grid.dy, grid.ny, margin)


@kernel
def columns_crossed(grid, row, ax, ay, bx, by, margin):
    """Columns that a segment touches inside one row of the grid."""
    low, high = 0.0, 1.0
    if ay != by:
        bottom = grid.y0 + (row - margin) * grid.dy
        top = grid.y0 + (row + 1 + margin) * grid.dy
        t0, t1 = (bottom - ay) / (by - ay), (top - ay) / (by - ay)
        low, high = max(min(t0, t1), 0.0), min(max(t0, t1), 1.0)
    x0, x1 = ax + low * (bx - ax), ax + high * (bx - ax)
    return span(min(x0, x1), max(x0, x1), grid.x0, grid.dx, grid.nx, margin)


# Twice the largest rounding error of an orientation determinant (Shewchuk 1997).
_ORIENTATION_ERROR = 8.0 * 2.0**-52


@kernel
def surely_on_one_side(ax, ay, bx, by, cx, cy, dx, dy):
    """True only where c and d are certainly on the same side of the line a-b, and not on it."""
    left_c, right_c = (bx - ax) * (cy - ay), (by - ay) * (cx - ax)
    left_d, right_d = (bx - ax) * (dy - ay), (by - ay) * (dx - ax)
    side_c, side_d = left_c - right_c, left_d - right_d
    sure_c = abs(side_c) > _ORIENTATION_ERROR * (abs(left_c) + abs(right_c))
    sure_d = abs(side_d) > _ORIENTATION_ERROR * (abs(left_d) + abs(right_d))
    return sure_c and sure_d and (side_c > 0.0) == (side_d > 0.0)


@kernel
def may_touch(ax, ay, bx, by, cx, cy, dx, dy):
    """False only where the segments a-b and c-d certainly share no point."""
    if max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx):
        return False
    if max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by):
        return False
    if surely_on_one_side(ax, ay, bx, by, cx, cy, dx, dy):
        return False
    return not surely_on_one_side(cx, cy, dx, dy, ax, ay, bx, by)


@kernel
def may_enter_circle(ax, ay, bx, by, cx, cy, radius):
    """False only where the segment a-b certainly stays outside the closed disc."""
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    t = 0.0
    if squared > 0.0:
        t = min(max(((cx - ax) * dx + (cy - ay) * dy) / squared, 0.0), 1.0)
    distance = math.hypot(ax + t * dx - cx, ay + t * dy - cy)
    scale = abs(ax) + abs(ay) + abs(bx) + abs(by) + abs(cx) + abs(cy)
    return distance <= radius + 16.0 * 2.0**-52 * scale


@kernel
def cell_is_hit(space, cell, ax, ay, bx, by):
    """Does the segment touch an edge or a circle that is listed in the cell?"""
    for k in range(space.edge_first[cell], space.edge_first[cell + 1]):
        e = space.edge_ids[k]
        cx, cy, dx, dy = space.edges[e, 0], space.edges[e, 1], space.edges[e, 2], space.edges[e, 3]
        if may_touch(ax, ay, bx, by, cx, cy, dx, dy):
            return True
    for k in range(space.circle_first[cell], space.circle_first[cell + 1]):
        c = space.circle_ids[k]
        cx, cy, radius = space.circles[c, 0], space.circles[c, 1], space.circles[c, 2]
        if may_enter_circle(ax, ay, bx, by, cx, cy, radius):
            return True
    return False


@kernel
def mask_is_hit(space, mask, ax, ay, bx, by):
    """Does the segment touch a blocked cell of one mask?"""
    frame, shape = space.mask_frames[mask], space.mask_shapes[mask]
    grid = Grid(frame[0], frame[1], frame[2], frame[3], shape[0], shape[1])
    rows = rows_crossed(grid, ay, by, frame[4])
    for row in range(rows.first, rows.last + 1):
        columns = columns_crossed(grid, row, ax, ay, bx, by, frame[4])
        for column in range(columns.first, columns.last + 1):
            if space.blocked[shape[2] + row * shape[0] + column]:
                return True
    return False


@kernel
def segment_is_free(space, ax, ay, bx, by):
    """True where the closed segment a-b certainly touches no obstacle's boundary and no mask.

    With one end in free space that is the whole test: to reach the inside of an
    obstacle a segment has to cross its boundary. Rounding depends on the order of the ends, so
    they are put into one order.
    """
    if bx < ax or (bx == ax and by < ay):
        ax, ay, bx, by = bx, by, ax, ay
    for mask in range(space.mask_shapes.shape[0]):
        if mask_is_hit(space, mask, ax, ay, bx, by):
            return False
    if space.edges.shape[0] == 0 and space.circles.shape[0] == 0:
        return True
    rows = rows_crossed(space.grid, ay, by, INDEX_MARGIN)
    for row in range(rows.first, rows.last + 1):
        columns = columns_crossed(space.grid, row, ax, ay, bx, by, INDEX_MARGIN)
        for column in range(columns.first, columns.last + 1):
            if cell_is_hit(space, row * space.grid.nx + column, ax, ay, bx, by):
                return False
    return True


@kernel
def fill_free(space, a, b, free):
    """Segments a[m]-b[m] at once: free (m,) uint8."""
    for m in range(a.shape[0]):
        free[m] = segment_is_free(space, a[m, 0], a[m, 1], b[m, 0], b[m, 1])


# Building the index


@kernel
def enlist(item, cell, first, ids):
    """Count an item of a cell; if ``ids`` is not empty, list the item there instead."""
    if ids.shape[0] > 0:
        ids[first[cell]] = item
        first[cell] += 1
    else:
        first[cell + 1] += 1


@kernel
def list_edges(grid, edges, first, ids):
    """Count the edges of each cell into first[cell + 1], or list them in ``ids``.

    Call it twice: first with an empty ``ids``, to count; then with the cumulative sums of the
    counts in ``first``, to list.
    """
    for e in range(edges.shape[0]):
        ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        rows = rows_crossed(grid, ay, by, INDEX_MARGIN)
        for row in range(rows.first, rows.last + 1):
            columns = columns_crossed(grid, row, ax, ay, bx, by, INDEX_MARGIN)
            for column in range(columns.first, columns.last + 1):
                enlist(e, row * grid.nx + column, first, ids)


@kernel
def list_circles(grid, circles, first, ids):
    """As ``list_edges``, for circles, by their bounding boxes."""
    for c in range(circles.shape[0]):
        x, y, r = circles[c, 0], circles[c, 1], circles[c, 2]
        rows = span(y - r, y + r, grid.y0, grid.dy, grid.ny, INDEX_MARGIN)
        columns = span(x - r, x + r, grid.x0, grid.dx, grid.nx, INDEX_MARGIN)
        for row in range(rows.first, rows.last + 1):
            for column in range(columns.first, columns.last + 1):
                enlist(c, row * grid.nx + column, first, ids)
