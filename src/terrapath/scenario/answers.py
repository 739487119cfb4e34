"""From a scenario to its answer: which planner, a corridor or not, tours and several goals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, TerrapathWarning, collecting
from ..planners.base import PROVING, Callback, Progress
from .option import Point
from .question import Itinerary, Question, open_question
from .scenario import Scenario, require_scenario

if TYPE_CHECKING:
    from .._kernels.second_core import SecondCore
    from ..certificates.certificate import Certificate
    from ..distance.field import DistanceField
    from ..planners.corridor import Part
    from ..planners.finished import Finished
    from ..planners.tours import GoalAnswer
    from ..problem import Problem, Solution
    from .outputs import RouteOutputs

# On a map with more cells than this, a coarse route is planned first, then a fine one in a
# corridor around it.
MOST_CELLS = 16_000_000


@dataclass(frozen=True, eq=False, kw_only=True)
class Answer:
    """The answer to a scenario's question.

    solution : the route, to the nearest of several goals. goals : what is known of each goal,
    where there are several. warnings : the warnings that were given meanwhile, in order.
    """

    scenario: Scenario
    solution: Solution
    goals: tuple[GoalAnswer, ...] = ()
    warnings: tuple[TerrapathWarning, ...] = ()

    def record(self) -> dict[str, Any]:
        """The answer ready for JSON: what ``terrapath plan --json`` prints."""
        from ..io import route_record

        record = route_record(self.solution)
        if self.goals:
            record["goals"] = [_goal_record(goal) for goal in self.goals]
        return record

    def write(self) -> None:
        """Write the files that the scenario names, each completely or not at all.

        Where no path was found, only the map and the page are drawn, with what blocks; after an
        interrupt nothing is. Raises MapError, which names the file and the remedy.
        """
        outputs, solution = _outputs(self.scenario), self.solution
        if outputs is None:
            return
        if solution.path is not None:
            outputs.write(solution)
        elif not solution.is_interrupted:
            outputs.draw(solution)


def _goal_record(answer: GoalAnswer) -> dict[str, object]:
    """What is known of one goal, ready for JSON."""
    solution = answer.solution
    path = None if solution is None else solution.path
    return {
        "goal": list(answer.goal),
        "status": goal_status(answer),
        "value": None if solution is None else solution.value,
        "unit": None if solution is None else solution.unit,
        "length": None if solution is None else solution.length,
        "ground_length": None if path is None else path.ground_length,
        "lower_bound": answer.least if math.isfinite(answer.least) else None,
        "path": None if path is None else path.points.tolist(),
    }


def goal_status(answer: GoalAnswer) -> str:
    """How planning to a goal ended. ``farther`` : it is not the nearest; no planning was needed."""
    return "farther" if answer.solution is None else answer.solution.status.value


def answer(scenario: Scenario, *, watch: Callback | None = None) -> Answer:
    """Answer a scenario's question, as ``terrapath plan`` does.

    On maps with too many cells it plans in a corridor, unless the scenario says otherwise. It
    checks before planning that the scenario's files can be written; ``Answer.write`` writes them.
    watch : gets the progress of each stage, and stops the planner by returning True.
    Raises TerrapathError, which names the value and the remedy.
    """
    require_scenario(scenario)
    _require_agreement(scenario)
    planner = _planner(scenario)
    outputs = _outputs(scenario)
    if outputs is not None:
        outputs.check(scenario.inputs())
    with collecting() as warnings, open_question(scenario) as question:
        cells = question.cells()
        run = _Run(planner, question, outputs, watch)
        solution, goals = (
            run.in_corridor(cells) if is_planned_in_corridor(scenario, cells) else run.whole()
        )
    return Answer(scenario=scenario, solution=solution, goals=goals, warnings=tuple(warnings))


def field(scenario: Scenario) -> DistanceField:
    """The distance field from the scenario's start, as ``terrapath field`` computes it."""
    from ..distance.field import field_of

    with open_question(scenario) as question:
        problem = question.problem_to_itself()
    return field_of(problem, spacing=scenario.planner.spacing)


