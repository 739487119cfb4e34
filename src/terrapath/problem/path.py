"""A path: a polyline on the plane, the curve on the surface above it, and its relief."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from ..surface import Surface, metric
from ..surface.ground import Ground, ground_of, value_unit
from ..validation import Array

if TYPE_CHECKING:
    from ..space.free_space import FreeSpace
    from .pricing import Pricing

Indices: TypeAlias = npt.NDArray[np.intp]

# Points a path is cut into to add up climb and draw profiles, unless the surface is finer.
PROFILE_POINTS = 256
# Samples to each of the surface's features, and on the whole path at least.
PER_FEATURE = 8.0
LEAST_SAMPLES = 256
# Pieces whose slope is at least this share of the largest are looked at more closely.
NEAR_LARGEST = 0.9
# A grade this much beyond another, as a share, is no steeper: it comes from rounding.
ROUNDING_OF_GRADES = 1e-6
CLOSER = 16


def sampled(points: Array, finest: float) -> Array:
    """A polyline (m, 2) whose segments are cut into equal ones, no longer than ``finest``.

    Where ``finest`` is 0 the segments stay as they are.
    """
    counts, moves = _counts(points, finest), np.diff(points, axis=0)
    piece = np.repeat(np.arange(len(moves)), counts)
    place = np.arange(1, len(piece) + 1) - np.repeat(np.cumsum(counts) - counts, counts)
    # The share of the last point is exactly 1, despite rounding.
    shares = np.where(place == counts[piece], 1.0, place * (1.0 / counts)[piece])
    return np.concatenate([points[:1], points[piece] + shares[:, None] * moves[piece]])


def _counts(points: Array, finest: float) -> Indices:
    """(m - 1,): into how many pieces each segment is cut."""
    moves = np.diff(points, axis=0)
    sizes = np.hypot(*moves.T) / finest if finest > 0.0 else np.ones(len(moves))
    return np.maximum(np.ceil(sizes), 1.0).astype(np.intp)


@dataclass(frozen=True, eq=False)
class Path:
    """A polyline on the plane, and the curve on the surface above it.

    surface : the surface. points : (m, 2), map units, from start to goal. pricing : what it costs
    under a travel model; None without one.

    ``length`` is the length under h, with the weights and costs of all layers, and ``value`` is
    what is minimised: the length, or what the travel model makes of the path. The numbers for
    people are those on the ground, height at its true scale, in ``ground_unit``: metres on maps,
    else the unit of the map. Slopes are rise over horizontal distance: 1 is 45 degrees.
    """

    surface: Surface
    points: Array
    pricing: Pricing | None = field(default=None, repr=False)
    # Where it has been tested, so that it is tested once.
    _free_in: FreeSpace | None = field(default=None, init=False, repr=False)

    @cached_property
    def length(self) -> float:
        """True length under h, map units, to 1e-9 relative."""
        return metric.curve_length(self.surface, self.points)

    @cached_property
    def gauged(self) -> float:
        """What paths with the same ends are compared by, above 0; see ``TravelModel.gauge``.

        It is the value, without what the gauge of a travel model takes off between the ends.
        """
        return self.length if self.pricing is None else self.pricing.gauged(self.points)

    @property
    def value(self) -> float:
        """What is minimised, in ``unit``, to 1e-9 relative: the length, or the cost of travel.

        A travel model's best switchbacks are taken where the path is steeper than its critical
        grades.
        """
        if self.pricing is None:
            return self.length
        return self.gauged + self.pricing.taken_off(self.points[0], self.points[-1])

    @property
    def unit(self) -> str:
        """The unit of ``value``."""
        return value_unit(self.surface) if self.pricing is None else self.pricing.model.unit

    @cached_property
    def in_switchbacks(self) -> float:
        """The share of the path, on the plane, that is steeper than the travel model's grades.

        There the value is that of switchbacks at the critical grade. 0 without a travel model.
        """
        if self.pricing is None:
            return 0.0
        return share_outside(self.ground, self.points, self.pricing.model.critical)

    @cached_property
    def line(self) -> shapely.LineString:
        """The path on the plane, map units."""
        return shapely.LineString(self.points)

    @cached_property
    def profile(self) -> Profile:
        """The surface along the path, sampled finely enough to show every feature of it."""
        finest = min(0.25 * self.surface.resolution, self.line.length / PROFILE_POINTS)
        points = sampled(self.points, finest)
        corners = np.concatenate([[0], np.cumsum(_counts(self.points, finest))])
        points[corners] = self.points  # despite rounding
        under, pricing = self.ground.surface, self.pricing
        distance = _cumulative(under, points)
        if pricing is not None:
            value = pricing.values(points)
        else:
            value = distance if under is self.surface else _cumulative(self.surface, points)
        values, costs = self.surface.values(points), self.surface.cost_values(points)
        return Profile(points, corners, self.ground.metres * distance, value, values, costs)

    @cached_property
    def ground(self) -> Ground:
        """The ground under the path."""
        return ground_of(self.surface)

    @property
    def ground_unit(self) -> str:
        """The unit of lengths on the ground and of climb; empty where it is not known."""
        return self.ground.unit

    @cached_property
    def ground_length(self) -> float:
        """Length on the ground, without weights and costs, ground units, to 1e-9 relative."""
        under = self.ground.surface
        plain = under is self.surface
        length = self.length if plain else metric.curve_length(under, self.points)
        return self.ground.metres * length

    @cached_property
    def _relief(self) -> Relief:
        return relief_along(self.ground, self.points)

    @property
    def climb(self) -> float:
        """The sum of all rises along the path, ground units; 0 where no layer is the height."""
        return self._relief.climb

    @property
    def descent(self) -> float:
        """The sum of all falls along the path, ground units, above 0."""
        return self._relief.descent

    @property
    def steepest(self) -> float:
        """The largest grade in the direction of travel, uphill or downhill."""
        return self._relief.steepest

    @property
    def steepest_side(self) -> float:
        """The largest side slope: across the direction of travel, to the left or right."""
        return self._relief.steepest_side

    @cached_property
    def contributions(self) -> dict[str, float]:
        """How much of the length each part makes: shares that add up to 1, by their names.

        "plane" is the share of the movement on the plane, and each layer has its own. Without
        costs, a step ds under h is the sum of dx_i^2 / ds over all coordinates of R^n, one for
        each share. A cost layer's share is the length that it adds by its factor; it is negative
        where the factor is below 1. Several cost layers divide what they add by the logarithms
        of their factors.
        """
        surface, profile = self.surface, self.profile
        steps = np.diff(np.hstack([profile.points, profile.values * surface.data.weights]), axis=0)
        sizes = np.maximum(np.linalg.norm(steps, axis=1), 1e-300)
        parts = np.square(steps) / sizes[:, None]
        amounts = {"plane": float(parts[:, :2].sum())}
        for layer, part in zip(surface.layers, parts[:, 2:].T, strict=True):
            amounts[layer.name] = float(part.sum())
        if surface.costs:
            middles = 0.5 * (profile.points[1:] + profile.points[:-1])
            weights = np.array([layer.weight for layer in surface.costs])
            logs = weights * np.log(surface.cost_values(middles))
            total = logs.sum(axis=1)
            each = np.where(np.abs(total) > 1e-12, np.expm1(total) / (total + 1e-300), 1.0)
            for layer, log in zip(surface.costs, logs.T, strict=True):
                amounts[layer.name] = float((log * each * sizes).sum())
        whole = sum(amounts.values())
        if whole == 0.0:
            return dict.fromkeys(amounts, 0.0)
        return {name: amount / whole for name, amount in amounts.items()}


def _cumulative(surface: Surface, points: Array) -> Array:
    """(m,): length under h from the first point to each, map units."""
    steps = metric.segment_lengths(surface, points[:-1], points[1:])
    return np.concatenate([[0.0], np.cumsum(steps)])


class Profile(NamedTuple):
    """The surface along a path, sampled."""

    points: Array  # (m, 2), map units
    corners: Indices  # (k,), which of them are the points of the path
    distance: Array  # (m,), on the ground from the start, ground units
    value: Array  # (m,), what is minimised, from the start, in the path's ``unit``
    values: Array  # (m, layers), in the layers' units
    costs: Array  # (m, costs), the factors of the cost layers, without weights


# Climb, descent and slopes


class Relief(NamedTuple):
    """What a path does in height, on the ground."""

    climb: float  # all rises, in the ground's unit
    descent: float  # all falls, in the ground's unit
    steepest: float  # the largest grade in the direction of travel, up or down: rise over run
    steepest_side: float  # the largest slope across the direction of travel, rise over run


class Pieces(NamedTuple):
    """Short straight pieces of a path, and the ground at both ends of each."""

    ends: Array  # (2, m, 2), units of the plane
    heights: Array  # (2, m): at the start and the end, units of the plane
    gradients: Array  # (2, m, 2)

    @classmethod
    def of(cls, ground: Ground, ends: Array) -> Pieces:
        """The pieces between ends (2, m, 2)."""
        scale = ground.height_scale
        heights = scale * ground.surface.values(ends)[..., 0]
        return cls(ends, heights, scale * ground.surface.gradients(ends)[..., 0, :])

    @property
    def moves(self) -> Array:
        """(m, 2): from each start to its end."""
        return np.asarray(self.ends[1] - self.ends[0])

    @property
    def rises(self) -> tuple[Array, Array]:
        """Heights gained, and heights lost, in each piece.

        Where the slope changes its sign, the height between is that of the cubic with the heights
        and slopes at both ends (Hermite's).
        """
        start, end = self.heights
        change = end - start
        first, last = (self.gradients * self.moves).sum(axis=-1)
        c, d = 3.0 * change - 2.0 * first - last, first + last - 2.0 * change
        turns = first * last < 0.0
        # The slope is first + 2 c t + 3 d t^2; of its roots, one is within the piece.
        root = np.sqrt(np.maximum(c * c - 3.0 * d * first, 0.0))
        q = -(c + np.copysign(root, c))
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(np.abs(first / q - 0.5) <= 0.5, first / q, q / (3.0 * d))
            between = start + t * (first + t * (c + t * d))
        turning = np.where(turns & np.isfinite(between), between, start)
        up = np.maximum(turning - start, 0.0) + np.maximum(end - turning, 0.0)
        return up, up - change

    @property
    def slopes(self) -> Array:
        """(2, m): the largest slopes along and across each piece, at its ends."""
        ahead = self.moves / np.hypot(*self.moves.T)[:, None]
        across = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        found = [np.abs((self.gradients * u).sum(axis=-1)).max(axis=0) for u in (ahead, across)]
        return np.array(found)


def relief_along(ground: Ground, points: Array) -> Relief:
    """Climb, descent and the steepest slopes along a polyline (m, 2), units of the plane."""
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    if ground.height_scale == 0.0 or length == 0.0:
        return Relief(0.0, 0.0, 0.0, 0.0)
    finest = min(ground.surface.resolution / PER_FEATURE, length / LEAST_SAMPLES)
    samples = sampled(points, finest)
    moves = np.diff(samples, axis=0).any(axis=1)
    pieces = Pieces.of(ground, np.array([samples[:-1][moves], samples[1:][moves]]))
    up, down = pieces.rises
    along, across = (_largest(ground, pieces, k) for k in (0, 1))
    return Relief(ground.metres * float(up.sum()), ground.metres * float(down.sum()), along, across)


def share_outside(ground: Ground, points: Array, grades: tuple[float, float]) -> float:
    """The share of a polyline (m, 2), on the plane, whose grade is outside a range."""
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    if length == 0.0:
        return 0.0
    finest = min(ground.surface.resolution / PER_FEATURE, length / LEAST_SAMPLES)
    samples = sampled(points, finest)
    sizes = np.hypot(*np.diff(samples, axis=0).T)
    rises = np.diff(ground.height_scale * ground.surface.values(samples)[:, 0])
    low, high = (1.0 + ROUNDING_OF_GRADES) * np.array(grades)
    outside = (rises < low * sizes) | (rises > high * sizes)
    return float(sizes[outside].sum() / sizes.sum())


def _largest(ground: Ground, pieces: Pieces, which: int) -> float:
    """The largest slope along (0) or across (1) the pieces, those near it cut into shorter ones."""
    slopes = pieces.slopes[which]
    near = slopes >= NEAR_LARGEST * slopes.max()
    start, end = pieces.ends[:, near, None]
    shares = np.linspace(0.0, 1.0, CLOSER + 1)[:, None]
    cuts = (1.0 - shares) * start + shares * end  # (m, CLOSER + 1, 2), never beyond the ends
    shorter = np.array([cuts[:, :-1].reshape(-1, 2), cuts[:, 1:].reshape(-1, 2)])
    moves = (shorter[0] != shorter[1]).any(axis=1)
    closer = Pieces.of(ground, shorter[:, moves]).slopes[which]
    return float(max(slopes.max(), closer.max(initial=0.0)))
