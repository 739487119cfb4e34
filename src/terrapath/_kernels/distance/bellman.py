"""The value of a node by Bellman's principle: the least of u(y) + C(y, x) over places y.

These are on the segments between neighbours in the star of x. Values are factored by the chord d
from the source, u = d tau: on a segment tau is linear and d exact. So no value is below the chord,
planes are exact, and near the source nothing special is needed. Where tau bends, its second
differences make the scheme second order.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..space.free_space import segment_is_free
from .ground import (
    Costs,
    bent,
    costed,
    flat,
    place_at,
    plus_rise,
    read,
    smooth_floor,
    times_cells,
)
from .ray import ray
from .segments import NO_SEGMENT, End, Segment, place_of_least, value_on
from .star import ACUTE, EAST, NORTH, X, Y, beside, bits_of, cost_along, direction_of


class Source(NamedTuple):
    """Where distances begin."""

    x: float  # in nodes
    y: float
    lift: np.ndarray  # (layers,) float64: the weighted heights, map units


class Medium(NamedTuple):
    """The lattice and all that a march needs to know of the ground."""

    ground: object  # Ground
    heights: np.ndarray  # (n, layers) float64: weighted, of the nodes
    stars: object  # Stars
    steps: np.ndarray  # (64,) int64: each direction as a difference of node numbers
    one_piece: np.ndarray  # (64,) uint8: is an edge along it a single piece?
    space: object  # Space
    grid: object  # Grid, of the nodes
    row_per_node: float  # 1 / nx
    has_obstacles: bool


class State(NamedTuple):
    """What is known of the nodes."""

    tau: np.ndarray  # (n,) float64: u over the chord
    best: np.ndarray  # (n,) uint8: the direction of the edge that offers least, or SEED
    queued: np.ndarray  # (n,) uint8
    times: np.ndarray  # (n,) uint8: how often it was settled, up to MOST_TIMES
    links: np.ndarray  # (n,) of calendar_queue.LINK


# Within this many nodes of the source, and where they would change a step by more than a share,
# second differences are not used.
CLOSE = 1.5
MOST_CORRECTED = 0.03


class Node(NamedTuple):
    """A node, its column and row, and how far these are from the source, in nodes."""

    n: int
    i: int
    j: int
    x: float
    y: float


@inner_kernel
def node_of(medium, source, n):
    # A division of integers takes longer; the half keeps rounding away from whole numbers.
    j = int((n + 0.5) * medium.row_per_node)
    i = n - j * medium.grid.nx
    return Node(n, i, j, i - source.x, j - source.y)


@inner_kernel
def chord_of(medium, source, node):
    """The chord from the source to a node, without costs, map units."""
    x, y = node.x * medium.grid.dx, node.y * medium.grid.dy
    squared = x * x + y * y
    for layer in range(source.lift.shape[0]):
        rise = medium.heights[node.n, layer] - source.lift[layer]
        squared += rise * rise
    return math.sqrt(squared)


@inner_kernel
def cost_per_chord(medium, n, k, chord):
    """What an edge costs, over its chord; 32 bits show no less than 2^-23 above the floor."""
    ratio, floor = cost_along(medium.stars, medium.steps, n, k) / chord, medium.ground.floor
    return floor if ratio < floor * (1.0 + 2.5e-7) else ratio


@inner_kernel
def leads(medium, n, x, y):
    """Does an edge lead from node n to the one (x, y) away?"""
    direction = direction_of(x, y)
    return direction >= 0 and bits_of(medium.stars, n) >> direction & 1 == 1


@inner_kernel
def is_clear(medium, n, ka, kb):
    """May a path to n begin anywhere between the ends of two directions?"""
    if not medium.has_obstacles:
        return True
    a = n + medium.steps[ka]
    if leads(medium, a, EAST[kb] - EAST[ka], NORTH[kb] - NORTH[ka]):
        return True
    grid, b = medium.grid, n + medium.steps[kb]
    ax, ay = grid.x0 + a % grid.nx * grid.dx, grid.y0 + a // grid.nx * grid.dy
    bx, by = grid.x0 + b % grid.nx * grid.dx, grid.y0 + b // grid.nx * grid.dy
    return segment_is_free(medium.space, ax, ay, bx, by)


@inner_kernel
def is_close(node, x, y):
    """Is the node (x, y) away from this one within CLOSE nodes of the source?"""
    x, y = node.x + x, node.y + y
    return x * x + y * y <= CLOSE * CLOSE


@inner_kernel
def bend_beyond(medium, front, state, node, ka, kb):
    """The second difference of tau, at the end of ka, along the line from the end of kb; NaN where
    the node beyond on that line is unknown.
    """
    grid, ex, ey = medium.grid, EAST[ka] - EAST[kb], NORTH[ka] - NORTH[kb]
    x, y = EAST[ka] + ex, NORTH[ka] + ey
    if not (0 <= node.i + x < grid.nx and 0 <= node.j + y < grid.ny):
        return math.nan
    a, b = node.n + medium.steps[ka], node.n + medium.steps[kb]
    n = 2 * a - b
    if front.u[n] == math.inf or is_close(node, x, y):
        return math.nan
    if medium.has_obstacles and not leads(medium, a, ex, ey):
        return math.nan
    return state.tau[n] - 2.0 * state.tau[a] + state.tau[b]


@inner_kernel
def bend_of(medium, front, state, node, ka, kb):
    """The second difference of tau along a segment: the smaller of those on its two sides."""
    if is_close(node, X[ka], Y[ka]) or is_close(node, X[kb], Y[kb]):
        return 0.0
    before = bend_beyond(medium, front, state, node, ka, kb)
    after = bend_beyond(medium, front, state, node, kb, ka)
    if math.isnan(before):
        return 0.0 if math.isnan(after) else after
    if math.isnan(after):
        return before
    if before * after <= 0.0:
        return 0.0
    return before if abs(before) < abs(after) else after


class Arrival(NamedTuple):
    """A path to a node: what it costs, and the chord from the source to where it begins."""

    cost: float
    chord: float


@inner_kernel
def along_ray(medium, source, node, x, y):
    """The straight path to a node from the place (x, y) away, in nodes, piece by piece."""
    ground, per = medium.ground, 2.0 * medium.ground.pieces
    cost = ray(ground, per * node.i, per * node.j, per * x, per * y)
    dx, dy = (node.x + x) * medium.grid.dx, (node.y + y) * medium.grid.dy
    place = place_at(ground, per * (node.i + x), per * (node.j + y))
    squared = dx * dx + dy * dy
    for layer in range(source.lift.shape[0]):
        rise = read(ground, ground.heights, layer, place) - source.lift[layer]
        squared += rise * rise
    return Arrival(cost, math.sqrt(squared))


class Crossing(NamedTuple):
    """Samples on the line from t between two neighbours to a node."""

    begin: float
    middle: float
    across: float  # the slope along the segment between the neighbours


@inner_kernel
def on_triangle(samples, i, j, ai, aj, bi, bj, t):
    """The quadratic through the corners of a triangle and the middles of its sides.

    (i, j) : the sample at the node. (ai, aj), (bi, bj) : half of the vectors to the neighbours.
    """
    za, zb = samples[j + 2 * aj, i + 2 * ai], samples[j + 2 * bj, i + 2 * bi]
    ma, mb = samples[j + aj, i + ai], samples[j + bj, i + bi]
    sag = samples[j + aj + bj, i + ai + bi] - 0.5 * (za + zb)
    return Crossing(
        za + t * (zb - za) + 4.0 * t * (1.0 - t) * sag,
        ma + t * (mb - ma) + t * (1.0 - t) * sag,
        2.0 * (mb - ma) + 2.0 * (1.0 - 2.0 * t) * sag,
    )


@inner_kernel
def in_triangle(medium, source, node, ka, kb, t):
    """The path from t between two neighbours, in one piece."""
    ground, grid, half = medium.ground, medium.grid, medium.ground.pieces
    i, j = 2 * half * node.i, 2 * half * node.j
    ai, aj, bi, bj = half * EAST[ka], half * NORTH[ka], half * EAST[kb], half * NORTH[kb]
    x, y = X[ka] + t * (X[kb] - X[ka]), Y[ka] + t * (Y[kb] - Y[ka])
    ex, ey = (X[kb] - X[ka]) * grid.dx, (Y[kb] - Y[ka]) * grid.dy
    lift = flat(0.0, x * grid.dx, y * grid.dy, ex, ey)
    sx, sy = (node.x + x) * grid.dx, (node.y + y) * grid.dy
    squared = sx * sx + sy * sy
    for layer in range(source.lift.shape[0]):
        z = on_triangle(ground.heights[layer], i, j, ai, aj, bi, bj, t)
        lift = plus_rise(lift, ground.heights[layer, j, i], z.middle, z.begin, z.across)
        rise = z.begin - source.lift[layer]
        squared += rise * rise
    cost = bent(lift)
    if ground.costs.shape[0] > 0:
        c = on_triangle(ground.costs[0], i, j, ai, aj, bi, bj, t)
        floor = smooth_floor(ground)
        begin, middle = max(c.begin, floor), max(c.middle, floor)
        cost = costed(ground, lift, cost, Costs(ground.costs[0, j, i], middle, begin, c.across))
    cost = times_cells(ground, cost, i, j, i + 2 * half * x, j + 2 * half * y)
    return Arrival(cost, math.sqrt(squared))


@inner_kernel
def value_through(medium, front, state, source, node, ka, kb, t):
    """The value of a node through the place t between two of its neighbours."""
    a, b, ground = node.n + medium.steps[ka], node.n + medium.steps[kb], medium.ground
    if medium.one_piece[ka] and medium.one_piece[kb]:
        arrival = in_triangle(medium, source, node, ka, kb, t)
    else:
        x, y = X[ka] + t * (X[kb] - X[ka]), Y[ka] + t * (Y[kb] - Y[ka])
        arrival = along_ray(medium, source, node, x, y)
    tau = state.tau[a] + t * (state.tau[b] - state.tau[a])
    bend = -0.5 * t * (1.0 - t) * bend_of(medium, front, state, node, ka, kb)
    if abs(bend) * arrival.chord <= MOST_CORRECTED * arrival.cost:
        tau += bend
    return arrival.cost + arrival.chord * max(tau, ground.floor)


@inner_kernel
def end_of(medium, front, state, source, node, k):
    """The end of a node's edge along k."""
    grid, z = medium.grid, medium.heights
    x, y, a = X[k] * grid.dx, Y[k] * grid.dy, node.n + medium.steps[k]
    sx, sy = (node.x + X[k]) * grid.dx, (node.y + Y[k]) * grid.dy
    aa, ss = x * x + y * y, sx * sx + sy * sy
    for layer in range(source.lift.shape[0]):
        rise, height = z[a, layer] - z[node.n, layer], z[a, layer] - source.lift[layer]
        aa, ss = aa + rise * rise, ss + height * height
    near = math.sqrt(aa)
    cost = cost_per_chord(medium, node.n, k, near)
    return End(k, aa, ss, near, math.sqrt(ss), cost, state.tau[a], front.u[a])


