"""What every planner offers, and what planners share."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

from ..errors import InputError
from ..problem import Path, Problem, Solution, Status
from ..space.lattice import Lattice, Spacing, as_spacing
from ..validation import require_positive

# The planners that take a travel model.
TAKES_TRAVEL = "choose optimal, rrt-star-r, rrt-star, rrt, dijkstra or a-star"

# Why a search was not needed: it is proven that there is no path.
SEPARATED = "start and goal lie in different parts of the free space"

# So much of a time limit is kept for the proof where one is asked for. On real maps a fifth makes a
# bound out of the chord; the routes found in the rest are hardly longer.
PROOF_SHARE = 0.2

# The least time limit, seconds: nothing that is asked for is begun, but all is ended in order.
MOMENT = 1e-9

# What stopped a search that Ctrl-C ended.
INTERRUPT = "interrupt"
# What stopped a search whose time was up.
TIME_LIMIT = "time limit"

# Where no path is found, the lattice may be too coarse to see a gap. Its spacing is halved this
# many times.
HALVINGS = 2
# But never to more nodes than this.
MOST_HALVED = 2**24

# A tree's default step is this share of the side of a square as large as the bounds: 1.0 in the
# paper's region of 12 x 12.
STEPS_PER_SIDE = 12.0

# The stages of a run.
SEARCHING, REFINING, PROVING = "searching", "refining the path", "proving the bound"


class Progress(NamedTuple):
    """How far a running planner is.

    stage : SEARCHING, REFINING or PROVING. leg : which leg of a tour is planned.
    """

    samples: int  # taken so far: samples, nodes or rays
    total: int  # of them, at most
    seconds: float  # since the run began
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
    """The clock and the callback of a run, and which of them ended it.

    time_limit : seconds. ``stopped_by`` is empty until one of them ends the run.
    """

    def __init__(self, callback: Callback | None, time_limit: float | None) -> None:
        self.callback, self.time_limit = callback, time_limit
        self.started = time.perf_counter()
        self.stopped_by = ""

    @property
    def seconds(self) -> float:
        """Since the run began."""
        return time.perf_counter() - self.started

    @property
    def seconds_left(self) -> float | None:
        """Until the time limit, at least a moment; None where there is no limit."""
        return seconds_left(self.time_limit, self.seconds)

    def is_late(self) -> bool:
        """Is the time up? The callback is not asked."""
        if self.time_limit is not None and self.seconds >= self.time_limit:
            self.stopped_by = TIME_LIMIT
            return True
        return False

    def must_stop(self, progress: Progress) -> bool:
        """Show the progress to the callback and check the clock; once True, always True."""
        if self.callback is not None and self.callback(progress):
            self.stopped_by = "callback"
        else:
            self.is_late()
        return bool(self.stopped_by)


@dataclasses.dataclass(frozen=True, kw_only=True)
class TreeOptions:
    """The options of a tree planner; see ``RRTStar``."""

    planner: str  # its name
    samples: int  # at most this many
    step: float | None  # map units, None for the default
    radius_factor: float  # 0 for a tree that is never rewired
    goal_bias: float
    seed: int
    riemannian: bool  # edges are measured by Line-R, not by the chord
    prune: bool
    informed: bool
    panel: float | None = None  # map units, None for the default
    time_limit: float | None = None  # seconds
    target_length: float = 0.0  # map units; infinite to stop at the first path


def default_step(problem: Problem) -> float:
    """A step that suits the region, map units."""
    return problem.bounds.side / STEPS_PER_SIDE


def straight_path(problem: Problem) -> Path | None:
    """The straight line from start to goal; None where it is not free."""
    if not problem.free_space.segments_are_free([problem.start], [problem.goal]).all():
        return None
    return problem.path([problem.start, problem.goal])


class FirstPath(NamedTuple):
    """What a tree begins with."""

    path: Path | None  # None where nothing was found
    seconds: float = 0.0  # it took, without compiling
    stopped_by: str = ""  # what ended the whole run while it was looked for
    branch: Path | None = None  # what the tree grows from; None where that is the path itself


class Planner(Protocol):
    """A frozen dataclass of options that turns problems into solutions.

    A planner that can be limited has an option ``time_limit``, seconds.
    """

    @property
    def name(self) -> str:
        """The planner's name on the command line."""

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True.

        time_limit : seconds for this call; a lower limit among the planner's options counts.
        """


def options_of(planner: object) -> dict[str, Any]:
    """The options of a planner by name: its fields; none where it is no dataclass."""
    if not dataclasses.is_dataclass(planner):
        return {}
    return {field.name: getattr(planner, field.name) for field in dataclasses.fields(planner)}


def limit_of(planner: Planner) -> float | None:
    """The time limit among a planner's options, seconds; None where it has none."""
    limit: float | None = getattr(planner, "time_limit", None)
    return limit


