"""``terrapath plan``: one route, from a scene, a map or a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from ..scenario.scenario import Given
from .console import ExitCode, compiling_announced, progress_bar
from .options import Where, asked, with_options

if TYPE_CHECKING:
    from ..problem import Solution
    from ..scenario.answers import Answer


@with_options("map", "route", "constraints", "travel", "planner", "output")
def plan_command(where: Where, given: Given) -> int:
    """Plan one route on a surface, and prove how far from the shortest it can be.

    All options can also be given in a scenario file, see `terrapath init`; options given here
    override the file. Exit codes: 0 solved, 2 bad input, 3 no path found within the limits,
    4 proven unreachable, 5 standard output is closed or full (all files are written), 130
    interrupted (the best route to the goal so far is written).
    """
    from ..scenario.answers import answer

    scenario = asked(where, given)
    quiet = scenario.output.quiet or scenario.output.json
    with compiling_announced(quiet), progress_bar(quiet) as watch:
        answered = answer(scenario, watch=watch)
    # The answer is printed first, so that a full disk does not lose it. Files are written even
    # if it cannot be printed.
    try:
        _print(answered)
    finally:
        answered.write()
    return exit_code(answered.solution)


def _print(answered: Answer) -> None:
    if answered.scenario.output.json:
        from ..io.routes.record import dump

        typer.echo(dump(answered.record()), nl=False)
        return
    from .report import print_report

    print_report(answered.solution, answered.scenario.planner.target_gap, answered.goals)


def exit_code(solution: Solution) -> ExitCode:
    """The exit code for a solution."""
    from ..problem import Status

    return {
        Status.SOLVED: ExitCode.SOLVED,
        Status.NOT_FOUND: ExitCode.NOT_FOUND,
        Status.UNREACHABLE: ExitCode.UNREACHABLE,
        Status.INTERRUPTED: ExitCode.INTERRUPTED,
    }[solution.status]
