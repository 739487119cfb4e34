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
from .bellman import chord_of, node_of, value_beside, value_of
from .calendar_queue import QUEUED, dequeue, earliest, enqueue, list_of
from .star import BASE, EIGHTH, HALF, bits_of, place_of_other

SEED = 255

# A settled node is queued again for values that are less by more than this share. From so many
# times on the share doubles each time, so that a march ends where costs leap by many powers of ten.
GAIN, SELDOM, MOST_TIMES = 1e-6, 16, 34

# A node this near to the source, in nodes, is the source.
AT_SOURCE = 1e-9


@kernel
def queue_up(front, state, n, value):
    """Queue a node for a value, or move it forward in the queue."""
    if state.queued[n]:
        if list_of(front, value) == list_of(front, front.trial[n]):
            front.trial[n] = value
            return
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
        value = value_of(medium, front, state, source, node, np.int64(state.best[n]))
    if value < front.u[n]:
        front.u[n] = value
        # At the source itself tau has its limit, the cost there, from the beginning.
        if node.x * node.x + node.y * node.y > AT_SOURCE * AT_SOURCE:
            state.tau[n] = value / chord_of(medium, source, node)
    # From now on only what is less by a share is an offer.
    times = min(int(state.times[n]) + 1, MOST_TIMES)
    state.times[n] = times
    front.trial[n] = front.u[n] * (1.0 - GAIN * (1 << max(times - SELDOM, 0)))


@inner_kernel
def offer_along(front, state, x, k, value):
    """Offer a value to node x, that an edge along k leads to."""
    if value < front.trial[x]:
        state.best[x] = (k + HALF) % (2 * HALF)
        queue_up(front, state, x, value)


@inner_kernel
def look_again(medium, front, state, source, n):
    """Offer what the wide segments that end in a settled node give to settled nodes around it."""
    bits = bits_of(medium.stars, n)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        x = n + medium.steps[k]
        if medium.stars.wide[x] and front.u[x] < math.inf:
            opposite = (k + HALF) % (2 * HALF)
            value = value_beside(medium, front, state, source, x, opposite)
            offer_along(front, state, x, k, value)


@inner_kernel
def offer(medium, front, state, n):
    """Offer the value of a settled node along all its edges."""
    stars, steps, u = medium.stars, medium.steps, front.u[n]
    ahead, back = np.int64(stars.ahead[n]), np.int64(stars.back[n])
    for k in range(0, HALF, EIGHTH):
        if ahead >> k & 1:
            offer_along(front, state, n + steps[k], k, u + np.float64(stars.base[n, k // EIGHTH]))
        if back >> k & 1:
            m = n - steps[k]
            offer_along(front, state, m, k + HALF, u + np.float64(stars.base[m, k // EIGHTH]))
    ahead, back, place = ahead & ~BASE, back & ~BASE, np.int64(stars.first[n])
    while ahead != 0:
        k = lowest_bit(ahead)
        ahead &= ahead - 1
        offer_along(front, state, n + steps[k], k, u + np.float64(stars.others[place]))
        place += 1
    while back != 0:
        k = lowest_bit(back)
        back &= back - 1
        m = n - steps[k]
        cost = np.float64(stars.others[place_of_other(stars, m, k)])
        offer_along(front, state, m, k + HALF, u + cost)


@kernel
def plant(front, state, seeds, values):
    """Queue the seeds with their values."""
    for m in range(seeds.shape[0]):
        state.best[seeds[m]] = SEED
        queue_up(front, state, seeds[m], values[m])


@kernel
def march(medium, front, state, source, most, limit, in_order):
    """Settle up to ``most`` nodes with trial values up to ``limit``; returns how many.

    in_order : within a day of the queue, too.
    """
    for settled in range(most):
        if front.counters[QUEUED] == 0:
            return settled
        n = earliest(state.links, front, in_order)
        if front.trial[n] > limit:
            return settled
        dequeue(state.links, front, n)
        front.counters[QUEUED] -= 1
        state.queued[n] = 0
        settle(medium, front, state, source, n)
        offer(medium, front, state, n)
        if medium.stars.wide[n]:
            look_again(medium, front, state, source, n)
    return most
