"""Distances on a lattice by Bellman's principle (Hopf and Lax), node by node in one pass.

Nodes are queued by what their edges offer. A node that is settled looks at the segments beside its
best edge: in stars without wide angles the places that matter are less (Mirebeau 2014), by so much
that nodes whose values differ by a share of the least edge may be settled in any order. A node that
is offered less later is queued again.
"""

import math

import numpy as np

from ..bits import lowest_bit
from ..compiler import inner_kernel, kernel
from ..prefetch import fetch
from .bellman import chord_of, node_at, row_of, sample_at, toward, value_at
from .calendar_queue import DAY, QUEUED, any_of_day, dequeue, earliest, enqueue, list_of
from .quartet import place_node
from .star import BASE, EIGHTH, HALF, base_cost, bits_ahead, bits_back, bits_of, index, other_cost
from .values import value_beside, values_of

SEED = 255

# A settled node is queued again for values that are less by more than this share. From so many
# times on the share doubles each time, so that a march ends where costs leap by many powers of ten.
GAIN, SELDOM, MOST_TIMES = 1e-6, 16, 34

# A node this near to the source, in nodes, is the source.
AT_SOURCE = 1e-9


@kernel
def queue_up(front, state, n, value):
    """Queue a node for a value, or move it forward in the queue."""
    node = node_at(state, n)
    if node.queued:
        if list_of(front, value) == list_of(front, value_at(state, n).u):
            value_at(state, n).u = value
            return
        dequeue(state.nodes, front, n)
    else:
        front.counters[QUEUED] += 1
        node.queued = 1
    enqueue(state.nodes, front, n, value)


@inner_kernel
def settle(medium, state, source, member, value):
    """Give a member of the quartet its value."""
    known, node = value_at(state, member.n), node_at(state, member.n)
    # At the source itself tau has its limit, the cost there.
    known.u, known.tau = value, source.cost
    if member.x * member.x + member.y * member.y > AT_SOURCE * AT_SOURCE:
        chord = chord_of(medium, source, member)
        known.u = max(value, medium.ground.floor * chord)  # rounding may be below it
        known.tau = known.u / chord
    node.times = min(int(node.times) + 1, MOST_TIMES)


@inner_kernel
def is_less(value, known, node):
    """Is a value less than that of a node, by a share where that is settled?"""
    if not value < known.u:
        return False
    if node.queued or known.tau == math.inf:
        return True
    return value < known.u * (1.0 - GAIN * (1 << max(int(node.times) - SELDOM, 0)))


@inner_kernel
def offer_along(front, state, x, k, value):
    """Offer a value to node x, that an edge along k leads to."""
    node = node_at(state, x)
    if is_less(value, value_at(state, x), node):
        node.best = (k + HALF) % (2 * HALF)
        queue_up(front, state, x, value)


@inner_kernel
def look_again(medium, front, state, source, n):
    """Offer what the wide segments that end in a settled node give to settled nodes around it."""
    bits = bits_of(medium.stars, n)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        x = toward(medium, n, k)
        if medium.stars.wide[index(x)] and value_at(state, x).tau < math.inf:
            opposite = (k + HALF) % (2 * HALF)
            value = value_beside(medium, state, source, x, opposite)
            offer_along(front, state, x, k, value)


@inner_kernel
def offer(medium, front, state, n):
    """Offer the value of a settled node along all its edges."""
    stars, u = medium.stars, value_at(state, n).u
    ahead, back = bits_ahead(stars, n), bits_back(stars, n)
    for k in range(0, HALF, EIGHTH):
        if ahead >> k & 1:
            value = u + base_cost(stars, n, k)
            offer_along(front, state, toward(medium, n, k), k, value)
        if back >> k & 1:
            m = toward(medium, n, k + HALF)
            offer_along(front, state, m, k + HALF, u + base_cost(stars, m, k))
    ahead, back, place = ahead & ~BASE, back & ~BASE, np.int64(stars.first[index(n)])
    while ahead != 0:
        k = lowest_bit(ahead)
        ahead &= ahead - 1
        value = u + np.float64(stars.others[index(place)])
        offer_along(front, state, toward(medium, n, k), k, value)
        place += 1
    while back != 0:
        k = lowest_bit(back)
        back &= back - 1
        m = toward(medium, n, k + HALF)
        offer_along(front, state, m, k + HALF, u + other_cost(stars, m, k))


