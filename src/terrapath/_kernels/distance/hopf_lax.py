"""Distances on a lattice by Bellman's principle (Hopf and Lax), node by node in one pass.

The value of a node x is the least of u(y) + C(y, x) over places y on the segments between
neighbours in its star. Values are factored by the chord d from the source, u = d tau: on a segment
tau is linear and d exact. So no value is below the chord, planes are exact, and near the source
nothing special is needed. Where tau bends, its second differences make the scheme second order.

Nodes are queued by what their edges offer. A node that is settled looks at the segments beside its
best edge: in stars without wide angles the places that matter are less (Mirebeau 2014). A node that
is offered less later is queued again.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..space.free_space import segment_is_free
from .calendar_queue import QUEUED, dequeue, enqueue, least
from .ground import (
    Costs,
    bent,
    costed,
    flat,
    place_at,
    plus_rise,
    ray,
    read,
    smooth_floor,
    times_cells,
)
from .segments import LEAST_T, NOWHERE, Place, Segment, place_of_least, value_on
from .star import EAST, HALF, NORTH, beside, direction_of, entry_of


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
    has_obstacles: bool


class State(NamedTuple):
    """What is known of the nodes."""

    tau: np.ndarray  # (n,) float64: u over the chord
    best: np.ndarray  # (n,) uint8: the direction of the edge that offers least, or SEED
    queued: np.ndarray  # (n,) uint8
    times: np.ndarray  # (n,) uint8: how often it was settled, up to MOST_TIMES
    links: np.ndarray  # (n,) of calendar_queue.LINK


SEED = 255

# A settled node is queued again for values that are less by more than this share. From so many
# times on the share doubles each time, so that a march ends where costs leap by many powers of ten.
GAIN, SELDOM, MOST_TIMES = 1e-6, 16, 34

# A node this near to the source, in nodes, is the source.
AT_SOURCE = 1e-9

# Within this many nodes of the source, and where they would change a step by more than a share,
# second differences are not used.
CLOSE = 1.5
MOST_CORRECTED = 0.03


class Node(NamedTuple):
    """A node, its column and row, and how far these are from the source, map units."""

    n: int
    i: int
    j: int
    x: float
    y: float


@inner_kernel
def node_of(medium, source, n):
    grid = medium.grid
    j = n // grid.nx
    i = n - j * grid.nx
    return Node(n, i, j, (i - source.x) * grid.dx, (j - source.y) * grid.dy)


@inner_kernel
def chord_of(medium, source, node):
    """The chord from the source to a node, without costs, map units."""
    squared = node.x * node.x + node.y * node.y
    for layer in range(source.lift.shape[0]):
        rise = medium.heights[node.n, layer] - source.lift[layer]
        squared += rise * rise
    return math.sqrt(squared)


# A node


@inner_kernel
def segment_between(medium, source, node, ka, kb):
    """The segment between the ends of two directions."""
    grid, z = medium.grid, medium.heights
    n, a, b = node.n, node.n + medium.steps[ka], node.n + medium.steps[kb]
    ax, ay = EAST[ka] * grid.dx, NORTH[ka] * grid.dy
    ex, ey = EAST[kb] * grid.dx - ax, NORTH[kb] * grid.dy - ay
    sx, sy = node.x + ax, node.y + ay
    aa, ae, ee = ax * ax + ay * ay, ax * ex + ay * ey, ex * ex + ey * ey
    ss, se = sx * sx + sy * sy, sx * ex + sy * ey
    for layer in range(source.lift.shape[0]):
        az, ez = z[a, layer] - z[n, layer], z[b, layer] - z[a, layer]
        sz = z[a, layer] - source.lift[layer]
        aa, ae, ee = aa + az * az, ae + az * ez, ee + ez * ez
        ss, se = ss + sz * sz, se + sz * ez
    return Segment(aa, ae, ee, ss, se)


@inner_kernel
def cost_per_chord(medium, entry, chord):
    """What an edge costs, over its chord; 32 bits show no less than 2^-23 above the floor."""
    ratio, floor = np.float64(medium.stars.costs[entry]) / chord, medium.ground.floor
    return floor if ratio < floor * (1.0 + 2.5e-7) else ratio


@inner_kernel
def is_clear(medium, n, ka, kb):
    """May a path to n begin anywhere between the ends of two directions?"""
    if not medium.has_obstacles:
        return True
    a, between = n + medium.steps[ka], direction_of(EAST[kb] - EAST[ka], NORTH[kb] - NORTH[ka])
    if between >= 0 and entry_of(medium.stars, a, between) >= 0:
        return True
    grid, b = medium.grid, n + medium.steps[kb]
    ax, ay = grid.x0 + a % grid.nx * grid.dx, grid.y0 + a // grid.nx * grid.dy
    bx, by = grid.x0 + b % grid.nx * grid.dx, grid.y0 + b // grid.nx * grid.dy
    return segment_is_free(medium.space, ax, ay, bx, by)


@inner_kernel
def is_close(medium, node, di, dj):
    """Is the node (di, dj) away from this one within CLOSE nodes of the source?"""
    x, y = node.x / medium.grid.dx + di, node.y / medium.grid.dy + dj
    return x * x + y * y <= CLOSE * CLOSE


@inner_kernel
def is_joined(medium, a, n):
    """Does an edge lead from node a to node n?"""
    nx = medium.grid.nx
    direction = direction_of(n % nx - a % nx, n // nx - a // nx)
    return direction >= 0 and entry_of(medium.stars, a, direction) >= 0


@inner_kernel
def bend_beyond(medium, front, state, node, a, b, di, dj):
    """The second difference of tau at a, with b and the node (di, dj) away; NaN where unknown.

    That node lies beyond a, as seen from b.
    """
    grid = medium.grid
    if not (0 <= node.i + di < grid.nx and 0 <= node.j + dj < grid.ny):
        return math.nan
    n = node.n + dj * grid.nx + di
    if front.u[n] == math.inf or is_close(medium, node, di, dj):
        return math.nan
    if medium.has_obstacles and not is_joined(medium, a, n):
        return math.nan
    return state.tau[n] - 2.0 * state.tau[a] + state.tau[b]


@inner_kernel
def bend_of(medium, front, state, node, ka, kb):
    """The second difference of tau along a segment: the smaller of those on its two sides."""
    ai, aj, bi, bj = EAST[ka], NORTH[ka], EAST[kb], NORTH[kb]
    if is_close(medium, node, ai, aj) or is_close(medium, node, bi, bj):
        return 0.0
    a, b = node.n + medium.steps[ka], node.n + medium.steps[kb]
    before = bend_beyond(medium, front, state, node, a, b, 2 * ai - bi, 2 * aj - bj)
    after = bend_beyond(medium, front, state, node, b, a, 2 * bi - ai, 2 * bj - aj)
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
    dx, dy = node.x + x * medium.grid.dx, node.y + y * medium.grid.dy
    place = place_at(ground, per * (node.i + x), per * (node.j + y))
    squared = dx * dx + dy * dy
    for layer in range(source.lift.shape[0]):
        rise = read(ground.heights, layer, place) - source.lift[layer]
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
    x, y = EAST[ka] + t * (EAST[kb] - EAST[ka]), NORTH[ka] + t * (NORTH[kb] - NORTH[ka])
    vx, vy = x * grid.dx, y * grid.dy
    ex, ey = (EAST[kb] - EAST[ka]) * grid.dx, (NORTH[kb] - NORTH[ka]) * grid.dy
    lift = flat(vx, vy, ex, ey)
    sx, sy = node.x + vx, node.y + vy
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
        x, y = EAST[ka] + t * (EAST[kb] - EAST[ka]), NORTH[ka] + t * (NORTH[kb] - NORTH[ka])
        arrival = along_ray(medium, source, node, x, y)
    tau = state.tau[a] + t * (state.tau[b] - state.tau[a])
    bend = -0.5 * t * (1.0 - t) * bend_of(medium, front, state, node, ka, kb)
    if abs(bend) * arrival.chord <= MOST_CORRECTED * arrival.cost:
        tau += bend
    return arrival.cost + arrival.chord * max(tau, ground.floor)


@inner_kernel
def best_beside(medium, front, state, source, node, e, side):
    """The place between the ends of edge e and of the one beside it that offers least."""
    stars, other = medium.stars, beside(medium.stars, node.n, e, side)
    if other < 0:
        return NOWHERE
    ka, kb = np.int64(stars.directions[e]), np.int64(stars.directions[other])
    a, b = node.n + medium.steps[ka], node.n + medium.steps[kb]
    if front.u[b] == math.inf or not is_clear(medium, node.n, ka, kb):
        return NOWHERE
    g = segment_between(medium, source, node, ka, kb)
    ca = cost_per_chord(medium, e, math.sqrt(g.aa))
    cb = cost_per_chord(medium, other, math.sqrt(g.aa + 2.0 * g.ae + g.ee))
    t = place_of_least(g, ca, cb, state.tau[a], state.tau[b], front.u[a], front.u[b])
    if t <= LEAST_T:
        return NOWHERE
    return Place(value_on(g, t, ca, cb, state.tau[a], state.tau[b]), kb, t)


@inner_kernel
def value_of(medium, front, state, source, node, e):
    """The value of a node by its edge e, or by one of the segments beside that."""
    best, k = front.trial[node.n], np.int64(medium.stars.directions[e])
    right = best_beside(medium, front, state, source, node, e, -1)
    left = best_beside(medium, front, state, source, node, e, 1)
    place = left if left.value < right.value else right
    if place.value < best:
        value = value_through(medium, front, state, source, node, k, place.direction, place.t)
        best = min(best, value)
    return best


# The front


@inner_kernel
def queue_up(front, state, n, value):
    """Queue a node for a value, or move it forward in the queue."""
    if state.queued[n]:
        dequeue(state.links, front, n)
    else:
        front.counters[QUEUED] += 1
        state.queued[n] = 1
    enqueue(state.links, front, n, value)


@inner_kernel
def settle(medium, front, state, source, n):
    """Give a node its value, where that is less than the one it has."""
    node, value = node_of(medium, source, n), front.trial[n]
    if state.best[n] != SEED:
        entry = entry_of(medium.stars, n, state.best[n])
        value = value_of(medium, front, state, source, node, entry)
    if value < front.u[n]:
        front.u[n] = value
        # At the source itself tau has its limit, the cost there, from the beginning.
        if math.hypot(node.x, node.y) > AT_SOURCE * medium.grid.dx:
            state.tau[n] = value / chord_of(medium, source, node)
    # From now on only what is less by a share is an offer.
    times = min(int(state.times[n]) + 1, MOST_TIMES)
    state.times[n] = times
    front.trial[n] = front.u[n] * (1.0 - GAIN * (1 << max(times - SELDOM, 0)))


@inner_kernel
def offer(medium, front, state, n):
    """Offer the value of a settled node along all its edges."""
    stars, u = medium.stars, front.u[n]
    for e in range(stars.first[n], stars.first[n + 1]):
        k = np.int64(stars.directions[e])
        x, value = n + medium.steps[k], u + np.float64(stars.costs[e])
        if value < front.trial[x]:
            state.best[x] = (k + HALF) % (2 * HALF)
            queue_up(front, state, x, value)


@kernel
def plant(front, state, seeds, values):
    """Queue the seeds with their values."""
    for m in range(seeds.shape[0]):
        state.best[seeds[m]] = SEED
        queue_up(front, state, seeds[m], values[m])


@kernel
def march(medium, front, state, source, most, limit):
    """Settle up to ``most`` nodes with trial values up to ``limit``; returns how many."""
    for settled in range(most):
        if front.counters[QUEUED] == 0:
            return settled
        n = least(state.links, front)
        if front.trial[n] > limit:
            return settled
        dequeue(state.links, front, n)
        front.counters[QUEUED] -= 1
        state.queued[n] = 0
        settle(medium, front, state, source, n)
        offer(medium, front, state, n)
    return most
