"""2 x 2 matrices, of which Newton's steps are made, and the surface's jets along a polyline."""

import math
from typing import NamedTuple

from ..compiler import inner_kernel, kernel
from ..surface.surfaces import jet_at, log_cost_at, put_jet


class Block(NamedTuple):
    """A 2 x 2 matrix."""

    a: float
    b: float
    c: float
    d: float


@inner_kernel
def product(m, k):
    return Block(
        m.a * k.a + m.b * k.c,
        m.a * k.b + m.b * k.d,
        m.c * k.a + m.d * k.c,
        m.c * k.b + m.d * k.d,
    )


@inner_kernel
def transposed(m):
    return Block(m.a, m.c, m.b, m.d)


@inner_kernel
def inverse(m):
    det = m.a * m.d - m.b * m.c
    return Block(m.d / det, -m.b / det, -m.c / det, m.a / det)


@inner_kernel
def entry(blocks, i):
    """Block i of an array (m, 2, 2)."""
    return Block(blocks[i, 0, 0], blocks[i, 0, 1], blocks[i, 1, 0], blocks[i, 1, 1])


@kernel
def put(blocks, i, m):
    blocks[i, 0, 0], blocks[i, 0, 1], blocks[i, 1, 0], blocks[i, 1, 1] = m.a, m.b, m.c, m.d


@kernel
def confined(m, projector):
    """P M P + (I - P): M for the moves that the projector P allows, the identity for the others."""
    k = product(product(projector, m), projector)
    p = projector
    return Block(k.a + 1.0 - p.a, k.b - p.b, k.c - p.c, k.d + 1.0 - p.d)


@inner_kernel
def put_squared_cost(row, log):
    """The jet of c^2 = exp(2 log c), from that of log c."""
    c2, x, y = math.exp(2.0 * log.f), 2.0 * log.fx, 2.0 * log.fy
    row[0], row[1], row[2] = c2, c2 * x, c2 * y
    row[3], row[4] = c2 * (2.0 * log.fxx + x * x), c2 * (2.0 * log.fxy + x * y)
    row[5] = c2 * (2.0 * log.fyy + y * y)


@kernel
def fill_jets(surface, strand):
    """Fill the jets of the layers and of the squared cost at the points of a polyline."""
    for m in range(strand.points.shape[0]):
        x, y = strand.points[m, 0], strand.points[m, 1]
        for layer in range(strand.weights.shape[0]):
            put_jet(strand.jets[m, layer], jet_at(surface, layer, x, y))
        put_squared_cost(strand.costs[m], log_cost_at(surface, x, y))
