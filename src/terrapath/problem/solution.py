"""What is answered: the path, the solution, and how they were found."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import shapely

from ..surface import Surface, metric
from ..validation import Array

if TYPE_CHECKING:
    from .problem import Problem


# Points a path is cut into to add up climb and draw profiles, unless the surface is finer.
PROFILE_POINTS = 256


def sampled(points: Array, finest: float) -> Array:
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
        points = sampled(self.points, finest)
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


class Status(enum.Enum):
    """How a planner ended. An unreachable goal is a result, not an error."""

    SOLVED = "solved"
    NOT_FOUND = "not-found"
    UNREACHABLE = "unreachable"
    INTERRUPTED = "interrupted"

    @property
    def message(self) -> str:
        """What the status means, and what to do about it."""
        return _MESSAGES[self]


_MESSAGES = {
    Status.SOLVED: "a path was found",
    Status.NOT_FOUND: "no path was found within the limits: the goal may be enclosed, or more "
    "samples, a longer time limit or another step may find one",
    Status.UNREACHABLE: "no path exists: obstacles or no-data enclose the start or the goal",
    Status.INTERRUPTED: "stopped by the user; the path, if any, is the best so far",
}


# Why a path that was found is not returned.
TOUCHES = "the path found touches an obstacle"


class History(NamedTuple):
    """How the best cost fell during a search; an entry for each chunk of samples."""

    samples: Array  # (k,), drawn so far
    seconds: Array  # (k,), since the search began
    best_cost: Array  # (k,), map units, infinite before the first path


class SearchTree(NamedTuple):
    """The vertices of a tree planner, in the order in which they were added."""

    points: Array  # (n, 2), map units
    parents: npt.NDArray[np.int32]  # (n,), number of each one's parent, -1 at the start
    costs: Array  # (n,), cost from the start, map units

    @property
    def segments(self) -> Array:
        """(n - 1, 2, 2): each edge, from parent to child, map units."""
        children = np.flatnonzero(self.parents >= 0)
        return np.stack([self.points[self.parents[children]], self.points[children]], axis=1)


class Proof(Protocol):
    """What proves a lower bound: see ``terrapath.Certificate``."""

    @property
    def value(self) -> float:
        """The lower bound, map units."""

    def save(self, path: str | FilePath) -> None:
        """Write it, to be checked again."""

    def check(self, problem: Problem) -> float:
        """Prove it again; returns the lower bound. Raises CertificateError where it fails."""


class PlannedPart(Protocol):
    """The part of a map that was planned on: see ``terrapath.planners.corridor.Corridor``."""

    @property
    def half_width(self) -> float:
        """On both sides of the coarse route, map units."""

    @property
    def decimate(self) -> int:
        """How many cells of the map, on a side, became one for the coarse route."""

    @property
    def coarse_length(self) -> float:
        """Length of the coarse route, map units."""

    def least_length(self, solution: Solution) -> float | None:
        """No path on the whole map is shorter, map units; None where nothing is proven of it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """What a planner found.

    Lengths are in map units. ``path``, ``length`` and ``cost`` are None where no path was found.
    ``length`` is the true length of the path, whatever the planner minimised; ``cost`` is the
    planner's own measure of it. ``lower_bound`` is None where none was asked for.

    Every path is tested as a whole when the solution is made. One that touches an obstacle or
    leaves the bounds, if only by rounding, is led round the place, or left out.
    """

    problem: Problem  # as it was asked
    planner: str  # its name
    status: Status  # how the planner ended
    path: Path | None
    cost: float | None  # map units
    seconds: float  # planning took, with refinement and bound
    samples: int = 0  # samples drawn, nodes settled or rays traced
    seed: int | None = None  # None for planners that draw no random numbers
    stopped_by: str = ""  # what ended the search, in words
    lower_bound: float | None = None  # on the length of every path, map units
    alternatives: tuple[Path, ...] = ()  # further paths, shortest first
    unrefined: Path | None = None  # the planner's own path, where it was refined
    certificate: Proof | None = None  # the proof of the lower bound
    history: History | None = None  # of tree planners
    tree: SearchTree | None = None  # of tree planners
    counters: dict[str, int] = field(default_factory=dict)  # of vertices and edges, by name
    legs: tuple[Solution, ...] = ()  # of a tour, from each stop to the next
    options: dict[str, Any] = field(default_factory=dict)  # the planner's, as it was run
    corridor: PlannedPart | None = None  # the lower bound holds only in it; None for everywhere

    def __post_init__(self) -> None:
        unrefined, given = (_kept(self.problem, path) for path in (self.unrefined, self.path))
        kept = [_kept(self.problem, path) for path in self.alternatives]
        tested: dict[str, Any] = {
            "path": given or unrefined,
            "unrefined": unrefined,
            "alternatives": tuple(path for path in kept if path is not None),
        }
        if self.path is not None and tested["path"] is None:
            tested |= {"cost": None, "stopped_by": TOUCHES}
            if self.status is Status.SOLVED:
                tested["status"] = Status.NOT_FOUND
        for name, value in tested.items():
            object.__setattr__(self, name, value)

    @property
    def length(self) -> float | None:
        """True length of the path under h, map units, to 1e-9 relative."""
        return None if self.path is None else self.path.length

    @property
    def gap(self) -> float | None:
        """(length - lower_bound) / lower_bound; infinite where the lower bound is 0."""
        if self.length is None or self.lower_bound is None:
            return None
        if self.length == self.lower_bound:
            return 0.0
        if self.lower_bound == 0.0:
            return math.inf
        return (self.length - self.lower_bound) / self.lower_bound

    @property
    def stops(self) -> Array:
        """(k, 2): the start and the end of each leg, map units; start and goal without legs."""
        ends = [leg.problem.goal for leg in self.legs or (self,)]
        return np.array([self.problem.start, *ends])

    @property
    def straight_length(self) -> float:
        """Length on the surface of the straight lines from stop to stop, through all obstacles."""
        return sum(leg.problem.straight_length for leg in self.legs or (self,))

    @property
    def via(self) -> Array:
        """(k, 2): the stops between start and goal, map units; none where there is no path."""
        return self.stops[1:-1] if self.path is not None else np.empty((0, 2))

    @property
    def bound_in_words(self) -> str:
        """What the lower bound says, in words, such as "no path is shorter"."""
        which = " through these points" if self.legs else ""
        where = "" if self.corridor is None else " in the corridor"
        return f"no path{which}{where} is shorter"

    def __repr__(self) -> str:
        length = "no path" if self.length is None else f"length {self.length:.6f}"
        return (
            f"Solution({self.planner}: {self.status.value}, {length}, "
            f"{self.samples} samples, {self.seconds:.3f} s)"
        )


def _kept(problem: Problem, path: Path | None) -> Path | None:
    """The path where the problem allows it, or one beside it that is allowed, or None."""
    if path is None or problem.allows(path):
        return path
    from .mending import mended

    points = mended(problem.free_space, path.points)
    return None if points is None else Path(path.surface, points)
