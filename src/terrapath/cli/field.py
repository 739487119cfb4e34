"""``terrapath field``: the distances from one place to everywhere."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from ..scenario.outputs import FieldOutputs
from ..scenario.scenario import Given
from .console import ExitCode, compiling_announced
from .options import Where, asked, with_options


@with_options(
    "map",
    "route",
    "constraints",
    also=["planner_spacing"],
    without=["route_goal", "route_all_goals", "route_via"],
)
def field_command(
    where: Where,
    given: Given,
    output: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Write .tif (GeoTIFF) or .npz; may be repeated."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the field: .png, .svg, .pdf or .jpg."),
    ] = None,
) -> int:
    """Compute the distance field: the least length from the start to every node of a lattice.

    From a scenario file, only the map, the start, the bounds, the constraints and the spacing
    are used. Exit codes: 0 done, 2 bad input, 5 standard output is closed or full (all files
    are written), 130 interrupted (nothing is written).
    """
    scenario = asked(where, given)
    outputs = FieldOutputs(output or [], plot)
    outputs.check(scenario.inputs())
    from ..scenario.answers import field as field_of
    from .report import print_field

    started = time.perf_counter()
    with compiling_announced():
        field = field_of(scenario)
    seconds = time.perf_counter() - started
    try:
        print_field(field, seconds)
    finally:
        outputs.write(field)
    return ExitCode.SOLVED
