"""Smooth curves through points.

They are those of SciPy's ``make_interp_spline``, whose import would take longer than a plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._kernels.banded import solve_banded
from ..validation import Array


@dataclass(frozen=True)
class Curve:
    """A B-spline of the share of the way.

    knots : (m + degree + 1,), rising from 0 to 1. coefficients : (m, 2), map units.
    """

    degree: int
    knots: Array
    coefficients: Array

    def __call__(self, shares: Array, derivative: int = 0) -> Array:
        """The points (m, 2) at shares (m,) of the way, or a derivative there by the share."""
        if derivative:
            return self._slope()(shares, derivative - 1)
        first, weights = _basis(self.knots, self.degree, shares)
        parts = (w[:, None] * self.coefficients[first + k] for k, w in enumerate(weights))
        return np.asarray(sum(parts))

    def _slope(self) -> Curve:
        k, knots = self.degree, self.knots
        spans = (knots[k + 1 : -1] - knots[1 : -k - 1])[:, None]
        return Curve(k - 1, knots[1:-1], k * np.diff(self.coefficients, axis=0) / spans)


def _basis(knots: Array, degree: int, shares: Array) -> tuple[NDArray[np.intp], list[Array]]:
    """The first of the B-splines that are not 0 at each share, and the values of all of them."""
    last = len(knots) - degree - 2
    piece = np.clip(np.searchsorted(knots, shares, side="right") - 1, degree, last)
    weights = [np.ones(len(shares))]
    # Cox and de Boor: each of one degree is shared between two of the next.
    for d in range(1, degree + 1):
        raised = [np.zeros(len(shares)) for _ in range(d + 1)]
        for k, weight in enumerate(weights):
            left, right = knots[piece - d + 1 + k], knots[piece + 1 + k]
            share = weight / (right - left)
            raised[k] += (right - shares) * share
            raised[k + 1] += (shares - left) * share
        weights = raised
    return piece - degree, weights


def spline_through(points: Array, degree: int) -> Curve:
    """The curve through points (m, 2) at equal shares of the way.

    degree : odd; of fewer points than it takes, as high as they let it be. Pieces join at the
    points, but not at those beside the ends.
    """
    pieces = len(points) - 1
    degree = min(degree, pieces)
    shares = np.linspace(0.0, 1.0, pieces + 1)
    beside = (degree + 1) // 2
    inner = shares[beside : beside + pieces - degree]
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    first, weights = _basis(knots, degree, shares)
    rows, coefficients = np.zeros((len(points), 2 * degree + 1)), np.array(points)
    for k, weight in enumerate(weights):
        rows[np.arange(len(points)), degree + first + k - np.arange(len(points))] = weight
    solve_banded(rows, coefficients)
    return Curve(degree, knots, coefficients)
