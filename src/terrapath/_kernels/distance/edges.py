"""What the edges of stars cost: of four at once, wherever these may be."""

import numpy as np

from ..bits import lowest_bit
from ..compiler import inner_kernel, kernel
from ..dtypes import record
from ..surface.cells import any_cells
from .ground import sampled_piece, seen_from, zero
from .ray import ray
from .star import EAST, EIGHTH, HALF, NORTH, place_of_other

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
def write_cost(stars, n, k, cost):
    """Write the cost of the edge from node n along direction k, rounded up to 32 bits."""
    rounded = np.float32(cost * (1.0 + 2.0**-23))
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


@kernel
def lay_edges(ground, nx, ny, rows, stars, waiting, counts):
    """Write the costs of the edges ahead from some rows.

    waiting : (HALF, 3) of WAITING; nodes that have an edge along a direction wait there for a
    fourth one. counts : (HALF,) int64, zeros; how many wait.
    Near the border, where edges look at what is beyond, and with costs that are constant in cells,
    each edge is by itself.
    """
    single = any_cells(ground.cells)
    per, columns = 2 * ground.pieces, ground.heights.shape[2]
    for j in range(rows[0], rows[1]):
        for i in range(nx):
            n, at = j * nx + i, per * (j * columns + i)
            bits = np.int64(stars.ahead[n])
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
    for k in range(HALF):
        for m in range(counts[k]):
            write_single(ground, nx, waiting[k, m].n, k, stars)
