"""Tours through waypoints, and the nearest of several goals."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..problem import Path, Problem, Solution, Status
from ..surface import metric
from ..validation import Point, PointLike
from .base import (
    INTERRUPT,
    Callback,
    Planner,
    Progress,
    limit_of,
    separated,
    solve_within,
    without_path,
)
from .finished import Finished

# From best to worst. A tour has the status of its worst leg.
_STATUSES = (Status.SOLVED, Status.NOT_FOUND, Status.INTERRUPTED, Status.UNREACHABLE)

# A leg is given no less time than this, seconds: a limit must be above 0.
_LEAST_SECONDS = 1e-3


def plan_tour(
    problem: Problem,
    planner: Planner,
    via: Sequence[PointLike] = (),
    *,
    callback: Callback | None = None,
) -> Solution:
    """Plan from the problem's start through the points of ``via``, in order, to its goal.

    via : (x1, x2) each, map units. The part of the route between two stops is a leg. The path
    returned is that of all legs, one after another. Its length, cost and lower bound are the
    sums over the legs, because every path through these points is made of such legs.
    The planner's time limit holds for all legs together.

    Where some leg is proven unreachable, nothing is planned. Planning ends after the first leg
    that has no path or was interrupted; ``legs`` then holds those planned so far. The tour has
    a path only if it leads to the goal.
    Raises InputError for a waypoint that is not free or outside the bounds.
    """
    tour = _Tour(problem, planner, callback, 1)
    return tour.solve([*tour.checked(via), problem.goal])


@dataclass(frozen=True, eq=False, kw_only=True)
class GoalAnswer:
    """What is known of one of several goals.

    goal : (x1, x2), map units. least : a lower bound on the length of every path to this goal,
    map units; infinite where it is unreachable. solution : None where nothing was planned,
    because ``least`` is no less than the length to a nearer goal.
    """

    goal: Point
    least: float
    solution: Solution | None


def plan_goals(
    problem: Problem,
    planner: Planner,
    goals: Sequence[PointLike],
    via: Sequence[PointLike] = (),
    *,
    every: bool = False,
    callback: Callback | None = None,
) -> tuple[GoalAnswer, ...]:
    """What is known of each goal, in the order given, from the start through ``via``.

    goals, via : (x1, x2) each, map units. Goals are planned to in the order of their chords,
    the shortest first. A goal whose chord is no less than the best length so far is left out,
    unless ``every`` is True. The legs to the last waypoint are the same for all goals, and
    planned once. After Ctrl-C the goals planned to so far are kept.
    Raises InputError where there is no goal, or a point is not free or outside the bounds.
    """
    if not goals:
        raise InputError("goals=[] names no goal; give at least one")
    ends = [problem.checked(goal, _goal_name(goals, k)) for k, goal in enumerate(goals)]
    tour = _Tour(problem, planner, callback, len(ends))
    stops = [problem.start, *tour.checked(via)]
    chords = [chord_through(problem, [*stops, end]) for end in ends]
    found: dict[int, GoalAnswer] = {}
    best, stopped = math.inf, False
    for k in sorted(range(len(ends)), key=chords.__getitem__):
        solution = None
        if not stopped and (every or chords[k] < best):
            solution = tour.solve([*stops[1:], ends[k]])
            stopped = solution.status is Status.INTERRUPTED
            best = min(best, math.inf if solution.value is None else solution.value)
        found[k] = GoalAnswer(goal=ends[k], least=_least(chords[k], solution), solution=solution)
    return tuple(found[k] for k in range(len(ends)))


def nearest(answers: Iterable[GoalAnswer]) -> Solution:
    """The solution with the shortest path to any of the goals.

    Its lower bound is the least of all goals': no path to any of them is shorter. Where no goal
    has a path, it is an interrupted solution, or else one that was not proven unreachable.
    """
    known = list(answers)
    planned = [answer.solution for answer in known if answer.solution is not None]
    found = [solution for solution in planned if solution.value is not None]
    if not found:
        return max(planned, key=lambda s: (s.status is Status.INTERRUPTED, -_badness(s)))
    best = min(found, key=lambda solution: solution.value or 0.0)
    stopped = any(solution.status is Status.INTERRUPTED for solution in planned)
    if stopped and best.status is Status.SOLVED:
        best = replace(best, status=Status.INTERRUPTED, stopped_by=INTERRUPT)
    if best.lower_bound is None:
        return best
    return replace(best, lower_bound=min(answer.least for answer in known))


def _badness(solution: Solution) -> int:
    return _STATUSES.index(solution.status)


def _goal_name(goals: Sequence[PointLike], k: int) -> str:
    return "goal" if len(goals) == 1 else f"goal {k + 1}"


def _least(chord: float, solution: Solution | None) -> float:
    """A lower bound on the length of every path to a goal with this chord."""
    if solution is None:
        return chord
    if solution.status is Status.UNREACHABLE:
        return math.inf
    proven = solution.lower_bound
    least = chord if proven is None else max(chord, proven)
    return least if solution.value is None else min(least, solution.value)  # rounding apart


class _Tour:
    """The legs of one or several tours, each planned once.

    goals : how many goals there are to plan to.
    """

    def __init__(
        self, problem: Problem, planner: Planner, callback: Callback | None, goals: int
    ) -> None:
        self.problem, self.planner, self.callback = problem, planner, callback
        self.goals = goals
        self.started = time.perf_counter()
        self.planned: dict[tuple[Point, Point], Solution] = {}

    def checked(self, via: Sequence[PointLike]) -> list[Point]:
        """The waypoints; InputError where one is not in free space."""
        return [self.problem.checked(point, f"via {k}") for k, point in enumerate(via, start=1)]

    def solve(self, stops: Sequence[Point]) -> Solution:
        """Plan through all the stops, of which the last is the goal. All of them are checked."""
        points = [self.problem.start, *stops]
        whole = self.problem.between_checked(self.problem.start, stops[-1])
        legs = [whole.between_checked(a, b) for a, b in pairwise(points)]
        if len(legs) > 1 and any(leg.is_unreachable for leg in legs):
            k = next(k for k, leg in enumerate(legs, start=1) if leg.is_unreachable)
            reason = f"leg {k} of {len(legs)}: {separated(legs[k - 1])}"
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
        """The solution of one leg, which is planned where it was not before."""
        ends = (leg.start, leg.goal)
        if ends not in self.planned:
            try:
                self.planned[ends] = self.plan(
                    leg, count - 1 + self.goals, self.watch(number, count)
                )
            except KeyboardInterrupt:  # between the leg before and this one
                return without_path(leg, self.planner.name, Status.INTERRUPTED, INTERRUPT)
        return self.planned[ends]

    def plan(self, leg: Problem, legs: int, callback: Callback | None) -> Solution:
        """Plan one of ``legs`` legs, within its share of the planner's time limit."""
        planner, limit = self.planner, limit_of(self.planner)
        if limit is not None:
            left = max(limit - (time.perf_counter() - self.started), _LEAST_SECONDS)
            share = left / max(legs - len(self.planned), 1)
            return solve_within(planner, leg, callback, share)
        if isinstance(planner, Finished) and (limit := limit_of(planner.planner)) is not None:
            # The clock counts finishing too, so it does not show what is left of the search's
            # time: all legs get the same.
            return planner.solve(leg, callback=callback, search_limit=limit / legs)
        return solve_within(planner, leg, callback, None)

    def watch(self, number: int, count: int) -> Callback | None:
        """The callback, with the leg named in each progress that it sees."""
        callback = self.callback
        if callback is None or count * self.goals == 1:
            return callback
        words = f"leg {number} of {count}" if count > 1 else "one of several goals"

        def see(progress: Progress) -> bool | None:
            return callback(progress._replace(leg=words))

        return see


def joined(problem: Problem, legs: Sequence[Solution], count: int) -> Solution:
    """The solution made of legs, one after another.

    problem : from the first start to the last goal. count : legs that were to be planned.
    """
    worst = max(legs, key=_badness)
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
    proven = [leg.lower_bound for leg in legs if leg.lower_bound is not None]
    if solution.value is None or len(proven) < len(legs):
        return solution
    return replace(solution, lower_bound=min(sum(proven), solution.value))  # rounding apart


def chord_through(problem: Problem, stops: Sequence[Point]) -> float:
    """What no path through all the stops costs less than, by chords, in the problem's unit."""
    least = metric.chord_through(problem.priced, stops)
    if problem.pricing is None:
        return least
    return least + problem.pricing.taken_off(stops[0], stops[-1])


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
