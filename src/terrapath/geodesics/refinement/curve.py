"""Smooth curves through points.

They are the same as those of SciPy's ``make_interp_spline``, whose import takes longer than a plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._kernels.geodesics.curves import fill_basis, solve_banded
from ...validation import Array


@dataclass(frozen=True)
class Curve:
    """A B-spline curve in the plane, with a parameter from 0 to 1.

    knots : (m + degree + 1,), rising from 0 to 1. coefficients : (m, 2), map units.
    """

    degree: int
    knots: Array
    coefficients: Array

    def __call__(self, parameters: Array, derivative: int = 0) -> Array:
        """The points (m, 2) at parameters (m,), or a derivative there."""
        if derivative:
            return self._slope()(parameters, derivative - 1)
        first, weights = _basis(self.knots, self.degree, parameters)
        nearby = self.coefficients.take(first[:, None] + np.arange(self.degree + 1), axis=0)
        return np.asarray(np.einsum("mk,mka->ma", weights, nearby))

    def _slope(self) -> Curve:
        k, knots = self.degree, self.knots
        spans = (knots[k + 1 : -1] - knots[1 : -k - 1])[:, None]
        return Curve(k - 1, knots[1:-1], k * np.diff(self.coefficients, axis=0) / spans)


def _basis(knots: Array, degree: int, parameters: Array) -> tuple[NDArray[np.int64], Array]:
    """The first of the B-splines that are not 0 at each parameter, and all their values."""
    count = len(parameters)
    first, weights = np.empty(count, np.int64), np.empty((count, degree + 1))
    fill_basis(knots, degree, parameters, first, weights)
    return first, weights


def spline_through(points: Array, degree: int) -> Curve:
    """The curve through points (m, 2) at equal steps of its parameter.

    degree : odd; lower where there are too few points for it. The pieces of the spline join at the
    points, except for those next to the ends.
    """
    pieces = len(points) - 1
    degree = min(degree, pieces)
    parameters = np.linspace(0.0, 1.0, pieces + 1)
    beside = (degree + 1) // 2
    inner = parameters[beside : beside + pieces - degree]
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    first, weights = _basis(knots, degree, parameters)
    rows, coefficients = np.zeros((len(points), 2 * degree + 1)), np.array(points)
    row = np.arange(len(points))[:, None]
    rows[row, degree + first[:, None] + np.arange(degree + 1) - row] = weights
    solve_banded(rows, coefficients)
    return Curve(degree, knots, coefficients)


def curve_through(points: Array) -> Curve:
    """The smooth curve through vertices (m, 2), with a parameter from 0 to 1."""
    return spline_through(points, 5 if len(points) > 6 else 3)


def along(points: Array, pieces: int) -> Array:
    """Points (pieces + 1, 2) at equal distances along a polyline on the plane."""
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    places = np.linspace(0.0, reached[-1], pieces + 1)
    return np.column_stack([np.interp(places, reached, axis) for axis in points.T])
