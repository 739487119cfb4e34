"""From a scenario to its answer: which planner, a corridor or not, tours and several goals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import InputError, TerrapathWarning, collecting
from ..planners.base import PROVING, Callback, Progress
from .option import Point
from .question import Itinerary, Question, asked
from .scenario import Scenario

if TYPE_CHECKING:
    from .._kernels.second_core import SecondCore
    from ..certificates.certificate import Certificate
    from ..distance.field import DistanceField
    from ..planners.corridor import Part
    from ..planners.finished import Finished
    from ..planners.tours import GoalAnswer
    from ..problem import Problem, Solution
    from .outputs import RouteOutputs

# A map with more cells than that is planned on in a corridor, coarse to fine.
MOST_CELLS = 16_000_000


@dataclass(frozen=True, eq=False, kw_only=True)
class Answer:
    """What a scenario's question was answered by.

    solution : the route, to the nearest of several goals. goals : what is known of each, where
    there are several. warnings : what went wrong on the way and was no error, in order.
    """

    scenario: Scenario
    solution: Solution
    goals: tuple[GoalAnswer, ...] = ()
    warnings: tuple[TerrapathWarning, ...] = ()

    def record(self) -> dict[str, Any]:
        """The answer ready for JSON: what ``terrapath plan --json`` prints."""
        from ..io import route_record

        found = route_record(self.solution)
        if self.goals:
            found["goals"] = [_goal_record(goal) for goal in self.goals]
        return found

    def write(self) -> None:
        """Write the files that the scenario names, each whole or not at all; none without a path.

        Raises MapError, naming the file and the remedy.
        """
        outputs = _outputs(self.scenario)
        if outputs is not None and self.solution.path is not None:
            outputs.write(self.solution)


def _goal_record(answer: GoalAnswer) -> dict[str, Any]:
    """What is known of one goal, ready for JSON."""
    solution = answer.solution
    path = None if solution is None else solution.path
    return {
        "goal": list(answer.goal),
        "status": goal_status(answer),
        "length": None if solution is None else solution.length,
        "lower_bound": answer.least if math.isfinite(answer.least) else None,
        "path": None if path is None else path.points.tolist(),
    }


def goal_status(answer: GoalAnswer) -> str:
    """How the planning to a goal ended; ``farther`` needed no planning to know it."""
    return "farther" if answer.solution is None else answer.solution.status.value


def answer(scenario: Scenario, *, watch: Callback | None = None) -> Answer:
    """Answer a scenario's question, as ``terrapath plan`` does.

    Maps with too many cells are planned on in a corridor, unless the scenario says otherwise.
    Files that the scenario names are looked at before anything is planned; ``Answer.write``
    writes them. watch : sees the progress of each stage, and stops the planner by returning True.
    Raises TerrapathError, naming the value and the remedy.
    """
    _require_agreement(scenario)
    planner = _planner(scenario)
    outputs = _outputs(scenario)
    if outputs is not None:
        outputs.check(scenario.inputs())
    with collecting() as warnings, asked(scenario) as question:
        cells = question.cells()
        run = _Run(planner, question, outputs, watch)
        solution, goals = (
            run.in_corridor(cells) if is_planned_in_corridor(scenario, cells) else run.whole()
        )
    return Answer(scenario=scenario, solution=solution, goals=goals, warnings=tuple(warnings))


def field(scenario: Scenario) -> DistanceField:
    """The distance field from the scenario's start, as ``terrapath field`` computes it."""
    from ..distance.field import field_of

    with asked(scenario) as question:
        problem = question.problem_to_itself()
    return field_of(problem, spacing=scenario.planner.spacing)


def check(scenario: Scenario, certificate: Certificate, *, leg: int | None = None) -> Problem:
    """Prove a certificate again, as ``terrapath check`` does; returns the problem it is of.

    leg : of a tour, from 1, the one that is proven. Raises CertificateError where it does not
    hold, and InputError where the scenario does not say which leg or goal is meant.
    """
    with asked(scenario) as question:
        problem = _leg(question.itinerary(), leg)
    certificate.check(problem)
    return problem


def _leg(asked_for: Itinerary, number: int | None) -> Problem:
    """The leg that a certificate is of."""
    if len(asked_for.goals) > 1:
        raise InputError(
            f"a certificate is of one goal, and {len(asked_for.goals)} are given; name it by "
            "--goal X,Y"
        )
    problem = asked_for.problem
    stops = [problem.start, *asked_for.via, problem.goal]
    count = len(stops) - 1
    if number is None and count > 1:
        raise InputError(f"the tour has {count} legs; say by --leg K which one is proven")
    if number is not None and not 1 <= number <= count:
        raise InputError(f"--leg {number}: the tour has {count} legs; give 1 to {count}")
    k = number or 1
    return problem.between(stops[k - 1], stops[k])


# What the scenario decides