@inner_kernel
def segment_beside(medium, front, state, source, node, end, side):
    """The segment from the end of a node's edge to that of the next on one side (1 or -1)."""
    ka, grid, z = end.direction, medium.grid, medium.heights
    kb = beside(bits_of(medium.stars, node.n), ka, side)
    if kb < 0:
        return NO_SEGMENT
    n, a, b = node.n, node.n + medium.steps[ka], node.n + medium.steps[kb]
    if front.u[b] == math.inf or not is_clear(medium, n, ka, kb):
        return NO_SEGMENT
    x, y = (X[kb] - X[ka]) * grid.dx, (Y[kb] - Y[ka]) * grid.dy
    ae = X[ka] * grid.dx * x + Y[ka] * grid.dy * y
    se = (node.x + X[ka]) * grid.dx * x + (node.y + Y[ka]) * grid.dy * y
    ee = x * x + y * y
    for layer in range(source.lift.shape[0]):
        za, rise = z[a, layer], z[b, layer] - z[a, layer]
        ae, ee = ae + (za - z[n, layer]) * rise, ee + rise * rise
        se += (za - source.lift[layer]) * rise
    cost = cost_per_chord(medium, n, kb, math.sqrt(end.aa + 2.0 * ae + ee))
    segment = Segment(kb, ae, ee, se, cost, state.tau[b], 0.0)
    t = place_of_least(end, segment, front.u[b])
    return Segment(kb, ae, ee, se, cost, state.tau[b], t)


