"""A relaxed pace as arrays, and what kernels ask of it.

A pace is cost per horizontal metre as a convex function P of the grade m. Between its knots it is
made of polynomials; beyond them it goes straight. See ``docs/mathematics.md``.
"""

from typing import Any, NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel

DEGREE = 11  # of the polynomials: Tobler's pace takes one on each side of its kink


class Pace(NamedTuple):
    """A relaxed pace function: n polynomials, two straight tails, and lines that lie below it.

    The arrays are of float64 in C order, except ``guide``. Piece i reaches from ``knots[i]`` to
    ``knots[i + 1]``. With t = (m - ``middles[i]``) ``scales[i]``, from -1 to 1 along it, its value
    is sum over k of ``coefficients[i, k] t^k``.
    """

    knots: Any  # (n + 1,) grades, increasing
    middles: Any  # (n,)
    scales: Any  # (n,) 2 / the width of a piece
    coefficients: Any  # (n, DEGREE + 1)
    guide: Any  # (cells,) int64: the piece at the left end of each cell, all of one width
    cells_per_grade: float
    tails: Any  # (2, 2): slope B and intercept A of the line below the first knot, above the last
    kinks: Any  # (k,) grades where the slope jumps, increasing
    slopes: Any  # (lines,) increasing: B of each line A + B m below P
    intercepts: Any  # (lines,): A(B) = min over m of P(m) - B m, 0 or above


class Jet(NamedTuple):
    """A value with its first and second derivatives."""

    value: float
    slope: float
    curvature: float


@inner_kernel
def piece_at(pace, grade):
    """The piece whose grades hold this one; the first or the last one beyond the knots."""
    cell = int((grade - pace.knots[0]) * pace.cells_per_grade)
    piece = pace.guide[min(max(cell, 0), len(pace.guide) - 1)]
    while piece + 1 < len(pace.coefficients) and grade >= pace.knots[piece + 1]:
        piece += 1
    return piece


@inner_kernel
def pace_jet(pace, grade):
    """P, P' and P'' at a grade; at a kink those on its uphill side."""
    knots = pace.knots
    if grade < knots[0]:
        return Jet(pace.tails[0, 1] + pace.tails[0, 0] * grade, pace.tails[0, 0], 0.0)
    if grade >= knots[-1]:
        return Jet(pace.tails[1, 1] + pace.tails[1, 0] * grade, pace.tails[1, 0], 0.0)
    piece = piece_at(pace, grade)
    scale = pace.scales[piece]
    t = (grade - pace.middles[piece]) * scale
    value, slope, curvature = pace.coefficients[piece, DEGREE], 0.0, 0.0
    for k in range(DEGREE - 1, -1, -1):  # Horner's scheme for the polynomial and its derivatives
        curvature = curvature * t + slope
        slope = slope * t + value
        value = value * t + pace.coefficients[piece, k]
    return Jet(value, slope * scale, 2.0 * curvature * scale * scale)


@inner_kernel
def pace_at(pace, grade):
    """P at a grade: cost per horizontal metre."""
    knots = pace.knots
    if grade < knots[0]:
        return pace.tails[0, 1] + pace.tails[0, 0] * grade
    if grade >= knots[-1]:
        return pace.tails[1, 1] + pace.tails[1, 0] * grade
    piece = piece_at(pace, grade)
    t = (grade - pace.middles[piece]) * pace.scales[piece]
    square = t * t
    odd, even = pace.coefficients[piece, DEGREE], pace.coefficients[piece, DEGREE - 1]
    for k in range(DEGREE - 2, 0, -2):  # two sums that do not wait for each other
        odd = odd * square + pace.coefficients[piece, k]
        even = even * square + pace.coefficients[piece, k - 1]
    return even + odd * t


@inner_kernel
def pace_along(pace, size, rise):
    """size P(rise / size): the cost of so many horizontal metres that rise so much in all."""
    knots, tails = pace.knots, pace.tails
    if rise < knots[0] * size:
        return tails[0, 1] * size + tails[0, 0] * rise
    if rise >= knots[-1] * size:  # also where the size is 0
        return tails[1, 1] * size + tails[1, 0] * rise
    return size * pace_at(pace, rise / size)


@inner_kernel
def intercept_at(pace, slope):
    """A(B) = min over m of P(m) - B m for a slope B; minus infinity where there is no minimum.

    P' grows with m, so that the grade with P' = B is found by bisection, at kinks too.
    """
    if slope < pace.tails[0, 0] or slope > pace.tails[1, 0]:
        return -np.inf
    low, high = pace.knots[0], pace.knots[-1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        if pace_jet(pace, middle).slope < slope:
            low = middle
        else:
            high = middle
    return min(pace_at(pace, low) - slope * low, pace_at(pace, high) - slope * high)


@inner_kernel
def hidden_bend(pace, a, b):
    """A bound on how far P is from straight between two grades; 0 where it has no joint there.

    Joints are kinks and the critical grades. Where P is smooth, rules see how it bends.
    """
    low, high = min(a, b), max(a, b)
    has_joint = low < pace.knots[0] < high or low < pace.knots[-1] < high
    for k in range(len(pace.kinks)):
        has_joint = has_joint or low < pace.kinks[k] < high
    if not has_joint:
        return 0.0
    return 0.25 * (high - low) * (pace_jet(pace, high).slope - pace_jet(pace, low).slope)


@kernel
def evaluate_paces(pace, grades, values):
    """Write P at grades (n,) to values (n,)."""
    for i in range(len(grades)):
        values[i] = pace_at(pace, grades[i])


@kernel
def evaluate_jets(pace, grades, jets):
    """Write P, P' and P'' at grades (n,) to jets (n, 3)."""
    for i in range(len(grades)):
        jet = pace_jet(pace, grades[i])
        jets[i, 0], jets[i, 1], jets[i, 2] = jet.value, jet.slope, jet.curvature


@kernel
def evaluate_intercepts(pace, slopes, values):
    """Write A(B) at slopes (n,) to values (n,)."""
    for i in range(len(slopes)):
        values[i] = intercept_at(pace, slopes[i])
