"""``terrapath field``: the distances from one place to everywhere."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from .exit_codes import ExitCode
from .outputs import require_outputs
from .question import HeightBand, Layers, Question, Start, Weights, Where

if TYPE_CHECKING:
    from ..eikonal import DistanceField


@dataclass(frozen=True)
class Outputs:
    """Where the field goes."""

    files: list[Path]
    plot: Path | None

    def check(self) -> None:
        """Find out beforehand whether all can be written."""
        from ..io.fields import require_known_format

        if not self.files and self.plot is None:
            raise InputError("no output is named; give --output FILE.tif, or --plot FILE.png")
        for path in self.files:
            require_known_format(path)
        if self.plot is not None:
            from ..plotting.figure import require_known_picture

            require_known_picture(self.plot)
        require_outputs([*self.files, *([] if self.plot is None else [self.plot])])

    def write(self, field: DistanceField) -> None:
        """Write every file."""
        from ..io import write_field

        for path in self.files:
            write_field(field, path)
        if self.plot is not None:
            from ..plotting import plot_field

            plot_field(field, self.plot)


def field_command(
    where: Where,
    start: Start = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            metavar="D",
            help="Of the nodes, map units [default: a 250th of the region's longer side, or a cell "
            "of a finer map].",
        ),
    ] = None,
    height_band: HeightBand = None,
    layer: Layers = None,
    weight: Weights = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Write .tif (GeoTIFF) or .npz; may be repeated."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw it: .png, .svg, .pdf or .jpg.")
    ] = None,
) -> int:
    """Compute the distance field: the least length from the start to every node of a lattice.

    Exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written).
    """
    outputs = Outputs(output or [], plot)
    outputs.check()
    question = Question(
        where=where, start=start, height_band=height_band, layers=layer, weights=weight
    )
    problem = question.problem_to_itself()
    from ..eikonal import distance_field
    from .report import print_field

    started = time.perf_counter()
    field = distance_field(problem.surface, problem.start, bounds=problem.bounds, spacing=spacing)
    print_field(problem, field, time.perf_counter() - started)
    outputs.write(field)
    return ExitCode.SOLVED
