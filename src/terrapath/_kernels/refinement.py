"""Newton's method for polylines of least energy, and what a moving polyline runs into.

The energy of a polyline is its number of pieces times the sum of its squared chords in R^n,
each times the mean of the squared cost C = c^2 at its ends. Least energy makes the pieces equally
long and their sum, whose square the energy then is, least.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiler import inner_kernel, kernel
from .free_space import Grid, span


class Block(NamedTuple):
    """A 2 x 2 matrix."""

    a: float
    b: float
    c: float
    d: float


@inner_kernel
def product(m, k):
    return Block(
        m.a * k.a + m.b * k.c,
        m.a * k.b + m.b * k.d,
        m.c * k.a + m.d * k.c,
        m.c * k.b + m.d * k.d,
    )


@inner_kernel
def transposed(m):
    return Block(m.a, m.c, m.b, m.d)


@inner_kernel
def inverse(m):
    det = m.a * m.d - m.b * m.c
    return Block(m.d / det, -m.b / det, -m.c / det, m.a / det)


@inner_kernel
def entry(blocks, i):
    """Block i of an array (m, 2, 2)."""
    return Block(blocks[i, 0, 0], blocks[i, 0, 1], blocks[i, 1, 0], blocks[i, 1, 1])


class Strand(NamedTuple):
    """The inner points of a polyline (m,) and its pieces (m + 1,)."""

    jets: np.ndarray  # (m, layers, 6): value, gradient and second derivatives of each layer
    weights: np.ndarray  # (layers,)
    costs: np.ndarray  # (m, 6): the jet of C
    chords: np.ndarray  # (m + 1, 2 + layers)
    stiffness: np.ndarray  # (m + 1,): the mean of C at the ends of each piece


@kernel
def frame_product(strand, i, j):
    """F_i^T F_j, where F = (I, w grad x_3, ..., w grad x_n)^T maps the plane into R^n."""
    a, b, c, d = 1.0, 0.0, 0.0, 1.0
    jets = strand.jets
    for k in range(strand.weights.shape[0]):
        w = strand.weights[k] * strand.weights[k]
        a += w * jets[i, k, 1] * jets[j, k, 1]
        b += w * jets[i, k, 1] * jets[j, k, 2]
        c += w * jets[i, k, 2] * jets[j, k, 1]
        d += w * jets[i, k, 2] * jets[j, k, 2]
    return Block(a, b, c, d)


@inner_kernel
def seen_from(strand, i, piece):
    """F_i^T times the chord of a piece."""
    chord = strand.chords[piece]
    x, y = chord[0], chord[1]
    for k in range(strand.weights.shape[0]):
        rise = strand.weights[k] * chord[k + 2]
        x += rise * strand.jets[i, k, 1]
        y += rise * strand.jets[i, k, 2]
    return x, y


@inner_kernel
def squared_chord(strand, piece):
    total = 0.0
    for k in range(strand.chords.shape[1]):
        total += strand.chords[piece, k] * strand.chords[piece, k]
    return total


@kernel
def own_block(strand, pull, i, curvature):
    """Half the energy's second derivative by point i.

    Of what the layers and the cost bend, the share ``curvature`` is taken.
    """
    m, costs = frame_product(strand, i, i), strand.costs
    stiffness = strand.stiffness[i] + strand.stiffness[i + 1]
    a, b, d = stiffness * m.a, stiffness * m.b, stiffness * m.d
    for k in range(strand.weights.shape[0]):
        w = curvature * strand.weights[k] * pull[i, k + 2]
        a += w * strand.jets[i, k, 3]
        b += w * strand.jets[i, k, 4]
        d += w * strand.jets[i, k, 5]
    (ax, ay), (bx, by) = seen_from(strand, i, i), seen_from(strand, i, i + 1)
    x, y = 0.5 * curvature * (ax - bx), 0.5 * curvature * (ay - by)
    squares = 0.25 * curvature * (squared_chord(strand, i) + squared_chord(strand, i + 1))
    a += 2.0 * x * costs[i, 1] + squares * costs[i, 3]
    b += x * costs[i, 2] + y * costs[i, 1] + squares * costs[i, 4]
    d += 2.0 * y * costs[i, 2] + squares * costs[i, 5]
    return Block(a, b, b, d)


@kernel
def link_block(strand, i, curvature):
    """Half the energy's second derivative by points i and i + 1."""
    m, stiffness, costs = frame_product(strand, i, i + 1), strand.stiffness[i + 1], strand.costs
    (ax, ay), (bx, by) = seen_from(strand, i, i + 1), seen_from(strand, i + 1, i + 1)
    half = 0.5 * curvature
    return Block(
        half * (costs[i, 1] * bx - ax * costs[i + 1, 1]) - stiffness * m.a,
        half * (costs[i, 1] * by - ax * costs[i + 1, 2]) - stiffness * m.b,
        half * (costs[i, 2] * bx - ay * costs[i + 1, 1]) - stiffness * m.c,
        half * (costs[i, 2] * by - ay * costs[i + 1, 2]) - stiffness * m.d,
    )


