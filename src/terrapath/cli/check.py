"""``terrapath check``: prove a certificate again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..scenario.scenario import assembled
from .console import ExitCode, compiling_told
from .options import Where, with_options


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
    from ..scenario.answers import check
    from .report import print_check

    scenario = assembled(where, given)
    loaded = Certificate.load(certificate)
    started = time.perf_counter()
    with compiling_told():
        problem = check(scenario, loaded, leg=leg)
    print_check(problem, loaded, time.perf_counter() - started)
    return ExitCode.SOLVED
