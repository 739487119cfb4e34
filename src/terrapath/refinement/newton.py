"""Polylines of least energy, by Newton's method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._kernels import refinement as kernels
from .._kernels.surfaces import fill_jets, fill_log_costs
from ..surface import Surface
from ..validation import Array
from .curve import spline_through

STATIONARY = 1e-9  # largest derivative of the energy, as a share of it, at the path found
SETTLED = 1e-9  # largest move of Newton's method, as a share of a mean piece, at a minimum
MOST_STEPS = 200
MOST_HALVINGS = 30

# One step moves no point farther than this many features of the surface, or this share of the
# path, whichever is more: the path is to settle where it lies, not behind the next hill.
FARTHEST_FEATURES = 2.0
FARTHEST_SHARE = 0.05


class Lifted(NamedTuple):
    """Points of the plane and what lies above them."""

    points: Array  # (m, 2), map units
    jets: Array  # (m, layers, 6): each layer's value, gradient and second derivatives
    above: Array  # (m, n): the points of R^n, layers weighted
    costs: Array  # (m, 6): the jet of the squared cost

    @property
    def chords(self) -> Array:
        """(m - 1, n)."""
        return np.diff(self.above, axis=0)

    @property
    def stiffness(self) -> Array:
        """(m - 1,): the mean of the squared costs at the ends of each piece."""
        return np.asarray(0.5 * (self.costs[1:, 0] + self.costs[:-1, 0]))

    @property
    def energy(self) -> float:
        """Pieces times the sum of squared chords, each times its squared cost.

        Least where the pieces are equally long and their sum, whose square it then is, is least.
        """
        squares = np.square(self.chords).sum(axis=1)
        return len(squares) * float((self.stiffness * squares).sum())

    @property
    def pull(self) -> Array:
        """(m - 2, n): the sum of the chords that leave each inner point, stiff, times -1."""
        return -np.diff(self.stiffness[:, None] * self.chords, axis=0)

    @property
    def drift(self) -> Array:
        """(m - 2, 2): half the energy's derivative by the cost at each inner point."""
        squares = np.square(self.chords).sum(axis=1)
        return np.asarray(0.25 * self.costs[1:-1, 1:3] * (squares[1:] + squares[:-1])[:, None])


def lift(surface: Surface, points: Array) -> Lifted:
    """Points (m, 2), map units, unchecked: off its edge a surface is continued."""
    jets = np.empty((len(points), len(surface.layers), 6))
    fill_jets(surface.data, points, jets)
    above = np.hstack([points, jets[:, :, 0] * surface.data.weights])
    return Lifted(points, jets, above, _squared_costs(surface, points))


def _squared_costs(surface: Surface, points: Array) -> Array:
    """(m, 6): the jet of c^2 = exp(2 log c) at points (m, 2)."""
    logs = np.empty((len(points), 6))
    fill_log_costs(surface.data, points, logs)
    value, x, y, xx, xy, yy = 2.0 * logs.T
    parts = (np.ones_like(x), x, y, xx + x * x, xy + x * y, yy + y * y)
    return np.ascontiguousarray((np.exp(value) * np.stack(parts)).T)


class Step(NamedTuple):
    """Where Newton's method would have the inner points go."""

    definite: bool  # is the second derivative of the energy positive definite?
    derivative: Array  # (m - 2, 2), of the energy, map units
    move: Array  # (m - 2, 2), map units; a direction of negative curvature where it is not


def newton_step(
    surface: Surface,
    path: Lifted,
    pull: Array,
    drift: Array,
    projectors: Array,
    curvature: float = 1.0,
) -> Step:
    """The step that makes the pull on every inner point normal to the surface.

    drift : (m - 2, 2), what the cost adds to the pull on the plane.
    projectors : (m - 2, 2, 2), onto the moves that each point is free to make.
    curvature : 1 for Newton's step, 0 to leave out what layers and cost bend, which makes a
    step that always leads down.
    """
    count = len(pull)
    derivative, move = np.empty((count, 2)), np.empty((count, 2))
    pivots, links = np.empty((count, 2, 2)), np.empty((count, 2, 2))
    strand = kernels.Strand(
        path.jets[1:-1], surface.data.weights, path.costs[1:-1], path.chords, path.stiffness
    )
    definite = kernels.newton_step(
        strand, pull, drift, projectors, curvature, pivots, links, derivative, move
    )
    return Step(definite, 2.0 * (count + 1) * derivative, move)


def descent_step(surface: Surface, path: Lifted, projectors: Array) -> Step:
    """Newton's step; where the energy is not convex, one that leads down and off a saddle."""
    step = newton_step(surface, path, path.pull, path.drift, projectors)
    if not step.definite:
        plain = newton_step(surface, path, path.pull, path.drift, projectors, 0.0)
        way = -1.0 if np.vdot(step.move, step.derivative) > 0.0 else 1.0
        size = _spacing(path.points) / np.abs(step.move).max()
        move = plain.move + way * size * step.move
        step = Step(False, plain.derivative, move)
    return step


def _spacing(points: Array) -> float:
    """Mean length of the pieces on the plane, map units."""
    return float(np.hypot(*np.diff(points, axis=0).T).mean())


def farthest_move(surface: Surface, points: Array) -> float:
    """How far one step may move a point, map units."""
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    return max(FARTHEST_FEATURES * surface.resolution, FARTHEST_SHARE * length)


def is_stationary(step: Step, path: Lifted) -> bool:
    """Is this a minimum, to the accuracy that Newton's method is run to?"""
    if len(step.move) == 0:
        return True
    if not step.definite:
        return False
    small = float(np.abs(step.derivative).max()) <= STATIONARY * path.energy
    return small or float(np.abs(step.move).max()) <= SETTLED * _spacing(path.points)


def lower(surface: Surface, path: Lifted, move: Array) -> Lifted | None:
    """The path moved by the largest of the halved steps that lowers its energy, if any does."""
    share = min(1.0, farthest_move(surface, path.points) / max(float(np.abs(move).max()), 1e-300))
    energy = path.energy
    for halvings in range(MOST_HALVINGS):
        points = path.points.copy()
        points[1:-1] += share * 0.5**halvings * move
        tried = lift(surface, points)
        if tried.energy < energy:
            return tried
    return None  # as low as rounding lets it be


def settle(surface: Surface, points: Array) -> Array:
    """The path of least energy with as many points, near the given one, by Newton's method."""
    path = lift(surface, points)
    projectors = np.tile(np.eye(2), (len(points) - 2, 1, 1))
    for _ in range(MOST_STEPS):
        step = descent_step(surface, path, projectors)
        if is_stationary(step, path):
            break
        found = lower(surface, path, step.move)
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
