"""What is answered: the path, the solution, and how they were found."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ..surface.ground import is_weighted
from ..validation import Array
from .path import Path

if TYPE_CHECKING:
    from .problem import Problem


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
    Status.UNREACHABLE: "no path exists",
    Status.INTERRUPTED: "stopped by the user; the path, if any, is the best so far",
}


# A gap above this proves little, and is called so.
LARGE_GAP = 0.1

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
    cost: float | None  # in ``unit``
    seconds: float  # planning took, with refinement and bound
    samples: int = 0  # samples drawn, nodes settled or rays traced
    seed: int | None = None  # None for planners that draw no random numbers
    stopped_by: str = ""  # what ended the search, in words
    lower_bound: float | None = None  # on the value of every path, in ``unit``
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
    def is_interrupted(self) -> bool:
        """Did the user stop the planner?"""
        return self.status is Status.INTERRUPTED

    @property
    def value(self) -> float | None:
        """What is minimised, measured on the path returned, in ``unit``, to 1e-9 relative."""
        return None if self.path is None else self.path.value

    @property
    def relaxed_value(self) -> float | None:
        """The value with the best switchbacks of the travel model, which the bound is compared to.

        Switchbacks are not laid out, so it is the value.
        """
        return self.value

    @property
    def unit(self) -> str:
        """The unit of ``value``: the travel model's; without one that of the map.

        It is "weighted m" with weights, layers or costs.
        """
        return self.problem.unit

    @property
    def gap(self) -> float | None:
        """(value - lower_bound) / lower_bound; infinite where the lower bound is 0.

        Where energy is gained on the way, the bound is below 0, and its size counts.
        """
        if self.value is None or self.lower_bound is None:
            return None
        if self.value == self.lower_bound:
            return 0.0
        if self.lower_bound == 0.0:
            return math.inf
        return (self.value - self.lower_bound) / abs(self.lower_bound)

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
    def straight_value(self) -> float:
        """The value of those lines, in ``unit``."""
        return sum(leg.problem.straight_value for leg in self.legs or (self,))

    @property
    def via(self) -> Array:
        """(k, 2): the stops between start and goal, map units; none where there is no path."""
        return self.stops[1:-1] if self.path is not None else np.empty((0, 2))

    @property
    def bound_in_words(self) -> str:
        """What the lower bound says, in words, such as "no path is shorter"."""
        which = " through these points" if self.legs else ""
        where = "" if self.corridor is None else " in the corridor"
        verb = "costs less" if self.is_weighted else "is shorter"
        return f"no path{which}{where} {verb}"

    @property
    def is_weighted(self) -> bool:
        """Is the value something else than the length on the ground?"""
        return self.problem.pricing is not None or is_weighted(self.problem.surface)

    @property
    def gap_in_words(self) -> str:
        """The gap in percent, and what a large one means; empty where there is none."""
        if self.gap is None:
            return ""
        if math.isinf(self.gap):
            return "infinite: nothing is proven, because the lower bound is 0"
        text = f"{100.0 * self.gap:.3g} %"
        if self.gap <= LARGE_GAP:
            return text
        less = "cost {} less" if self.is_weighted else "be {} shorter"
        saving = less.format(f"{100.0 * self.gap / (1.0 + self.gap):.3g} %")
        return f"{text}, which proves little: the best path may {saving}"

    def __repr__(self) -> str:
        if self.value is None:
            value = "no path"
        elif self.problem.travel is None:
            value = f"length {self.value:.6f}"
        else:
            value = f"{self.value:.6f} {self.unit}"
        return (
            f"Solution({self.planner}: {self.status.value}, {value}, "
            f"{self.samples} samples, {self.seconds:.3f} s)"
        )


def _kept(problem: Problem, path: Path | None) -> Path | None:
    """The path where the problem allows it, or one beside it that is allowed, or None."""
    space = problem.free_space
    if path is None or path._free_in is space:
        return path
    kept: Path | None = path
    if not problem.allows(path):
        from .mending import mended

        points = mended(space, path.points)
        kept = None if points is None else Path(path.surface, points, path.pricing)
    if kept is not None:
        object.__setattr__(kept, "_free_in", space)
    return kept
