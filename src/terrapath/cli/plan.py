"""``terrapath plan``: one route, from a scene, a map or a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from ..scenario.scenario import assembled
from .console import ExitCode, compiling_told, progress_bar
from .options import Where, with_options

if TYPE_CHECKING:
    from ..problem import Solution
    from ..scenario.answers import Answer


@with_options("map", "route", "constraints", "planner", "output")
def plan_command(where: Where, given: dict[str, dict[str, Any]]) -> int:
    """Plan one route on a surface, and prove how far from the shortest it can be.

    All options may stand in a scenario file, see `terrapath init`; those given here count
    before the file's. Exit codes: 0 solved, 2 bad input, 3 no path found within the limits,
    4 proven unreachable, 5 standard output is closed or full (all files are written), 130
    interrupted (the best route to the goal so far is written).
    """
    from ..scenario.answers import answer

    scenario = assembled(where, given)
    quiet = scenario.output.quiet or scenario.output.json
    with compiling_told(quiet), progress_bar(quiet) as watch:
        found = answer(scenario, watch=watch)
    # Shown before it is written, so that a full disk loses no answer; and written although it
    # cannot be shown.
    try:
        _print(found)
    finally:
        found.write()
    return exit_code(found.solution)


def _print(found: Answer) -> None:
    if found.scenario.output.json:
        from ..io.routes.record import dump

        typer.echo(dump(found.record()), nl=False)
        return
    from .report import print_report

    print_report(found.solution, found.scenario.planner.target_gap, found.goals)


def exit_code(solution: Solution) -> ExitCode:
    """The documented exit code for a solution."""
    from ..problem import Status

    return {
        Status.SOLVED: ExitCode.SOLVED,
        Status.NOT_FOUND: ExitCode.NOT_FOUND,
        Status.UNREACHABLE: ExitCode.UNREACHABLE,
        Status.INTERRUPTED: ExitCode.INTERRUPTED,
    }[solution.status]
