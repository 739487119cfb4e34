"""``terrapath check``: prove a certificate again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ..scenario.question import Question, scenario_of
from .compiling import compiling_told
from .exit_codes import ExitCode
from .options import Where, with_options

if TYPE_CHECKING:
    from ..problem import Problem
    from ..scenario.question import Itinerary


def _leg(asked: Itinerary, number: int | None) -> Problem:
    """The leg that a certificate is of."""
    if len(asked.goals) > 1:
        raise InputError(
            f"a certificate is of one goal, and {len(asked.goals)} are given; name it by --goal X,Y"
        )
    problem = asked.problem
    stops = [problem.start, *asked.via, problem.goal]
    count = len(stops) - 1
    if number is None and count > 1:
        raise InputError(f"the tour has {count} legs; say by --leg K which one is proven")
    if number is not None and not 1 <= number <= count:
        raise InputError(f"--leg {number}: the tour has {count} legs; give 1 to {count}")
    k = number or 1
    return problem.between(stops[k - 1], stops[k])


@with_options("map", "route", "constraints", without=["route_all_goals"])
def check_command(
    where: Where,
    certificate: Annotated[
        Path, typer.Argument(metavar="CERTIFICATE", help="What `plan --certificate` wrote, .npz.")
    ],
    given: dict[str, dict[str, Any]],
    leg: Annotated[
        int | None, typer.Option(metavar="K", help="Of a tour: the leg that is proven, from 1.")
    ] = None,
) -> int:
    """Prove a lower bound again, from nothing but the problem and its certificate.

    Give the problem's options as they were given to `terrapath plan`. Exit codes: 0 it holds,
    2 it does not, or is no certificate of this problem, 5 standard output is closed or full.
    """
    from ..certificates.certificate import Certificate

    question = Question(scenario_of(where, given))
    loaded = Certificate.load(certificate)
    with compiling_told():
        problem = _leg(question.itinerary(), leg)
        started = time.perf_counter()
        loaded.check(problem)
    seconds = time.perf_counter() - started
    from .report import print_check

    print_check(problem, loaded, seconds)
    return ExitCode.SOLVED
