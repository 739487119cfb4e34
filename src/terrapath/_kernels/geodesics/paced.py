"""Newton's method for polylines of least energy under a pace: pieces that cost more uphill.

The energy is the number of pieces times the sum of their squared costs. A piece costs its planar
size times the pace at its chord's grade, times the root of the mean of c^2 at its ends. The pace is
softened: a kink becomes a hyperbola of a width in grades, and a small share of the length is added,
so that of paths that cost the same, as among switchbacks, the shortest is taken.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..travel.paces import Jet, pace_jet
from ..travel.priced import Price
from .blocks import Block, fill_jets


class PacedStrand(NamedTuple):
    """A polyline (m,) under a pace, and the surface along it."""

    points: np.ndarray  # (m, 2), map units
    weights: np.ndarray  # (1,)
    jets: np.ndarray  # (m, 1, 6): value, gradient and second derivatives of the height
    costs: np.ndarray  # (m, 6): the jet of c^2
    chords: np.ndarray  # (m - 1, 3): the pieces: both steps on the plane, and the rise
    stiffness: np.ndarray  # (m - 1,): the mean of c^2 at the ends of each piece
    pieces: np.ndarray  # (m - 1, PIECE): see below
    price: Price


# Entries of a row of PacedStrand.pieces.
COST = 0  # of the chord, at c = 1
INTERCEPT = 1  # A = P - m P' at its grade m
SLOPE = 2  # P'
ACROSS = 3  # A over its planar size: how it stiffens against turning
ALONG = 4  # P'' over its planar size
UX, UY = 5, 6  # its direction on the plane
GRADE = 7
PIECE = 8


@kernel
def softened_jet(strand, grade):
    """A pace with softened kinks and a share of length, with its derivatives at a grade."""
    price, pace = strand.price, strand.price.pace
    jet = pace_jet(pace, grade)
    value, slope, curvature = jet.value, jet.slope, jet.curvature
    for k in range(len(pace.kinks)):
        apart, half = grade - pace.kinks[k], 0.5 * price.jumps[k]
        root = math.sqrt(apart * apart + price.width * price.width)
        value += half * (root - abs(apart))
        slope += half * (apart / root - (1.0 if apart >= 0.0 else -1.0))
        curvature += half * price.width * price.width / (root * root * root)
    root = math.sqrt(1.0 + grade * grade)
    value += price.share * root
    slope += price.share * grade / root
    curvature += price.share / (root * root * root)
    return Jet(value, slope, curvature)


@kernel
def fill_piece(strand, m):
    """Fill the row of a piece from its chord. Returns its squared cost at c = 1."""
    dx, dy, rise = strand.chords[m, 0], strand.chords[m, 1], strand.chords[m, 2]
    size, row = math.sqrt(dx * dx + dy * dy), strand.pieces[m]
    if size == 0.0:
        for entry in range(PIECE):
            row[entry] = 0.0
        return 0.0
    grade = rise / size
    jet = softened_jet(strand, grade)
    row[COST], row[SLOPE], row[GRADE] = size * jet.value, jet.slope, grade
    row[INTERCEPT] = max(jet.value - grade * jet.slope, 0.0)
    row[ACROSS], row[ALONG] = row[INTERCEPT] / size, jet.curvature / size
    row[UX], row[UY] = dx / size, dy / size
    return row[COST] * row[COST]


@kernel
def fill_paced_pieces(strand):
    """Fill chords, stiffness and pieces from the jets at the points. Returns the energy."""
    points, jets, chords, costs = strand.points, strand.jets, strand.chords, strand.costs
    count, energy = chords.shape[0], 0.0
    for m in range(count):
        chords[m, 0] = points[m + 1, 0] - points[m, 0]
        chords[m, 1] = points[m + 1, 1] - points[m, 1]
        chords[m, 2] = strand.weights[0] * (jets[m + 1, 0, 0] - jets[m, 0, 0])
        strand.stiffness[m] = 0.5 * (costs[m, 0] + costs[m + 1, 0])
        energy += strand.stiffness[m] * fill_piece(strand, m)
    return count * energy


@kernel
def lift_paced(surface, strand):
    fill_jets(surface, strand)
    return fill_paced_pieces(strand)


@inner_kernel
def steepness(strand, at):
    """The slopes of the height at a point, weighted."""
    return strand.weights[0] * strand.jets[at, 0, 1], strand.weights[0] * strand.jets[at, 0, 2]


@inner_kernel
def growth(strand, piece, at):
    """How the cost of a piece at c = 1 grows as its end at a point moves; its begin: minus that."""
    (fx, fy), row = steepness(strand, at), strand.pieces[piece]
    a, b = row[INTERCEPT], row[SLOPE]
    return a * row[UX] + b * fx, a * row[UY] + b * fy


@inner_kernel
def slant(strand, piece, at):
    """How the grade of a piece, times its planar size, changes as its end at a point moves."""
    (fx, fy), row = steepness(strand, at), strand.pieces[piece]
    return fx - row[GRADE] * row[UX], fy - row[GRADE] * row[UY]


@kernel
def half_of_piece(strand, piece, at, sign, curvature):
    """Half the second derivative of a piece's squared cost by one of its ends.

    sign : 1 for its end, -1 for its begin.
    """
    row, cost, stiffness = strand.pieces[piece], strand.costs[at], strand.stiffness[piece]
    (gx, gy), (qx, qy) = growth(strand, piece, at), slant(strand, piece, at)
    phi, ux, uy = row[COST], row[UX], row[UY]
    bend = curvature * sign * row[SLOPE] * strand.weights[0]
    a = row[ACROSS] * uy * uy + row[ALONG] * qx * qx + bend * strand.jets[at, 0, 3]
    b = -row[ACROSS] * ux * uy + row[ALONG] * qx * qy + bend * strand.jets[at, 0, 4]
    d = row[ACROSS] * ux * ux + row[ALONG] * qy * qy + bend * strand.jets[at, 0, 5]
    a, b = stiffness * (gx * gx + phi * a), stiffness * (gx * gy + phi * b)
    d = stiffness * (gy * gy + phi * d)
    x, y, squares = 0.5 * curvature * sign * phi * gx, 0.5 * curvature * sign * phi * gy, phi * phi
    a += 2.0 * x * cost[1] + 0.25 * curvature * squares * cost[3]
    b += x * cost[2] + y * cost[1] + 0.25 * curvature * squares * cost[4]
    d += 2.0 * y * cost[2] + 0.25 * curvature * squares * cost[5]
    return Block(a, b, b, d)


@kernel
def paced_own_block(strand, i, curvature):
    """Half the energy's second derivative by inner point i."""
    m = half_of_piece(strand, i, i + 1, 1.0, curvature)
    k = half_of_piece(strand, i + 1, i + 1, -1.0, curvature)
    return Block(m.a + k.a, m.b + k.b, m.c + k.c, m.d + k.d)


