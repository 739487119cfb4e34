"""Newton's method for polylines of least energy: the surface along a polyline, and one step.

The energy of a polyline is its number of pieces times the sum of its squared chords in R^n,
each times the mean of the squared cost C = c^2 at its ends. At least energy, all pieces have the
same length and their sum is least; the energy is then the square of that sum.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..dispatch import per_class
from ..travel.priced import per_price
from .blocks import Block, confined, entry, fill_jets, inverse, product, put, transposed
from .paced import (
    PacedStrand,
    lift_paced,
    paced_link_block,
    paced_own_block,
    paced_pull,
)


class Strand(NamedTuple):
    """A polyline (m,), and the surface along it. Inner points are numbered from 0, too."""

    points: np.ndarray  # (m, 2), map units
    weights: np.ndarray  # (layers,)
    jets: np.ndarray  # (m, layers, 6): value, gradient and second derivatives of each layer
    costs: np.ndarray  # (m, 6): the jet of C
    chords: np.ndarray  # (m - 1, 2 + layers): the pieces in R^n
    stiffness: np.ndarray  # (m - 1,): the mean of C at the ends of each piece
    pull: np.ndarray  # (m - 2, 2 + layers): -(C s')' at each inner point
    drift: np.ndarray  # (m - 2, 2): |s'|^2 / 2 grad C there


class Workspace(NamedTuple):
    """The workspace of a Newton step, and its result."""

    derivative: np.ndarray  # (m - 2, 2), half the energy's by each inner point
    move: np.ndarray  # (m - 2, 2), map units
    pivots: np.ndarray  # (m - 2, 2, 2): the inverses of the diagonal blocks
    links: np.ndarray  # (m - 2, 2, 2): the blocks above the diagonal


@kernel
def frame_product(strand, i, j):
    """F_i^T F_j, where F = (I, w grad x_3, ..., w grad x_n)^T maps the plane into R^n."""
    a, b, c, d = 1.0, 0.0, 0.0, 1.0
    jets = strand.jets
    for k in range(strand.weights.shape[0]):
        w = strand.weights[k] * strand.weights[k]
        a += w * jets[i, k, 1] * jets[j, k, 1]
        b += w * jets[i, k, 1] * jets[j, k, 2]
        c += w * jets[i, k, 2] * jets[j, k, 1]
        d += w * jets[i, k, 2] * jets[j, k, 2]
    return Block(a, b, c, d)


@inner_kernel
def seen_from(strand, i, piece):
    """F_i^T times the chord of a piece."""
    chord = strand.chords[piece]
    x, y = chord[0], chord[1]
    for k in range(strand.weights.shape[0]):
        rise = strand.weights[k] * chord[k + 2]
        x += rise * strand.jets[i, k, 1]
        y += rise * strand.jets[i, k, 2]
    return x, y


@inner_kernel
def squared_chord(strand, piece):
    total = 0.0
    for k in range(strand.chords.shape[1]):
        total += strand.chords[piece, k] * strand.chords[piece, k]
    return total


@kernel
def metric_own_block(strand, i, curvature):
    at = i + 1
    m, cost = frame_product(strand, at, at), strand.costs[at]
    stiffness = strand.stiffness[i] + strand.stiffness[i + 1]
    a, b, d = stiffness * m.a, stiffness * m.b, stiffness * m.d
    for k in range(strand.weights.shape[0]):
        w = curvature * strand.weights[k] * strand.pull[i, k + 2]
        a += w * strand.jets[at, k, 3]
        b += w * strand.jets[at, k, 4]
        d += w * strand.jets[at, k, 5]
    (ax, ay), (bx, by) = seen_from(strand, at, i), seen_from(strand, at, i + 1)
    x, y = 0.5 * curvature * (ax - bx), 0.5 * curvature * (ay - by)
    squares = 0.25 * curvature * (squared_chord(strand, i) + squared_chord(strand, i + 1))
    a += 2.0 * x * cost[1] + squares * cost[3]
    b += x * cost[2] + y * cost[1] + squares * cost[4]
    d += 2.0 * y * cost[2] + squares * cost[5]
    return Block(a, b, b, d)


@per_class({Strand: metric_own_block, PacedStrand: paced_own_block})
def own_block(strand, i, curvature):
    """Half the energy's second derivative by inner point i.

    curvature : the share that is taken of the second derivatives of the layers and the cost.
    """


@kernel
def metric_link_block(strand, i, curvature):
    at, piece = i + 1, i + 1
    m, stiffness = frame_product(strand, at, at + 1), strand.stiffness[piece]
    (ax, ay), (bx, by) = seen_from(strand, at, piece), seen_from(strand, at + 1, piece)
    half, cost, next_cost = 0.5 * curvature, strand.costs[at], strand.costs[at + 1]
    return Block(
        half * (cost[1] * bx - ax * next_cost[1]) - stiffness * m.a,
        half * (cost[1] * by - ax * next_cost[2]) - stiffness * m.b,
        half * (cost[2] * bx - ay * next_cost[1]) - stiffness * m.c,
        half * (cost[2] * by - ay * next_cost[2]) - stiffness * m.d,
    )


@per_class({Strand: metric_link_block, PacedStrand: paced_link_block})
def link_block(strand, i, curvature):
    """Half the energy's second derivative by inner points i and i + 1."""


@inner_kernel
def metric_pull(strand, i):
    jets, weights, pull = strand.jets, strand.weights, strand.pull
    gx, gy = strand.drift[i, 0] + pull[i, 0], strand.drift[i, 1] + pull[i, 1]
    for k in range(weights.shape[0]):
        gx += weights[k] * jets[i + 1, k, 1] * pull[i, k + 2]
        gy += weights[k] * jets[i + 1, k, 2] * pull[i, k + 2]
    return gx, gy


