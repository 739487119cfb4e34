"""Values between the nodes of a distance field, and paths back to the source.

Where the field u is smooth, both follow from cubic interpolation of tau, its ratio to the chord. At
kinks, where shortest paths from two sides meet, the slope of a cubic is a mean of both sides. Near
obstacles and unsettled nodes there is no cubic. At such a point p, the value follows from Bellman's
principle: the least of u(q) plus the cost from q to p. Here q runs over a ring of nodes around p,
and over the edges between them, as far as p can be seen from them.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..space.free_space import Grid, segment_is_free
from ..surface.lengths import inverse
from ..surface.surfaces import (
    cell_range,
    floor_of,
    has_cells,
    metric_at,
    slope_at as surface_slope_at,
    spot_at,
)
from .cubic import first_node, interpolate
from .surface_ray import surface_ray


class Field(NamedTuple):
    """A distance field and where it lies."""

    u: np.ndarray  # (ny, nx) float64, infinite where not settled
    tau: np.ndarray  # (ny, nx) float64: u over the chord without costs
    grid: Grid
    source_x: float
    source_y: float
    lift: np.ndarray  # (layers,) float64: the weighted heights of the source
    has_obstacles: bool


# Smooth places


# By the eikonal equation the dual norm of the slope is 1. At a kink the slope of the cubic is a
# mean of two, so its norm is less. A place is smooth where the norm is less by at most this share.
ROUGH = 0.1


class Chord(NamedTuple):
    """The chord from the source without costs, and its slope per map unit."""

    value: float
    x: float
    y: float


@kernel
def chord_at(surface, field, x, y):
    """The chord at (x, y)."""
    dx, dy = x - field.source_x, y - field.source_y
    squared, gx, gy = dx * dx + dy * dy, dx, dy
    spot = spot_at(surface, x, y)
    for layer in range(surface.weights.shape[0]):
        weight, slope = surface.weights[layer], surface_slope_at(surface, layer, spot)
        rise = weight * slope.f - field.lift[layer]
        squared += rise * rise
        gx += rise * weight * slope.fx
        gy += rise * weight * slope.fy
    value = math.sqrt(squared)
    share = 1.0 / value if value > 0.0 else 0.0
    return Chord(value, share * gx, share * gy)


class Slope(NamedTuple):
    """The value of u at a smooth place, and the direction of steepest ascent under h.

    The value is infinite where u is not smooth.
    """

    value: float
    x: float
    y: float


ROUGH_PLACE = Slope(math.inf, 0.0, 0.0)


@inner_kernel
def sees_cell(space, grid, x, y):
    """Can the 16 nodes of the cubic at (x, y) be seen from there?"""
    i = first_node((x - grid.x0) / grid.dx, grid.nx)
    j = first_node((y - grid.y0) / grid.dy, grid.ny)
    for q in range(4):
        for p in range(4):
            nx, ny = grid.x0 + (i + p) * grid.dx, grid.y0 + (j + q) * grid.dy
            if not segment_is_free(space, x, y, nx, ny):
                return False
    return True


@inner_kernel
def cell_costs_differ(surface, grid, x, y):
    """Do costs that are constant in cells differ between the 16 nodes of the cubic at (x, y)?"""
    if not has_cells(surface):
        return False
    x0 = grid.x0 + first_node((x - grid.x0) / grid.dx, grid.nx) * grid.dx
    y0 = grid.y0 + first_node((y - grid.y0) / grid.dy, grid.ny) * grid.dy
    costs = cell_range(surface, x0, x0 + 3.0 * grid.dx, y0, y0 + 3.0 * grid.dy)
    return costs.low < costs.high


@kernel
def slope_at(surface, space, field, x, y):
    """The field at (x, y), where it is smooth there."""
    grid = field.grid
    s, t = (x - grid.x0) / grid.dx, (y - grid.y0) / grid.dy
    if min(grid.nx, grid.ny) < 4 or not (0.0 <= s <= grid.nx - 1 and 0.0 <= t <= grid.ny - 1):
        return ROUGH_PLACE
    if cell_costs_differ(surface, grid, x, y):
        return ROUGH_PLACE
    patch = interpolate(field.tau, s, t)
    if patch.value == math.inf or (field.has_obstacles and not sees_cell(space, grid, x, y)):
        return ROUGH_PLACE
    d = inverse(metric_at(surface, x, y))
    chord, tau = chord_at(surface, field, x, y), max(patch.value, floor_of(surface))
    gx = tau * chord.x + chord.value * patch.x / grid.dx
    gy = tau * chord.y + chord.value * patch.y / grid.dy
    vx, vy = d.h11 * gx + d.h12 * gy, d.h12 * gx + d.h22 * gy
    if not gx * vx + gy * vy >= (1.0 - ROUGH) * (1.0 - ROUGH):
        return ROUGH_PLACE
    size = math.hypot(vx, vy)
    return Slope(chord.value * tau, vx / size, vy / size)


# Anywhere


class Approach(NamedTuple):
    """The last segment of a shortest path to a point: where it begins, and u at both ends.

    u is below ``level`` where it begins.
    """

    x: float
    y: float
    begin: float
    end: float
    level: float


# Half the side of the ring around a point, in nodes.
RING = 1


@inner_kernel
def nodes_apart(grid, ax, ay, bx, by):
    """Distance between two points, in nodes."""
    return math.hypot((ax - bx) / grid.dx, (ay - by) / grid.dy)


@kernel
def short_cost(surface, grid, ax, ay, bx, by):
    """The cost of the straight line between two places, in pieces of at most a node."""
    count = max(math.ceil(nodes_apart(grid, ax, ay, bx, by) - 1e-9), 1)
    return surface_ray(surface, ax, ay, bx, by, count)


@kernel
def better(surface, space, field, best, qx, qy, u, x, y):
    """The approach to (x, y) from q, if it is free and shorter than the best so far."""
    if not (u < best.end and u < best.level):
        return best
    end = u + short_cost(surface, field.grid, qx, qy, x, y)
    if end < best.end and (not field.has_obstacles or segment_is_free(space, x, y, qx, qy)):
        return Approach(qx, qy, u, end, best.level)
    return best


@inner_kernel
def best_share(h, ax, ay, bx, by, rise):
    """The t in [0, 1] that makes t rise + |p - q(t)| least, p - q(t) = a - t b."""
    bb = h.h11 * bx * bx + 2.0 * h.h12 * bx * by + h.h22 * by * by
    ab = h.h11 * ax * bx + h.h12 * (ax * by + ay * bx) + h.h22 * ay * by
    aa = h.h11 * ax * ax + 2.0 * h.h12 * ax * ay + h.h22 * ay * ay
    if rise * rise >= bb:
        return 0.0 if rise > 0.0 else 1.0
    across = max(aa - ab * ab / bb, 0.0)
    t = ab / bb - rise * math.sqrt(across / (bb * (bb - rise * rise)))
    return min(max(t, 0.0), 1.0)


@kernel
def better_on_edge(surface, space, field, best, h, i, j, step_i, step_j, x, y):
    """Like ``better``, from any place between the nodes (i, j) and (i, j) + step."""
    grid = field.grid
    a, b = field.u[j, i], field.u[j + step_j, i + step_i]
    if not (max(a, b) < math.inf and min(a, b) < best.end):
        return best
    ax, ay = grid.x0 + i * grid.dx, grid.y0 + j * grid.dy
    ex, ey = step_i * grid.dx, step_j * grid.dy
    if field.has_obstacles and not segment_is_free(space, ax, ay, ax + ex, ay + ey):
        return best
    t = best_share(h, x - ax, y - ay, ex, ey, b - a)
    return better(surface, space, field, best, ax + t * ex, ay + t * ey, a + t * (b - a), x, y)


class Ring(NamedTuple):
    """A rectangle of nodes around a cell; part of it may be outside the lattice."""

    i0: int
    j0: int
    i1: int
    j1: int


@inner_kernel
def ring_around(grid, x, y, r):
    """The ring r nodes away from the cell that holds (x, y)."""
    i = min(max(math.floor((x - grid.x0) / grid.dx), 0), grid.nx - 2)
    j = min(max(math.floor((y - grid.y0) / grid.dy), 0), grid.ny - 2)
    return Ring(i - r, j - r, i + 1 + r, j + 1 + r)


@kernel
def best_on_side(surface, space, field, best, h, i, j, step_i, step_j, count, x, y):
    """The best approach from the nodes (i, j) + k step, 0 <= k < count, or from between them."""
    grid = field.grid
    for k in range(count):
        p, q = i + k * step_i, j + k * step_j
        if 0 <= p < grid.nx and 0 <= q < grid.ny:
            px, py = grid.x0 + p * grid.dx, grid.y0 + q * grid.dy
            best = better(surface, space, field, best, px, py, field.u[q, p], x, y)
            last = k == count - 1 or p + step_i >= grid.nx or q + step_j >= grid.ny
            if not last:
                best = better_on_edge(surface, space, field, best, h, p, q, step_i, step_j, x, y)
    return best


@kernel
def best_on_ring(surface, space, field, best, h, ring, x, y):
    """The best approach to (x, y) from a ring, or ``best`` where none is better."""
    wide, high = ring.i1 - ring.i0 + 1, ring.j1 - ring.j0 + 1
    for j in (ring.j0, ring.j1):
        best = best_on_side(surface, space, field, best, h, ring.i0, j, 1, 0, wide, x, y)
    for i in (ring.i0, ring.i1):
        best = best_on_side(surface, space, field, best, h, i, ring.j0, 0, 1, high, x, y)
    return best


@kernel
def approach(surface, space, field, x, y, level):
    """The best last segment of a path to (x, y), from nearby nodes or from the source.

    It begins where u is less than ``level``; ``end`` is infinite where there is none. Tried are the
    corners of the cell, and the ring of nodes around these.
    """
    grid, best = field.grid, Approach(x, y, math.inf, math.inf, level)
    if nodes_apart(grid, x, y, field.source_x, field.source_y) <= RING + 1.0:
        best = better(surface, space, field, best, field.source_x, field.source_y, 0.0, x, y)
    h = metric_at(surface, x, y)
    for r in range(RING, -1, -1):
        ring = ring_around(grid, x, y, r)
        best = best_on_ring(surface, space, field, best, h, ring, x, y)
    return best


@kernel
def fill_distances(surface, space, field, points, values):
    """The field at points (m, 2) of the lattice's rectangle, infinite where it is not known."""
    for m in range(points.shape[0]):
        x, y = points[m, 0], points[m, 1]
        values[m] = slope_at(surface, space, field, x, y).value
        if values[m] == math.inf:
            value = approach(surface, space, field, x, y, math.inf).end
            values[m] = max(value, floor_of(surface) * chord_at(surface, field, x, y).value)


