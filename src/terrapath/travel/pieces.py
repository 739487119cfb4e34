"""Functions of the grade as polynomials between knots, and how a formula becomes one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev, polynomial

from .._kernels.travel.paces import DEGREE
from ..errors import InputError
from ..validation import Array

Formula = Callable[[Array], Array]

PRECISION = 2e-13  # of a polynomial, of the largest value on its piece
MOST_PIECES = 20_000
FINEST = 1e-13  # pieces are not halved further than this share of the range
# A piece that had to be so small lies at a kink or a jump that the formula did not declare.
AT_KINK = 1e-6

NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))[::-1]
# The nodes leave out the ends, and so these: a kink beside an end would not be seen otherwise. What
# is seen there alone may be of a kink that was found to ``AT_ENDS``.
CHECKS = np.concatenate([np.cos(np.pi * np.arange(1, 13) / 13), [2e-9 - 1.0, 1.0 - 2e-9]])
AT_ENDS = 1e-9
ALLOWED = np.array([PRECISION] * 12 + [AT_ENDS] * 2)
SAMPLES = np.cos(np.pi * np.arange(32, -1, -1) / 32)  # both ends are among them


class Pieces(NamedTuple):
    """A function that is a polynomial between knots, and may jump at them.

    On piece i, with t from -1 to 1, it is sum over k of ``coefficients[i, k] t^k``.
    """

    knots: Array  # (n + 1,)
    coefficients: Array  # (n, DEGREE + 1)

    @property
    def middles(self) -> Array:
        """The grades where t is 0."""
        return 0.5 * (self.knots[1:] + self.knots[:-1])

    @property
    def halves(self) -> Array:
        """Grades for each unit of t."""
        return 0.5 * np.diff(self.knots)

    def samples(self) -> tuple[Array, Array]:
        """Grades and values (n, 33) on each piece, with both of its ends."""
        grades = self.middles[:, None] + self.halves[:, None] * SAMPLES
        grades[:, 0], grades[:, -1] = self.knots[:-1], self.knots[1:]
        return grades, self.coefficients @ polynomial.polyvander(SAMPLES, DEGREE).T

    def at_ends(self, order: int) -> tuple[Array, Array]:
        """The value (0) or the slope (1) of each piece at its left and its right end."""
        derived = np.asarray(polynomial.polyder(self.coefficients.T, order))
        left, right = (np.asarray(polynomial.polyval(t, derived)) for t in (-1.0, 1.0))
        return left / self.halves**order, right / self.halves**order

    def __neg__(self) -> Pieces:
        """The function of the opposite grade, f(-m)."""
        signs = (-1.0) ** np.arange(DEGREE + 1)
        return Pieces(-self.knots[::-1], (self.coefficients * signs)[::-1])

    def tilted(self, slope: float) -> Pieces:
        """The function plus ``slope`` times the grade."""
        coefficients = self.coefficients.copy()
        coefficients[:, 0] += slope * self.middles
        coefficients[:, 1] += slope * self.halves
        return Pieces(self.knots, coefficients)

    def between(self, low: float, high: float) -> Pieces:
        """The part between two grades inside the knots."""
        inside = (self.knots > low) & (self.knots < high)
        knots = np.array([low, *self.knots[inside], high])
        first = int(np.searchsorted(self.knots, low, side="right")) - 1
        of = np.arange(first, first + len(knots) - 1)
        left, right = ((knots[:-1] - self.middles[of]), (knots[1:] - self.middles[of]))
        middle, half = (
            0.5 * (left + right) / self.halves[of],
            0.5 * (right - left) / self.halves[of],
        )
        whole = (knots[:-1] == self.knots[of]) & (knots[1:] == self.knots[of + 1])
        moved = [
            coefficients if same else _moved(coefficients, m, h)
            for coefficients, same, m, h in zip(
                self.coefficients[of], whole, middle, half, strict=True
            )
        ]
        return Pieces(knots, np.array(moved))

    def lowest(self, slope: float) -> tuple[float, float]:
        """The least of f(m) - ``slope`` m, and the grade nearest to 0 where it is taken."""
        candidates = [
            (value, grade)
            for piece in range(len(self.coefficients))
            for value, grade in self._stationary(piece, slope)
        ]
        return min(candidates, key=lambda pair: (pair[0], abs(pair[1])))

    def _stationary(self, piece: int, slope: float) -> Iterator[tuple[float, float]]:
        """The values of f - slope m at the ends of a piece and where its derivative is 0."""
        middle, half = float(self.middles[piece]), float(self.halves[piece])
        tilted = self.coefficients[piece].copy()
        tilted[0] -= slope * middle
        tilted[1] -= slope * half
        left, right = float(self.knots[piece]), float(self.knots[piece + 1])
        inside = ((t, middle + t * half) for t in roots(np.asarray(polynomial.polyder(tilted))))
        for t, grade in ((-1.0, left), (1.0, right), *inside):
            yield float(polynomial.polyval(t, tilted)), grade


def joined(parts: Iterable[Pieces]) -> Pieces:
    """Parts that follow each other, as one."""
    several = list(parts)
    knots = [several[0].knots[:1], *(part.knots[1:] for part in several)]
    return Pieces(np.concatenate(knots), np.concatenate([part.coefficients for part in several]))


def straight(grades: tuple[float, float], values: tuple[float, float]) -> Pieces:
    """One straight piece between two points."""
    return Pieces(np.array(grades), _linear(*(np.array([value]) for value in values)))


def _linear(left: Array, right: Array) -> Array:
    """Coefficients (n, DEGREE + 1) of straight pieces with these values at their ends (n,)."""
    coefficients = np.zeros((len(left), DEGREE + 1))
    coefficients[:, 0], coefficients[:, 1] = 0.5 * (left + right), 0.5 * (right - left)
    return coefficients


def _moved(coefficients: Array, middle: float, half: float) -> Array:
    """The polynomial of t as one of s, where t = middle + half s."""
    values = polynomial.polyval(middle + half * NODES, coefficients)
    return _through(np.asarray(values))


def roots(coefficients: Array) -> list[float]:
    """The real roots in [-1, 1] of a polynomial; none for a constant."""
    size = np.abs(coefficients)
    significant = np.flatnonzero(size > 1e-15 * size.max(initial=0.0))
    if len(significant) == 0 or significant[-1] == 0:
        return []
    found = polynomial.polyroots(coefficients[: significant[-1] + 1])
    real = found[np.abs(found.imag) < 1e-7].real
    return [float(t) for t in real if abs(t) <= 1.0]


def _through(values: Array) -> Array:
    """Coefficients of t^k (..., DEGREE + 1) of the polynomials through values at the nodes.

    Chebyshev coefficients that are rounding alone become 0: they would be large in the derivatives.
    """
    to_chebyshev, to_monomials = _bases()
    by_chebyshev = values @ to_chebyshev.T
    noise = 2e-15 * np.abs(values).max(axis=-1, keepdims=True)
    by_chebyshev[np.abs(by_chebyshev) < noise] = 0.0
    return np.asarray(by_chebyshev @ to_monomials.T)


@cache
def _bases() -> tuple[Array, Array]:
    """The matrices from values at the nodes to Chebyshev coefficients, and to those of t^k."""
    size = DEGREE + 1
    to_chebyshev = np.asarray(chebyshev.chebvander(NODES, DEGREE), dtype=np.float64).T
    to_chebyshev = to_chebyshev * (2.0 / size)
    to_chebyshev[0] *= 0.5
    to_monomials = np.zeros((size, size))
    for k in range(size):
        to_monomials[: k + 1, k] = chebyshev.cheb2poly(np.eye(size)[k, : k + 1])
    return np.asarray(to_chebyshev), to_monomials


def evaluate(formula: Formula, grades: Array) -> Array:
    """A formula at grades of any shape; InputError where it is not finite or no array."""
    try:
        with np.errstate(all="ignore"):  # what is not finite is found below
            values = np.asarray(formula(grades.ravel()), dtype=np.float64)
    except (TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"pace fails for an array of grades: {reason}; it must take an array and return one "
            "of the same shape, as NumPy's functions do"
        ) from None
    if values.shape not in ((grades.size,), ()):
        raise InputError(
            f"pace returns the shape {values.shape} for grades of shape {(grades.size,)}; it must "
            "return one pace for each grade"
        )
    values = np.broadcast_to(values, (grades.size,))
    if not np.isfinite(values).all():
        worst = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InputError(
            f"pace is {values[worst]} at the grade {grades.ravel()[worst]:.6g}; it must be finite "
            "in its range of grades, so narrow the range"
        )
    return values.reshape(grades.shape)


def fit(formula: Formula, breaks: Iterable[float]) -> Pieces:
    """A formula as polynomials, to ``PRECISION`` of its largest value on each piece.

    breaks : both ends of the range, 0, and where the formula has kinks or jumps. Others are found
    by halving, to 1e-12 or so, and then count as breaks too.
    """
    knots = np.unique(np.asarray(list(breaks), dtype=np.float64))
    pieces = _halved(formula, knots)
    found = _kinks(pieces)
    return _halved(formula, np.union1d(knots, found)) if len(found) else pieces


def _halved(formula: Formula, knots: Array) -> Pieces:
    """Polynomials on intervals that are halved until they agree with the formula."""
    finest = FINEST * (knots[-1] - knots[0])
    left, right = knots[:-1], knots[1:]
    done: list[tuple[Array, Array]] = []
    count = 0
    while len(left):
        middle, half = 0.5 * (left + right), 0.5 * (right - left)
        values = evaluate(formula, middle[:, None] + half[:, None] * NODES)
        coefficients = _through(values)
        expected = evaluate(formula, middle[:, None] + half[:, None] * CHECKS)
        errors = np.abs(coefficients @ polynomial.polyvander(CHECKS, DEGREE).T - expected)
        size = np.abs(expected).max(axis=1, keepdims=True)
        agrees = (errors <= ALLOWED * size).all(axis=1)
        at_jump = ~agrees & (right - left <= finest)  # a polynomial would swing past both sides
        coefficients[at_jump] = _linear(expected[at_jump, -2], expected[at_jump, -1])
        agrees |= at_jump
        done.append((left[agrees], coefficients[agrees]))
        count += len(left)
        if count > MOST_PIECES:
            raise InputError(
                f"pace takes more than {MOST_PIECES:,} polynomials of degree {DEGREE}; it is too "
                "rough: smooth it, or give it as a table of grades and paces"
            )
        left, right = (
            np.stack([left, middle], axis=1)[~agrees].ravel(),
            np.stack([middle, right], axis=1)[~agrees].ravel(),
        )
    starts = np.concatenate([starts for starts, _ in done])
    order = np.argsort(starts)
    coefficients = np.concatenate([part for _, part in done])[order]
    return Pieces(np.append(starts[order], knots[-1]), coefficients)


def _kinks(pieces: Pieces) -> list[float]:
    """The middle of the smallest piece in each group of pieces that are very small."""
    widths = np.diff(pieces.knots)
    small = widths < AT_KINK * math.fsum(widths)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], small, [False]]).astype(int)))
    groups = zip(edges[::2], edges[1::2], strict=True)
    smallest = [first + int(widths[first:last].argmin()) for first, last in groups]
    return [float(pieces.middles[k]) for k in smallest]
