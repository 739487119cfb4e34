"""The walls and corners that a moving polyline meets, and when."""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import kernel
from ..space.free_space import INDEX_MARGIN, Grid, span


class Walls(NamedTuple):
    """Straight walls with free ground to the right of each, and the corners it can bend round.

    Edges and corners stand a little behind the points where a path touches them, so that rounding
    cannot put a path along a wall behind it. The edges of cell c = j * nx + i are
    ``edge_ids[edge_first[c]:edge_first[c + 1]]``, and likewise the corners.
    """

    grid: Grid
    edges: np.ndarray  # (e, 4) float64: x1, y1, x2, y2
    normals: np.ndarray  # (e, 2) float64: unit vectors towards free ground
    edge_first: np.ndarray  # (cells + 1,) int64
    edge_ids: np.ndarray  # int64
    corners: np.ndarray  # (c, 2) float64
    outwards: np.ndarray  # (c, 2) float64: from each corner to where a path is held by it
    corner_first: np.ndarray
    corner_ids: np.ndarray


@kernel
def first_root(q0, q1, q2, after):
    """The least root of q0 + q1 t + q2 t^2 in (after, 1], or infinity."""
    discriminant = q1 * q1 - 4.0 * q0 * q2
    if discriminant < 0.0:
        return math.inf
    q = -0.5 * (q1 + math.copysign(math.sqrt(discriminant), q1))
    first = q / q2 if q2 != 0.0 else math.inf
    second = q0 / q if q != 0.0 else math.inf
    low, high = min(first, second), max(first, second)
    if after < low <= 1.0:
        return low
    return high if after < high <= 1.0 else math.inf


@kernel
def corner_time(ax, ay, ux, uy, bx, by, vx, vy, cx, cy):
    """When the segment a-b, whose ends move by u and v in unit time, first meets the point c."""
    ex, ey, fx, fy = bx - ax, by - ay, vx - ux, vy - uy
    wx, wy = cx - ax, cy - ay
    q0 = ex * wy - ey * wx
    q1 = fx * wy - fy * wx - ex * uy + ey * ux
    q2 = -fx * uy + fy * ux
    t = first_root(q0, q1, q2, -1.0e-12)
    while t <= 1.0:
        gx, gy = ex + t * fx, ey + t * fy
        squared = gx * gx + gy * gy
        along = (wx - t * ux) * gx + (wy - t * uy) * gy
        if -1e-9 * squared <= along <= (1.0 + 1e-9) * squared and squared > 0.0:
            return max(t, 0.0)
        t = first_root(q0, q1, q2, t)
    return math.inf


@kernel
def is_passed(ax, ay, ux, uy, bx, by, vx, vy, cx, cy, ox, oy):
    """Does the moving segment a-b already lie a little behind the corner c, and go on from there?

    Rounding puts it there where a path meets several corners at once. (ox, oy) points outwards,
    and how far a segment may be behind is measured by it.
    """
    ex, ey, wx, wy = bx - ax, by - ay, cx - ax, cy - ay
    outside, behind = ex * oy - ey * ox, ex * wy - ey * wx
    if behind * outside < 0.0 or behind * behind > 4.0 * (ox * ox + oy * oy) * (ex * ex + ey * ey):
        return False
    along = wx * ex + wy * ey
    if along < 0.0 or along > ex * ex + ey * ey:
        return False
    change = (vx - ux) * wy - (vy - uy) * wx - ex * uy + ey * ux
    return change * outside > 0.0


@kernel
def wall_time(walls, e, x, y, dx, dy):
    """When a point that moves by (dx, dy) in unit time crosses a wall from the free side."""
    ax, ay, bx, by = walls.edges[e, 0], walls.edges[e, 1], walls.edges[e, 2], walls.edges[e, 3]
    nx, ny = walls.normals[e, 0], walls.normals[e, 1]
    away, change = nx * (x - ax) + ny * (y - ay), nx * dx + ny * dy
    if away < 0.0 or away + change >= 0.0:
        return math.inf
    t = -away / change
    squared = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
    along = (x + t * dx - ax) * (bx - ax) + (y + t * dy - ay) * (by - ay)
    if along < -1e-9 * squared or along > (1.0 + 1e-9) * squared:
        return math.inf
    return t


@kernel
def first_wall(walls, x, y, dx, dy):
    """The first wall that a moving point crosses, and when; -1 for none."""
    grid, best, hit = walls.grid, math.inf, -1
    rows = span(min(y, y + dy), max(y, y + dy), grid.y0, grid.dy, grid.ny, INDEX_MARGIN)
    columns = span(min(x, x + dx), max(x, x + dx), grid.x0, grid.dx, grid.nx, INDEX_MARGIN)
    for row in range(rows.first, rows.last + 1):
        for column in range(columns.first, columns.last + 1):
            cell = row * grid.nx + column
            for k in range(walls.edge_first[cell], walls.edge_first[cell + 1]):
                t = wall_time(walls, walls.edge_ids[k], x, y, dx, dy)
                if t < best:
                    best, hit = t, walls.edge_ids[k]
    return best, hit


