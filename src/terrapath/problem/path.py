"""A path on a surface: its true length, its profile, and the parts that add up to its length."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from ..surface import Surface, metric
from ..validation import Array

# Points a path is cut into to add up climb and draw profiles, unless the surface is finer.
PROFILE_POINTS = 256


def _sampled(points: Array, finest: float) -> Array:
    """A polyline (m, 2) whose segments are cut into equal ones, no longer than ``finest``.

    Where ``finest`` is 0 the segments stay as they are.
    """
    moves = np.diff(points, axis=0)
    sizes = np.hypot(*moves.T) / finest if finest > 0.0 else np.ones(len(moves))
    counts = np.maximum(np.ceil(sizes), 1.0).astype(np.intp)
    piece = np.repeat(np.arange(len(moves)), counts)
    place = np.arange(1, len(piece) + 1) - np.repeat(np.cumsum(counts) - counts, counts)
    # The last point is exactly the segment's end, despite rounding.
    shares = np.where(place == counts[piece], 1.0, place * (1.0 / counts)[piece])
    return np.concatenate([points[:1], points[piece] + shares[:, None] * moves[piece]])


@dataclass(frozen=True, eq=False)
class Path:
    """A polyline on the plane, and the curve on the surface above it.

    surface : the surface. points : (m, 2), map units, from start to goal.
    """

    surface: Surface
    points: Array

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
        points = _sampled(self.points, finest)
        steps = metric.segment_lengths(self.surface, points[:-1], points[1:])
        distance = np.concatenate([[0.0], np.cumsum(steps)])
        values, costs = self.surface.values(points), self.surface.cost_values(points)
        return Profile(points, distance, values, costs)

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

    @cached_property
    def climb(self) -> float:
        """The sum of all rises of the first layer along the path, in the layer's unit."""
        rises = np.diff(self.profile.values[:, 0])
        return float(rises[rises > 0.0].sum())


class Profile(NamedTuple):
    """The surface along a path, sampled."""

    points: Array  # (m, 2), map units
    distance: Array  # (m,), length under h from the start, map units
    values: Array  # (m, layers), in the layers' units
    costs: Array  # (m, costs), the factors of the cost layers, without weights
