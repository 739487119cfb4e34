"""The stars of a lattice: which nodes an edge leads to from each node, and what it costs.

A star has the eight neighbours of a node. Where the angle between two of them, as the lifted ground
has it, is wide, the direction between them in the Stern-Brocot tree joins them, and so on
(Mirebeau 2014, "Efficient fast marching with Finsler metrics"): a value then follows from values
that are less. An edge leads both ways and is in the stars of both nodes.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..space.free_space import segment_is_free
from ..surface.surfaces import Metric
from .ground import ray, sampled_piece


def _directions(levels):
    """The vectors of the Stern-Brocot tree down to a level, all around, by their angle."""
    quadrant = [(1, 0), (0, 1)]
    for _ in range(levels):
        between = [(a + c, b + d) for (a, b), (c, d) in pairwise(quadrant)]
        quadrant = [v for pair in zip(quadrant, between, strict=False) for v in pair] + [(0, 1)]
    turned = quadrant[:-1]
    around = []
    for _ in range(4):
        around += turned
        turned = [(-y, x) for x, y in turned]
    return np.array(around, np.int64)


# Direction k + HALF is opposite to direction k; each EIGHTH one leads to one of the eight nodes
# around.
DIRECTIONS = _directions(4)
HALF, QUARTER, EIGHTH = 32, 16, 8
EAST, NORTH = DIRECTIONS[:, 0].copy(), DIRECTIONS[:, 1].copy()
FARTHEST = 5
BASE = sum(1 << k for k in range(0, HALF, EIGHTH))


def _numbers():
    """(11, 11): the number of the direction (x, y) at [y + FARTHEST, x + FARTHEST], else -1."""
    numbers = np.full((2 * FARTHEST + 1, 2 * FARTHEST + 1), -1)
    for k, (x, y) in enumerate(DIRECTIONS):
        numbers[y + FARTHEST, x + FARTHEST] = k
    return numbers


NUMBERS = _numbers()

# Two neighbours side by side have at least this cosine of the angle between them.
ACUTE = 0.65


class Stars(NamedTuple):
    """The edges of node n are those from first[n] to first[n + 1], by their angle."""

    first: np.ndarray  # (n + 1,) int32
    directions: np.ndarray  # (edges,) uint8: which of DIRECTIONS
    costs: np.ndarray  # (edges,) float32


# Which edges


@inner_kernel
def product(h, a, b):
    """The product of two directions under the metric of a node, in nodes."""
    return (
        h.h11 * EAST[a] * EAST[b]
        + h.h12 * (EAST[a] * NORTH[b] + NORTH[a] * EAST[b])
        + h.h22 * NORTH[a] * NORTH[b]
    )


@inner_kernel
def is_wide(h, a, b):
    """Is the angle between two directions too wide?"""
    both = product(h, a, b)
    return not both > 0.0 or both * both < ACUTE * ACUTE * product(h, a, a) * product(h, b, b)


@inner_kernel
def metric_of_node(ground, i, j):
    """h at node (i, j), in nodes, by differences between the samples beside it."""
    per = 2 * ground.pieces
    rows, columns = ground.heights.shape[1], ground.heights.shape[2]
    i0, i1 = max(per * i - 1, 0), min(per * i + 1, columns - 1)
    j0, j1 = max(per * j - 1, 0), min(per * j + 1, rows - 1)
    dx, dy = per * ground.dx, per * ground.dy
    h11, h12, h22 = dx * dx, 0.0, dy * dy
    for layer in range(ground.heights.shape[0]):
        z = ground.heights[layer]
        fx = (z[per * j, i1] - z[per * j, i0]) * (per / (i1 - i0))
        fy = (z[j1, per * i] - z[j0, per * i]) * (per / (j1 - j0))
        h11, h12, h22 = h11 + fx * fx, h12 + fx * fy, h22 + fy * fy
    return Metric(h11, h12, h22)


@kernel
def directions_between(h, a, width):
    """The bits of the directions needed between a and a + width."""
    bits, k = 0, 0
    pieces = 1  # the k-th of so many equal parts is looked at
    while k < pieces:
        part = width // pieces
        begin = a + k * part
        if part > 1 and is_wide(h, begin, (begin + part) % (2 * HALF)):
            bits |= 1 << begin + part // 2
            k, pieces = 2 * k, 2 * pieces
            continue
        k += 1
        while k % 2 == 0 and pieces > 1:
            k, pieces = k // 2, pieces // 2
    return bits


@inner_kernel
def needed(h):
    """The bits of the directions in the first half of a node's star."""
    bits = BASE
    for a in range(0, HALF, EIGHTH):
        if is_wide(h, a, (a + EIGHTH) % (2 * HALF)):
            bits |= directions_between(h, a, EIGHTH)
    return bits


@inner_kernel
def is_inside(i, j, nx, ny):
    return 0 <= i < nx and 0 <= j < ny