@kernel
def paced_link_block(strand, i, curvature):
    """Half the energy's second derivative by inner points i and i + 1."""
    at, piece = i + 1, i + 1
    row, stiffness = strand.pieces[piece], strand.stiffness[piece]
    (gx, gy), (hx, hy) = growth(strand, piece, at), growth(strand, piece, at + 1)
    (px, py), (qx, qy) = slant(strand, piece, at), slant(strand, piece, at + 1)
    phi, ux, uy = row[COST], row[UX], row[UY]
    across, along, half = row[ACROSS] * phi, row[ALONG] * phi, 0.5 * curvature * phi
    cost, next_cost = strand.costs[at], strand.costs[at + 1]
    return Block(
        half * (cost[1] * hx - gx * next_cost[1])
        - stiffness * (gx * hx + across * uy * uy + along * px * qx),
        half * (cost[1] * hy - gx * next_cost[2])
        - stiffness * (gx * hy - across * ux * uy + along * px * qy),
        half * (cost[2] * hx - gy * next_cost[1])
        - stiffness * (gy * hx - across * ux * uy + along * py * qx),
        half * (cost[2] * hy - gy * next_cost[2])
        - stiffness * (gy * hy + across * ux * ux + along * py * qy),
    )


@kernel
def paced_pull(strand, i):
    """Half the energy's derivative by inner point i."""
    at, before, after = i + 1, strand.pieces[i], strand.pieces[i + 1]
    (ax, ay), (bx, by) = growth(strand, i, at), growth(strand, i + 1, at)
    first, last = strand.stiffness[i] * before[COST], strand.stiffness[i + 1] * after[COST]
    both = 0.25 * (before[COST] * before[COST] + after[COST] * after[COST])
    cost = strand.costs[at]
    return first * ax - last * bx + both * cost[1], first * ay - last * by + both * cost[2]