@kernel
def confined(m, projector):
    """P M P + (I - P): M for the moves that P lets through, the identity for the others."""
    k = product(product(projector, m), projector)
    p = projector
    return Block(k.a + 1.0 - p.a, k.b - p.b, k.c - p.c, k.d + 1.0 - p.d)


@kernel
def fill_derivative(strand, pull, drift, projectors, derivative):
    """Half the energy's derivative by each point, (m, 2), along the moves it is free to make."""
    jets, weights = strand.jets, strand.weights
    for i in range(pull.shape[0]):
        gx, gy = drift[i, 0] + pull[i, 0], drift[i, 1] + pull[i, 1]
        for k in range(weights.shape[0]):
            gx += weights[k] * jets[i, k, 1] * pull[i, k + 2]
            gy += weights[k] * jets[i, k, 2] * pull[i, k + 2]
        p = entry(projectors, i)
        derivative[i, 0] = p.a * gx + p.b * gy
        derivative[i, 1] = p.c * gx + p.d * gy


@kernel
def put(blocks, i, m):
    blocks[i, 0, 0], blocks[i, 0, 1], blocks[i, 1, 0], blocks[i, 1, 1] = m.a, m.b, m.c, m.d


@kernel
def eliminate(strand, pull, projectors, curvature, pivots, links, step):
    """Forward elimination of H step = -derivative; ``step`` holds the derivative on entry.

    pivots : the inverses of the diagonal blocks. links : the blocks above the diagonal.
    Returns the row at which H is found not to be positive definite, whose pivot is then left
    as it is, or the number of rows.
    """
    for i in range(step.shape[0]):
        p = entry(projectors, i)
        m = confined(own_block(strand, pull, i, curvature), p)
        gx, gy = -step[i, 0], -step[i, 1]
        if i > 0:
            q = product(entry(projectors, i - 1), link_block(strand, i - 1, curvature))
            put(links, i - 1, product(q, p))
            left = product(transposed(entry(links, i - 1)), entry(pivots, i - 1))
            k = product(left, entry(links, i - 1))
            m = Block(m.a - k.a, m.b - k.b, m.c - k.c, m.d - k.d)
            gx -= left.a * step[i - 1, 0] + left.b * step[i - 1, 1]
            gy -= left.c * step[i - 1, 0] + left.d * step[i - 1, 1]
        if not (m.a > 0.0 and m.a * m.d - m.b * m.c > 1e-14 * m.a * m.d):
            put(pivots, i, m)
            return i
        put(pivots, i, inverse(m))
        step[i, 0], step[i, 1] = gx, gy
    return step.shape[0]


