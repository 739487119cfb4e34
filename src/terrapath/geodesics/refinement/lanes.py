"""Shortening a path on rough ground, where no smooth model of its length holds.

Every point has a few places around it, and the path over the best of them is found by dynamic
programming. Among the places are those that Newton's method proposes, on a quadratic through the
lengths of pieces between three places of each point; beside obstacles, their corners, too. Each
point has a reach, how far its places are from it: it follows the point's moves. The lengths of free
pieces decide, so the path never becomes longer and never leaves free space.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from ..._kernels.geodesics import lanes as kernels
from ..._support.watching import MustStop, never
from ...problem import Problem
from ...surface.metric import feature_size
from ...validation import Array
from .newton import along
from .walls import corners_near

# The spacing of points, stage by stage, in features of the surface; and a stage is over where the
# path gains less than this share of its length, round after round.
STAGES = ((0.5, 1e-4), (0.25, 1e-4), (0.125, 1e-5), (0.0625, 1e-6))
COARSE = STAGES[:2]
PATIENCE, MOST_ROUNDS = 4, 24
MOST_POINTS = 16_384

# The reach of a point, in spacings: at first, and at most. The least, in features, is far above
# rounding.
FIRST_REACH, MOST_REACH = 0.1, 1.0
LEAST_REACH, ROUNDING = 1e-5, 1e-7
# Where a point moves, its reach becomes the length of that move, within these factors; where it
# stays, the reach shrinks.
SHRINKS, GROWS, STAYS = 0.25, 1.5, 0.4

# Newton's method moves a point by at most so many reaches; a second place is so far on the way.
FARTHEST, PART = 8.0, 0.3

# A stage gains about a quarter to a half of what the one before gained, so all that follow gain no
# more than this many times what it did, and a little: a share for each feature between points.
HOPE, MORE = 1.5, 0.02
# A share of the length that is worth a word.
MUCH = 0.01

# One rule measures at most this much, in features.
LONGEST = 0.25
# Corners of obstacles are looked for so near to the path, in features.
BESIDE = 4.0

Flags = npt.NDArray[np.uint8]


class Shortened(NamedTuple):
    """A path that was shortened.

    points : (k, 2), map units. remains : what finer points would gain, as a share of its length.
    is_hopeless : was it left, because it cannot become shorter than its rival?
    """

    points: Array
    remains: float
    is_hopeless: bool = False

    @property
    def is_settled(self) -> bool:
        """Would finer points hardly gain anything?"""
        return self.remains < MUCH

    @property
    def remark(self) -> str:
        """What to say of a path that is not settled."""
        share = "an unknown share" if math.isinf(self.remains) else f"about {self.remains:.0%}"
        return (
            f"a path was refined in part: the ground is so rough between its samples that {share} "
            "more may be gained; smooth the surface, or lower its weights"
        )


def shortened(
    problem: Problem,
    points: Array,
    must_stop: MustStop = never,
    stages: Sequence[tuple[float, float]] = STAGES,
    rival: float = math.inf,
) -> Shortened:
    """A shorter path near the one given, on any ground; where it must stop, as far as it is.

    points : (m, 2), map units, through free space. stages : as of ``STAGES``; with fewer the path
    is found sooner and longer. rival : the length of a path that this one competes with, map units;
    a path that cannot become shorter than that is left.
    """
    ground, given, remains = _Ground.of(problem, points), points, math.inf
    for spacing, least_gain in stages:
        finer = ground.subdivided(points, spacing)
        if len(finer) > MOST_POINTS:
            remains = math.inf
            break
        if must_stop():
            break
        stage = _Stage(ground, finer, spacing)
        points = stage.settled(least_gain, must_stop)
        if stage.length * (1.0 - HOPE * stage.gain - MORE * spacing) > rival:
            return Shortened(given, math.inf, is_hopeless=True)
        # Halved spacings gain a quarter of what those before gained.
        remains = max(stage.gain / 3.0, ground.gain_by_bending(points))
    if is_passed_otherwise(ground.corners, given, points):
        return Shortened(given, math.inf)
    return Shortened(points, remains)


def is_passed_otherwise(places: Array, a: Array, b: Array) -> bool:
    """Do two paths (m, 2) from one start to one goal pass any of the places (c, 2) differently?

    Together they wind round such a place: a ray from there crosses them to and fro unequally.
    """
    loop = np.concatenate([a, b[-2:0:-1]])
    after = np.roll(loop, -1, axis=0)
    for x, y in places:
        up = (loop[:, 1] <= y) & (after[:, 1] > y)
        down = (loop[:, 1] > y) & (after[:, 1] <= y)
        crossing = np.flatnonzero(up | down)
        (ax, ay), (bx, by) = loop[crossing].T, after[crossing].T
        right = ax + (y - ay) / (by - ay) * (bx - ax) > x
        if up[crossing][right].sum() != down[crossing][right].sum():
            return True
    return False


@dataclass(frozen=True)
class _Ground:
    """A problem near a path.

    size : (2,), of its features along each axis, map units. bends : (c, 2), where a path bends
    round the obstacles' corners (c, 2).
    """

    problem: Problem
    size: Array
    frame: kernels.Frame
    bends: Array
    corners: Array
    tree: shapely.STRtree

    @classmethod
    def of(cls, problem: Problem, points: Array) -> _Ground:
        size = np.array(feature_size(problem.priced))
        frame = kernels.Frame(*problem.bounds, *(LONGEST * size).tolist())
        bends, corners = corners_near(problem.free_space, points, BESIDE * float(size.max()))
        tree = shapely.STRtree(shapely.points(bends / size))
        return cls(problem, size, frame, bends, corners, tree)

    @property
    def least_reach(self) -> float:
        """In features; below this rounding decides which place is better."""
        largest = float(np.abs(self.problem.bounds).max())
        return max(LEAST_REACH, ROUNDING * math.sqrt(largest / float(self.size.min())))

    def subdivided(self, points: Array, spacing: float) -> Array:
        """The path with points at most a spacing apart, in features.

        They are evenly spaced where that makes it no longer, and it stays free.
        """
        scaled = points / self.size
        sizes = np.hypot(*np.diff(scaled, axis=0).T)
        even = along(scaled, max(math.ceil(sizes.sum() / spacing), 2)) * self.size
        even[[0, -1]] = points[[0, -1]]
        given = self.problem.path(points)
        if self.problem.allows(even) and self.problem.path(even).gauged <= given.gauged:
            return even
        counts = np.maximum(np.ceil(sizes / spacing - 1e-9), 1).astype(np.int64)
        first = np.repeat(np.cumsum(counts) - counts, counts)
        shares = ((np.arange(counts.sum()) - first) / np.repeat(counts, counts))[:, None]
        begins, ends = (np.repeat(ends, counts, axis=0) for ends in (points[:-1], points[1:]))
        return np.concatenate([(1.0 - shares) * begins + shares * ends, points[-1:]])

    def fill(self, lanes: kernels.Lanes, changed: Flags) -> None:
        """Measure the pieces between places beside the points that have changed."""
        surface, space = self.problem.priced.data, self.problem.free_space.data
        kernels.fill_table(surface, space, self.frame, lanes, changed)

    def gain_by_bending(self, points: Array) -> float:
        """By what share a path would be shorter if its pieces bent between their ends."""
        length = self.problem.path(points).gauged
        return 1.0 - float(kernels.bent_length(self.problem.priced.data, points)) / length

    def bends_beside(self, points: Array, distance: float) -> Array:
        """The nearest bend (m, 2) to each point within a distance in features; else NaN."""
        found = np.full_like(points, math.nan)
        near, bend = self.tree.query_nearest(
            shapely.points(points / self.size), max_distance=distance, all_matches=False
        )
        found[near] = self.bends[bend]
        return found


def _lanes(points: int, lanes: int) -> kernels.Lanes:
    return kernels.Lanes(
        np.full((points, lanes, 2), math.nan),
        np.full((points - 1, lanes, lanes), math.inf),
        np.empty((points, lanes)),
        np.empty((points, lanes), np.int64),
    )


@dataclass
class _Stage:
    """A path with a number of points that does not change, and their places.

    reaches : (m,), in features. around : the places around each point. ahead : the best of those,
    and what Newton's method proposes. beside : (m,), is a place of the point not free? changed,
    before : (m,), which points have new places, in this round and the one before. length : of the
    path, map units. gain : of the whole stage, as a share of the length.
    """

    ground: _Ground
    points: Array
    spacing: float
    reaches: Array = field(init=False)
    around: kernels.Lanes = field(init=False)
    ahead: kernels.Lanes = field(init=False)
    beside: npt.NDArray[np.bool_] = field(init=False)
    changed: Flags = field(init=False)
    before: Flags = field(init=False)
    length: float = math.inf
    gain: float = 0.0

    def __post_init__(self) -> None:
        count = len(self.points)
        self.reaches = np.full(count, FIRST_REACH * self.spacing)
        self.around, self.ahead = _lanes(count, 6), _lanes(count, 4)
        self.beside = np.zeros(count, np.bool_)
        self.changed = self.before = np.ones(count, np.uint8)

    def settled(self, least_gain: float, must_stop: MustStop) -> Array:
        """The points (m, 2) after rounds of moves."""
        slow, first = 0, 0.0
        for _ in range(MOST_ROUNDS):
            shorter = self.improve()
            first = first or shorter
            slow = slow + 1 if shorter > (1.0 - least_gain) * self.length else 0
            self.length = shorter
            if slow == PATIENCE or must_stop():
                break
        self.gain = 1.0 - self.length / first
        return self.points

    def improve(self) -> float:
        """Move the points; returns the path's length, map units."""
        count = np.arange(len(self.points))
        choices, steps = np.empty(len(count), np.int64), np.empty(len(count))
        across = self.place_around()
        self.ground.fill(self.around, self.changed)
        kernels.choose(self.around, choices)
        kernels.newton(self.around.table, np.empty((2, len(count))), steps)
        step = np.clip(steps, -FARTHEST, FARTHEST)[:, None] * across
        places = self.ahead.places
        places[:, 0], places[:, 1] = self.points, self.around.places[count, choices]
        places[:, 2], places[:, 3] = self.points + step, self.points + PART * step
        places[self.changed == 0, 1:] = math.nan
        places[choices == 0, 1] = places[steps == 0.0, 2:] = math.nan  # where a point would stay
        self.ground.fill(self.ahead, self.changed | self.before)
        length = kernels.choose(self.ahead, choices)
        self.move(places[count, choices])
        return float(length)

    def place_around(self) -> Array:
        """Places to both sides of each point; beside obstacles along the path, and at corners.

        Returns the vectors (m, 2) to one side, map units.
        """
        pieces = np.diff(self.points, axis=0) / self.ground.size
        pieces /= np.maximum(np.hypot(*pieces.T), 1e-300)[:, None]
        ahead = np.zeros_like(self.points)
        ahead[1:-1] = pieces[1:] + pieces[:-1]
        ahead *= (self.reaches / np.maximum(np.hypot(*ahead.T), 1e-300))[:, None]
        across = np.column_stack([-ahead[:, 1], ahead[:, 0]]) * self.ground.size
        ahead *= self.ground.size
        places, beside = self.around.places, np.flatnonzero(self.beside)
        places[:, 0], places[:, 3:] = self.points, math.nan
        places[:, 1], places[:, 2] = self.points + across, self.points - across
        if len(beside):
            here = self.points[beside]
            places[beside, 3], places[beside, 4] = here + ahead[beside], here - ahead[beside]
            places[beside, 5] = self.ground.bends_beside(here, self.spacing)
        return across

    def move(self, places: Array) -> None:
        """Move the points to places (m, 2), and let their reaches follow."""
        sizes = np.hypot(*((places - self.points) / self.ground.size).T)
        followed = np.clip(sizes, SHRINKS * self.reaches, GROWS * self.reaches)
        reaches = np.where(sizes == 0.0, STAYS * self.reaches, followed)
        reaches = np.clip(reaches, self.ground.least_reach, MOST_REACH * self.spacing)
        beside = self.are_beside_obstacles()
        moves = (sizes > 0.0) | (reaches != self.reaches) | (beside != self.beside)
        changed = moves.copy()  # the sides of a point depend on those next to it
        changed[1:] |= moves[:-1]
        changed[:-1] |= moves[1:]
        self.before, self.changed = self.changed, changed.astype(np.uint8)
        self.points, self.reaches, self.beside = places.copy(), reaches, beside

    def are_beside_obstacles(self) -> npt.NDArray[np.bool_]:
        """(m,): is a piece between places to the sides not free?"""
        blocked = np.isinf(self.around.table[:, :3, :3])
        blocked[0, 1:], blocked[-1, :, 1:] = False, False
        pieces = blocked.any(axis=(1, 2))
        beside = np.zeros(len(self.points), np.bool_)
        beside[1:] |= pieces
        beside[:-1] |= pieces
        return beside
