"""Distances on a lattice by Bellman's principle (Hopf and Lax), node by node in one pass.

The value of a node x is the least of u(y) + C(y, x) over places y on the segments between
neighbours in its star. Values are factored by the chord d from the source, u = d tau: on a segment
tau is linear and d exact. So no value is below the chord, planes are exact, and near the source
nothing special is needed. Where tau bends, its second differences make the scheme second order.

Nodes are queued by what their edges offer. A node that is settled looks at the two segments beside
its best edge (Mirebeau 2014: in stars without wide angles the places that matter are less).
A node that is offered less later is queued again.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..space.free_space import segment_is_free
from .calendar_queue import QUEUED, dequeue, enqueue, least
from .ground import place_at, ray, read
from .star import EAST, HALF, NORTH, beside, direction_between, entry_of


class Source(NamedTuple):
    """Where distances begin."""

    x: float  # in nodes
    y: float
    lift: np.ndarray  # (layers,) float64: the weighted heights, map units


class Medium(NamedTuple):
    """The lattice and all that a march needs to know of the ground."""

    ground: object  # Ground
    stars: object  # Stars
    space: object  # Space
    grid: object  # Grid, of the nodes
    has_obstacles: bool


class State(NamedTuple):
    """What is known of the nodes."""

    tau: np.ndarray  # (n,) float64: u over the chord
    best: np.ndarray  # (n,) uint8: the direction of the edge that offers least; SEED, UNSEEN
    queued: np.ndarray  # (n,) uint8
    links: np.ndarray  # (n,) of calendar_queue.LINK


SEED, UNSEEN = 254, 255

# What is offered to a settled node is less by more than this share, or it is left out.
GAIN = 1e-6

# A node this near to the source, in nodes, is the source.
AT_SOURCE = 1e-9

# Within this many nodes of the source, and where they would change a step by more than a share,
# second differences are not used.
CLOSE = 1.5
MOST_CORRECTED = 0.03


@inner_kernel
def lifted_height(medium, layer, n):
    """The weighted height of a node."""
    ground, nx = medium.ground, medium.grid.nx
    per = 2 * ground.pieces
    return ground.heights[layer, per * (n // nx), per * (n % nx)]


@inner_kernel
def offset_of(medium, direction):
    """A direction as a difference of node numbers."""
    return NORTH[direction] * medium.grid.nx + EAST[direction]


@inner_kernel
def nodes_from(medium, source, n):
    """How many nodes a node is from the source."""
    nx = medium.grid.nx
    return math.hypot(n % nx - source.x, n // nx - source.y)


@kernel
def chord_to_node(medium, source, n):
    """The chord from the source to a node, without costs, map units."""
    grid = medium.grid
    x, y = (n % grid.nx - source.x) * grid.dx, (n // grid.nx - source.y) * grid.dy
    squared = x * x + y * y
    for layer in range(source.lift.shape[0]):
        rise = lifted_height(medium, layer, n) - source.lift[layer]
        squared += rise * rise
    return math.sqrt(squared)


@kernel
def chord_to_place(medium, source, x, y):
    """The chord from the source to a place, in nodes, map units."""
    ground, grid = medium.ground, medium.grid
    dx, dy = (x - source.x) * grid.dx, (y - source.y) * grid.dy
    squared = dx * dx + dy * dy
    place = place_at(ground, 2 * ground.pieces * x, 2 * ground.pieces * y)
    for layer in range(source.lift.shape[0]):
        rise = read(ground.heights, layer, place) - source.lift[layer]
        squared += rise * rise
    return math.sqrt(squared)


# The segment between two neighbours a and b of a node x, in R^n


class Segment(NamedTuple):
    """Products of the lifts a and b - a from x, and of a from the source."""

    aa: float
    ae: float
    ee: float
    ss: float  # of a from the source, squared
    se: float  # its product with b - a


@inner_kernel
def segment_between(medium, source, n, ka, kb):
    """The segment between the ends of two directions."""
    grid = medium.grid
    a, b = n + offset_of(medium, ka), n + offset_of(medium, kb)
    ax, ay = EAST[ka] * grid.dx, NORTH[ka] * grid.dy
    ex, ey = EAST[kb] * grid.dx - ax, NORTH[kb] * grid.dy - ay
    sx = (n % grid.nx - source.x) * grid.dx + ax
    sy = (n // grid.nx - source.y) * grid.dy + ay
    aa, ae, ee = ax * ax + ay * ay, ax * ex + ay * ey, ex * ex + ey * ey
    ss, se = sx * sx + sy * sy, sx * ex + sy * ey
    for layer in range(source.lift.shape[0]):
        za = lifted_height(medium, layer, a)
        az, ez = za - lifted_height(medium, layer, n), lifted_height(medium, layer, b) - za
        sz = za - source.lift[layer]
        aa, ae, ee = aa + az * az, ae + az * ez, ee + ez * ez
        ss, se = ss + sz * sz, se + sz * ez
    return Segment(aa, ae, ee, ss, se)


class Place(NamedTuple):
    """A place a + t (b - a) on a segment, and the value that it offers."""

    value: float
    t: float


# Where the value rises along a segment at this rate at its beginning, its least is there.
UPHILL = 0.35


@inner_kernel
def value_on(g, t, ca, cb, ta, tb):
    """The value offered from the place t of a segment: costs per chord c, and tau, are linear."""
    c, tau = ca + t * (cb - ca), ta + t * (tb - ta)
    near = math.sqrt(max(g.aa + t * (2.0 * g.ae + t * g.ee), 0.0))
    far = math.sqrt(max(g.ss + t * (2.0 * g.se + t * g.ee), 0.0))
    return c * near + tau * far


@kernel
def improved(g, t, ca, cb, ta, tb):
    """The t of the least value, by a step of Newton's method."""
    c, tau = ca + t * (cb - ca), ta + t * (tb - ta)
    near = math.sqrt(max(g.aa + t * (2.0 * g.ae + t * g.ee), 0.0))
    far = math.sqrt(max(g.ss + t * (2.0 * g.se + t * g.ee), 0.0))
    if not (near > 0.0 and far > 0.0):
        return t
    near_rise, far_rise = (g.ae + t * g.ee) / near, (g.se + t * g.ee) / far
    slope = c * near_rise + (cb - ca) * near + tau * far_rise + (tb - ta) * far
    bend = c * (g.ee - near_rise * near_rise) / near + tau * (g.ee - far_rise * far_rise) / far
    bend += 2.0 * ((cb - ca) * near_rise + (tb - ta) * far_rise)
    return min(max(t - slope / bend, 0.0), 1.0) if bend > 0.0 else t


