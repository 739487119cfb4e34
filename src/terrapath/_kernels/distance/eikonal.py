"""The eikonal equation grad u^T h^-1 grad u = 1 on a lattice, by single-pass fast marching.

With h^-1 = sum_k rho_k e_k e_k^T, rho_k >= 0 (see ``stencils``),

    sum_k rho_k max(0, u(x) - u(x + e_k), u(x) - u(x - e_k))^2 = 1

is monotone and causal, so that each node is settled once, in the order of the values
(Mirebeau 2014, 2019). The order follows from this equation. The final value of a node follows
from the same equation with second-order differences, where the field is smooth.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from .calendar_queue import QUEUED, dequeue, earliest, enqueue
from .stencils import (
    ALL_LINKS,
    ALL_SIDES,
    AROUND,
    EDGE,
    SECOND,
    WINDOW,
    around,
    edge_length,
    rho_of,
    steps_of,
    vector_of,
)


class Source(NamedTuple):
    """A model v of the distance near the source, on a window of nodes.

    Differences are taken of u - v, which is smooth where u is not (additive factoring).
    """

    row: int  # of the window's first node
    column: int
    model: np.ndarray  # (rows, columns) float64: v, NaN where it does not hold
    slope_x: np.ndarray  # (rows, columns) float64: dv/di, per node
    slope_y: np.ndarray


# The scheme


@inner_kernel
def solve_upwind(a0, a1, a2, w0, w1, w2):
    """The u with sum_k w_k max(0, u - a_k)^2 = 1; infinite a_k take no part."""
    if a1 < a0:
        a0, a1, w0, w1 = a1, a0, w1, w0
    if a2 < a0:
        a0, a2, w0, w2 = a2, a0, w2, w0
    if a2 < a1:
        a1, a2, w1, w2 = a2, a1, w2, w1
    # Relative to a0: squares of large values would round off their difference.
    d1, d2 = a1 - a0, a2 - a0
    if w0 * d1 * d1 >= 1.0:
        return a0 + 1.0 / math.sqrt(w0)
    w, b, c = w0 + w1, w1 * d1, w1 * d1 * d1
    if w0 * d2 * d2 + w1 * (d2 - d1) * (d2 - d1) < 1.0:
        w, b, c = w + w2, b + w2 * d2, c + w2 * d2 * d2
    return a0 + (b + math.sqrt(max(b * b - w * (c - 1.0), 0.0))) / w


@inner_kernel
def nearest(u, links, n, step, side):
    """The smaller settled value on the two sides of a direction, infinite where there is none."""
    a = math.inf
    if links >> side & 1:
        a = u[n + step]
    if links >> side & 2:
        a = min(a, u[n - step])
    return a


@inner_kernel
def least_upwind(u, links, n, steps):
    """The smallest settled value along the three directions."""
    a0 = nearest(u, links, n, steps.s0, 0)
    a1 = nearest(u, links, n, steps.s1, 2)
    return min(a0, a1, nearest(u, links, n, steps.s2, 4))


@inner_kernel
def first_order(u, node, nx, n):
    """The value of a node by first-order differences to settled neighbours."""
    s = steps_of(node, nx)
    if node.links & ALL_SIDES == ALL_SIDES:
        a0 = min(u[n + s.s0], u[n - s.s0])
        a1 = min(u[n + s.s1], u[n - s.s1])
        a2 = min(u[n + s.s2], u[n - s.s2])
    else:
        a0 = nearest(u, node.links, n, s.s0, 0)
        a1 = nearest(u, node.links, n, s.s1, 2)
        a2 = nearest(u, node.links, n, s.s2, 4)
    return solve_upwind(
        a0, a1, a2, np.float64(node.rho0), np.float64(node.rho1), np.float64(node.rho2)
    )


# Second-order differences are used where the slope beyond the neighbour is at most this many times
# the slope between it and the node. Elsewhere the field is not smooth.
STEEPEST = 2.0


class Difference(NamedTuple):
    """w (u - a)^2 stands for the squared derivative along a direction."""

    a: float
    w: float


@inner_kernel
def difference(trial, near, far, rho):
    """The difference along a direction, of second order where the field is smooth there.

    3/2 (u - (4 u_1 - u_2) / 3) replaces u - u_1. near : u_1. far : u_2. They are infinite where
    they may not be used.
    """
    # Written such that infinite values do not lead to NaN.
    is_smooth = (far < near) & (far >= near - STEEPEST * (trial - near))
    a = (4.0 * near - far) / 3.0 if is_smooth else near
    w = 2.25 * rho if is_smooth else rho
    return Difference(a, w)


@inner_kernel
def plain_difference(u, trial, n, step, rho):
    """``difference`` where all neighbours may be used."""
    ahead, behind = u[n + step], u[n - step]
    upwind = step if ahead < behind else -step
    return difference(trial, min(ahead, behind), u[n + 2 * upwind], rho)


class Upwind(NamedTuple):
    """The sign of a neighbour's vector; the values there and one step farther, else infinite."""

    sign: int
    near: float
    far: float


