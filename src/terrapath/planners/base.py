"""What every planner offers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

from ..problem import Problem, Solution, Status
from ..space.lattice import Lattice

# What a planner says that did not have to search.
SEPARATED = "start and goal lie in different parts of the free space"


# What a solution says that Ctrl-C ended.
INTERRUPT = "interrupt"

# Where no path is found the lattice may be too coarse for a gap: so often it is made finer.
HALVINGS = 2

# What a planner is at.
SEARCHING, REFINING, PROVING = "searching", "refining the path", "proving the bound"


class Progress(NamedTuple):
    """Where a running planner stands."""

    samples: int
    total: int
    seconds: float
    best_cost: float  # map units, infinite before the first path
    lower_bound: float = 0.0  # map units, 0 before one is proven
    stage: str = SEARCHING
    leg: str = ""  # of a tour, in words
    unit: str = ""  # of costs and bounds, where there is one

    @property
    def gap(self) -> float:
        """(best_cost - lower_bound) / lower_bound, infinite before both are known."""
        if self.lower_bound <= 0.0:
            return math.inf
        return (self.best_cost - self.lower_bound) / self.lower_bound


# Called now and then while a planner runs; returning True stops it.
Callback = Callable[[Progress], bool | None]


class Stopper:
    """The clock and the callback of a run, and which of them ended it."""

    def __init__(self, callback: Callback | None, time_limit: float | None) -> None:
        self.callback, self.time_limit = callback, time_limit
        self.started = time.perf_counter()
        self.stopped_by = ""

    @property
    def seconds(self) -> float:
        """Since the run began."""
        return time.perf_counter() - self.started

    def must_stop(self, progress: Progress) -> bool:
        """Show the progress to the callback and look at the clock; once True, always True."""
        if self.callback is not None and self.callback(progress):
            self.stopped_by = "callback"
        elif self.time_limit is not None and progress.seconds >= self.time_limit:
            self.stopped_by = "time limit"
        return bool(self.stopped_by)


class Planner(Protocol):
    """A frozen set of options that turns problems into solutions."""

    @property
    def name(self) -> str:
        """The planner's name on the command line."""

    def solve(self, problem: Problem, *, callback: Callback | None = None) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True."""


def stay_put(problem: Problem, planner: str, seed: int | None = None) -> Solution:
    """The answer where the start is the goal: a path of length 0."""
    return Solution(
        problem=problem,
        planner=planner,
        status=Status.SOLVED,
        path=problem.path([problem.start, problem.goal]),
        cost=0.0,
        seconds=0.0,
        seed=seed,
        stopped_by="start is goal",
    )


def without_path(
    problem: Problem,
    planner: str,
    status: Status,
    stopped_by: str,
    *,
    seconds: float = 0.0,
    seed: int | None = None,
) -> Solution:
    """The answer where nothing was searched, and there is no path."""
    return Solution(
        problem=problem,
        planner=planner,
        status=status,
        path=None,
        cost=None,
        seconds=seconds,
        seed=seed,
        stopped_by=stopped_by,
    )


def answer_without_search(
    problem: Problem, planner: str, seed: int | None = None
) -> Solution | None:
    """The answer where the start is the goal, or where it is proven that no path exists.

    None where a search is needed. Every planner asks this first; one that then ends without
    a path has not found one, and no more is known.
    """
    if problem.start == problem.goal:
        return stay_put(problem, planner, seed)
    started = time.perf_counter()
    if not problem.is_unreachable:
        return None
    seconds = time.perf_counter() - started
    return without_path(problem, planner, Status.UNREACHABLE, SEPARATED, seconds=seconds, seed=seed)


def lattices(problem: Problem, spacing: float | None) -> Iterator[Lattice]:
    """The lattice to look for a path on, and finer ones for where it shows none.

    spacing : of the first one's nodes, map units; by default the problem's own.
    """
    first = spacing or problem.default_spacing
    for halvings in range(HALVINGS + 1):
        yield Lattice.spanning(problem.bounds, first * 0.5**halvings)