# Paths back to the source


@inner_kernel
def clamp(x, low, high):
    return min(max(x, low), high)


@inner_kernel
def step_down(grid, x, y, slope, step):
    """A step against a slope, kept on the lattice. step : in nodes."""
    step /= nodes_apart(grid, slope.x, slope.y, 0.0, 0.0)
    right, top = grid.x0 + (grid.nx - 1) * grid.dx, grid.y0 + (grid.ny - 1) * grid.dy
    return clamp(x - step * slope.x, grid.x0, right), clamp(y - step * slope.y, grid.y0, top)


@kernel
def descend(surface, space, field, x, y, level, step):
    """The next point of a path down the field from (x, y), and u there or just before.

    Where the field is smooth and less than ``level``: a step by the midpoint method. Elsewhere: the
    beginning of the best approach.
    """
    grid, slope = field.grid, slope_at(surface, space, field, x, y)
    if slope.value < math.inf:
        mx, my = step_down(grid, x, y, slope, 0.5 * step)
        slope = slope_at(surface, space, field, mx, my)
        if slope.value < level:
            nx, ny = step_down(grid, x, y, slope, step)
            if not field.has_obstacles or segment_is_free(space, x, y, nx, ny):
                return Slope(slope.value, nx, ny)
    best = approach(surface, space, field, x, y, level)
    if best.end == math.inf:
        return ROUGH_PLACE
    share = min(step / nodes_apart(grid, x, y, best.x, best.y), 1.0)
    value = best.end + share * (best.begin - best.end)
    nx, ny = x + share * (best.x - x), y + share * (best.y - y)
    # Rounding puts the end of a share beside the segment that was tested.
    if value < level and (not field.has_obstacles or segment_is_free(space, x, y, nx, ny)):
        return Slope(value, nx, ny)
    return Slope(best.begin, best.x, best.y)


# A path that is this near to the source, in nodes, ends with a straight step.
ARRIVED = 2.0


@kernel
def trace(surface, space, field, step, points):
    """Follow the field down from points[0] to the source; returns the number of points.

    step : in nodes. Returns 0 where the source is not reached.
    """
    level = math.inf
    x, y = points[0, 0], points[0, 1]
    for m in range(1, points.shape[0]):
        near = nodes_apart(field.grid, x, y, field.source_x, field.source_y) <= ARRIVED
        if near and segment_is_free(space, x, y, field.source_x, field.source_y):
            points[m, 0], points[m, 1] = field.source_x, field.source_y
            return m + 1
        place = descend(surface, space, field, x, y, level, step)
        if place.value == math.inf:
            return 0
        level, x, y = place.value, place.x, place.y
        points[m, 0], points[m, 1] = x, y
    return 0
