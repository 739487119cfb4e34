"""Polylines of least energy, by Newton's method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..._kernels.geodesics import newton as kernels
from ...surface import Surface
from ...validation import Array
from .curve import spline_through

# Largest derivative of the energy at the path found, times the path's length on the plane, as a
# share of the energy: free of units.
STATIONARY = 1e-9
SETTLED = 1e-9  # largest move of Newton's method, as a share of a mean piece, at a minimum
ROUNDING = 1e-15  # of the energy: whether a step saves less only rounding decides
MOST_STEPS = 200
MOST_HALVINGS = 30

# One step moves no point farther than this many features of the surface, or this share of the
# path, whichever is more: the path is to settle where it lies, not behind the next hill.
FARTHEST_FEATURES = 2.0
FARTHEST_SHARE = 0.05


class Lifted(NamedTuple):
    """A polyline and what lies above it.

    energy : pieces times the sum of squared chords, each times its squared cost. It is least
    where the pieces are equally long and their sum, whose square it then is, is least.
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
        """Map units."""
        return float(np.hypot(self.strand.chords[:, 0], self.strand.chords[:, 1]).sum())


def lift(surface: Surface, points: Array) -> Lifted:
    """Points (m, 2), map units, unchecked: off its edge a surface is continued."""
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
    """Where Newton's method would have the inner points go."""

    definite: bool  # is the second derivative of the energy positive definite?
    derivative: Array  # (m - 2, 2), of the energy, map units
    move: Array  # (m - 2, 2), map units; a direction of negative curvature where it is not


def newton_step(strand: kernels.Strand, projectors: Array, curvature: float = 1.0) -> Step:
    """The step that makes the pull on every inner point normal to the surface.

    projectors : (m - 2, 2, 2), onto the moves that each point is free to make.
    curvature : 1 for Newton's step, 0 to leave out what layers and cost bend, which makes a
    step that always leads down.
    """
    count = len(projectors)
    space = kernels.Workspace(*np.empty((2, count, 2)), *np.empty((2, count, 2, 2)))
    definite = kernels.newton_step(strand, projectors, curvature, space)
    return Step(definite, 2.0 * (count + 1) * space.derivative, space.move)


def _descent_step(path: Lifted, projectors: Array) -> Step:
    """Newton's step; where the energy is not convex, one that leads down and off a saddle."""
    step = newton_step(path.strand, projectors)
    if not step.definite:
        plain = newton_step(path.strand, projectors, 0.0)
        way = -1.0 if np.vdot(step.move, step.derivative) > 0.0 else 1.0
        spacing = path.planar_length / (len(path.points) - 1)
        move = plain.move + way * (spacing / _largest(step.move)) * step.move
        step = Step(False, plain.derivative, move)
    return step


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def farthest_move(surface: Surface, length: float) -> float:
    """How far one step may move a point of a path of that length on the plane, map units."""
    return max(FARTHEST_FEATURES * surface.resolution, FARTHEST_SHARE * length)


def _is_minimum(step: Step, path: Lifted) -> bool:
    """Is this one, to the accuracy that Newton's method is run to?"""
    if not step.definite:
        return False
    if _largest(step.derivative) * path.planar_length <= STATIONARY * path.energy:
        return True
    saved = -0.5 * float(np.vdot(step.move, step.derivative))
    settled = SETTLED * path.planar_length / (len(path.points) - 1)
    return saved <= ROUNDING * path.energy or _largest(step.move) <= settled


def lower(surface: Surface, path: Lifted, projectors: Array) -> Lifted | None:
    """The path moved by the largest of the halved steps that lowers its energy, if any does.

    There is none at a minimum. projectors : (m - 2, 2, 2), onto the moves that each inner
    point is free to make.
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
    return None  # as low as rounding lets it be


def all_free(points: Array) -> Array:
    """(m - 2, 2, 2), the projectors of points that nothing holds but their ends."""
    return np.tile(np.eye(2), (len(points) - 2, 1, 1))


def settle(surface: Surface, points: Array) -> Array:
    """The path of least energy with as many points, near the given one, by Newton's method."""
    path, projectors = lift(surface, points), all_free(points)
    for _ in range(MOST_STEPS):
        found = lower(surface, path, projectors)
        if found is None:
            break
        path = found
    return path.points


def resample(points: Array, pieces: int) -> Array:
    """As many pieces, equal in the curve's parameter, of the smooth curve through the points."""
    return spline_through(points, 3)(np.linspace(0.0, 1.0, pieces + 1))


def shortest_polyline(surface: Surface, points: Array, pieces: tuple[int, ...]) -> Array:
    """The locally shortest polyline near the one given, (m, 2), map units.

    pieces : of the path, from coarse to fine; each number starts from the path of the one
    before, the first from the points.
    """
    for count in pieces:
        finer = points if len(points) == count + 1 else resample(points, count)
        points = settle(surface, finer)
    return points
