"""From a pace to its relaxed pace: lower envelope, critical grades, tangents through the origin.

Switchbacks of a path reach every cost of the convex hull. What is proven of them is in
``docs/mathematics.md``.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial

from ..errors import InputError
from ..validation import Array
from .pieces import Pieces, joined, roots, straight

# Lines this close to the pace touch it; as a share of the pace of level ground.
TOUCHING = 1e-12
# Between two bridges nothing is left that is narrower than this.
SLIVER = 1e-12


class End(NamedTuple):
    """How a relaxed pace goes on beyond its last knot uphill, or downhill as seen from there."""

    grade: float  # of the last knot
    critical: float  # infinite where no switchbacks are better than the straight climb
    slope: float  # B of the tail A + B m
    intercept: float  # A, 0 where the tail is the tangent through the origin


class Relaxed(NamedTuple):
    """A convex pace on the grades that are travelled straight, and its tails."""

    pieces: Pieces
    downhill: End  # of the pace of the opposite grade
    uphill: End
    bridges: list[tuple[float, float]]  # grades where the pace was not convex


def relax(pieces: Pieces, unbounded: tuple[bool, bool]) -> Relaxed:
    """The relaxed pace of a function with 0 among its knots.

    unbounded : are there paces beyond the first knot, and beyond the last one? They go straight on.
    """
    level = _level(pieces)
    if level <= 0:
        raise InputError(
            f"the pace of level ground is {level:g}; it must be above 0, or one could travel for "
            "ever at no cost"
        )
    least, most = -_least_ratio(-pieces), _least_ratio(pieces)
    if least >= most:
        raise InputError(
            f"the pace is so far below 0 that no gauge mends it: a metre down costs {-least:g} and "
            f"a metre up {most:g}, together not above 0, so one could travel up and down for ever; "
            "lower the regeneration, or raise the pace"
        )
    downhill = _end(-pieces, unbounded[0], level)
    uphill = _end(pieces, unbounded[1], level)
    down, up = (end.intercept + end.slope * end.grade for end in (downhill, uphill))
    convex, bridges = _envelope(pieces.between(-downhill.grade, uphill.grade), (down, up), level)
    return Relaxed(convex, downhill, uphill, bridges)


def _level(pieces: Pieces) -> float:
    """The pace of level ground, the lower one where it jumps there."""
    left, right = pieces.at_ends(0)
    at = int(np.searchsorted(pieces.knots, 0.0))
    return float(min(right[at - 1], left[at]))


def _uphill(pieces: Pieces) -> Pieces:
    return pieces.between(0.0, float(pieces.knots[-1]))


def _least_ratio(pieces: Pieces) -> float:
    """The least cost of a metre of climb, of the pace as it is."""
    grades, values = _uphill(pieces).samples()
    climbing = grades > 0
    return float((values[climbing] / grades[climbing]).min())


def _end(pieces: Pieces, unbounded: bool, level: float) -> End:
    """The critical grade uphill: where a metre of climb costs least, the smallest such grade."""
    uphill = _uphill(pieces)
    costs = [pair for piece in _promising(uphill) for pair in _climbs(uphill, piece)]
    cost, _ = min(costs)
    grade = min(m for each, m in costs if (each - cost) * m <= TOUCHING * level)
    last = float(uphill.knots[-1])
    if unbounded and grade == last:
        value, slope = (float(uphill.at_ends(order)[1][-1]) for order in (0, 1))
        return End(last, math.inf, slope, max(value - slope * last, 0.0))
    return End(grade, grade, cost, 0.0)


def _promising(uphill: Pieces) -> list[int]:
    """The pieces where, by their samples, a metre of climb may cost least."""
    grades, values = uphill.samples()
    ratios = values[:, 1:] / grades[:, 1:]  # without level ground
    least, most = ratios.min(axis=1), ratios.max(axis=1)
    return [int(piece) for piece in np.flatnonzero(least - 0.01 * (most - least) <= least.min())]


def _climbs(pieces: Pieces, piece: int) -> list[tuple[float, float]]:
    """What a metre of climb costs where that may be least on a piece, and the grades."""
    middle, half = pieces.middles[piece], pieces.halves[piece]
    coefficients = pieces.coefficients[piece]
    # p' m - p, with m = middle + half t and p' by t divided by half.
    slope = polynomial.polyder(coefficients)
    condition = polynomial.polysub(polynomial.polymul(slope, [middle / half, 1.0]), coefficients)
    places = [-1.0, 1.0, *roots(condition)]
    return [
        (float(polynomial.polyval(t, coefficients)) / m, m)
        for t in places
        if (m := float(pieces.knots[piece + 1] if t == 1.0 else middle + half * t)) > 0
    ]


# The lower envelope


def _envelope(
    pieces: Pieces, ends: tuple[float, float], level: float
) -> tuple[Pieces, list[tuple[float, float]]]:
    """The greatest convex function below, with a straight piece over each part that is not.

    ends : the values at both ends, which may be below the pieces where the pace jumps there.
    """
    grades, values = (part.ravel() for part in pieces.samples())
    jumps = [values[k] - end > TOUCHING * level for k, end in zip((0, -1), ends, strict=True)]
    values[0], values[-1] = min(values[0], ends[0]), min(values[-1], ends[1])
    hull = _lower_hull(grades, values)
    bridges = []
    for a, b in itertools.pairwise(hull):
        share = (grades[a + 1 : b] - grades[a]) / (grades[b] - grades[a])
        chord = values[a] + share * (values[b] - values[a])
        rounding = TOUCHING * (level + np.abs(values[a : b + 1]).max())
        at_jump = (a == 0 and jumps[0]) or (b == len(values) - 1 and jumps[1])
        if at_jump or (values[a + 1 : b] - chord > rounding).any():
            bridges.append(_bridge(pieces, grades, values, (a, b)))
    return _bridged(pieces, bridges), [(left, right) for (left, right), _ in bridges]


def _lower_hull(grades: Array, values: Array) -> list[int]:
    """The indices of the points on the lower convex hull; grades do not decrease."""
    hull: list[int] = []
    for i in range(len(grades)):
        if hull and grades[i] == grades[hull[-1]]:
            if values[i] >= values[hull[-1]]:
                continue
            hull.pop()
        while len(hull) > 1:
            a, b = hull[-2:]
            turn = (grades[b] - grades[a]) * (values[i] - values[a]) - (values[b] - values[a]) * (
                grades[i] - grades[a]
            )
            if turn > 0:
                break
            hull.pop()
        hull.append(i)
    return hull


Bridge = tuple[tuple[float, float], tuple[float, float]]  # its grades, and its values there


def _bridge(pieces: Pieces, grades: Array, values: Array, ends: tuple[int, int]) -> Bridge:
    """The common tangent near two samples.

    With a slope B both sides have a grade where f - B m is least. The slope of the chord between
    those two points is the next B: Newton's step for the B at which both sides are equally low.
    """
    a, b = ends
    # No sample is on both sides, as there is one between that lies above the chord.
    left, right = _around(pieces, grades, a - 2, a + 1), _around(pieces, grades, b - 1, b + 2)
    slope, step = (values[b] - values[a]) / (grades[b] - grades[a]), math.inf
    while True:
        low, start = min(left.lowest(slope), (values[a] - slope * grades[a], grades[a]))
        high, end = min(right.lowest(slope), (values[b] - slope * grades[b], grades[b]))
        at_ends = low + slope * start, high + slope * end
        if start >= end:  # by rounding, at a kink
            return (float(grades[a]), float(grades[b])), (float(values[a]), float(values[b]))
        last, slope = slope, (at_ends[1] - at_ends[0]) / (end - start)
        # Steps shrink until they are rounding.
        if not abs(slope - last) < step:
            return (float(start), float(end)), (float(at_ends[0]), float(at_ends[1]))
        step = abs(slope - last)


def _around(pieces: Pieces, grades: Array, first: int, last: int) -> Pieces:
    """The part between two samples, or as far as there are samples."""
    return pieces.between(float(grades[max(first, 0)]), float(grades[min(last, len(grades) - 1)]))


def _bridged(pieces: Pieces, bridges: list[Bridge]) -> Pieces:
    parts, last = [], float(pieces.knots[0])
    for (start, end), values in bridges:
        if start > last + SLIVER:
            parts.append(pieces.between(last, start))
        parts.append(straight((last if start <= last + SLIVER else start, end), values))
        last = end
    if last < pieces.knots[-1] - SLIVER:
        parts.append(pieces.between(last, float(pieces.knots[-1])))
    return joined(parts)
