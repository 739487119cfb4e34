"""A path: a polyline on the plane, and the curve on the surface above it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from ..surface import Surface, metric
from ..surface.ground import Ground, ground_of
from ..validation import Array

if TYPE_CHECKING:
    from ..space.free_space import FreeSpace
    from .relief import Relief

Indices: TypeAlias = npt.NDArray[np.intp]

# Points a path is cut into to add up climb and draw profiles, unless the surface is finer.
PROFILE_POINTS = 256


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

    surface : the surface. points : (m, 2), map units, from start to goal.

    ``length`` is what is minimised, with the weights and costs of all layers. The numbers for
    people are those on the ground, height at its true scale, in ``ground_unit``: metres on maps,
    else the unit of the map. Slopes are rise over horizontal distance: 1 is 45 degrees.
    """

    surface: Surface
    points: Array
    # Where it has been tested, so that it is tested once.
    _free_in: FreeSpace | None = field(default=None, init=False, repr=False)

    @cached_property
    def length(self) -> float:
        """True length under h, map units, to 1e-9 relative."""
        return metric.curve_length(self.surface, self.points)

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
        value = _cumulative(self.surface, points)
        under = self.ground.surface
        distance = value if under is self.surface else _cumulative(under, points)
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
        from .relief import relief_along

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
    value: Array  # (m,), length under h from the start, map units
    values: Array  # (m, layers), in the layers' units
    costs: Array  # (m, costs), the factors of the cost layers, without weights
