"""Stencils: h^-1 as a sum of squares along lattice vectors, and the links between nodes.

Selling's algorithm writes h^-1 as a sum of three rank-one tensors along lattice vectors,
h^-1 = sum_k rho_k e_k e_k^T with rho_k >= 0, whatever the anisotropy (Selling 1874; Mirebeau
2014, FM-LBR; Mirebeau 2019, Riemannian fast-marching with Voronoi's first reduction). Nodes
are numbered j * nx + i. All lattice vectors are in nodes, and so is the metric that belongs to
them: h11 dx^2, h12 dx dy, h22 dy^2.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..dtypes import record
from ..surface.lengths import inverse
from ..surface.metric_rows import H11, H12, H22, fill_row
from ..surface.surfaces import Metric
from .selling import Superbase, obtuse_superbase, products

# Bits of a node's links: the neighbour on side 2 k + (0: +e_k, 1: -e_k) may be used; the node one
# vector farther may be used (shifted by SECOND); the node lies in the source's window.
SECOND = 6
ALL_SIDES = (1 << 6) - 1
ALL_LINKS = (1 << 12) - 1
WINDOW = 1 << 12

# The stencil of a node.
NODE = record(
    ("x0", np.int16),  # e_0 and e_1, in nodes; e_2 = -e_0 - e_1
    ("y0", np.int16),
    ("x1", np.int16),
    ("y1", np.int16),
    ("rho0", np.float32),
    ("rho1", np.float32),
    ("rho2", np.float32),
    ("links", np.uint16),
    ("around", np.uint16),  # bit k: the k-th node around may be reached along an edge
    ("after", np.int32),  # the next node in the list of the same bucket, -1 where none
    ("before", np.int32),  # the node before it in that list; at the head, -2 - bucket
)


# A stencil with missing links may not reach far enough. Then the node can also be reached along the
# edges to the eight nodes around it; a node that is read along an edge is on side EDGE.
EDGE = 6
AROUND = 8


# Making stencils


class Vector(NamedTuple):
    """A lattice vector."""

    x: np.int64
    y: np.int64


@inner_kernel
def is_inside(grid, i, j):
    return 0 <= i < grid.nx and 0 <= j < grid.ny


@inner_kernel
def side_links(grid, i, j, ex, ey, side):
    """The bits of a direction for its neighbours inside the lattice."""
    links = 0
    if is_inside(grid, i + ex, j + ey):
        links |= 1 << side
    if is_inside(grid, i - ex, j - ey):
        links |= 2 << side
    if is_inside(grid, i + 2 * ex, j + 2 * ey):
        links |= 1 << side + SECOND
    if is_inside(grid, i - 2 * ex, j - 2 * ey):
        links |= 2 << side + SECOND
    return links


@inner_kernel
def links_inside(grid, i, j, x0, y0, x1, y1):
    """The bits of all neighbours inside the lattice."""
    x2, y2 = -x0 - x1, -y0 - y1
    reach_x = 2 * max(abs(x0), abs(x1), abs(x2))
    reach_y = 2 * max(abs(y0), abs(y1), abs(y2))
    if reach_x <= i < grid.nx - reach_x and reach_y <= j < grid.ny - reach_y:
        return ALL_LINKS
    links = side_links(grid, i, j, x0, y0, 0) | side_links(grid, i, j, x1, y1, 2)
    return links | side_links(grid, i, j, x2, y2, 4)


@inner_kernel
def around(k):
    """The vector to the k-th of the eight nodes around a node; the opposite one is 7 - k."""
    place = k if k < 4 else k + 1
    return Vector(place % 3 - 1, place // 3 - 1)


@inner_kernel
def around_inside(grid, i, j):
    """The bits of the nodes around (i, j) that are inside the lattice."""
    bits = 0
    for k in range(AROUND):
        e = around(k)
        if is_inside(grid, i + e.x, j + e.y):
            bits |= 1 << k
    return bits


@inner_kernel
def is_cut_off(links, x0, y0, x1, y1):
    """Do the bounds cut off a neighbour that is not one of the nodes around?"""
    x2, y2 = -x0 - x1, -y0 - y1
    return (
        (links & 3 != 3 and max(abs(x0), abs(y0)) > 1)
        or (links & 12 != 12 and max(abs(x1), abs(y1)) > 1)
        or (links & 48 != 48 and max(abs(x2), abs(y2)) > 1)
    )


# The bits of direction 0; those of direction k are shifted by 2 k.
DIRECTION = 3 | 3 << SECOND


@inner_kernel
def lay_stencil(grid, i, j, h, b, nodes):
    """Write the stencil of node (i, j), where h is the metric in units of nodes.

    b : the superbase to start from. Returns the superbase that was found.
    """
    d = inverse(h)
    b = obtuse_superbase(d, b)
    p = products(d, b)
    # e_k is b_k turned by a right angle. A vector too long for 16 bits leads off the lattice.
    x0, y0, x1, y1 = int(-b.y0), int(b.x0), int(-b.y1), int(b.x1)
    links = links_inside(grid, i, j, x0, y0, x1, y1)
    node = nodes[j * grid.nx + i]
    if links != ALL_LINKS and is_cut_off(links, x0, y0, x1, y1):
        node.around = around_inside(grid, i, j)
    node.x0, node.y0, node.x1, node.y1 = x0, y0, x1, y1
    node.rho0, node.rho1, node.rho2 = max(-p.p12, 0.0), max(-p.p20, 0.0), max(-p.p01, 0.0)
    if not min(node.rho0, node.rho1, node.rho2) > 0.0:
        links &= ~(DIRECTION if node.rho0 == 0.0 else 0)
        links &= ~(DIRECTION << 2 if node.rho1 == 0.0 else 0)
        links &= ~(DIRECTION << 4 if node.rho2 == 0.0 else 0)
    node.links = links
    return b


@inner_kernel
def per_node(h11, h12, h22, grid):
    """The metric h in units of nodes."""
    return Metric(h11 * grid.dx * grid.dx, h12 * grid.dx * grid.dy, h22 * grid.dy * grid.dy)


@kernel
def lay_surface_stencils(surface, grid, columns, row, nodes):
    """Write the stencils of a surface's metric at all nodes of a lattice.

    columns : of ``columns_of``; row : workspace of ``fill_row``.
    """
    b = Superbase(1.0, 0.0, 0.0, 1.0)
    for j in range(grid.ny):
        fill_row(surface, grid, j, columns, row)
        for i in range(grid.nx):
            b = lay_stencil(
                grid, i, j, per_node(row[H11, i], row[H12, i], row[H22, i], grid), b, nodes
            )


@kernel
def lay_tensor_stencils(tensors, grid, nodes):
    """Write the stencils of a metric given at all nodes: tensors (ny, nx, 3), h11, h12, h22."""
    b = Superbase(1.0, 0.0, 0.0, 1.0)
    for j in range(grid.ny):
        for i in range(grid.nx):
            t = tensors[j, i]
            b = lay_stencil(grid, i, j, per_node(t[0], t[1], t[2], grid), b, nodes)


# Reading stencils


class Steps(NamedTuple):
    """e_0, e_1 and e_2 as differences of node numbers."""

    s0: int
    s1: int
    s2: int


@inner_kernel
def steps_of(node, nx):
    s0 = node.y0 * nx + node.x0
    s1 = node.y1 * nx + node.x1
    return Steps(s0, s1, -s0 - s1)


@inner_kernel
def vector_of(node, side):
    """The lattice vector to the neighbour on a side."""
    x, y = np.int64(node.x0), np.int64(node.y0)
    if side >= 4:
        x, y = -x - node.x1, -y - node.y1
    elif side >= 2:
        x, y = np.int64(node.x1), np.int64(node.y1)
    return Vector(-x, -y) if side & 1 else Vector(x, y)


@inner_kernel
def rho_of(node, side):
    """The weight of a side's direction."""
    if side >= 4:
        return np.float64(node.rho2)
    return np.float64(node.rho1) if side >= 2 else np.float64(node.rho0)