def _require_agreement(scenario: Scenario) -> None:
    """Raise InputError for options that contradict each other."""
    planner, output = scenario.planner, scenario.output
    if planner.name == "optimal" and not (planner.refine and planner.bound):
        raise InputError(
            "planner optimal refines its routes and proves its bound by itself; leave out "
            "--no-refine and --no-bound, or choose fast-marching"
        )
    for option, value in (
        ("--target-gap", planner.target_gap),
        ("--certificate", output.certificate),
    ):
        if value is not None and not planner.bound:
            raise InputError(f"{option} asks for a bound and --no-bound for none; leave out one")
    if scenario.route.all_goals and len(scenario.route.goals) < 2:
        raise InputError("--all-goals reports several goals; give --goal more than once")


def _planner(scenario: Scenario) -> Finished:
    from ..planners.registry import make_finished

    wanted = scenario.planner
    return make_finished(
        wanted.name,
        refine=wanted.refine,
        bound=wanted.bound,
        target_gap=wanted.target_gap,
        **wanted.own,
    )


def _outputs(scenario: Scenario) -> RouteOutputs | None:
    """The files to write; None where the scenario names none."""
    if not any(scenario.outputs()):
        return None
    from .outputs import RouteOutputs

    return RouteOutputs(scenario.output, len(scenario.route.via) + 1)


def is_planned_in_corridor(scenario: Scenario, cells: int) -> bool:
    """Is the map too large to be planned on as a whole? InputError for what needs it whole.

    cells : of the map that is asked about.
    """
    if scenario.planner.corridor == "none" or cells <= MOST_CELLS:
        return False
    for what, is_asked in (
        ("several goals", len(scenario.route.goals) > 1),
        ("--certificate", scenario.output.certificate is not None),
    ):
        if is_asked:
            raise InputError(
                f"the map has {cells:,} cells, so it is planned on in a corridor, and {what} needs "
                "it whole; leave that out, shrink --bounds, or give --corridor none"
            )
    return True


# Planning


@dataclass(frozen=True)
class _Run:
    """A planner at a question."""

    planner: Finished
    question: Question
    outputs: RouteOutputs | None
    watch: Callback | None

    def whole(self) -> tuple[Solution, tuple[GoalAnswer, ...]]:
        """Plan on all of the map: one route, or one to each goal that may be the nearest."""
        itinerary = self._itinerary()
        problem, via, goals = itinerary.problem, itinerary.via, itinerary.goals
        with self._watched(problem) as watch:
            if len(goals) == 1 and not via:
                return self.planner.solve(problem, callback=watch), ()
            from ..planners.tours import nearest, plan_goals, plan_tour

            if len(goals) == 1:
                return plan_tour(problem, self.planner, via, callback=watch), ()
            every = self.question.scenario.route.all_goals
            found = plan_goals(problem, self.planner, goals, via, every=every, callback=watch)
        return nearest(found), found

    def in_corridor(self, cells: int) -> tuple[Solution, tuple[GoalAnswer, ...]]:
        """Plan on the map read coarser, and on the map itself around the route found there."""
        from ..planners.corridor import plan_in_corridor

        def pose(part: Part) -> tuple[Problem, Sequence[Point]]:
            itinerary = self._itinerary(part)
            return itinerary.problem, itinerary.via

        width = self.question.scenario.planner.corridor
        half_width = width if isinstance(width, float) else None
        with self._watched(None) as watch:
            solution = plan_in_corridor(
                pose, self.planner, cells, half_width=half_width, callback=watch
            )
        return solution, ()

    def _itinerary(self, part: Part | None = None) -> Itinerary:
        itinerary = self.question.itinerary(part)
        if self.outputs is not None:
            self.outputs.require_fit(itinerary.problem)
        return itinerary

    @contextmanager
    def _watched(self, problem: Problem | None) -> Iterator[Callback | None]:
        """The watcher, told the unit of what it sees; and kernels compiled on a second core.

        problem : None where it is made later, of a part of a map.
        """
        surface = None if problem is None else problem.surface
        unit = "" if surface is None else surface.unit
        watch = None if self.watch is None else _with_unit(self.watch, unit)
        if not (self.planner.bound or self.planner.target_gap is not None):
            yield watch
            return
        from .._kernels.second_core import SecondCore, rehearsal_name

        kind = "spline" if surface is None else type(surface.data).__name__.lower()
        with SecondCore(rehearsal_name("lower bounds", kind)) as second:
            yield _waiting(second, watch)


def _waiting(second: SecondCore, watch: Callback | None) -> Callback:
    """A watcher that waits for the second core when the lower bound is begun."""

    def see(progress: Progress) -> bool:
        if progress.stage == PROVING:
            second.wait()
        return watch is not None and bool(watch(progress))

    return see


def _with_unit(watch: Callback, unit: str) -> Callback:
    return lambda progress: watch(progress._replace(unit=unit))
