"""Polylines of least energy, by Newton's method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..._kernels.geodesics import newton as kernels
from ...surface import Surface
from ...validation import Array
from .curve import spline_through

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


class Lifted(NamedTuple):
    """A polyline, with what kernels need to know of the surface above it.

    strand : what kernels read and write. energy : the number of pieces times the sum of squared
    chords, each times its squared cost. It is least where the pieces are equally long and the
    polyline is shortest; then it is the square of the length.
    """

    strand: kernels.Strand
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


def newton_step(strand: kernels.Strand, projectors: Array, curvature: float = 1.0) -> Step:
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


def settle(surface: Surface, points: Array) -> Array:
    """The path of least energy near points (m, 2), with as many points, by Newton's method."""
    path, projectors = lift(surface, points), all_free(points)
    for _ in range(MOST_STEPS):
        found = lower(surface, path, projectors)
        if found is None:
            break
        path = found
    return path.points


def resample(points: Array, pieces: int) -> Array:
    """``pieces`` + 1 points of the smooth curve through points, at equal steps of its parameter."""
    return spline_through(points, 3)(np.linspace(0.0, 1.0, pieces + 1))


def shortest_polyline(surface: Surface, points: Array, pieces: tuple[int, ...]) -> Array:
    """The locally shortest polyline near the one given, (m, 2), map units.

    pieces : numbers of pieces, from coarse to fine. The first stage starts from the points given,
    each other one from the path of the stage before.
    """
    for count in pieces:
        finer = points if len(points) == count + 1 else resample(points, count)
        points = settle(surface, finer)
    return points
