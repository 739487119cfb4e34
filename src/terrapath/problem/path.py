"""A path on a surface: its true length, its profile, and what its length is made of."""

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
    """A polyline (m, 2) with its pieces cut into equal ones that are no longer than ``finest``.

    They stay as they are where that is 0.
    """
    moves = np.diff(points, axis=0)
    sizes = np.hypot(*moves.T) / finest if finest > 0.0 else np.ones(len(moves))
    counts = np.maximum(np.ceil(sizes), 1.0).astype(np.intp)
    piece = np.repeat(np.arange(len(moves)), counts)
    place = np.arange(1, len(piece) + 1) - np.repeat(np.cumsum(counts) - counts, counts)
    # The last place is the piece's end, whatever rounding makes of the share.
    shares = np.where(place == counts[piece], 1.0, place * (1.0 / counts)[piece])
    return np.concatenate([points[:1], points[piece] + shares[:, None] * moves[piece]])


@dataclass(frozen=True, eq=False)
class Path:
    """A polyline of the plane, read as a curve on the surface above it.

    points : (m, 2), map units, from start to goal.
    """

    surface: Surface
    points: Array

    @cached_property
    def length(self) -> float:
        """True length under h, map units, to 1e-9 relative."""
        return metric.curve_length(self.surface, self.points)

    @cached_property
    def line(self) -> shapely.LineString:
        """The path on the plane."""
        return shapely.LineString(self.points)

    @cached_property
    def profile(self) -> Profile:
        """The path sampled finely enough to see every feature of the surface."""
        finest = min(0.25 * self.surface.resolution, self.line.length / PROFILE_POINTS)
        points = _sampled(self.points, finest)
        steps = metric.segment_lengths(self.surface, points[:-1], points[1:])
        distance = np.concatenate([[0.0], np.cumsum(steps)])
        values, costs = self.surface.values(points), self.surface.cost_values(points)
        return Profile(points, distance, values, costs)

    @cached_property
    def contributions(self) -> dict[str, float]:
        """What makes up the length: shares that add up to 1, by the profile.

        A step ds under h without costs is the sum of dx_i^2 / ds over all coordinates of R^n:
        "plane" is the share of the plane's, and each layer has its own. Costs have what they
        multiply the length by on top, which is below 0 where that is below 1; several divide it
        by their logarithms.
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
        """Sum of all rises of the first layer along the path, in its unit."""
        rises = np.diff(self.profile.values[:, 0])
        return float(rises[rises > 0.0].sum())


class Profile(NamedTuple):
    """What a traveller meets along a path."""

    points: Array  # (m, 2), map units
    distance: Array  # (m,) length from the start under h, map units
    values: Array  # (m, layers), in the layers' units
    costs: Array  # (m, costs): what the cost layers multiply lengths by, weights left out