@kernel
def plant(front, state, seeds, values):
    """Queue the seeds with their values."""
    for m in range(seeds.shape[0]):
        node_at(state, seeds[m]).best = SEED
        queue_up(front, state, seeds[m], values[m])


@inner_kernel
def fetch_around(medium, state, n):
    """Ask for what is known around a node."""
    stars, j = medium.stars, row_of(medium, n)
    at = sample_at(medium, n - j * medium.grid.nx, j)
    for layer in range(medium.samples.shape[0]):
        for row in range(-1, 2):
            fetch(medium.samples[layer], at + row * medium.columns)
    fetch(stars.ahead, n)
    fetch(stars.back, n)
    fetch(stars.first, n)
    fetch(state.nodes, n)
    for row in range(-1, 2):
        m = n + row * medium.grid.nx
        fetch(state.values, m - 1)
        fetch(state.values, m + 1)
        fetch(stars.base, 4 * m)


@inner_kernel
def fetch_next(medium, front, state):
    """Ask for what is known around the nodes that will be taken next."""
    n = front.heads[front.counters[DAY] & (front.heads.shape[0] - 1)]
    for _ in range(4):
        if n < 0:
            return
        fetch_around(medium, state, n)
        n = node_at(state, n).after


@inner_kernel
def take(medium, front, state, source, node, n):
    """Take node n out of the queue."""
    dequeue(state.nodes, front, n)
    front.counters[QUEUED] -= 1
    node_at(state, n).queued = 0
    place_node(medium, source, node, n, np.int64(node_at(state, n).best))


@inner_kernel
def take_four(medium, front, state, source, first, most):
    """Take a node and up to three more of its day, but no seed beside others; returns how many."""
    nodes = state.quartet.nodes
    take(medium, front, state, source, nodes[0], first)
    if nodes[0].a == SEED:
        return 1
    for count in range(1, min(most, 4)):
        n = any_of_day(state.nodes, front, front.counters[DAY])
        if n < 0 or node_at(state, n).best == SEED:
            return count
        take(medium, front, state, source, nodes[count], n)
    return min(most, 4)


@inner_kernel
def settle_four(medium, state, source, count):
    """Settle the nodes that were taken."""
    nodes = state.quartet.nodes
    if nodes[0].a == SEED:
        settle(medium, state, source, nodes[0], value_at(state, nodes[0].n).u)
        return
    values = values_of(medium, state, source, state.quartet, count)
    for m in range(count):
        value = min(values[m], value_at(state, nodes[m].n).u)
        settle(medium, state, source, nodes[m], value)


@kernel
def march(medium, front, state, source, most, limit, in_order):
    """Settle up to ``most`` nodes with trial values up to ``limit``; returns how many.

    in_order : within a day of the queue, too. Otherwise up to four nodes of a day at once.
    """
    settled = 0
    while settled < most and front.counters[QUEUED] > 0:
        n = earliest(state.nodes, front, in_order)
        if value_at(state, n).u > limit:
            return settled
        count = take_four(medium, front, state, source, n, 1 if in_order else most - settled)
        fetch_next(medium, front, state)
        settle_four(medium, state, source, count)
        settled += count
        for m in range(count):
            n = state.quartet.nodes[m].n
            offer(medium, front, state, n)
            if medium.stars.wide[index(n)]:
                look_again(medium, front, state, source, n)
    return settled
