"""Four nodes side by side, and what is read of them and of their edges.

What is read of the nodes, one after the other, is put into the rows of a table with four columns;
the arithmetic that follows is four times the same.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel
from ..dtypes import record
from ..vec4 import four, larger, sqrt, where_above
from .bellman import height_at, is_clear, row_of, sample_at, sample_toward, toward, value_at
from .segments import End, Segment
from .star import X, Y, beside, bits_of, cost_along

# A node, the number of the sample at it, its column and row, and how far these are from the source,
# in nodes. The directions of the edge that offers least, and of the next edges on both sides and on
# the side that is chosen.
MEMBER = record(
    ("n", np.int64),
    ("at", np.int64),
    ("i", np.int64),
    ("j", np.int64),
    ("x", np.float64),
    ("y", np.float64),
    ("a", np.int64),
    ("right", np.int64),
    ("left", np.int64),
    ("b", np.int64),
)


class Quartet(NamedTuple):
    """Four nodes, and what is read of them."""

    nodes: np.ndarray  # (4,) of MEMBER
    table: np.ndarray  # (1, ROWS, 4) float64


# Rows of the table. Of edges, as of End but with costs that are not per chord:
AA, SS, COST, TAU, U = range(5)
# Of the segments on the right and on the left, from these rows on, as of Segment:
RIGHT, LEFT = 5, 12
EXISTS, AE, EE, SE, SIDE_COST, SIDE_TAU, SIDE_U = range(7)
SIDE_ROWS = 7
# Of triangles: samples at a, b and the node, half along both edges and between these.
AT_A, AT_B, AT_NODE, HALF_A, HALF_B, BETWEEN = range(19, 25)
WAY_X, WAY_Y, ACROSS_X, ACROSS_Y, FROM_X, FROM_Y = range(25, 31)
BEND, ARRIVAL, CHORD = range(31, 34)
ROWS = 34


def make_quartet() -> Quartet:
    """Quartet that no node is in."""
    table = np.ones((1, ROWS, 4))
    table[0, ACROSS_X] = -1.0  # what is across a way must not lie along it
    return Quartet(np.zeros(4, MEMBER), table)


@inner_kernel
def row(table, k):
    return four(table[0, k, 0], table[0, k, 1], table[0, k, 2], table[0, k, 3])


@inner_kernel
def fill_row(table, k, values):
    """Write a row."""
    for m in range(4):
        table[0, k, m] = values[m]


# Reading a node


@inner_kernel
def place_node(medium, source, node, n, a):
    """Fill a member with node n and the direction of its edge."""
    j = row_of(medium, n)
    node.n, node.i, node.j = n, n - j * medium.grid.nx, j
    node.x, node.y, node.a = node.i - source.x, node.j - source.y, a
    node.at = sample_at(medium, node.i, j)


@inner_kernel
def read_edge(medium, state, source, quartet, m):
    """Fill column m with a node's edge."""
    node, t = quartet.nodes[m], quartet.table
    n, k = node.n, node.a
    x, y, a = X[k] * medium.grid.dx, Y[k] * medium.grid.dy, toward(medium, n, k)
    sx, sy = (node.x + X[k]) * medium.grid.dx, (node.y + Y[k]) * medium.grid.dy
    aa, ss = x * x + y * y, sx * sx + sy * sy
    for layer in range(source.lift.shape[0]):
        z = height_at(medium, layer, sample_toward(medium, node.at, k))
        rise, height = z - height_at(medium, layer, node.at), z - source.lift[layer]
        aa, ss = aa + rise * rise, ss + height * height
    t[0, AA, m], t[0, SS, m] = aa, ss
    t[0, TAU, m], t[0, U, m] = value_at(state, a).tau, value_at(state, a).u
    t[0, COST, m] = cost_along(medium.stars, medium.steps, n, k)


@inner_kernel
def read_side(medium, state, source, quartet, m, side):
    """Fill column m with the segment on one side (1 or -1) of the edge; returns the direction of
    the next edge, that of the edge itself where there is no segment.
    """
    node, t, first = quartet.nodes[m], quartet.table, RIGHT if side < 0 else LEFT
    n, ka = node.n, node.a
    kb = beside(bits_of(medium.stars, n), ka, side)
    for r in range(first, first + SIDE_ROWS):  # as if there were no segment
        t[0, r, m] = 0.0 if r <= first + AE else 1.0
    if kb < 0 or not is_clear(medium, n, ka, kb):
        return ka
    b = toward(medium, n, kb)
    if value_at(state, b).tau == math.inf:
        return ka
    x, y = (X[kb] - X[ka]) * medium.grid.dx, (Y[kb] - Y[ka]) * medium.grid.dy
    ae = X[ka] * medium.grid.dx * x + Y[ka] * medium.grid.dy * y
    se = (node.x + X[ka]) * medium.grid.dx * x + (node.y + Y[ka]) * medium.grid.dy * y
    ee = x * x + y * y
    for layer in range(source.lift.shape[0]):
        za = height_at(medium, layer, sample_toward(medium, node.at, ka))
        rise = height_at(medium, layer, sample_toward(medium, node.at, kb)) - za
        ae, ee = ae + (za - height_at(medium, layer, node.at)) * rise, ee + rise * rise
        se += (za - source.lift[layer]) * rise
    t[0, first + EXISTS, m], t[0, first + SIDE_TAU, m] = 1.0, value_at(state, b).tau
    t[0, first + AE, m], t[0, first + EE, m], t[0, first + SE, m] = ae, ee, se
    t[0, first + SIDE_U, m] = value_at(state, b).u
    t[0, first + SIDE_COST, m] = cost_along(medium.stars, medium.steps, n, kb)
    return kb


@inner_kernel
def per_chord(medium, cost, chord):
    """The cost of edges over their chords; 32 bits show no less than 2^-23 above the floor."""
    ratio, floor = cost / chord, medium.ground.floor
    return where_above(floor * (1.0 + 2.5e-7), ratio, floor, ratio)


@inner_kernel
def ends_of(medium, t):
    """The ends of the edges in a table."""
    aa, ss = row(t, AA), row(t, SS)
    near = sqrt(aa)
    return End(
        aa, ss, near, sqrt(ss), per_chord(medium, row(t, COST), near), row(t, TAU), row(t, U)
    )


@inner_kernel
def segments_of(medium, end, t, first):
    """The segments in a table on one side, from a row on."""
    ae, ee = row(t, first + AE), row(t, first + EE)
    cost = per_chord(medium, row(t, first + SIDE_COST), sqrt(larger(end.aa + 2.0 * ae + ee, 0.0)))
    tau, u = row(t, first + SIDE_TAU), row(t, first + SIDE_U)
    return Segment(row(t, first + EXISTS), ae, ee, row(t, first + SE), cost, tau, u)
