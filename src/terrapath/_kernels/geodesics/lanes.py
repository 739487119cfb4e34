"""Paths over lanes: each point of a path has a few places, and a path over lanes one of each.

Pieces between places are measured as they are, and tested for obstacles. So dynamic programming
finds a path that is free and never longer than the one in the first lane, however rough the ground.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..distance.surface_ray import surface_piece
from ..space.free_space import segment_is_free
from ..surface.lengths import gauss
from ..surface.speeds import speed_at
from ..surface.surfaces import (
    has_cells,
    mean_cell_cost,
    slope_at,
    spot_at,
    squared_cost_at,
    stretch_at,
    value_at,
)
from ..travel.paces import pace_along, pace_jet
from ..travel.priced import per_price

# Gauss's rule of five points on [-1, 1]: the outer two pairs of nodes, and the weights.
INNER, OUTER = 0.5384693101056831, 0.9061798459386640
MIDDLE_WEIGHT = 0.5688888888888889
INNER_WEIGHT, OUTER_WEIGHT = 0.4786286704993665, 0.2369268850561891

# A segment that is no longer than this share of a panel needs three points.
SHORT = 0.6

# A pivot of Newton's method is at least this share of the sum of second differences.
LEAST_PIVOT = 0.1


class Frame(NamedTuple):
    """Where a path may be, and how finely it is measured, all in map units."""

    x0: float
    y0: float
    x1: float
    y1: float
    longest_x: float  # one rule measures at most this much along x1
    longest_y: float


class Lanes(NamedTuple):
    """A path's places, and what pieces between them cost."""

    places: np.ndarray  # (m, lanes, 2), map units; NaN where there is none; the path itself first
    table: np.ndarray  # (m - 1, lanes, lanes): lengths of pieces, infinite where not free
    costs: np.ndarray  # (m, lanes)
    before: np.ndarray  # (m, lanes) int64


@inner_kernel
def pair(surface, x, y, vx, vy, share):
    """The sum of |v|_h at two places beside (x, y)."""
    px, py = 0.5 * share * vx, 0.5 * share * vy
    return speed_at(surface, x - px, y - py, vx, vy) + speed_at(surface, x + px, y + py, vx, vy)


@kernel
def gauss_length(surface, frame, ax, ay, bx, by):
    """The length of a segment by Gauss's rule: five points in each panel, or three in all."""
    across = max(abs(bx - ax) / frame.longest_x, abs(by - ay) / frame.longest_y)
    if across <= SHORT:
        return gauss(surface, ax, ay, bx - ax, by - ay)
    panels = max(math.ceil(across), 1)
    vx, vy = (bx - ax) / panels, (by - ay) / panels
    total = 0.0
    for k in range(panels):
        x, y = ax + (k + 0.5) * vx, ay + (k + 0.5) * vy
        total += MIDDLE_WEIGHT * speed_at(surface, x, y, vx, vy)
        total += INNER_WEIGHT * pair(surface, x, y, vx, vy, INNER)
        total += OUTER_WEIGHT * pair(surface, x, y, vx, vy, OUTER)
    return 0.5 * total


@kernel
def lane_length(surface, frame, ax, ay, bx, by):
    """The length of a segment; where costs are constant in cells, each cell has its own."""
    if not has_cells(surface):
        return gauss_length(surface, frame, ax, ay, bx, by)
    dx, dy = bx - ax, by - ay
    total, share = 0.0, 0.0
    while share < 1.0:
        here = stretch_at(surface, ax, ay, dx, dy, share)
        x0, y0, x1, y1 = ax + share * dx, ay + share * dy, ax + here.end * dx, ay + here.end * dy
        total += here.cost * gauss_length(surface, frame, x0, y0, x1, y1)
        share = here.end
    return total


@inner_kernel
def pair_of_chords(pace, size, z0, z1, z2):
    """The chords of both halves of a piece, from the heights at its ends and its middle."""
    return pace_along(pace, 0.5 * size, z1 - z0) + pace_along(pace, 0.5 * size, z2 - z1)


@kernel
def priced_piece(surface, ax, ay, bx, by):
    vx, vy = bx - ax, by - ay
    size, weight, pace = math.sqrt(vx * vx + vy * vy), surface.weights[0], surface.price.pace
    if size == 0.0:
        return 0.0
    a, b = spot_at(surface, ax, ay), spot_at(surface, bx, by)
    middle = spot_at(surface, ax + 0.5 * vx, ay + 0.5 * vy)
    z0, slope, z2 = value_at(surface, 0, a), slope_at(surface, 0, middle), value_at(surface, 0, b)
    chord = pace_along(pace, size, weight * (z2 - z0))
    halves = pair_of_chords(pace, size, weight * z0, weight * slope.f, weight * z2)
    jet, grade = pace_jet(pace, weight * (z2 - z0) / size), weight * (z2 - z0) / size
    intercept = max(jet.value - grade * jet.slope, 0.0)
    across = weight * (vx * slope.fy - vy * slope.fx) / size
    stiff = intercept + jet.curvature * across * across
    bent = (halves - chord) * (4.0 / 3.0) * (intercept / stiff if stiff > 0.0 else 0.0)
    ends = math.sqrt(squared_cost_at(surface, a)) + math.sqrt(squared_cost_at(surface, b))
    cost = (ends + 4.0 * math.sqrt(squared_cost_at(surface, middle))) / 6.0
    if has_cells(surface):
        cost *= mean_cell_cost(surface, ax, ay, bx, by)
    return cost * (chord + max(bent, 0.0))


