"""``terrapath init``: a commented scenario file to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..scenario.scenario import Given
from .console import ExitCode
from .options import with_options


@with_options("constraints")
def init_command(
    where: Annotated[
        str,
        typer.Argument(metavar="MAP", help="A raster, or a built-in scene."),
    ],
    given: Given,
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The scenario file, .toml [default: named after the map]."
        ),
    ] = None,
    crs: Annotated[
        str | None,
        typer.Option(metavar="CRS", help="CRS of a map that has none, such as EPSG:32617."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")] = False,
) -> int:
    """Write a scenario file for a map: every key with its help, and a route that can be planned.

    Constraints that are given stand in the file, and the route keeps to them.
    Exit codes: 0 written, 2 bad input.
    """
    from .._support.files import written_whole
    from ..problem.scenes import SCENES
    from ..scenario.outputs import require_ending, require_outputs
    from ..scenario.templates import template

    file = output or Path(f"{where if where in SCENES else Path(where).stem}.toml")
    require_ending(file, "output", ".toml")
    require_outputs([file], [where])
    if file.exists() and not force:
        raise InputError(f"{file} exists; name another by --output, or give --force to replace it")
    text = template(where, file, crs=crs, constraints=given.get("constraints"))
    with written_whole(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    typer.echo(f"{file} is written; plan it by: terrapath plan {file}")
    return ExitCode.SOLVED
