"""Smooth curves through points.

They are those of SciPy's ``make_interp_spline``, whose import would take longer than a plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._kernels.geodesics.curves import fill_basis, solve_banded
from ...validation import Array


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
        nearby = self.coefficients.take(first[:, None] + np.arange(self.degree + 1), axis=0)
        return np.asarray(np.einsum("mk,mka->ma", weights, nearby))

    def _slope(self) -> Curve:
        k, knots = self.degree, self.knots
        spans = (knots[k + 1 : -1] - knots[1 : -k - 1])[:, None]
        return Curve(k - 1, knots[1:-1], k * np.diff(self.coefficients, axis=0) / spans)


def _basis(knots: Array, degree: int, shares: Array) -> tuple[NDArray[np.int64], Array]:
    """The first of the B-splines that are not 0 at each share, and the values of all of them."""
    first, weights = np.empty(len(shares), np.int64), np.empty((len(shares), degree + 1))
    fill_basis(knots, degree, shares, first, weights)
    return first, weights


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
    row = np.arange(len(points))[:, None]
    rows[row, degree + first[:, None] + np.arange(degree + 1) - row] = weights
    solve_banded(rows, coefficients)
    return Curve(degree, knots, coefficients)
