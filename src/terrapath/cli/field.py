"""``terrapath field``: the distances from one place to everywhere."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ..scenario.question import Question, scenario_of
from .compiling import compiling_told
from .exit_codes import ExitCode
from .options import Where, with_options
from .outputs import require_outputs

if TYPE_CHECKING:
    from ..distance.field import DistanceField


@dataclass(frozen=True)
class Outputs:
    """Where the field goes."""

    files: list[Path]
    plot: Path | None

    def check(self, inputs: Iterable[str]) -> None:
        """Find out beforehand whether all can be written, and replaces no input."""
        from ..io.fields import require_known_format

        if not self.files and self.plot is None:
            raise InputError("no output is named; give --output FILE.tif, or --plot FILE.png")
        for path in self.files:
            require_known_format(path)
        if self.plot is not None:
            from ..plotting.figure import require_known_picture

            require_known_picture(self.plot)
        require_outputs([*self.files, *([] if self.plot is None else [self.plot])], inputs)

    def write(self, field: DistanceField) -> None:
        """Write every file."""
        from ..io import write_field

        for path in self.files:
            write_field(field, path)
        if self.plot is not None:
            from ..plotting import plot_field

            plot_field(field, self.plot)


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
    scenario = scenario_of(where, given)
    outputs = Outputs(output or [], plot)
    outputs.check([where, *scenario.inputs()])
    from ..distance.field import field_of
    from .report import print_field

    with compiling_told():
        problem = Question(scenario).problem_to_itself()
        started = time.perf_counter()
        field = field_of(problem, spacing=scenario.planner.spacing)
    seconds = time.perf_counter() - started
    try:
        print_field(problem, field, seconds)
    finally:
        outputs.write(field)
    return ExitCode.SOLVED