@kernel
def substitute(pivots, links, step, rows):
    """Back substitution from row ``rows`` - 1 upwards; what lies below is taken as it is."""
    for i in range(rows - 1, -1, -1):
        gx, gy = step[i, 0], step[i, 1]
        if i + 1 < step.shape[0]:
            k = entry(links, i)
            gx -= k.a * step[i + 1, 0] + k.b * step[i + 1, 1]
            gy -= k.c * step[i + 1, 0] + k.d * step[i + 1, 1]
        m = entry(pivots, i)
        step[i, 0] = m.a * gx + m.b * gy
        step[i, 1] = m.c * gx + m.d * gy


@kernel
def downward(pivots, links, step, row):
    """A direction of negative curvature where the elimination broke down at a row.

    v^T H v = u^T M u for the eigenvector u of the pivot M with its least eigenvalue.
    """
    m = entry(pivots, row)
    least = 0.5 * (m.a + m.d) - math.hypot(0.5 * (m.a - m.d), m.b)
    ux, uy = m.b, least - m.a
    if abs(least - m.d) > abs(uy):
        ux, uy = least - m.d, m.b
    size = math.hypot(ux, uy)
    for i in range(step.shape[0]):
        step[i, 0], step[i, 1] = 0.0, 0.0
    step[row, 0] = ux / size if size > 0.0 else 1.0
    step[row, 1] = uy / size if size > 0.0 else 0.0
    substitute(pivots, links, step, row)


@kernel
def newton_step(strand, pull, drift, projectors, curvature, pivots, links, derivative, step):
    """Newton's step (m, 2) for the points of a polyline, both of its ends left out.

    pull (m, n) on each point in R^n, drift (m, 2) of the cost; where H is not positive
    definite, a direction of negative curvature instead. Returns whether it is.
    curvature : 1 for Newton's step; 0 leaves out what the layers and the cost bend, which
    makes H positive definite always.
    """
    fill_derivative(strand, pull, drift, projectors, derivative)
    for i in range(step.shape[0]):
        step[i, 0], step[i, 1] = derivative[i, 0], derivative[i, 1]
    rows = eliminate(strand, pull, projectors, curvature, pivots, links, step)
    if rows < step.shape[0]:
        downward(pivots, links, step, rows)
        return False
    substitute(pivots, links, step, rows)
    return True


# What a moving polyline runs into


class Walls(NamedTuple):
    """Straight walls with free ground to the right of each, and the corners it can bend round.

    Edges and corners stand a little behind the places where a path that meets them is put, so
    that a path along a wall is clear of it whatever the rounding. The edges of cell
    c = j * nx + i are ``edge_ids[edge_first[c]:edge_first[c + 1]]``, and likewise the corners.
    """

    grid: Grid
    edges: np.ndarray  # (e, 4) float64: x1, y1, x2, y2
    normals: np.ndarray  # (e, 2) float64: unit vectors towards free ground
    edge_first: np.ndarray  # (cells + 1,) int64
    edge_ids: np.ndarray  # int64
    corners: np.ndarray  # (c, 2) float64
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
    """When the segment a-b, its ends moving by u and v in unit time, first meets the point c."""
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
    rows = span(min(y, y + dy), max(y, y + dy), grid.y0, grid.dy, grid.ny)
    columns = span(min(x, x + dx), max(x, x + dx), grid.x0, grid.dx, grid.nx)
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
    rows = span(low_y, high_y, grid.y0, grid.dy, grid.ny)
    columns = span(low_x, high_x, grid.x0, grid.dx, grid.nx)
    for row in range(rows.first, rows.last + 1):
        for column in range(columns.first, columns.last + 1):
            cell = row * grid.nx + column
            for k in range(walls.corner_first[cell], walls.corner_first[cell + 1]):
                c = walls.corner_ids[k]
                cx, cy = walls.corners[c, 0], walls.corners[c, 1]
                if c in (skipped, also_skipped) or not low_x <= cx <= high_x:
                    continue
                if low_y <= cy <= high_y:
                    t = corner_time(ax, ay, ux, uy, bx, by, vx, vy, cx, cy)
                    if t < best:
                        best, hit = t, c
    return best, hit


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