@inner_kernel
def upwind(u, links, n, step, side):
    """The settled neighbour with the smaller value along a direction."""
    ahead, behind, far, sign = math.inf, math.inf, math.inf, 1
    if links >> side & 1:
        ahead = u[n + step]
    if links >> side & 2:
        behind = u[n - step]
    if behind < ahead:
        ahead, side, sign = behind, side + 1, -1
    if links >> (side + SECOND) & 1:
        far = u[n + 2 * sign * step]
    return Upwind(sign, ahead, far)


@inner_kernel
def linked_difference(u, trial, links, n, step, side, rho):
    """``difference``, from the neighbours that links lead to."""
    found = upwind(u, links, n, step, side)
    return difference(trial, found.near, found.far, rho)


@inner_kernel
def model_at(source, row, column):
    """The model v at a place of the window, NaN outside."""
    if 0 <= row < source.model.shape[0] and 0 <= column < source.model.shape[1]:
        return source.model[row, column]
    return math.nan


@inner_kernel
def factored_difference(source, nx, u, trial, node, n, side, rho):
    """``linked_difference`` of u - v, plus the derivative of the model v.

    Where no neighbour is nearer to the source, a is infinite, and w is what the model's
    derivative adds to the left side of the equation.
    """
    e = vector_of(node, side)
    found = upwind(u, node.links, n, e.y * nx + e.x, side)
    ex, ey = found.sign * e.x, found.sign * e.y
    row, column = n // nx - source.row, n % nx - source.column
    v0 = source.model[row, column]
    v1 = model_at(source, row + ey, column + ex)
    v2 = model_at(source, row + 2 * ey, column + 2 * ex)
    slope = ex * source.slope_x[row, column] + ey * source.slope_y[row, column]
    plain = difference(trial, found.near, found.far, rho)
    a, w = plain.a, plain.w
    if w > rho and not math.isnan(v2):
        a += (3.0 * v0 - 4.0 * v1 + v2 + 2.0 * slope) / 3.0
    elif not math.isnan(v1):
        a, w = found.near + slope + v0 - v1, rho
    if a < trial:
        return Difference(a, w)
    return Difference(math.inf, rho * slope * slope)


# Where the model's own derivatives would leave less than this share of the equation to the
# neighbours, they are not subtracted.
LEAST_SHARE = 0.1


@kernel
def solve_factored(u, trial, node, source, nx, n):
    """Like ``second_order``, in the source's window."""
    d0 = factored_difference(source, nx, u, trial, node, n, 0, np.float64(node.rho0))
    d1 = factored_difference(source, nx, u, trial, node, n, 2, np.float64(node.rho1))
    d2 = factored_difference(source, nx, u, trial, node, n, 4, np.float64(node.rho2))
    share = 1.0
    for d in (d0, d1, d2):
        if d.a == math.inf:
            share -= d.w
    share = share if share >= LEAST_SHARE else 1.0
    return solve_upwind(d0.a, d1.a, d2.a, d0.w / share, d1.w / share, d2.w / share)