@kernel
def first_corner(walls, ax, ay, ux, uy, bx, by, vx, vy, skipped, also_skipped):
    """The first corner that a moving segment meets, and when; -1 for none."""
    grid, best, hit = walls.grid, math.inf, -1
    low_x, high_x = min(ax, ax + ux, bx, bx + vx), max(ax, ax + ux, bx, bx + vx)
    low_y, high_y = min(ay, ay + uy, by, by + vy), max(ay, ay + uy, by, by + vy)
    rows = span(low_y, high_y, grid.y0, grid.dy, grid.ny, INDEX_MARGIN)
    columns = span(low_x, high_x, grid.x0, grid.dx, grid.nx, INDEX_MARGIN)
    for row in range(rows.first, rows.last + 1):
        for column in range(columns.first, columns.last + 1):
            cell = row * grid.nx + column
            for k in range(walls.corner_first[cell], walls.corner_first[cell + 1]):
                c = walls.corner_ids[k]
                cx, cy = walls.corners[c, 0], walls.corners[c, 1]
                if c in (skipped, also_skipped) or not low_x <= cx <= high_x:
                    continue
                if low_y <= cy <= high_y:
                    ox, oy = walls.outwards[c, 0], walls.outwards[c, 1]
                    if is_passed(ax, ay, ux, uy, bx, by, vx, vy, cx, cy, ox, oy):
                        return 0.0, c
                    t = corner_time(ax, ay, ux, uy, bx, by, vx, vy, cx, cy)
                    if t < best:
                        best, hit = t, c
    return best, hit


@kernel
def strip_depth(walls, e, x, y):
    """How far behind a wall a point is; infinite for a point in front of it or beside it."""
    ax, ay, bx, by = walls.edges[e, 0], walls.edges[e, 1], walls.edges[e, 2], walls.edges[e, 3]
    depth = walls.normals[e, 0] * (ax - x) + walls.normals[e, 1] * (ay - y)
    ahead_x, ahead_y = bx - ax, by - ay
    along = (x - ax) * ahead_x + (y - ay) * ahead_y
    beside = along < 0.0 or along > ahead_x * ahead_x + ahead_y * ahead_y
    return math.inf if beside or depth <= 0.0 else depth


@kernel
def wall_before(walls, strips, widest, x, y):
    """The wall in whose strip a point is least deep, and how deep; -1 for none."""
    grid, least, hit = walls.grid, math.inf, -1
    rows = span(y - widest, y + widest, grid.y0, grid.dy, grid.ny, INDEX_MARGIN)
    columns = span(x - widest, x + widest, grid.x0, grid.dx, grid.nx, INDEX_MARGIN)
    for row in range(rows.first, rows.last + 1):
        for column in range(columns.first, columns.last + 1):
            cell = row * grid.nx + column
            for k in range(walls.edge_first[cell], walls.edge_first[cell + 1]):
                e = walls.edge_ids[k]
                depth = strip_depth(walls, e, x, y)
                if depth < strips[e] and depth < least:
                    least, hit = depth, e
    return least, hit


@kernel
def fill_strips(walls, strips, widest, points, hits, depths):
    """The wall in whose strip each point is: hits (m,), -1 for none, and depths (m,).

    strips (e,) : the width of the strip behind each wall, up to its obstacle. widest : of them.
    """
    for m in range(points.shape[0]):
        depths[m], hits[m] = wall_before(walls, strips, widest, points[m, 0], points[m, 1])


@kernel
def fill_walls(walls, points, moves, times, hits):
    """The first wall that each moving point crosses: times (m,), infinite for none, hits (m,)."""
    for m in range(points.shape[0]):
        x, y, dx, dy = points[m, 0], points[m, 1], moves[m, 0], moves[m, 1]
        times[m], hits[m] = math.inf, -1
        if dx != 0.0 or dy != 0.0:
            times[m], hits[m] = first_wall(walls, x, y, dx, dy)


@kernel
def fill_corners(walls, points, moves, bends, times, hits):
    """The first corner that each segment of a moving polyline meets: times and hits (m - 1,).

    bends (m,) : the corner that each point is at, which its segments do not meet; -1 for none.
    """
    for m in range(points.shape[0] - 1):
        ax, ay, ux, uy = points[m, 0], points[m, 1], moves[m, 0], moves[m, 1]
        bx, by, vx, vy = points[m + 1, 0], points[m + 1, 1], moves[m + 1, 0], moves[m + 1, 1]
        times[m], hits[m] = math.inf, -1
        if ux != 0.0 or uy != 0.0 or vx != 0.0 or vy != 0.0:
            times[m], hits[m] = first_corner(
                walls, ax, ay, ux, uy, bx, by, vx, vy, bends[m], bends[m + 1]
            )