@inner_kernel
def least_on(g, ca, cb, ta, tb, ua, ub):
    """The place of a segment that offers least; infinite where that is its beginning."""
    length, near = math.sqrt(g.ee), math.sqrt(g.aa)
    c = 0.5 * (ca + cb)
    rise = ub - ua + (cb - ca) * near
    if rise + c * g.ae / near > UPHILL * c * length:
        return Place(math.inf, 0.0)
    across = max(g.aa - g.ae * g.ae / g.ee, 0.0)
    room = c * c * g.ee - rise * rise
    t = 0.5
    if room > 0.0:
        t = -g.ae / g.ee - rise * math.sqrt(across / (g.ee * room))
    t = improved(g, min(max(t, 0.0), 1.0), ca, cb, ta, tb)
    if t <= 1e-6:
        return Place(math.inf, 0.0)
    return Place(value_on(g, t, ca, cb, ta, tb), t)


# A node


@inner_kernel
def cost_per_chord(medium, n, entry, aa):
    """What an edge costs, over its chord; 32 bits do not show less than GAIN."""
    ratio = np.float64(medium.stars.costs[entry]) / math.sqrt(aa)
    floor = medium.ground.floor
    return floor if ratio < floor * (1.0 + 2e-7) else ratio


@inner_kernel
def is_clear(medium, n, ka, kb):
    """May a path to n begin anywhere between the ends of two directions?"""
    if not medium.has_obstacles:
        return True
    a, between = n + offset_of(medium, ka), direction_between(ka, kb)
    if between >= 0 and entry_of(medium.stars, a, between) >= 0:
        return True
    grid, b = medium.grid, n + offset_of(medium, kb)
    ax, ay = grid.x0 + a % grid.nx * grid.dx, grid.y0 + a // grid.nx * grid.dy
    bx, by = grid.x0 + b % grid.nx * grid.dx, grid.y0 + b // grid.nx * grid.dy
    return segment_is_free(medium.space, ax, ay, bx, by)


@inner_kernel
def bend_beyond(medium, front, state, source, a, b, i, j):
    """The second difference of tau at a and b, and the node (i, j) beyond a; NaN where unknown."""
    grid = medium.grid
    if not (0 <= i < grid.nx and 0 <= j < grid.ny):
        return math.nan
    n = j * grid.nx + i
    if front.u[n] == math.inf or nodes_from(medium, source, n) <= CLOSE:
        return math.nan
    return state.tau[n] - 2.0 * state.tau[a] + state.tau[b]


