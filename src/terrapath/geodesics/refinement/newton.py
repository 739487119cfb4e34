"""Polylines of least energy, by Newton's method, and their correction to the exact geodesic.

The error of the vertices of a polyline of least energy falls with the square of their spacing. On a
geodesic of constant speed the acceleration in R^n is normal to the surface, apart from a part that
the slope of the cost makes. Differences of fourth order measure that acceleration with an error
that falls with the fourth power of the spacing. The matrix of Newton's step for the polyline then
corrects the vertices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._kernels.geodesics import newton as kernels
from ..._kernels.geodesics.curves import fill_basis, solve_banded
from ..._kernels.geodesics.paced import PacedStrand
from ..._kernels.travel.priced import is_directed
from ..._support.watching import MustStop, never
from ...surface import Surface
from ...validation import Array
from .paced import paced_strand, softened, split_parameters

# At a minimum the derivative of the energy, times the path's length on the plane, is at most this
# share of the energy. It has no unit.
STATIONARY = 1e-9
SETTLED = 1e-9  # at a minimum a step is at most this share of a mean piece
ROUNDING = 1e-15  # of the energy; a step that saves less may save nothing but rounding
MOST_STEPS = 200
MOST_HALVINGS = 30

# A step moves no point farther than this many features of the surface or this share of the path,
# whichever is more. So the path stays on its side of a hill.
FARTHEST_FEATURES = 2.0
FARTHEST_SHARE = 0.05

FEWEST_PIECES = 7  # that the differences need
MOST_CORRECTIONS = 12
CORRECTED = 1e-10  # the largest correction of the last round, as a share of the path's length

_CENTRAL = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
_BESIDE_END = np.array([10.0, -15.0, -4.0, 14.0, -6.0, 1.0]) / 12.0
_CENTRAL_SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
_SLOPE_BESIDE_END = np.array([-3.0, -10.0, 18.0, -6.0, 1.0, 0.0]) / 12.0

# Where the path is straight, points are placed at this share of the mean density.
LEAST_DENSITY = 0.1
SAMPLES_PER_PIECE = 4
MOST_POINTS = 8192


class Lifted(NamedTuple):
    """A polyline, with what kernels need to know of the surface above it.

    strand : what kernels read and write. energy : the number of pieces times the sum of squared
    chords, each times its squared cost. It is least where the pieces are equally long and the
    polyline is shortest; then it is the square of the length.
    """

    strand: kernels.Strand | PacedStrand
    energy: float

    @property
    def points(self) -> Array:
        """(m, 2), map units."""
        points: Array = self.strand.points
        return points

    @property
    def planar_length(self) -> float:
        """The length on the plane, map units."""
        return float(np.hypot(self.strand.chords[:, 0], self.strand.chords[:, 1]).sum())


def lift(surface: Surface, points: Array) -> Lifted:
    """The polyline through points (m, 2), map units; beyond its edge a surface is extrapolated."""
    if is_directed(surface.data):
        paced = paced_strand(surface, points)
        return Lifted(paced, kernels.lift(surface.data, paced))
    m, layers = len(points), len(surface.layers)
    strand = kernels.Strand(
        points,
        surface.data.weights,
        np.empty((m, layers, 6)),
        np.empty((m, 6)),
        np.empty((m - 1, 2 + layers)),
        np.empty(m - 1),
        np.empty((m - 2, 2 + layers)),
        np.empty((m - 2, 2)),
    )
    return Lifted(strand, kernels.lift(surface.data, strand))


class Step(NamedTuple):
    """A step of Newton's method for the inner points of a polyline."""

    definite: bool  # is the second derivative of the energy positive definite?
    derivative: Array  # (m - 2, 2), of the energy, map units
    move: Array  # (m - 2, 2), map units; where not definite, a direction of negative curvature


def newton_step(
    strand: kernels.Strand | PacedStrand, projectors: Array, curvature: float = 1.0
) -> Step:
    """The step after which the pull on every inner point is normal to the surface.

    projectors : (m - 2, 2, 2), onto the moves that each point is free to make.
    curvature : 1 for Newton's step; 0 leaves out the curvature of layers and cost, so that the
    step always lowers the energy.
    """
    count = len(projectors)
    space = kernels.Workspace(*np.empty((2, count, 2)), *np.empty((2, count, 2, 2)))
    definite = kernels.newton_step(strand, projectors, curvature, space)
    return Step(definite, 2.0 * (count + 1) * space.derivative, space.move)


