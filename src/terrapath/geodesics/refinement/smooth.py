"""From a polyline of least energy to the exact geodesic, and points along it.

The error of the vertices of a polyline of least energy falls with the square of their spacing. On a
geodesic of constant speed the acceleration in R^n is normal to the surface, apart from a part that
the slope of the cost makes. Differences of fourth order measure that acceleration with an error
that falls with the fourth power of the spacing. The matrix of Newton's step for the polyline then
corrects the vertices.
"""

from __future__ import annotations

import math

import numpy as np

from ..._kernels.geodesics.newton import Strand
from ...surface import Surface
from ...validation import Array
from .curve import Curve, spline_through
from .newton import all_free, farthest_move, lift, newton_step

FEWEST_PIECES = 7  # that the differences need
MOST_CORRECTIONS = 12
CORRECTED = 1e-10  # the largest correction of the last round, as a share of the path's length

# Where the path is straight, points are placed at this share of the mean density.
LEAST_DENSITY = 0.1
SAMPLES_PER_PIECE = 4
MOST_POINTS = 8192

_CENTRAL = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
_BESIDE_END = np.array([10.0, -15.0, -4.0, 14.0, -6.0, 1.0]) / 12.0
_CENTRAL_SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
_SLOPE_BESIDE_END = np.array([-3.0, -10.0, 18.0, -6.0, 1.0, 0.0]) / 12.0


def _differences(above: Array, central: Array, beside_end: Array, sign: float) -> Array:
    """Differences of fourth order at the inner points, (m, n) -> (m - 2, n).

    sign : 1 or -1, the factor on the differences when the order of the points is reversed.
    """
    found = np.empty((len(above) - 2, above.shape[1]))
    windows = (above[k : len(above) - 4 + k] for k in range(5))
    found[1:-1] = sum(w * part for w, part in zip(central, windows, strict=True))
    found[0] = beside_end @ above[:6]
    found[-1] = sign * (beside_end @ above[:-7:-1])
    return found


def _of_fourth_order(path: Strand) -> Strand:
    """The strand with the pull and the drift of the curve through its points."""
    above = np.hstack([path.points, path.jets[:, :, 0] * path.weights])
    second = _differences(above, _CENTRAL, _BESIDE_END, 1.0)
    first = _differences(above, _CENTRAL_SLOPE, _SLOPE_BESIDE_END, -1.0)
    cost, slope = path.costs[1:-1, :1], path.costs[1:-1, 1:3]
    along = (slope * first[:, :2]).sum(axis=1)[:, None]
    drift = 0.5 * np.square(first).sum(axis=1)[:, None] * slope
    return path._replace(pull=-(cost * second + along * first), drift=drift)


def correct(surface: Surface, points: Array) -> Array | None:
    """The vertices (m, 2) of a polyline of least energy, moved onto the geodesic.

    Their error falls with the fourth power of their spacing. None where the surface is too rough
    between the vertices for that.
    """
    if len(points) <= FEWEST_PIECES:
        return None
    projectors = all_free(points)
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    last = farthest_move(surface, length)
    points = points.copy()
    for _ in range(MOST_CORRECTIONS):
        step = newton_step(_of_fourth_order(lift(surface, points).strand), projectors)
        size = float(np.abs(step.move).max())
        if not step.definite or not size < last:
            return None
        points[1:-1] += step.move
        if size <= CORRECTED * length:
            break
        last = size
    return points


def curve_through(points: Array) -> Curve:
    """The smooth curve through vertices (m, 2), with a parameter from 0 to 1."""
    return spline_through(points, 5 if len(points) > 6 else 3)


def _measured(surface: Surface, points: Array, v: Array) -> tuple[Array, Array]:
    """|v|_h and det h, both (m,), at points (m, 2)."""
    path = lift(surface, points).strand
    slopes = path.jets[:, :, 1:3] * path.weights[:, None]
    h = path.costs[:, 0, None, None] * (np.eye(2) + np.einsum("mka,mkb->mab", slopes, slopes))
    determinant = h[:, 0, 0] * h[:, 1, 1] - h[:, 0, 1] ** 2
    return np.sqrt(np.einsum("ma,mab,mb->m", v, h, v)), determinant


def placed_parameters(surface: Surface, curve: Curve, pieces: int, tolerance: float) -> Array:
    """The curve's parameters at the points of a polyline, both ends included.

    tolerance : by which the polyline is longer than the geodesic, relative. Let a piece have the
    planar length d and the direction u, and let the curve turn by c per unit of length there.
    The piece is too long by det h / h(u, u)^(3/2) c^2 d^3 / 24. pieces : of the curve; each is
    sampled.
    """
    t = np.linspace(0.0, 1.0, SAMPLES_PER_PIECE * pieces + 1)
    v, bend = curve(t, 1), curve(t, 2)
    speed, determinant = _measured(surface, curve(t), v)
    turning = v[:, 0] * bend[:, 1] - v[:, 1] * bend[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        density = np.cbrt(np.nan_to_num(determinant * turning**2 / (24.0 * speed**3)))
    total, length = np.trapezoid(density, t), np.trapezoid(speed, t)
    if not (total > 0.0 and length > 0.0):
        return np.array([0.0, 1.0])
    count = math.ceil(math.sqrt(total**3 / (tolerance * length)))
    density = np.maximum(density, LEAST_DENSITY * total)
    reached = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    count = min(math.ceil(count * reached[-1] * (t[1] / total)), MOST_POINTS)
    return np.asarray(np.interp(np.linspace(0.0, reached[-1], count + 1), reached, t))
