"""What is answered: status, path, bound, and how they were found."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..validation import Array
from .path import Path
from .problem import Problem


class Status(enum.Enum):
    """How a planner ended. An unreachable goal is a result, not an error."""

    SOLVED = "solved"
    NOT_FOUND = "not-found"
    UNREACHABLE = "unreachable"
    INTERRUPTED = "interrupted"

    @property
    def message(self) -> str:
        """What it means and what to do about it."""
        return _MESSAGES[self]


_MESSAGES = {
    Status.SOLVED: "a path was found",
    Status.NOT_FOUND: "no path was found within the limits: the goal may be enclosed, or more "
    "samples, a longer time limit or another step may find one",
    Status.UNREACHABLE: "no path exists: obstacles or no-data enclose the start or the goal",
    Status.INTERRUPTED: "stopped by the user; the path, if any, is the best so far",
}


class History(NamedTuple):
    """How the best cost fell, one entry a chunk of samples."""

    samples: Array  # (k,)
    seconds: Array  # (k,)
    best_cost: Array  # (k,), map units, infinite before the first path


class SearchTree(NamedTuple):
    """The vertices of a tree planner."""

    points: Array  # (n, 2), map units
    parents: np.ndarray[Any, np.dtype[np.int32]]  # (n,), -1 at the start
    costs: Array  # (n,), map units

    @property
    def segments(self) -> Array:
        """(n - 1, 2, 2): each edge from parent to child."""
        children = np.flatnonzero(self.parents >= 0)
        return np.stack([self.points[self.parents[children]], self.points[children]], axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """What a planner found.

    Lengths are in map units. ``length`` is the true length of the path whatever the
    planner optimised; ``cost`` is what the planner itself believed. ``path``, ``length``
    and ``cost`` are None where no path was found, and so is a bound not asked for.
    ``alternatives`` are further paths that the planner found, shortest first. Where the path
    was refined, ``unrefined`` is the planner's own. ``certificate`` proves the lower bound.
    """

    problem: Problem
    planner: str
    status: Status
    path: Path | None
    cost: float | None
    seconds: float
    samples: int = 0
    seed: int | None = None
    stopped_by: str = ""
    lower_bound: float | None = None
    alternatives: tuple[Path, ...] = ()
    unrefined: Path | None = None
    certificate: Any = None
    history: History | None = None
    tree: SearchTree | None = None
    counters: dict[str, int] = field(default_factory=dict)
    legs: tuple[Solution, ...] = ()  # of a tour, from each waypoint to the next
    options: dict[str, Any] = field(default_factory=dict)  # of the planner, as it was run
    corridor: Any = None  # where alone the lower bound holds; None for everywhere

    @property
    def length(self) -> float | None:
        """True length of the path under h, to 1e-9 relative."""
        return None if self.path is None else self.path.length

    @property
    def gap(self) -> float | None:
        """(length - lower_bound) / lower_bound; infinite where nothing above 0 is proven."""
        if self.length is None or self.lower_bound is None:
            return None
        if self.length == self.lower_bound:
            return 0.0
        if self.lower_bound == 0.0:
            return math.inf
        return (self.length - self.lower_bound) / self.lower_bound

    @property
    def stops(self) -> Array:
        """(k, 2): the start and where each leg ends, map units; two points without legs."""
        ends = [leg.problem.goal for leg in self.legs or (self,)]
        return np.array([self.problem.start, *ends])

    @property
    def straight_length(self) -> float:
        """Length on the surface of the straight ways from stop to stop, obstacles or not."""
        return sum(leg.problem.straight_length for leg in self.legs or (self,))

    @property
    def via(self) -> Array:
        """(k, 2): stops of the route between start and goal, map units; none without a route."""
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