def _descent_step(path: Lifted, projectors: Array) -> Step:
    """Newton's step; where the energy is not convex, a step that lowers it and leaves a saddle."""
    step = newton_step(path.strand, projectors)
    if not step.definite:
        plain = newton_step(path.strand, projectors, 0.0)
        sign = -1.0 if np.vdot(step.move, step.derivative) > 0.0 else 1.0
        spacing = path.planar_length / (len(path.points) - 1)
        move = plain.move + sign * (spacing / _largest(step.move)) * step.move
        step = Step(False, plain.derivative, move)
    return step


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def farthest_move(surface: Surface, length: float) -> float:
    """How far a step may move a point, map units. length : of the path on the plane."""
    return max(FARTHEST_FEATURES * surface.resolution, FARTHEST_SHARE * length)


def _is_minimum(step: Step, path: Lifted) -> bool:
    """Is the path at a minimum of the energy, within the tolerances above?"""
    if not step.definite:
        return False
    if _largest(step.derivative) * path.planar_length <= STATIONARY * path.energy:
        return True
    saved = -0.5 * float(np.vdot(step.move, step.derivative))
    settled = SETTLED * path.planar_length / (len(path.points) - 1)
    return saved <= ROUNDING * path.energy or _largest(step.move) <= settled


def lower(surface: Surface, path: Lifted, projectors: Array) -> Lifted | None:
    """The path after a step that lowers its energy; None at a minimum.

    The step is halved until it lowers the energy. projectors : (m - 2, 2, 2), onto the moves that
    each inner point is free to make.
    """
    step = _descent_step(path, projectors)
    if _is_minimum(step, path):
        return None
    farthest = farthest_move(surface, path.planar_length)
    move = min(1.0, farthest / max(_largest(step.move), 1e-300)) * step.move
    for halvings in range(MOST_HALVINGS):
        points = path.points.copy()
        points[1:-1] += 0.5**halvings * move
        tried = lift(surface, points)
        if tried.energy < path.energy:
            return tried
    return None  # rounding lets no step lower it


def all_free(points: Array) -> Array:
    """(m - 2, 2, 2), the projectors where all inner points may move freely."""
    return np.tile(np.eye(2), (len(points) - 2, 1, 1))


def settle(surface: Surface, points: Array, must_stop: MustStop = never) -> Array:
    """The path of least energy near points (m, 2), with as many points, by Newton's method.

    Where it must stop, the path so far.
    """
    projectors = all_free(points)
    for ground in softened(surface) if is_directed(surface.data) else (surface,):
        path = lift(ground, points)
        for _ in range(MOST_STEPS):
            found = None if must_stop() else lower(ground, path, projectors)
            if found is None:
                break
            path = found
        points = path.points
    return points


def resample(points: Array, pieces: int) -> Array:
    """``pieces`` + 1 points of the smooth curve through points, at equal steps of its parameter."""
    return spline_through(points, 3)(np.linspace(0.0, 1.0, pieces + 1))


def shortest_polyline(
    surface: Surface, points: Array, pieces: tuple[int, ...], must_stop: MustStop = never
) -> Array:
    """The locally shortest polyline near the one given, (m, 2), map units.

    pieces : numbers of pieces, from coarse to fine. The first stage starts from the points given,
    each other one from the path of the stage before. must_stop : ends it with the path so far.
    """
    for count in pieces:
        if must_stop():
            break
        finer = points if len(points) == count + 1 else resample(points, count)
        points = settle(surface, finer, must_stop)
    return points


# Correction of fourth order


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


def _of_fourth_order(path: kernels.Strand) -> kernels.Strand:
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
    between the vertices for that, and under a pace.
    """
    if len(points) <= FEWEST_PIECES or is_directed(surface.data):
        return None
    projectors = all_free(points)
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    last = farthest_move(surface, length)
    points = points.copy()
    for _ in range(MOST_CORRECTIONS):
        strand = lift(surface, points).strand
        assert isinstance(strand, kernels.Strand)
        step = newton_step(_of_fourth_order(strand), projectors)
        size = float(np.abs(step.move).max())
        if not step.definite or not size < last:
            return None
        points[1:-1] += step.move
        if size <= CORRECTED * length:
            break
        last = size
    return points


# Points along the geodesic


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
    if is_directed(surface.data):
        return split_parameters(surface, curve, pieces, tolerance, MOST_POINTS)
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


@dataclass(frozen=True)
class Curve:
    """A B-spline curve in the plane, with a parameter from 0 to 1.

    Its curves are the same as those of SciPy's ``make_interp_spline``, whose import takes longer
    than a plan.

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