@inner_kernel
def bend_of(medium, front, state, source, n, ka, kb):
    """The second difference of tau along a segment: the smaller of those on its two sides."""
    nx = medium.grid.nx
    a, b = n + offset_of(medium, ka), n + offset_of(medium, kb)
    if min(nodes_from(medium, source, a), nodes_from(medium, source, b)) <= CLOSE:
        return 0.0
    i, j = n % nx, n // nx
    ex, ey = EAST[kb] - EAST[ka], NORTH[kb] - NORTH[ka]
    before = bend_beyond(medium, front, state, source, a, b, i + EAST[ka] - ex, j + NORTH[ka] - ey)
    after = bend_beyond(medium, front, state, source, b, a, i + EAST[kb] + ex, j + NORTH[kb] + ey)
    if math.isnan(before):
        return 0.0 if math.isnan(after) else after
    if math.isnan(after):
        return before
    if before * after <= 0.0:
        return 0.0
    return before if abs(before) < abs(after) else after


@kernel
def value_through(medium, front, state, source, n, ka, kb, t):
    """The value of node n through the place t between two of its neighbours."""
    nx, per = medium.grid.nx, 2.0 * medium.ground.pieces
    a, b = n + offset_of(medium, ka), n + offset_of(medium, kb)
    dx, dy = EAST[ka] + t * (EAST[kb] - EAST[ka]), NORTH[ka] + t * (NORTH[kb] - NORTH[ka])
    x, y = float(n % nx), float(n // nx)
    cost = ray(medium.ground, per * x, per * y, per * dx, per * dy)
    chord = chord_to_place(medium, source, x + dx, y + dy)
    tau = state.tau[a] + t * (state.tau[b] - state.tau[a])
    bend = -0.5 * t * (1.0 - t) * bend_of(medium, front, state, source, n, ka, kb)
    if abs(bend) * chord <= MOST_CORRECTED * cost:
        tau += bend
    return cost + chord * max(tau, medium.ground.floor)


@kernel
def beside_edge(medium, front, state, source, n, e, side):
    """The best place between the ends of edge e and of the one beside it."""
    stars = medium.stars
    other = beside(stars, n, e, side)
    if other < 0:
        return Place(math.inf, 0.0)
    ka, kb = np.int64(stars.directions[e]), np.int64(stars.directions[other])
    a, b = n + offset_of(medium, ka), n + offset_of(medium, kb)
    if front.u[b] == math.inf or not is_clear(medium, n, ka, kb):
        return Place(math.inf, 0.0)
    g = segment_between(medium, source, n, ka, kb)
    ca = cost_per_chord(medium, n, e, g.aa)
    cb = cost_per_chord(medium, n, other, g.aa + 2.0 * g.ae + g.ee)
    return least_on(g, ca, cb, state.tau[a], state.tau[b], front.u[a], front.u[b])


@kernel
def value_by(medium, front, state, source, n, e):
    """The value of node n by way of its edge e and of the segments beside that."""
    stars = medium.stars
    k = np.int64(stars.directions[e])
    a, aa = n + offset_of(medium, k), 0.0
    grid = medium.grid
    aa = (EAST[k] * grid.dx) ** 2 + (NORTH[k] * grid.dy) ** 2
    for layer in range(source.lift.shape[0]):
        aa += (lifted_height(medium, layer, a) - lifted_height(medium, layer, n)) ** 2
    best = front.u[a] + cost_per_chord(medium, n, e, aa) * math.sqrt(aa)
    right = beside_edge(medium, front, state, source, n, e, -1)
    left = beside_edge(medium, front, state, source, n, e, 1)
    side = 1 if left.value < right.value else -1
    place = left if side == 1 else right
    if place.value < best:
        other = np.int64(stars.directions[beside(stars, n, e, side)])
        best = min(best, value_through(medium, front, state, source, n, k, other, place.t))
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
def lower(medium, front, state, source, n, value):
    """Give a node its value."""
    front.u[n] = value
    # At the source itself tau has its limit, the cost there, from the beginning.
    if nodes_from(medium, source, n) > AT_SOURCE:
        state.tau[n] = value / chord_to_node(medium, source, n)


@inner_kernel
def offer(medium, front, state, source, n):
    """Offer the value of a settled node along all its edges."""
    stars = medium.stars
    for e in range(stars.first[n], stars.first[n + 1]):
        k = np.int64(stars.directions[e])
        x, value = n + offset_of(medium, k), front.u[n] + np.float64(stars.costs[e])
        if value < front.trial[x] and value < front.u[x] * (1.0 - GAIN):
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
        value = front.trial[n]
        if state.best[n] != SEED:
            entry = entry_of(medium.stars, n, state.best[n])
            value = value_by(medium, front, state, source, n, entry)
        if value < front.u[n]:
            lower(medium, front, state, source, n, value)
        offer(medium, front, state, source, n)
    return most
