"""Parts of a multigrid cycle for weighted graph Laplacians on a lattice.

A level has nodes (ny, nx) with links to their eight neighbours. Its operator is, at a node, the sum
of link times difference over these. Every second node along both axes belongs to the next coarser
level. The others are interpolated from these as their links say (Dendy 1982), so that a wall of
weak links stays a wall. The links of the coarser level are those of the interpolated function's
energy.

All arrays have a margin of one node, whose links are 0.
"""

from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel

# The links that a node holds: to its neighbours in the north-west, north, north-east and east.
NORTH_WEST, NORTH, NORTH_EAST, EAST = range(4)


class Level(NamedTuple):
    """One level; u and b are the unknown and the right side of its equation."""

    links: np.ndarray  # (ny + 2, nx + 2, 4)
    per_sum: np.ndarray  # (ny + 2, nx + 2): 1 over the sum of a node's links, 0 where there is none
    shares: np.ndarray  # (ny + 2, nx + 2, 2, 2): of the coarser nodes from (j // 2, i // 2) on
    u: np.ndarray  # (ny + 2, nx + 2)
    b: np.ndarray  # (ny + 2, nx + 2)


@inner_kernel
def link(links, j, i, down, east):
    """The link of a node to a neighbour, by its offset in rows and columns."""
    if down == 0:
        return links[j, i + min(east, 0), EAST]
    if down < 0:
        return links[j - 1, i + east, NORTH - east]
    return links[j, i, NORTH + east]


@inner_kernel
def pull(links, u, j, i):
    """The sum of link times value over the neighbours of a node."""
    total = links[j, i, EAST] * u[j, i + 1] + links[j, i - 1, EAST] * u[j, i - 1]
    for east in range(-1, 2):
        total += links[j, i, NORTH + east] * u[j + 1, i + east]
        total += links[j - 1, i + east, NORTH - east] * u[j - 1, i + east]
    return total


@kernel
def fill_links(weights, east, north, links):
    """The links of the energy of slopes, from the weights of cells (ny - 1, nx - 1).

    Each half of a cell has one slope along each axis. east, north : the factors of their squares.
    """
    links[:] = 0.0
    for j in range(weights.shape[0]):
        for i in range(weights.shape[1]):
            for m in range(2):
                links[j + 1 + m, i + 1, EAST] += weights[j, i] * east
                links[j + 1, i + 1 + m, NORTH] += weights[j, i] * north


@kernel
def fill_sums(links, per_sum):
    """One over the sum of the links of each node; 0 where that is 0."""
    per_sum[:] = 0.0
    for j in range(1, links.shape[0] - 1):
        for i in range(1, links.shape[1] - 1):
            total = 0.0
            for down in range(-1, 2):
                for east in range(-1, 2):
                    if down != 0 or east != 0:
                        total += link(links, j, i, down, east)
            per_sum[j, i] = 1.0 / total if total > 0.0 else 0.0


@inner_kernel
def add_share(links, shares, j, i, down, east):
    """Add to the shares of a node what its link to one neighbour says; returns how much.

    The neighbour's shares are known if it lies between fewer coarser nodes than this one. Links
    below 0, which coarser levels can have, do not count.
    """
    between_y, between_x = (j - 1) % 2, (i - 1) % 2
    weight = max(link(links, j, i, down, east), 0.0)
    q, p = between_y * max(down, 0), between_x * max(east, 0)
    if between_x and between_y and down == 0:  # between two nodes of its own column
        shares[j, i, 0, p] += weight * shares[j, i + east, 0, 0]
        shares[j, i, 1, p] += weight * shares[j, i + east, 1, 0]
    elif between_x and between_y and east == 0:
        shares[j, i, q, 0] += weight * shares[j + down, i, 0, 0]
        shares[j, i, q, 1] += weight * shares[j + down, i, 0, 1]
    else:
        shares[j, i, q, p] += weight
    return weight


@kernel
def fill_share(links, shares, j, i):
    """The shares of one node that is no coarser one."""
    between_y, between_x = (j - 1) % 2, (i - 1) % 2
    total = 0.0
    for down in range(-1, 2):
        for east in range(-1, 2):
            beside = (between_x and east != 0) or (between_y and down != 0)
            # Between two nodes, those of its own line across count for neither.
            if beside and (between_x or down != 0) and (between_y or east != 0):
                total += add_share(links, shares, j, i, down, east)
    for q in range(2):
        for p in range(2):
            shares[j, i, q, p] *= 1.0 / total if total > 0.0 else 0.0
    if not total > 0.0:
        shares[j, i, 0, 0] = 1.0


