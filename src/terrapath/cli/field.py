"""``terrapath field``: the distances from one place to everywhere."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..scenario.outputs import FieldOutputs
from ..scenario.scenario import assembled
from .console import ExitCode, compiling_told
from .options import Where, with_options


@with_options(
    "map",
    "route",
    "constraints",
    also=["planner_spacing"],
    without=["route_goal", "route_all_goals", "route_via"],
)
def field_command(
    where: Where,
    given: dict[str, dict[str, Any]],
    output: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Write .tif (GeoTIFF) or .npz; may be repeated."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw it: .png, .svg, .pdf or .jpg.")
    ] = None,
) -> int:
    """Compute the distance field: the least length from the start to every node of a lattice.

    Of a scenario file only the map, the start, the bounds, the constraints and the spacing
    count. Exit codes: 0 done, 2 bad input, 5 standard output is closed or full (all files are
    written), 130 interrupted (nothing is written).
    """
    scenario = assembled(where, given)
    outputs = FieldOutputs(output or [], plot)
    outputs.check(scenario.inputs())
    from ..scenario.answers import field as field_of
    from .report import print_field

    started = time.perf_counter()
    with compiling_told():
        field = field_of(scenario)
    seconds = time.perf_counter() - started
    try:
        print_field(field, seconds)
    finally:
        outputs.write(field)
    return ExitCode.SOLVED