@per_class({Strand: metric_pull, PacedStrand: paced_pull})
def pull_at(strand, i):
    """Half the energy's derivative by inner point i."""


@kernel
def fill_derivative(strand, projectors, derivative):
    """Half the energy's derivative by each inner point, along the moves it is free to make."""
    for i in range(derivative.shape[0]):
        gx, gy = pull_at(strand, i)
        p = entry(projectors, i)
        derivative[i, 0] = p.a * gx + p.b * gy
        derivative[i, 1] = p.c * gx + p.d * gy


@kernel
def eliminate(strand, projectors, curvature, pivots, links, step):
    """Forward elimination of H step = -derivative; ``step`` holds the derivative on entry.

    Returns the number of rows; or, where H is not positive definite, the row that shows it. The
    pivot of that row is left as it is.
    """
    for i in range(step.shape[0]):
        p = entry(projectors, i)
        m = confined(own_block(strand, i, curvature), p)
        gx, gy = -step[i, 0], -step[i, 1]
        if i > 0:
            q = product(entry(projectors, i - 1), link_block(strand, i - 1, curvature))
            put(links, i - 1, product(q, p))
            left = product(transposed(entry(links, i - 1)), entry(pivots, i - 1))
            k = product(left, entry(links, i - 1))
            m = Block(m.a - k.a, m.b - k.b, m.c - k.c, m.d - k.d)
            gx -= left.a * step[i - 1, 0] + left.b * step[i - 1, 1]
            gy -= left.c * step[i - 1, 0] + left.d * step[i - 1, 1]
        if not (m.a > 0.0 and m.a * m.d - m.b * m.c > 1e-14 * m.a * m.d):
            put(pivots, i, m)
            return i
        put(pivots, i, inverse(m))
        step[i, 0], step[i, 1] = gx, gy
    return step.shape[0]


@kernel
def substitute(pivots, links, step, rows):
    """Back substitution from row ``rows`` - 1 upwards; the rows below it are already solved."""
    for i in range(rows - 1, -1, -1):
        gx, gy = step[i, 0], step[i, 1]
        if i + 1 < step.shape[0]:
            k = entry(links, i)
            gx -= k.a * step[i + 1, 0] + k.b * step[i + 1, 1]
            gy -= k.c * step[i + 1, 0] + k.d * step[i + 1, 1]
        m = entry(pivots, i)
        step[i, 0] = m.a * gx + m.b * gy
        step[i, 1] = m.c * gx + m.d * gy


@kernel
def downward(pivots, links, step, row):
    """A direction of negative curvature where the elimination broke down at a row.

    v^T H v = u^T M u for the eigenvector u of the pivot M with its least eigenvalue.
    """
    m = entry(pivots, row)
    least = 0.5 * (m.a + m.d) - math.hypot(0.5 * (m.a - m.d), m.b)
    ux, uy = m.b, least - m.a
    if abs(least - m.d) > abs(uy):
        ux, uy = least - m.d, m.b
    size = math.hypot(ux, uy)
    for i in range(step.shape[0]):
        step[i, 0], step[i, 1] = 0.0, 0.0
    step[row, 0] = ux / size if size > 0.0 else 1.0
    step[row, 1] = uy / size if size > 0.0 else 0.0
    substitute(pivots, links, step, row)


@kernel
def newton_step(strand, projectors, curvature, workspace):
    """Newton's step for the inner points of a polyline; both ends stay.

    projectors : (m - 2, 2, 2), onto the moves that each point is free to make.
    curvature : 1 for Newton's step; 0 leaves out the second derivatives of the layers and the
    cost, so that H is always positive definite.
    Where H is not positive definite, the move is a direction of negative curvature instead.
    Returns whether H is positive definite.
    """
    derivative, step = workspace.derivative, workspace.move
    fill_derivative(strand, projectors, derivative)
    for i in range(step.shape[0]):
        step[i, 0], step[i, 1] = derivative[i, 0], derivative[i, 1]
    rows = eliminate(strand, projectors, curvature, workspace.pivots, workspace.links, step)
    if rows < step.shape[0]:
        downward(workspace.pivots, workspace.links, step, rows)
        return False
    substitute(workspace.pivots, workspace.links, step, rows)
    return True


# The surface along a polyline


@kernel
def fill_pieces(strand):
    """Fill chords, stiffness, pull and drift from the jets at the points. Returns the energy."""
    points, jets, chords, costs = strand.points, strand.jets, strand.chords, strand.costs
    pieces, energy, squares = chords.shape[0], 0.0, 0.0
    for m in range(pieces):
        chords[m, 0] = points[m + 1, 0] - points[m, 0]
        chords[m, 1] = points[m + 1, 1] - points[m, 1]
        for k in range(strand.weights.shape[0]):
            chords[m, k + 2] = strand.weights[k] * (jets[m + 1, k, 0] - jets[m, k, 0])
        strand.stiffness[m] = 0.5 * (costs[m, 0] + costs[m + 1, 0])
        squares_before, squares = squares, squared_chord(strand, m)
        energy += strand.stiffness[m] * squares
        if m > 0:
            both = 0.25 * (squares_before + squares)
            strand.drift[m - 1, 0], strand.drift[m - 1, 1] = both * costs[m, 1], both * costs[m, 2]
            for k in range(chords.shape[1]):
                before = strand.stiffness[m - 1] * chords[m - 1, k]
                strand.pull[m - 1, k] = before - strand.stiffness[m] * chords[m, k]
    return pieces * energy


@kernel
def lift_metric(surface, strand):
    fill_jets(surface, strand)
    return fill_pieces(strand)


@per_price(lift_metric, lift_paced)
def lift(surface, strand):
    """Evaluate the surface at the points of a polyline. Returns the polyline's energy."""
