"""What the edges of stars cost: of four at once, wherever these may be."""

import numpy as np

from ..bits import lowest_bit
from ..compiler import inner_kernel, kernel
from ..dtypes import record
from ..surface.cells import any_cells
from .ground import sampled_piece, seen_from, zero
from .ray import ray
from .star import BASE, EAST, EIGHTH, HALF, NORTH, place_of_other

# A node that waits, and the number of the sample at it.
WAITING = record(("n", np.int64), ("at", np.int64))


@inner_kernel
def edge_cost(ground, i, j, k):
    """The cost of the edge along direction k from node (i, j), or of those from four nodes."""
    per = 2 * ground.pieces
    ex, ey = EAST[k], NORTH[k]
    if per * max(abs(ex), abs(ey)) <= ground.reach:
        return sampled_piece(ground, per * i, per * j, ground.pieces * ex, ground.pieces * ey)
    if k % EIGHTH:
        return ray(ground, float(per * i), float(per * j), float(per * ex), float(per * ey))
    cost = zero(ground)
    for m in range(ground.pieces):
        cost = cost + sampled_piece(ground, per * i + 2 * m * ex, per * j + 2 * m * ey, ex, ey)
    return cost


@inner_kernel
def rounded_up(cost):
    """A cost in 32 bits, that is no less."""
    return np.float32(cost * (1.0 + 2.0**-23))


@inner_kernel
def write_cost(stars, n, k, cost):
    """Write the cost of the edge from node n along direction k, rounded up to 32 bits."""
    rounded = rounded_up(cost)
    if k % EIGHTH == 0:
        stars.base[n, k // EIGHTH] = rounded
    else:
        stars.others[place_of_other(stars, n, k)] = rounded


@kernel
def write_single(ground, nx, n, k, stars):
    write_cost(stars, n, k, edge_cost(ground, n % nx, n // nx, k))


@inner_kernel
def write_four(ground, i, j, n, at, three, k, stars):
    """Write the costs of the edges along direction k from node n, (i, j), and from three more.

    at : the number of the sample at node n.
    """
    a, b, c = three[0], three[1], three[2]
    fours = seen_from(ground, a.at - at, b.at - at, c.at - at)
    costs = edge_cost(fours, i, j, k)
    write_cost(stars, n, k, costs[0])
    write_cost(stars, a.n, k, costs[1])
    write_cost(stars, b.n, k, costs[2])
    write_cost(stars, c.n, k, costs[3])


@inner_kernel
def lay_base(ground, nx, i, j, stars):
    """Write the costs of the edges of BASE from four nodes side by side, (i, j) the first.

    All four must have these edges, and be at least two nodes away from the border.
    """
    per, n = 2 * ground.pieces, j * nx + i
    fours = seen_from(ground, per, 2 * per, 3 * per)
    for k in range(4):
        ex, ey = ground.pieces * EAST[EIGHTH * k], ground.pieces * NORTH[EIGHTH * k]
        costs = sampled_piece(fours, per * i, per * j, ex, ey)
        for m in range(4):
            stars.base[n + m, k] = rounded_up(costs[m])


@inner_kernel
def have_base(stars, n):
    """Do four nodes side by side, n the first, all have the edges of BASE?"""
    a = stars.ahead
    return a[n] & a[n + 1] & a[n + 2] & a[n + 3] & BASE == BASE


@inner_kernel
def lay_single_or_wait(ground, nx, ny, i, j, bits, stars, waiting, counts):
    """Write the costs of the edges from node (i, j) along directions, or let them wait."""
    n, at = j * nx + i, 2 * ground.pieces * (j * ground.heights.shape[2] + i)
    single = any_cells(ground.cells)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        count, far = counts[k], max(abs(EAST[k]), abs(NORTH[k])) + 1
        if single or not (far <= i < nx - far and far <= j < ny - far):
            write_single(ground, nx, n, k, stars)
        elif count == 3:
            write_four(ground, i, j, n, at, waiting[k], k, stars)
            counts[k] = 0
        else:
            waiting[k, count].n, waiting[k, count].at = n, at
            counts[k] = count + 1


@kernel
def lay_edges(ground, nx, ny, rows, stars, waiting, counts):
    """Write the costs of the edges ahead from some rows.

    waiting : (HALF, 3) of WAITING; nodes that have an edge along a direction wait there for a
    fourth one. counts : (HALF,) int64, zeros; how many wait.
    Near the border, where edges look at what is beyond, and with costs that are constant in cells,
    each edge is by itself.
    """
    each = any_cells(ground.cells) or 2 * ground.pieces > ground.reach
    for j in range(rows[0], rows[1]):
        for i in range(0, nx, 4):
            n, rest = j * nx + i, -1
            inside = 2 <= i < nx - 5 and 2 <= j < ny - 2
            if inside and not each and have_base(stars, n):
                lay_base(ground, nx, i, j, stars)
                rest = ~BASE
            for m in range(min(4, nx - i)):
                bits = np.int64(stars.ahead[n + m]) & rest
                lay_single_or_wait(ground, nx, ny, i + m, j, bits, stars, waiting, counts)
    for k in range(HALF):
        for m in range(counts[k]):
            write_single(ground, nx, waiting[k, m].n, k, stars)