def check(
    scenario: Scenario, certificate: Certificate | str | Path, *, leg: int | None = None
) -> Problem:
    """Prove a certificate again, as ``terrapath check`` does; returns the certificate's problem.

    certificate : or its file. leg : the number of the tour's leg that is proven, from 1.
    Raises CertificateError where the certificate does not hold, and InputError where the leg or
    the goal is not clear.
    """
    from ..certificates.certificate import Certificate

    if isinstance(certificate, str | Path):
        certificate = Certificate.load(certificate)
    with open_question(scenario) as question:
        problem = _leg(question.itinerary(), leg)
    certificate.check(problem)
    return problem


def _leg(itinerary: Itinerary, number: int | None) -> Problem:
    """The leg that a certificate belongs to."""
    if len(itinerary.goals) > 1:
        raise InputError(
            f"a certificate belongs to one goal, and {len(itinerary.goals)} are given; name it by "
            "--goal X,Y"
        )
    problem = itinerary.problem
    stops = [problem.start, *itinerary.via, problem.goal]
    count = len(stops) - 1
    if number is None and count > 1:
        raise InputError(f"the tour has {count} legs; give the leg that is proven by --leg K")
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
            raise InputError(f"{option} needs a lower bound; leave out either it or --no-bound")
    if scenario.travel.model is not None and output.certificate is not None:
        raise InputError(
            "--certificate: with a travel model the lower bound is a chord, which needs no proof "
            "in a file; leave it out"
        )
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
    if not scenario.output.names_files:
        return None
    from .outputs import RouteOutputs

    return RouteOutputs(scenario.output, len(scenario.route.via) + 1)


def is_planned_in_corridor(scenario: Scenario, cells: int) -> bool:
    """Is the map too large to plan on the whole of it?

    cells : their number in the part of the map that is planned on. Raises InputError for options
    that need the whole map.
    """
    if scenario.planner.corridor == "none" or cells <= MOST_CELLS:
        return False
    for what, is_given in (
        ("several goals", len(scenario.route.goals) > 1),
        ("--certificate", scenario.output.certificate is not None),
        ("--travel", scenario.travel.model is not None),
    ):
        if is_given:
            raise InputError(
                f"the map has {cells:,} cells, so the route is planned in a corridor, and {what} "
                "needs the whole map; leave that out, shrink --bounds, or give --corridor none"
            )
    return True


# Planning


@dataclass(frozen=True)
class _Run:
    """A planner that answers a question."""

    planner: Finished
    question: Question
    outputs: RouteOutputs | None
    watch: Callback | None

    def whole(self) -> tuple[Solution, tuple[GoalAnswer, ...]]:
        """Plan on the whole map: one route, or one to each goal that may be the nearest."""
        itinerary = self._itinerary()
        problem, via, goals = itinerary.problem, itinerary.via, itinerary.goals
        with self._watched(problem) as watch:
            if len(goals) == 1 and not via:
                return self.planner.solve(problem, callback=watch), ()
            from ..planners.tours import nearest, plan_goals, plan_tour

            if len(goals) == 1:
                return plan_tour(problem, self.planner, via, callback=watch), ()
            every = self.question.scenario.route.all_goals
            answers = plan_goals(problem, self.planner, goals, via, every=every, callback=watch)
        return nearest(answers), answers

    def in_corridor(self, cells: int) -> tuple[Solution, tuple[GoalAnswer, ...]]:
        """Plan on a coarser copy of the map, then on the map itself around the coarse route."""
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
        """The watcher, with the unit of lengths; meanwhile a second core may compile kernels.

        problem : None where it is made later, from a part of a map.
        """
        surface = None if problem is None else problem.surface
        unit = "" if problem is None else problem.unit
        watch = None if self.watch is None else _with_unit(self.watch, unit)
        is_proven = self.planner.bound or self.planner.target_gap is not None
        if not is_proven or self.question.scenario.travel.model is not None:
            yield watch
            return
        from .._kernels.second_core import SecondCore, rehearsal_name

        kind = "spline" if surface is None else type(surface.data).__name__.lower()
        with SecondCore(rehearsal_name("lower bounds", kind)) as second:
            yield _waiting(second, watch)


def _waiting(second: SecondCore, watch: Callback | None) -> Callback:
    """A watcher that waits for the second core when the search for the lower bound begins."""

    def see(progress: Progress) -> bool:
        if progress.stage == PROVING:
            second.wait()
        return watch is not None and bool(watch(progress))

    return see


def _with_unit(watch: Callback, unit: str) -> Callback:
    return lambda progress: watch(progress._replace(unit=unit))
