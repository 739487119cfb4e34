"""Climb, descent and slopes along a path on the ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..surface.ground import Ground
from ..validation import Array
from .path import sampled

# Samples to each of the surface's features, and on the whole path at least.
PER_FEATURE = 8.0
LEAST_SAMPLES = 256
# Pieces whose slope is at least this share of the largest are looked at more closely.
NEAR_LARGEST = 0.9
CLOSER = 16


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