def least_limit(own: float | None, asked: float | None) -> float | None:
    """The time limit of one call, seconds: the lower of the planner's own and the caller's."""
    if asked is not None:
        require_positive(time_limit=asked)
    return min((limit for limit in (own, asked) if limit is not None), default=None)


def seconds_left(time_limit: float | None, used: float) -> float | None:
    """What is left of a time limit; at least a moment, because limits are above 0."""
    return None if time_limit is None else max(time_limit - used, MOMENT)


def before_proof(time_limit: float | None) -> float | None:
    """The seconds of a time limit that may pass before a proof begins."""
    return None if time_limit is None else (1.0 - PROOF_SHARE) * time_limit


def solve_within(
    planner: Planner, problem: Problem, callback: Callback | None, time_limit: float | None
) -> Solution:
    """What a planner answers within a time limit, seconds.

    Without a limit the argument is left out, so that planners that do not take it work, too.
    """
    if time_limit is None:
        return planner.solve(problem, callback=callback)
    return planner.solve(problem, callback=callback, time_limit=time_limit)


def status_of(path: Path | None, stopped_by: str) -> Status:
    """The status of a search that found this path, or none, when this ended it."""
    if stopped_by == INTERRUPT:
        return Status.INTERRUPTED
    return Status.NOT_FOUND if path is None else Status.SOLVED


def stay_put(problem: Problem, planner: str, seed: int | None = None) -> Solution:
    """The solution where the start is the goal: a path of length 0."""
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
    """The solution where nothing was searched, and there is no path."""
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
    problem: Problem, planner: str, seed: int | None = None, *, takes_travel: bool = False
) -> Solution | None:
    """The solution where the start is the goal, or where it is proven that no path exists.

    None where a search is needed. Every planner calls this first. So a planner that searches
    and finds no path only says that it found none; it proves nothing. takes_travel : whether the
    planner can minimise what a travel model says; others raise InputError for a problem with one.
    """
    if not takes_travel:
        require_metric(problem, f"planner {planner}")
    if problem.start == problem.goal:
        return stay_put(problem, planner, seed)
    started = time.perf_counter()
    if not problem.is_unreachable:
        return None
    seconds = time.perf_counter() - started
    reason = separated(problem)
    return without_path(problem, planner, Status.UNREACHABLE, reason, seconds=seconds, seed=seed)


def require_metric(problem: Problem, what: str, remedy: str = TAKES_TRAVEL) -> None:
    """Raise InputError where a travel model is given to what knows lengths alone."""
    if problem.travel is not None:
        raise InputError(f"{what} minimises length and takes no travel model; {remedy}")


def separated(problem: Problem) -> str:
    """Why an unreachable problem is so, with what lies between start and goal."""
    return (
        f"{SEPARATED}: {problem.constraints.separating(problem.start, problem.goal)} between them"
    )


def lattices(
    problem: Problem, spacing: float | None, *, at_cells: bool = False
) -> Iterator[Lattice]:
    """A lattice to search for a path, then finer ones, for where it shows none.

    spacing : of the nodes of the first, map units; by default the problem's. at_cells : by
    default, nodes lie at the centres of the problem's cells; a lattice then need not reach the
    edge of the bounds.
    """
    first = as_spacing(spacing or problem.default_spacing)
    cells = problem.cells
    for halvings in range(HALVINGS + 1):
        step = Spacing(first.x * 0.5**halvings, first.y * 0.5**halvings)
        if at_cells and spacing is None and cells is not None:
            lattice = Lattice.at_cells(problem.bounds, step, cells)
        else:
            lattice = Lattice.spanning(problem.bounds, step)
        if halvings and lattice.nx * lattice.ny > MOST_HALVED:
            return
        yield lattice