@kernel
def fill_shares(links, shares):
    """How the nodes are interpolated from the coarser ones: those between two first, then four."""
    shares[:] = 0.0
    for between in range(3):
        for j in range(1, links.shape[0] - 1):
            for i in range(1, links.shape[1] - 1):
                if (j - 1) % 2 + (i - 1) % 2 != between:
                    continue
                if between == 0:
                    shares[j, i, 0, 0] = 1.0
                else:
                    fill_share(links, shares, j, i)


@inner_kernel
def coarser(k):
    """The coarser node at or before a node, both counted with the margin."""
    return (k - 1) // 2 + 1


@kernel
def add_energy(shares, j, i, down, east, weight, factors, links):
    """Add the energy of one link to the links of the coarser level.

    The difference along it is that of four coarser values, with factors that add up to 0. Such a
    sum's square is the sum of -(product of two factors) times (difference of their values) squared.
    factors (2, 2) is workspace.
    """
    row, column = min(coarser(j), coarser(j + down)), min(coarser(i), coarser(i + east))
    factors[:] = 0.0
    for q in range(2):
        for p in range(2):
            # A share beyond the four nodes is 0.
            y, x = coarser(j) - row + q, coarser(i) - column + p
            if y < 2 and x < 2:
                factors[y, x] += shares[j, i, q, p]
            y, x = coarser(j + down) - row + q, coarser(i + east) - column + p
            if y < 2 and x < 2:
                factors[y, x] -= shares[j + down, i + east, q, p]
    for m in range(2):
        links[row + m, column, EAST] -= weight * factors[m, 0] * factors[m, 1]
        links[row, column + m, NORTH] -= weight * factors[0, m] * factors[1, m]
    links[row, column, NORTH_EAST] -= weight * factors[0, 0] * factors[1, 1]
    links[row, column + 1, NORTH_WEST] -= weight * factors[0, 1] * factors[1, 0]


@kernel
def fill_coarser_links(fine, shares, factors, links):
    """The links of the coarser level; factors (2, 2) is workspace."""
    links[:] = 0.0
    for j in range(1, fine.shape[0] - 1):
        for i in range(1, fine.shape[1] - 1):
            if fine[j, i, EAST] != 0.0:
                add_energy(shares, j, i, 0, 1, fine[j, i, EAST], factors, links)
            for east in range(-1, 2):
                weight = fine[j, i, NORTH + east]
                if weight != 0.0:
                    add_energy(shares, j, i, 1, east, weight, factors, links)


@kernel
def relax_forward(level):
    """Gauss-Seidel from the first node to the last, from u = 0."""
    u = level.u
    u[:] = 0.0
    for j in range(1, u.shape[0] - 1):
        for i in range(1, u.shape[1] - 1):
            u[j, i] = (level.b[j, i] + pull(level.links, u, j, i)) * level.per_sum[j, i]


@kernel
def relax_backward(level):
    """Gauss-Seidel from the last node to the first."""
    u = level.u
    for j in range(u.shape[0] - 2, 0, -1):
        for i in range(u.shape[1] - 2, 0, -1):
            u[j, i] = (level.b[j, i] + pull(level.links, u, j, i)) * level.per_sum[j, i]


@kernel
def restrict(level, b):
    """What is left of a level's right side, gathered at the coarser nodes."""
    b[:] = 0.0
    for j in range(1, level.u.shape[0] - 1):
        for i in range(1, level.u.shape[1] - 1):
            if level.per_sum[j, i] == 0.0:
                continue
            left = level.b[j, i] + pull(level.links, level.u, j, i)
            left -= level.u[j, i] / level.per_sum[j, i]
            for q in range(2):
                for p in range(2):
                    b[coarser(j) + q, coarser(i) + p] += level.shares[j, i, q, p] * left


@kernel
def prolong(level, change):
    """Add the coarser level's answer, interpolated."""
    for j in range(1, level.u.shape[0] - 1):
        for i in range(1, level.u.shape[1] - 1):
            for q in range(2):
                for p in range(2):
                    share = level.shares[j, i, q, p]
                    level.u[j, i] += share * change[coarser(j) + q, coarser(i) + p]