@kernel
def choose_edges(ground, nx, ny, rows, ahead, back):
    """Choose the edges: bit k of ahead[n] leads from n along direction k, of back[n] against it.

    rows : the first, and the one after the last, of those whose stars are looked at.
    """
    for j in range(rows[0], rows[1]):
        for i in range(nx):
            n, bits = j * nx + i, needed(metric_of_node(ground, i, j))
            for k in range(0, HALF, EIGHTH if bits == BASE else 1):
                if not bits >> k & 1:
                    continue
                step = NORTH[k] * nx + EAST[k]
                if is_inside(i + EAST[k], j + NORTH[k], nx, ny):
                    ahead[n] |= 1 << k
                    back[n + step] |= 1 << k
                if is_inside(i - EAST[k], j - NORTH[k], nx, ny):
                    ahead[n - step] |= 1 << k
                    back[n] |= 1 << k


@kernel
def cut_edges(space, grid, rows, ahead, back):
    """Remove the edges from some rows that touch an obstacle."""
    for n in range(rows[0] * grid.nx, rows[1] * grid.nx):
        x, y = grid.x0 + n % grid.nx * grid.dx, grid.y0 + n // grid.nx * grid.dy
        for k in range(HALF):
            if not ahead[n] >> k & 1:
                continue
            ex, ey = EAST[k], NORTH[k]
            if not segment_is_free(space, x, y, x + ex * grid.dx, y + ey * grid.dy):
                ahead[n] ^= 1 << k
                back[n + ey * grid.nx + ex] ^= 1 << k


# What edges cost


@inner_kernel
def count_bits(bits):
    """How many of the 32 low bits are set."""
    bits = bits - (bits >> 1 & 0x55555555)
    bits = (bits & 0x33333333) + (bits >> 2 & 0x33333333)
    bits = bits + (bits >> 4) & 0x0F0F0F0F
    return bits * 0x01010101 >> 24 & 0xFF


@kernel
def count_edges(ahead, back, first):
    """first[n + 1] : how many edges the nodes up to n have."""
    for n in range(ahead.shape[0]):
        edges = count_bits(np.int64(ahead[n])) + count_bits(np.int64(back[n]))
        first[n + 1] = first[n] + edges


@inner_kernel
def edge_cost(ground, i, j, k):
    """The cost of the edge along direction k from node (i, j), rounded up to 32 bits."""
    per = 2 * ground.pieces
    ex, ey = EAST[k], NORTH[k]
    if 2 * ground.pieces * max(abs(ex), abs(ey)) <= ground.reach:
        cost = sampled_piece(ground, per * i, per * j, ground.pieces * ex, ground.pieces * ey)
    elif k % EIGHTH:
        cost = ray(ground, float(per * i), float(per * j), float(per * ex), float(per * ey))
    else:
        cost = 0.0
        for m in range(ground.pieces):
            cost += sampled_piece(ground, per * i + 2 * m * ex, per * j + 2 * m * ey, ex, ey)
    return np.float32(cost * (1.0 + 2.0**-23))


@kernel
def lay_edges(ground, nx, rows, ahead, back, stars):
    """Write the edges from some rows, with their costs."""
    for n in range(rows[0] * nx, rows[1] * nx):
        bits, place = np.int64(ahead[n]), np.int64(stars.first[n])
        for k in range(0, HALF, EIGHTH if bits & ~BASE == 0 else 1):
            if not bits >> k & 1:
                continue
            cost = edge_cost(ground, n % nx, n // nx, k)
            stars.directions[place], stars.costs[place] = k, cost
            place += 1
            m = n + NORTH[k] * nx + EAST[k]
            before = count_bits(np.int64(back[m]) & (1 << k) - 1)
            other = stars.first[m] + count_bits(np.int64(ahead[m])) + before
            stars.directions[other], stars.costs[other] = k + HALF, cost


# Reading stars


@inner_kernel
def entry_of(stars, n, direction):
    """Where node n's edge along a direction is listed, -1 where there is none."""
    for e in range(stars.first[n], stars.first[n + 1]):
        if stars.directions[e] == direction:
            return e
    return -1


@inner_kernel
def beside(stars, n, e, side):
    """The next edge of node n by angle, on one side (1 or -1); -1 where none is near enough."""
    first, last = np.int64(stars.first[n]), np.int64(stars.first[n + 1]) - 1
    other = e + side
    if other > last:
        other = first
    elif other < first:
        other = last
    turn = side * (np.int64(stars.directions[other]) - np.int64(stars.directions[e]))
    return other if 0 < turn % (2 * HALF) <= QUARTER else -1


@inner_kernel
def direction_of(x, y):
    """The number of the direction along (x, y), in nodes; -1 where there is none."""
    if max(abs(x), abs(y)) > FARTHEST:
        return -1
    return NUMBERS[y + FARTHEST, x + FARTHEST]
