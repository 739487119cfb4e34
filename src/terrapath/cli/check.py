"""``terrapath check``: prove a certificate again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from ..scenario.scenario import Given
from .console import ExitCode, compiling_announced
from .options import Where, asked, with_options


@with_options("map", "route", "constraints", without=["route_all_goals"])
def check_command(
    where: Where,
    certificate: Annotated[
        Path,
        typer.Argument(metavar="CERTIFICATE", help="A file that `plan --certificate` wrote, .npz."),
    ],
    given: Given,
    leg: Annotated[
        int | None,
        typer.Option(metavar="K", help="The leg of a tour that the certificate proves, from 1."),
    ] = None,
) -> int:
    """Check a certificate: prove its lower bound again, from the problem alone.

    Give the same options for the problem as to `terrapath plan`. Exit codes: 0 the certificate
    holds, 2 it does not, or it belongs to another problem, 5 standard output is closed or full.
    """
    from ..certificates.certificate import Certificate
    from ..scenario.answers import check
    from .report import print_check

    scenario = asked(where, given)
    loaded = Certificate.load(certificate)
    started = time.perf_counter()
    with compiling_announced():
        problem = check(scenario, loaded, leg=leg)
    print_check(problem, loaded, time.perf_counter() - started)
    return ExitCode.SOLVED
