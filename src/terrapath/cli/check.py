"""``terrapath check``: prove a certificate again."""

from __future__ import annotations

import time
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import MapError
from .exit_codes import ExitCode
from .question import Goal, HeightBand, Layers, Question, Start, Weights, Where

if TYPE_CHECKING:
    from ..certificate import Certificate


def _load(path: Path) -> Certificate:
    from ..certificate import Certificate

    try:
        return Certificate.load(path)
    except (zipfile.BadZipFile, zlib.error) as error:
        raise MapError(f"{path} is not a certificate, or damaged: {error}") from None


def check_command(
    where: Where,
    certificate: Annotated[
        Path, typer.Argument(metavar="CERTIFICATE", help="What `plan --certificate` wrote, .npz.")
    ],
    start: Start = None,
    goal: Goal = None,
    height_band: HeightBand = None,
    layer: Layers = None,
    weight: Weights = None,
) -> int:
    """Prove a lower bound again, from nothing but the problem and its certificate.

    Give the problem's options as they were given to `terrapath plan`. Exit codes: 0 it holds,
    2 it does not, or is no certificate of this problem.
    """
    question = Question(
        where=where, start=start, goal=goal, height_band=height_band, layers=layer, weights=weight
    )
    loaded = _load(certificate)
    problem = question.problem()
    started = time.perf_counter()
    loaded.check(problem)
    seconds = time.perf_counter() - started
    from .report import print_check

    print_check(problem, loaded, seconds)
    return ExitCode.SOLVED