@kernel
def block_nodes(grid, blocked, nodes):
    """Remove all links to blocked nodes. blocked : (ny nx,) uint8."""
    for n in range(nodes.shape[0]):
        node = nodes[n]
        links = np.int64(node.links)
        for side in range(6):
            if links >> side & 1:
                vector = vector_of(node, side)
                step = vector.y * grid.nx + vector.x
                if blocked[n] or blocked[n + step]:
                    links &= ~(1 << side | 1 << side + SECOND)
                elif links >> side + SECOND & 1 and blocked[n + 2 * step]:
                    links &= ~(1 << side + SECOND)
        node.links = links
        edges = np.int64(node.around)
        for k in range(AROUND):
            e = around(k)
            if edges >> k & 1 and (blocked[n] or blocked[n + e.y * grid.nx + e.x]):
                edges &= ~(1 << k)
        node.around = edges


@inner_kernel
def length_at(node, e):
    """Length of a lattice vector e under the metric of a node.

    The vectors of a superbase span unit area, so det h^-1 = rho_0 rho_1 + rho_1 rho_2 + ...
    and h(e, e) = sum_k rho_k (e_k x e)^2 / det h^-1.
    """
    r0, r1, r2 = np.float64(node.rho0), np.float64(node.rho1), np.float64(node.rho2)
    c0 = np.float64(node.x0 * e.y - node.y0 * e.x)
    c1 = np.float64(node.x1 * e.y - node.y1 * e.x)
    c2 = -c0 - c1
    return math.sqrt((r0 * c0 * c0 + r1 * c1 * c1 + r2 * c2 * c2) / (r0 * r1 + r1 * r2 + r2 * r0))


@inner_kernel
def edge_length(nodes, n, e, m):
    """Length of the edge e from node n to m: the mean of its lengths under the metrics of both."""
    return 0.5 * (length_at(nodes[n], e) + length_at(nodes[m], e))
