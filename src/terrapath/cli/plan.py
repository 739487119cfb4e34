"""``terrapath plan``: one route, from a scene, a map or a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from ..errors import InputError
from ..scenario.problem_options import Point
from ..scenario.question import Itinerary, Question, scenario_of
from ..scenario.scenario import Scenario
from .compiling import compiling_told
from .exit_codes import ExitCode
from .options import Where, with_options
from .outputs import RouteOutputs

if TYPE_CHECKING:
    from ..planners import Finished, GoalAnswer
    from ..problem import Problem, Solution


@dataclass(frozen=True)
class Answer:
    """The route, and what is known of each of several goals."""

    solution: Solution
    goals: tuple[GoalAnswer, ...] = ()

    def record(self) -> dict[str, Any]:
        """Ready for JSON."""
        from ..io import route_record
        from .records import goal_records

        record = route_record(self.solution)
        if self.goals:
            record["goals"] = goal_records(self.goals)
        return record


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
    from ..planners import make_finished

    asked = scenario.planner
    return make_finished(
        asked.name,
        refine=asked.refine,
        bound=asked.bound,
        target_gap=asked.target_gap,
        **asked.own,
    )


def _solve(planner: Finished, asked: Itinerary, every: bool, quiet: bool) -> Answer:
    """Plan, with a progress bar where somebody is watching."""
    from ..planners import nearest, plan_goals, plan_tour
    from .progress import progress_bar

    with progress_bar(asked.problem, quiet) as callback:
        if len(asked.goals) == 1:
            return Answer(plan_tour(asked.problem, planner, asked.via, callback=callback))
        goals = plan_goals(
            asked.problem, planner, asked.goals, asked.via, every=every, callback=callback
        )
        return Answer(nearest(goals), goals)


def is_planned_in_corridor(scenario: Scenario, cells: int) -> bool:
    """Is the map too large to be planned on as a whole? InputError for what needs it whole."""
    from ..planners.corridor import MOST_CELLS

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


def _solve_in_corridor(
    planner: Finished, question: Question, cells: int, outputs: RouteOutputs, quiet: bool
) -> Answer:
    """Plan on the map read coarser, and on the map itself around the route found there."""
    from ..planners.corridor import Part, plan_in_corridor
    from .progress import progress_bar

    def pose(part: Part) -> tuple[Problem, Sequence[Point]]:
        asked = question.itinerary(part)
        outputs.require_fit(asked.problem)
        return asked.problem, asked.via

    width = question.scenario.planner.corridor
    with progress_bar(None, quiet) as callback:
        return Answer(
            plan_in_corridor(
                pose,
                planner,
                cells,
                half_width=width if isinstance(width, float) else None,
                callback=callback,
            )
        )


@with_options("map", "route", "constraints", "planner", "output")
def plan_command(where: Where, given: dict[str, dict[str, Any]]) -> int:
    """Plan one route on a surface, and prove how far from the shortest it can be.

    All options may stand in a scenario file, see `terrapath init`; those given here count
    before the file's. Exit codes: 0 solved, 2 bad input, 3 no path found within the limits,
    4 proven unreachable, 5 standard output is closed or full (all files are written), 130
    interrupted (the best route to the goal so far is written).
    """
    scenario = scenario_of(where, given)
    _require_agreement(scenario)
    planner = _planner(scenario)
    output, route = scenario.output, scenario.route
    outputs = RouteOutputs(output, len(route.via) + 1)
    outputs.check([where, *scenario.inputs()])
    question, quiet = Question(scenario), output.quiet or output.json
    with compiling_told(quiet):
        if is_planned_in_corridor(scenario, cells := question.cells()):
            answer = _solve_in_corridor(planner, question, cells, outputs, quiet)
        else:
            itinerary = question.itinerary()
            outputs.require_fit(itinerary.problem)
            answer = _solve(planner, itinerary, route.all_goals, quiet)
    # Shown before it is written, so that a full disk loses no answer; and written although it
    # cannot be shown.
    try:
        _print(answer, scenario)
    finally:
        if answer.solution.path is not None:
            outputs.write(answer.solution)
    return exit_code(answer.solution)


def _print(answer: Answer, scenario: Scenario) -> None:
    if scenario.output.json:
        from ..io.routes.record import dump

        typer.echo(dump(answer.record()), nl=False)
        return
    from .report import print_report

    print_report(answer.solution, scenario.planner.target_gap, answer.goals)


def exit_code(solution: Solution) -> ExitCode:
    """The documented exit code for a solution."""
    from ..problem import Status

    return {
        Status.SOLVED: ExitCode.SOLVED,
        Status.NOT_FOUND: ExitCode.NOT_FOUND,
        Status.UNREACHABLE: ExitCode.UNREACHABLE,
        Status.INTERRUPTED: ExitCode.INTERRUPTED,
    }[solution.status]