@per_price(surface_piece, priced_piece)
def piece(surface, ax, ay, bx, by):
    """About what the best path between two places nearby costs."""


@kernel
def bent_length(surface, points):
    """About the length of a path (m, 2) whose pieces may bend between their ends."""
    total = 0.0
    for m in range(points.shape[0] - 1):
        total += piece(surface, points[m, 0], points[m, 1], points[m + 1, 0], points[m + 1, 1])
    return total


@inner_kernel
def is_inside(frame, x, y):
    """Is a place within the bounds? NaN is not."""
    return frame.x0 <= x <= frame.x1 and frame.y0 <= y <= frame.y1


@kernel
def leave_blocked(space, frame, places, m):
    """Leave out the places of a point that no free segment leads to from the first one."""
    x, y = places[m, 0, 0], places[m, 0, 1]
    for j in range(1, places.shape[1]):
        px, py = places[m, j, 0], places[m, j, 1]
        if not (is_inside(frame, px, py) and segment_is_free(space, x, y, px, py)):
            places[m, j, 0] = math.nan


@kernel
def measure(surface, space, frame, places, m, table):
    """Fill the table of the pieces between points m and m + 1."""
    lanes, last = places.shape[1], places.shape[0] - 2
    for i in range(lanes if m > 0 else 1):
        ax, ay = places[m, i, 0], places[m, i, 1]
        for j in range(lanes if m < last else 1):
            bx, by = places[m + 1, j, 0], places[m + 1, j, 1]
            table[m, i, j] = math.inf
            exists = not (math.isnan(ax) or math.isnan(bx))
            if exists and segment_is_free(space, ax, ay, bx, by):
                table[m, i, j] = lane_length(surface, frame, ax, ay, bx, by)


@kernel
def fill_table(surface, space, frame, lanes, changed):
    """Measure the pieces beside the points (m,) that have changed, uint8."""
    for m in range(1, lanes.table.shape[0]):
        if changed[m]:
            leave_blocked(space, frame, lanes.places, m)
    for m in range(lanes.table.shape[0]):
        if changed[m] or changed[m + 1]:
            measure(surface, space, frame, lanes.places, m, lanes.table)


@kernel
def choose(lanes, chosen):
    """The lanes (m,) of the shortest path; returns its length. Both ends are in the first lane."""
    table, costs, before = lanes.table, lanes.costs, lanes.before
    last, count = table.shape[0], table.shape[1]
    costs[0, 0] = 0.0
    for m in range(1, last + 1):
        for j in range(count if m < last else 1):
            costs[m, j], before[m, j] = math.inf, 0
            for i in range(count if m > 1 else 1):
                reached = costs[m - 1, i] + table[m - 1, i, j]
                if reached < costs[m, j]:
                    costs[m, j], before[m, j] = reached, i
    lane = 0
    for m in range(last, 0, -1):
        chosen[m] = lane
        lane = before[m, lane]
    chosen[0] = 0
    return costs[last, 0]


@inner_kernel
def slope_and_bend(ahead, here, back):
    """First and second differences of three lengths; NaN where one is infinite."""
    return 0.5 * (ahead - back), (ahead - here) + (back - here)


@inner_kernel
def mixed(f):
    """The mixed second difference of a piece; 0 where one of its lengths is infinite."""
    value = 0.25 * ((f[1, 1] - f[1, 2]) - (f[2, 1] - f[2, 2]))
    return value if math.isfinite(value) else 0.0


@kernel
def newton(table, work, shares):
    """Newton's step (m,) for the quadratic through a table's first three lanes.

    These are 0, 1 and -1. Where the quadratic is not convex, its curvature is taken as larger.
    Points whose places are not all free stay. work : (2, m).
    """
    last, pivots, sizes = table.shape[0], work[0], work[1]
    for m in range(last + 1):
        pivots[m], sizes[m], shares[m] = 0.0, 0.0, 0.0
    for m in range(last):
        f = table[m]
        if m > 0:
            slope, bend = slope_and_bend(f[1, 0], f[0, 0], f[2, 0])
            shares[m], pivots[m] = shares[m] - slope, pivots[m] + bend
            sizes[m] += abs(bend)
        if m < last - 1:
            slope, bend = slope_and_bend(f[0, 1], f[0, 0], f[0, 2])
            shares[m + 1], pivots[m + 1] = shares[m + 1] - slope, pivots[m + 1] + bend
            sizes[m + 1] += abs(bend)
    solve(table, pivots, sizes, shares)


@kernel
def solve(table, pivots, sizes, shares):
    """Solve the tridiagonal system of Newton's step in place; points without a slope stay."""
    last = table.shape[0]
    for m in range(1, last):
        if not (math.isfinite(shares[m]) and 0.0 < sizes[m] < math.inf):
            shares[m], pivots[m] = 0.0, math.inf
            continue
        if m > 1 and pivots[m - 1] < math.inf:
            share = mixed(table[m - 1]) / pivots[m - 1]
            pivots[m] -= mixed(table[m - 1]) * share
            shares[m] -= share * shares[m - 1]
        pivots[m] = max(pivots[m], LEAST_PIVOT * sizes[m])
    for m in range(last - 1, 0, -1):
        if pivots[m] < math.inf:
            if m < last - 1:
                shares[m] -= mixed(table[m]) * shares[m + 1]
            shares[m] /= pivots[m]
    shares[0] = shares[last] = 0.0
