"""Paths with as many points as the map has detail, for files that people read.

Douglas and Peucker's algorithm (1973) on the lifted curve: of each stretch, the sample that is
farthest from the straight line in space is kept, until all samples left out are near enough.
A line is also divided where it is not free, and as long as the path's length changes too much.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..space.free_space import FreeSpace
from ..surface import Surface, metric
from ..validation import Array
from .path import Indices, Path
from .problem import Problem

# The default tolerance, in cells.
TOLERANCE_CELLS = 0.1
# The length on the ground changes by no more than this share.
LENGTH_KEPT = 9e-5


def default_tolerance(problem: Problem) -> float:
    """A tenth of the map's cell, map units; where there are no cells, of the finest feature."""
    return TOLERANCE_CELLS * cell_size(problem)


def cell_size(problem: Problem) -> float:
    """A cell of the map, map units; where there are no cells, the finest feature."""
    surface, size = problem.surface, problem.surface.resolution
    if surface.cells is not None and surface.fit.smoothing is not None:
        size = min(size, surface.cells.dx, surface.cells.dy)  # features are larger than cells
    return size if math.isfinite(size) else min(problem.default_spacing)


def simplified(
    problem: Problem, path: Path, tolerance: float, stops: Array, *, longest: float = math.inf
) -> Indices:
    """Which samples of a path's profile to write, in their order.

    path : as the problem allows it. tolerance : no sample left out is farther from the lines
    between those kept, map units, heights at their true scale. stops (k, 2) : points that are kept.
    longest : of the lines, on the plane, map units. The lines touch no obstacle, as the problem's
    free space finds.
    """
    samples, limits = _Samples.of(path, stops), _Limits(problem.free_space, tolerance, longest)
    candidates = np.arange(len(samples.places))
    while True:
        part = samples.chosen(candidates)
        kept = candidates[_divided(part, limits)]
        blocked = ~limits.space.segments_are_free(*samples.ends(kept))
        if not blocked.any():
            return kept
        # Within rounding of an obstacle, the samples of an edge may touch what the edge does not.
        edges = np.searchsorted(path.profile.corners, candidates, side="right")
        within = np.isin(edges, edges[np.searchsorted(candidates, kept[:-1][blocked])])
        dropped = within & ~np.isin(candidates, path.profile.corners)
        if not dropped.any():
            return path.profile.corners
        candidates = candidates[~dropped]


class _Samples(NamedTuple):
    """Samples of a path."""

    ground: Surface  # under which the length is kept
    places: Array  # (m, 2), map units
    lifted: Array  # (m, 3), heights at their true scale
    lengths: Array  # (m,), on the ground from the start, map units
    fixed: npt.NDArray[np.bool_]  # (m,), which ones must be kept

    @classmethod
    def of(cls, path: Path, stops: Array) -> _Samples:
        profile, ground = path.profile, path.ground
        heights = ground.height_scale * ground.surface.values(profile.points)[:, 0]
        fixed = (profile.points[:, None] == stops).all(axis=-1).any(axis=1)
        fixed[[0, -1]] = True
        return cls(
            ground.surface,
            profile.points,
            np.column_stack([profile.points, heights]),
            profile.distance / ground.metres,
            fixed,
        )

    def ends(self, kept: Indices) -> tuple[Array, Array]:
        """Where the lines between samples that are kept start and end."""
        return self.places[kept[:-1]], self.places[kept[1:]]

    def chosen(self, which: Indices) -> _Samples:
        """Some of the samples."""
        return _Samples(
            self.ground,
            self.places[which],
            self.lifted[which],
            self.lengths[which],
            self.fixed[which],
        )


class _Limits(NamedTuple):
    """What the lines between samples that are kept must keep to."""

    space: FreeSpace
    tolerance: float  # map units
    longest: float  # map units

    def are_broken(self, a: Array, b: Array, off: Array) -> npt.NDArray[np.bool_]:
        """(m,): which lines from a to b, the path so far off them, are not allowed."""
        broken = (off > self.tolerance) | (np.hypot(*(b - a).T) > self.longest)
        return np.asarray(broken | ~self.space.segments_are_free(a, b))


def _divided(samples: _Samples, limits: _Limits) -> Indices:
    """The samples between which straight lines keep to the limits, and keep the path's length."""
    kept = np.flatnonzero(samples.fixed)
    while True:
        far, off = _farthest(samples.lifted, kept)
        divisible = np.diff(kept) > 1
        divided = divisible & limits.are_broken(*samples.ends(kept), off)
        if not divided.any():
            divided = divisible & _change_length(samples, kept)
        if not divided.any():
            return kept
        kept = np.sort(np.concatenate([kept, far[divided]]))


def _farthest(lifted: Array, kept: Indices) -> tuple[Indices, Array]:
    """For each line between samples that are kept: the sample farthest from it, and how far."""
    first, counts = kept[:-1], np.diff(kept)
    line = np.repeat(np.arange(len(first)), counts)
    start, move = lifted[first], np.diff(lifted[kept], axis=0)
    away = lifted[kept[0] : kept[-1]] - start[line]
    squares = np.maximum((move * move).sum(axis=1), 1e-300)
    share = np.clip((away * move[line]).sum(axis=1) / squares[line], 0.0, 1.0)
    off = np.linalg.norm(away - share[:, None] * move[line], axis=1)
    largest = np.maximum.reduceat(off, first - kept[0])
    at = np.flatnonzero(off == largest[line])
    _, one = np.unique(line[at], return_index=True)
    far = at[one] + kept[0]
    # Where all samples are on the line, the one in the middle.
    return np.where(largest > 0.0, far, first + counts // 2), largest


def _change_length(samples: _Samples, kept: Indices) -> npt.NDArray[np.bool_]:
    """The lines that change the length most, if all of them together change it too much."""
    along = metric.segment_lengths(samples.ground, *samples.ends(kept))
    change = np.abs(along - np.diff(samples.lengths[kept]))
    order = np.argsort(-change, kind="stable")
    # What is left after the first, the first two, ... of them.
    left = change.sum() - np.cumsum(change[order])
    allowed = LENGTH_KEPT * samples.lengths[-1]
    worst = np.zeros(len(change), bool)
    if change.sum() > allowed:
        worst[order[: int(np.argmax(left <= allowed)) + 1]] = True
    return worst & (change > 0.0)
