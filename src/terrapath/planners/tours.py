"""Tours through waypoints, and the nearest of several goals."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError
from ..problem import Path, Problem, Solution, Status
from ..surface import metric
from .base import INTERRUPT, SEPARATED, Callback, Planner, Progress, without_path

# From best to worst: a tour ends as its worst leg does.
_WORSE = (Status.SOLVED, Status.NOT_FOUND, Status.INTERRUPTED, Status.UNREACHABLE)


def plan_tour(
    problem: Problem, planner: Planner, via: Sequence[Any] = (), *, callback: Callback | None = None
) -> Solution:
    """From the problem's start through the points of ``via``, in order, to its goal.

    The answer's path is that of all legs, one after another; its length, cost and lower bound
    are their sums, for every path through these points is made of such legs. A leg that is
    proven unreachable is found out before anything is planned, and planning ends with the
    first leg that has no path, or that was interrupted. Then the tour has a path only if the
    goal was reached, so a route that is written is always whole; ``legs`` holds what there is.
    A planner's time limit holds for all legs together.
    """
    return _Tour(problem, planner, callback, 1).solve([*via, problem.goal])


@dataclass(frozen=True, eq=False, kw_only=True)
class GoalAnswer:
    """What is known of one of several goals.

    least : no way to this goal is shorter, map units; infinite where it is unreachable.
    solution : None where nothing was planned, for ``least`` is no less than the best length.
    """

    goal: tuple[float, float]
    least: float
    solution: Solution | None


def plan_goals(
    problem: Problem,
    planner: Planner,
    goals: Sequence[Any],
    via: Sequence[Any] = (),
    *,
    every: bool = False,
    callback: Callback | None = None,
) -> tuple[GoalAnswer, ...]:
    """What is known of each goal, in the order given, from the start through ``via``.

    Goals are planned to from the nearest by chord on, and one whose chord is no less than the
    best length so far is left out, unless ``every`` is True. The legs to the last
    waypoint are the same for all and planned once. Ctrl-C ends it with what was found.
    """
    if not goals:
        raise InputError("goals=[] names no goal; give at least one")
    ends = [
        problem.between(problem.start, goal, ("start", _goal_name(goals, k))).goal
        for k, goal in enumerate(goals)
    ]
    tour = _Tour(problem, planner, callback, len(ends))
    stops = [problem.start, *tour.checked(via)]
    chords = [metric.chord_through(problem.surface, [*stops, end]) for end in ends]
    found: dict[int, GoalAnswer] = {}
    best, stopped = math.inf, False
    for k in sorted(range(len(ends)), key=chords.__getitem__):
        solution = None
        if not stopped and (every or chords[k] < best):
            solution = tour.solve([*stops[1:], ends[k]])
            stopped = solution.status is Status.INTERRUPTED
            best = min(best, math.inf if solution.length is None else solution.length)
        found[k] = GoalAnswer(goal=ends[k], least=_least(chords[k], solution), solution=solution)
    return tuple(found[k] for k in range(len(ends)))


def nearest(answers: Iterable[GoalAnswer]) -> Solution:
    """The shortest route of all; where there is none, the answer that still leaves most open.

    Its lower bound is the least of all goals': no way to any of them is shorter.
    """
    known = list(answers)
    planned = [answer.solution for answer in known if answer.solution is not None]
    ways = [solution for solution in planned if solution.length is not None]
    if not ways:
        return max(planned, key=lambda s: (s.status is Status.INTERRUPTED, _openness(s)))
    best = min(ways, key=lambda solution: solution.length or 0.0)
    stopped = any(solution.status is Status.INTERRUPTED for solution in planned)
    if stopped and best.status is Status.SOLVED:
        best = replace(best, status=Status.INTERRUPTED, stopped_by=INTERRUPT)
    if best.lower_bound is None:
        return best
    return replace(best, lower_bound=min(answer.least for answer in known))


def _openness(solution: Solution) -> int:
    return -_WORSE.index(solution.status)


def _goal_name(goals: Sequence[Any], k: int) -> str:
    return "goal" if len(goals) == 1 else f"goal {k + 1}"


def _least(chord: float, solution: Solution | None) -> float:
    """No way to the goal is shorter than this."""
    if solution is None:
        return chord
    if solution.status is Status.UNREACHABLE:
        return math.inf
    least = max(chord, solution.lower_bound or 0.0)
    return least if solution.length is None else min(least, solution.length)  # rounding apart


class _Tour:
    """Legs as they are planned, each once."""

    def __init__(
        self, problem: Problem, planner: Planner, callback: Callback | None, goals: int
    ) -> None:
        self.problem, self.planner, self.callback = problem, planner, callback
        self.goals = goals
        self.started = time.perf_counter()
        self.planned: dict[tuple[Any, Any], Solution] = {}

    def checked(self, via: Sequence[Any]) -> list[tuple[float, float]]:
        """The waypoints, in free space."""
        start = self.problem.start
        return [
            self.problem.between(start, point, ("start", f"via {k}")).goal
            for k, point in enumerate(via, start=1)
        ]

    def solve(self, stops: Sequence[Any]) -> Solution:
        """Through all the stops; the last is the goal."""
        points = [self.problem.start, *self.checked(stops[:-1]), stops[-1]]
        whole = self.problem.between(self.problem.start, stops[-1])
        legs = [whole.between(a, b) for a, b in pairwise(points)]
        if len(legs) > 1 and any(leg.is_unreachable for leg in legs):
            k = next(k for k, leg in enumerate(legs, start=1) if leg.is_unreachable)
            reason = f"leg {k} of {len(legs)}: {SEPARATED}"
            return without_path(whole, self.planner.name, Status.UNREACHABLE, reason)
        solutions: list[Solution] = []
        for k, leg in enumerate(legs, start=1):
            solutions.append(self.leg(leg, k, len(legs)))
            if solutions[-1].status is not Status.SOLVED:
                break
        if len(legs) == 1:
            return solutions[0]
        return joined(whole, solutions, len(legs))

    def leg(self, leg: Problem, number: int, count: int) -> Solution:
        """One leg, or what is known of it already."""
        ends = (leg.start, leg.goal)
        if ends not in self.planned:
            planner = self.with_share(count)
            try:
                self.planned[ends] = planner.solve(leg, callback=self.watch(number, count))
            except KeyboardInterrupt:  # between the leg before and this one
                return without_path(leg, planner.name, Status.INTERRUPTED, INTERRUPT)
        return self.planned[ends]

    def with_share(self, count: int) -> Planner:
        """The planner with its share of the time that is left."""
        legs = count - 1 + self.goals
        limit = getattr(self.planner, "time_limit", None)
        if limit is None:
            shared: Planner = _with_equal_share(self.planner, legs)
            return shared
        open_legs = max(legs - len(self.planned), 1)
        left = limit - (time.perf_counter() - self.started)
        limited: Planner = _limited(self.planner, max(left, 1e-3) / open_legs)
        return limited

    def watch(self, number: int, count: int) -> Callback | None:
        """The callback, told which leg it sees."""
        callback = self.callback
        if callback is None or count * self.goals == 1:
            return callback
        words = f"leg {number} of {count}" if count > 1 else "one of several goals"

        def see(progress: Progress) -> bool | None:
            return callback(progress._replace(leg=words))

        return see


def _with_equal_share(planner: Any, legs: int) -> Any:
    """A planner whose limit, its own or that of the planner within it, is shared by the legs.

    Equally: where only the planner within has a limit, finishing has none, and the clock does
    not tell how much of the planner's time is left.
    """
    limit = getattr(planner, "time_limit", None)
    if limit is not None:
        return _limited(planner, limit / legs)
    if "planner" not in _fields(planner):
        return planner
    return replace(planner, planner=_with_equal_share(planner.planner, legs))


def _limited(planner: Any, seconds: float) -> Any:
    """A planner with another time limit, and so the planner within it."""
    names = _fields(planner)
    changes: dict[str, Any] = {}
    if "time_limit" in names:
        changes["time_limit"] = seconds
    if "planner" in names:
        changes["planner"] = _limited(planner.planner, seconds)
    return replace(planner, **changes) if changes else planner


def _fields(planner: Any) -> set[str]:
    return {entry.name for entry in fields(planner)} if is_dataclass(planner) else set()


def joined(problem: Problem, legs: Sequence[Solution], count: int) -> Solution:
    """Legs one after another as the answer to one problem; ``count`` were to be planned."""
    worst = max(legs, key=lambda leg: _WORSE.index(leg.status))
    is_whole = len(legs) == count and all(leg.path is not None for leg in legs)
    counters: Counter[str] = Counter()
    for leg in legs:
        counters.update(leg.counters)
    solution = Solution(
        problem=problem,
        planner=legs[0].planner,
        status=worst.status,
        path=_concatenated(problem, [leg.path for leg in legs]) if is_whole else None,
        cost=sum(leg.cost or 0.0 for leg in legs) if is_whole else None,
        seconds=sum(leg.seconds for leg in legs),
        samples=sum(leg.samples for leg in legs),
        seed=legs[0].seed,
        options=legs[0].options,
        stopped_by=_reasons(legs, count),
        unrefined=_unrefined(problem, legs) if is_whole else None,
        counters=dict(counters),
        legs=tuple(legs),
    )
    bounds = [leg.lower_bound for leg in legs]
    if solution.length is None or any(bound is None for bound in bounds):
        return solution
    least = min(sum(bound or 0.0 for bound in bounds), solution.length)  # rounding apart
    return replace(solution, lower_bound=least)


def _reasons(legs: Sequence[Solution], count: int) -> str:
    reasons = list(dict.fromkeys(leg.stopped_by for leg in legs))
    if len(legs) < count or legs[-1].status is not Status.SOLVED:
        return f"leg {len(legs)} of {count}: {legs[-1].stopped_by}"
    return ", ".join(reasons)


def _concatenated(problem: Problem, paths: Sequence[Path | None]) -> Path:
    """Paths one after another, each joint once."""
    pieces = [path.points for path in paths if path is not None]
    return problem.path(np.concatenate([pieces[0], *(points[1:] for points in pieces[1:])]))


def _unrefined(problem: Problem, legs: Sequence[Solution]) -> Path | None:
    if all(leg.unrefined is None for leg in legs):
        return None
    return _concatenated(problem, [leg.unrefined or leg.path for leg in legs])
