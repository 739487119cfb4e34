"""The stars of a lattice: which nodes an edge leads to from each node, and what it costs.

A star has the eight neighbours of a node. Where the angle between two of them, as the lifted ground
has it, is wide, the direction between them in the Stern-Brocot tree joins them, and so on
(Mirebeau 2014, "Efficient fast marching with Finsler metrics"): a value then follows from values
that are less. An edge leads both ways and is in the stars of both nodes.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..bits import count_bits, lowest_bit, steps_after, steps_before
from ..compiler import inner_kernel, kernel
from ..space.free_space import segment_is_free
from ..surface.surfaces import Metric
from ..vec4 import any_above, larger
from .ground import sample, seen_from, zero


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
X, Y = EAST.astype(np.float64), NORTH.astype(np.float64)
FARTHEST = 5
BASE = sum(1 << k for k in range(0, HALF, EIGHTH))
WIDE = 1 << HALF


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
    """The edges between nodes. Bit k of ahead[n] is set where one leads from node n along
    direction k; then bit k of back[m] is set, m being the node that it leads to.

    The directions of BASE have their costs in ``base``, the others of a node in ``others``, from
    first[n] on and by their direction.
    """

    ahead: np.ndarray  # (n,) uint32
    back: np.ndarray  # (n,) uint32
    base: np.ndarray  # (n, 4) float32
    first: np.ndarray  # (n,) int32
    others: np.ndarray  # (edges,) float32
    wide: np.ndarray  # (n,) uint8: are angles left that are too wide?


# Which edges


@inner_kernel
def product(h, a, b):
    """The product of two directions under the metric of a node, in nodes."""
    return h.h11 * (X[a] * X[b]) + h.h12 * (X[a] * Y[b] + Y[a] * X[b]) + h.h22 * (Y[a] * Y[b])


@inner_kernel
def width_above(h, a, b):
    """Above 0 where the angle between two directions is too wide for a metric."""
    both = larger(product(h, a, b), 0.0)
    return ACUTE * ACUTE * product(h, a, a) * product(h, b, b) - both * both


@inner_kernel
def metric_of_node(ground, i, j):
    """h at node (i, j), in nodes, by differences between the samples beside it."""
    per = 2 * ground.pieces
    rows, columns = ground.heights.shape[1], ground.heights.shape[2]
    i0, i1 = max(per * i - 1, 0), min(per * i + 1, columns - 1)
    j0, j1 = max(per * j - 1, 0), min(per * j + 1, rows - 1)
    dx, dy, z = per * ground.dx, per * ground.dy, ground.heights
    h11, h12, h22 = dx * dx + zero(ground), zero(ground), dy * dy + zero(ground)
    for layer in range(z.shape[0]):
        fx = sample(ground, z, layer, per * j, i1) - sample(ground, z, layer, per * j, i0)
        fy = sample(ground, z, layer, j1, per * i) - sample(ground, z, layer, j0, per * i)
        fx, fy = fx * (per / (i1 - i0)), fy * (per / (j1 - j0))
        h11, h12, h22 = h11 + fx * fx, h12 + fx * fy, h22 + fy * fy
    return Metric(h11, h12, h22)


@kernel
def directions_between(h, a, width):
    """The bits of the directions needed between a and a + width, between which the angle is too
    wide; and WIDE, where these are not enough.
    """
    bits = 1 << a + width // 2
    k, pieces = 0, 2  # the k-th of so many equal parts is looked at
    while k < pieces:
        part = width // pieces
        begin = a + k * part
        if width_above(h, begin, (begin + part) % (2 * HALF)) > 0.0:
            if part > 1:
                bits |= 1 << begin + part // 2
                k, pieces = 2 * k, 2 * pieces
                continue
            bits |= WIDE
        k += 1
        while k % 2 == 0 and pieces > 1:
            k, pieces = k // 2, pieces // 2
    return bits


@inner_kernel
def is_inside(i, j, nx, ny):
    return 0 <= i < nx and 0 <= j < ny


@inner_kernel
def add_edges(nx, ny, i, j, bits, ahead, back):
    """Add the edges from node (i, j) along directions, and against them."""
    n = j * nx + i
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        step = NORTH[k] * nx + EAST[k]
        if is_inside(i + EAST[k], j + NORTH[k], nx, ny):
            ahead[n] |= 1 << k
            back[n + step] |= 1 << k
        if is_inside(i - EAST[k], j - NORTH[k], nx, ny):
            ahead[n - step] |= 1 << k
            back[n] |= 1 << k


@inner_kernel
def add_between(h, nx, ny, i, j, a, ahead, back, wide):
    """Add the edges of node (i, j) between direction a and the next of BASE."""
    bits = directions_between(h, a, EIGHTH)
    if bits & WIDE:
        wide[j * nx + i] = 1
    add_edges(nx, ny, i, j, bits & ~WIDE, ahead, back)


@inner_kernel
def choose_for_one(ground, nx, ny, i, j, ahead, back, wide):
    """Choose the edges that the star of node (i, j) needs beside those of BASE."""
    h = metric_of_node(ground, i, j)
    for a in range(0, HALF, EIGHTH):
        if width_above(h, a, a + EIGHTH) > 0.0:
            add_between(h, nx, ny, i, j, a, ahead, back, wide)


@inner_kernel
def choose_for_four(fours, nx, ny, i, j, ahead, back, wide):
    """Choose the edges of four nodes side by side, (i, j) the first."""
    h = metric_of_node(fours, i, j)
    for a in range(0, HALF, EIGHTH):
        above = width_above(h, a, a + EIGHTH)
        if any_above(above, 0.0):
            for m in range(4):
                if above[m] > 0.0:
                    one = Metric(h.h11[m], h.h12[m], h.h22[m])
                    add_between(one, nx, ny, i + m, j, a, ahead, back, wide)


@kernel
def choose_edges(ground, nx, ny, rows, ahead, back, wide):
    """Choose the edges that the stars of some rows need; see Stars for ahead and back.

    rows : the first, and the one after the last.
    """
    per = 2 * ground.pieces
    fours = seen_from(ground, per, 2 * per, 3 * per)
    for j in range(rows[0], rows[1]):
        for i in range(0, nx, 4):
            if i > 0 and i + 4 < nx and 0 < j < ny - 1:
                choose_for_four(fours, nx, ny, i, j, ahead, back, wide)
                continue
            for k in range(i, min(i + 4, nx)):
                choose_for_one(ground, nx, ny, k, j, ahead, back, wide)


def base_edges(nx: int, ny: int) -> tuple[np.ndarray, np.ndarray]:
    """The edges to the eight neighbours: ahead and back of Stars, both (n,)."""
    ahead, back = np.full((ny, nx), BASE, np.uint32), np.full((ny, nx), BASE, np.uint32)
    for k in range(0, HALF, EIGHTH):
        east, bit = EAST[k], np.uint32(1 << k)
        if NORTH[k]:
            ahead[-1] &= ~bit
            back[0] &= ~bit
        if east:
            ahead[:, -1 if east > 0 else 0] &= ~bit
            back[:, 0 if east > 0 else -1] &= ~bit
    return ahead.ravel(), back.ravel()


@kernel
def cut_edges(space, grid, rows, ahead, back):
    """Remove the edges from some rows that touch an obstacle."""
    for n in range(rows[0] * grid.nx, rows[1] * grid.nx):
        x, y = grid.x0 + n % grid.nx * grid.dx, grid.y0 + n // grid.nx * grid.dy
        bits = np.int64(ahead[n])
        while bits != 0:
            k = lowest_bit(bits)
            bits &= bits - 1
            ex, ey = EAST[k], NORTH[k]
            if not segment_is_free(space, x, y, x + ex * grid.dx, y + ey * grid.dy):
                ahead[n] ^= 1 << k
                back[n + ey * grid.nx + ex] ^= 1 << k


@kernel
def count_others(ahead, first):
    """first[n] : how many edges that are not of BASE lead ahead from the nodes before; returns
    how many there are in all.
    """
    edges = 0
    for n in range(ahead.shape[0]):
        first[n] = edges
        edges += count_bits(np.int64(ahead[n]) & ~BASE)
    return edges


def list_edges(stars: Stars) -> tuple[np.ndarray, ...]:
    """The edges ahead: from which node, along which direction, and what they cost, (edges,)."""
    lists = []
    for k in range(HALF):
        tails = np.flatnonzero(stars.ahead >> k & 1)
        if k % EIGHTH == 0:
            costs = stars.base[tails, k // EIGHTH]
        else:
            before = np.bitwise_count(stars.ahead[tails] & np.uint32(~BASE & (1 << k) - 1))
            costs = stars.others[stars.first[tails] + before]
        lists.append((tails, np.full(len(tails), k), costs))
    return tuple(np.concatenate(columns) for columns in zip(*lists, strict=True))


# Reading stars


@inner_kernel
def index(n):
    """A number as an index that Numba knows is not counted from the end, which saves time."""
    return np.uint64(n)


@inner_kernel
def bits_ahead(stars, n):
    """The directions of the edges ahead from a node."""
    return np.int64(stars.ahead[index(n)])


@inner_kernel
def bits_back(stars, n):
    """The directions, read the other way, of the edges that lead to a node."""
    return np.int64(stars.back[index(n)])


@inner_kernel
def bits_of(stars, n):
    """The directions of all edges of a node, both ways."""
    return bits_ahead(stars, n) | bits_back(stars, n) << HALF


@inner_kernel
def place_of_other(stars, n, k):
    """Where the cost of an edge ahead is listed that has another direction than those of BASE."""
    return stars.first[index(n)] + count_bits(bits_ahead(stars, n) & ~BASE & (1 << k) - 1)


@inner_kernel
def base_cost(stars, n, k):
    """The cost of an edge ahead along a direction of BASE."""
    return np.float64(stars.base[index(n), index(k // EIGHTH)])


@inner_kernel
def other_cost(stars, n, k):
    """The cost of an edge ahead along another direction."""
    return np.float64(stars.others[index(place_of_other(stars, n, k))])


@inner_kernel
def cost_along(stars, steps, n, k):
    """The cost of an edge along any direction. steps : directions as differences of numbers."""
    if k >= HALF:
        n, k = n + steps[index(k)], k - HALF
    return base_cost(stars, n, k) if k % EIGHTH == 0 else other_cost(stars, n, k)


@inner_kernel
def beside(bits, k, side):
    """The next direction by angle, on one side (1 or -1) of k; -1 where none is near enough."""
    steps = steps_after(bits, k) if side > 0 else steps_before(bits, k)
    return (k + side * steps) % (2 * HALF) if steps <= QUARTER else -1


@inner_kernel
def direction_of(x, y):
    """The number of the direction along (x, y), in nodes; -1 where there is none."""
    if max(abs(x), abs(y)) > FARTHEST:
        return -1
    return NUMBERS[y + FARTHEST, x + FARTHEST]