@inner_kernel
def second_order(u, trial, node, source, nx, n):
    """The second-order value of a node whose first-order value is ``trial``."""
    links = node.links
    s = steps_of(node, nx)
    if links & WINDOW:
        value = solve_factored(u, trial, node, source, nx, n)
        # The values of plain differences rise from node to node; of the model's, where it holds.
        if value > least_upwind(u, links, n, s):
            return value
    r0, r1, r2 = np.float64(node.rho0), np.float64(node.rho1), np.float64(node.rho2)
    if links == ALL_LINKS:
        d0 = plain_difference(u, trial, n, s.s0, r0)
        d1 = plain_difference(u, trial, n, s.s1, r1)
        d2 = plain_difference(u, trial, n, s.s2, r2)
    else:
        d0 = linked_difference(u, trial, links, n, s.s0, 0, r0)
        d1 = linked_difference(u, trial, links, n, s.s1, 2, r1)
        d2 = linked_difference(u, trial, links, n, s.s2, 4, r2)
    return solve_upwind(d0.a, d1.a, d2.a, d0.w, d1.w, d2.w)


# Edges to the nodes around, where links are missing


@kernel
def by_edges(nodes, u, nx, n):
    """The least value of node n along a single edge."""
    best = math.inf
    for k in range(AROUND):
        if nodes[n].around >> k & 1:
            e = around(k)
            m = n + e.y * nx + e.x
            if u[m] < best:
                best = min(best, u[m] + edge_length(nodes, n, e, m))
    return best


@inner_kernel
def offered(nodes, front, nx, n, dependent, side):
    """The value that a dependent gets from the settled nodes; n was settled last."""
    if side == EDGE:
        return by_edges(nodes, front.u, nx, dependent)
    if front.trial[dependent] == math.inf:
        return front.u[n] + 1.0 / math.sqrt(rho_of(nodes[dependent], side))
    return first_order(front.u, nodes[dependent], nx, dependent)


@inner_kernel
def offer(nodes, front, dependents, nx, n):
    """Give every dependent of a newly settled node a new trial value."""
    for m in range(dependents.first[n], dependents.first[n + 1]):
        entry = dependents.entries[m]
        dependent = np.int64(entry >> 3)
        if front.u[dependent] < math.inf:
            continue
        before = front.trial[dependent]
        value = offered(nodes, front, nx, n, dependent, np.int64(entry & 7))
        # Written such that NaN, from lengths that overflow, is not queued; nor is infinity.
        if not value < before:
            continue
        if before == math.inf:
            front.counters[QUEUED] += 1
        else:
            dequeue(nodes, front, dependent)
        enqueue(nodes, front, dependent, value)


@inner_kernel
def settled_value(nodes, front, source, nx, n):
    """The final value of node n."""
    value = second_order(front.u, front.trial[n], nodes[n], source, nx, n)
    if nodes[n].around:
        edge = by_edges(nodes, front.u, nx, n)
        # Written such that NaN is replaced, too: the stencil may have no settled neighbour.
        if not value < edge:
            value = edge
    return value if value < math.inf else front.trial[n]


@kernel
def plant(nodes, front, dependents, nx, seeds, values):
    """Settle the seeds at their values, and give their dependents trial values."""
    for m in range(seeds.shape[0]):
        front.u[seeds[m]] = values[m]
    for m in range(seeds.shape[0]):
        offer(nodes, front, dependents, nx, seeds[m])


@kernel
def march(nodes, front, dependents, source, nx, most, limit):
    """Settle up to ``most`` nodes with trial values up to ``limit``; returns how many."""
    for settled in range(most):
        if front.counters[QUEUED] == 0:
            return settled
        n = earliest(nodes, front, True)
        if front.trial[n] > limit:
            return settled
        dequeue(nodes, front, n)
        front.counters[QUEUED] -= 1
        front.u[n] = settled_value(nodes, front, source, nx, n)
        offer(nodes, front, dependents, nx, n)
    return most