@inner_kernel
def is_too_wide(end, s):
    """Is the angle between the edges to both ends of a segment too wide?"""
    both = max(end.aa + s.ae, 0.0)
    return both * both < ACUTE * ACUTE * end.aa * (end.aa + 2.0 * s.ae + s.ee)


@inner_kernel
def value_of(medium, front, state, source, node, k):
    """The value of a node by its edge along k, or by one of the segments beside that."""
    end = end_of(medium, front, state, source, node, k)
    best = min(front.trial[node.n], end.u + end.cost * end.near)
    segment = segment_beside(medium, front, state, source, node, end, -1)
    left = segment_beside(medium, front, state, source, node, end, 1)
    if segment.t == 0.0 or (
        left.t > 0.0 and value_on(end, left, left.t) < value_on(end, segment, segment.t)
    ):
        segment = left
    if segment.t == 0.0:
        return best
    value = value_through(medium, front, state, source, node, k, segment.direction, segment.t)
    return min(best, value)


@kernel
def value_beside(medium, front, state, source, n, k):
    """The value of node n by the segments beside its edge along k that are too wide.

    They lie far from the node, as the lifted ground has it. So they count only where the ground
    between is as even as the two edges say.
    """
    node, best = node_of(medium, source, n), math.inf
    end = end_of(medium, front, state, source, node, k)
    for side in (-1, 1):
        segment = segment_beside(medium, front, state, source, node, end, side)
        if segment.t > 0.0 and is_too_wide(end, segment):
            t, kb = segment.t, segment.direction
            value = value_through(medium, front, state, source, node, k, kb, t)
            apart = abs(value - value_on(end, segment, t))
            step = math.sqrt(max(end.aa + t * (2.0 * segment.ae + t * segment.ee), 0.0))
            if apart <= MOST_CORRECTED * end.cost * step:
                best = min(best, value)
    return best
