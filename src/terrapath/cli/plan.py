"""``terrapath plan``: one route, from a scene or a map."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError, MapError
from .exit_codes import ExitCode

if TYPE_CHECKING:
    from ..planners import Planner
    from ..problem import Problem, Solution


@dataclass(frozen=True)
class Outputs:
    """Where the answer goes."""

    files: list[Path]
    plot: Path | None

    def check(self) -> None:
        """Find out before the planning whether all can be written."""
        from ..files import require_writable
        from ..io.routes import require_known_format

        for path in self.files:
            require_known_format(path)
        if self.plot is not None:
            from ..plotting.figure import require_known_picture

            require_known_picture(self.plot)
        for path in self.all:
            require_writable(path)
        if len({path.absolute() for path in self.all}) < len(self.all):
            raise MapError("the same file is named twice among the outputs; name each once")

    @property
    def all(self) -> list[Path]:
        """Every file that will be written."""
        return [*self.files, *([] if self.plot is None else [self.plot])]

    def write(self, solution: Solution) -> None:
        """Write every file."""
        from ..io import write_route

        for path in self.files:
            write_route(solution, path)
        if self.plot is not None:
            from ..plotting import plot_route

            plot_route(solution, self.plot)


def _parse_point(text: str, name: str) -> tuple[float, float]:
    """X,Y."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"{name}={text!r} is not a point; write it as X,Y, two numbers with a comma between"
        ) from None
    return x, y


def _parse_pair(text: str, option: str, form: str) -> tuple[str, str]:
    """NAME=VALUE."""
    name, separator, value = text.partition("=")
    if not (separator and name.strip() and value.strip()):
        raise InputError(f"{option} {text!r} is not of the form {form}")
    return name.strip(), value.strip()


def _parse_weights(texts: list[str]) -> dict[str, float]:
    weights = {}
    for text in texts:
        name, value = _parse_pair(text, "--weight", "NAME=WEIGHT")
        try:
            weights[name] = float(value)
        except ValueError:
            raise InputError(f"--weight {text!r}: {value!r} is not a number") from None
    return weights


@dataclass(frozen=True)
class Question:
    """What the command line asks to be planned."""

    where: str
    start: str | None
    goal: str | None
    height_band: int | None
    layers: list[str]
    weights: list[str]

    def problem(self) -> Problem:
        """The problem that is asked for."""
        from ..scenes import SCENES

        base = self._scene() if self.where in SCENES else None
        surface = base.surface if base is not None else self._read_surface()
        weights = _parse_weights(self.weights)
        return self._build(surface.with_weights(weights) if weights else surface, base)

    def _scene(self) -> Problem:
        from ..scenes import load

        if self.layers or self.height_band is not None:
            raise InputError(
                f"--layer and --height-band describe a raster, but {self.where!r} is a built-in "
                "scene; leave them out, or name a file"
            )
        return load(self.where)

    def _read_surface(self) -> Any:
        from ..io import read_surface
        from ..scenes import names

        path = Path(self.where)
        if not path.exists() and not path.suffix:
            raise InputError(
                f"{self.where!r} is neither a built-in scene ({', '.join(names())}) nor a file"
            )
        pairs = [_parse_pair(t, "--layer", "NAME=FILE[:BAND][*WEIGHT]") for t in self.layers]
        layers = dict(pairs)
        if len(layers) < len(pairs):
            raise InputError("--layer gives a name twice; give each layer its own name")
        band = 1 if self.height_band is None else self.height_band
        return read_surface(path, height_band=band, layers=layers)

    def _build(self, surface: Any, base: Problem | None) -> Problem:
        from ..problem import Problem

        ends = {}
        for name, text in (("start", self.start), ("goal", self.goal)):
            if text is not None:
                ends[name] = _to_plane(surface, _parse_point(text, name), name)
            elif base is not None:
                ends[name] = base.start if name == "start" else base.goal
            else:
                raise InputError(
                    f"{name} is missing; give --{name} X,Y in map units, within "
                    f"{_describe_extent(surface)}"
                )
        bounds = None if base is None else base.bounds
        title = base.name if base is not None else Path(self.where).stem
        return Problem(surface, ends["start"], ends["goal"], bounds, name=title)


def _to_plane(surface: Any, point: tuple[float, float], name: str) -> tuple[float, float]:
    """A point in the map's own coordinates, on the plane that is planned in."""
    import math

    import numpy as np

    reference = surface.georeference
    if reference is None or reference.is_map_crs:
        return point
    x, y = reference.from_map(np.array(point))
    inside = surface.bounds is None or surface.bounds.contains(np.array([x, y]))
    if not (math.isfinite(x) and math.isfinite(y) and inside):
        raise InputError(
            f"{name}=({point[0]:.10g}, {point[1]:.10g}) is outside the map, "
            f"{_describe_extent(surface)}; check the axis order: X is the longitude"
        )
    return float(x), float(y)


def _describe_extent(surface: Any) -> str:
    """The surface's extent in the map's own coordinates."""
    import numpy as np

    reference, bounds = surface.georeference, surface.bounds
    if reference is None or reference.is_map_crs:
        return str(bounds)
    (west, south), (east, north) = reference.to_map(np.array([bounds[:2], bounds[2:]]))
    return f"longitude {west:.5f} to {east:.5f}, latitude {south:.5f} to {north:.5f}"


def _solve(planner: Planner, problem: Problem, quiet: bool) -> Solution:
    """Plan, with a progress bar where somebody is watching."""
    from .progress import progress_bar

    with progress_bar(problem, quiet) as callback:
        return planner.solve(problem, callback=callback)


def plan_command(
    where: Annotated[
        str,
        typer.Argument(
            metavar="WHERE", help="A built-in scene (see `terrapath scenes`) or a raster."
        ),
    ],
    start: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Start, in the map's own coordinates.")
    ] = None,
    goal: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Goal, in the map's own coordinates.")
    ] = None,
    planner: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="rrt-star-r, rrt-star (chord baseline), rrt, dijkstra, a-star or "
            "geodesic-traversal.",
        ),
    ] = "rrt-star-r",
    samples: Annotated[
        int | None, typer.Option(metavar="N", help="Samples to draw [default: 10000].")
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            metavar="S", help="Longest edge, map units [default: a twelfth of the region's side]."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(metavar="K", help="The same seed, the same route [default: 0]."),
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            metavar="D",
            help="Of the nodes of dijkstra and a-star, map units "
            "[default: a 250th of the region's longer side].",
        ),
    ] = None,
    neighbours: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Of a node of dijkstra and a-star: 8, 16 or 32 [default: 16]."
        ),
    ] = None,
    directions: Annotated[
        int | None,
        typer.Option(metavar="N", help="Rays of geodesic-traversal [default: 600]."),
    ] = None,
    radius_factor: Annotated[
        float | None,
        typer.Option(metavar="F", help="Times the least near radius of the theory [default: 1.5]."),
    ] = None,
    goal_bias: Annotated[
        float | None,
        typer.Option(metavar="P", help="Share of samples that are the goal [default: 0.05]."),
    ] = None,
    informed: Annotated[
        bool | None,
        typer.Option(
            "--informed/--uniform",
            help="Sample where better paths can be [default], or everywhere.",
        ),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Stop then, with the best so far."),
    ] = None,
    target_length: Annotated[
        float | None, typer.Option(metavar="LENGTH", help="Stop at a path this short, map units.")
    ] = None,
    height_band: Annotated[
        int | None,
        typer.Option(metavar="BAND", help="Band of the heights [default: 1]."),
    ] = None,
    layer: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=FILE[:BAND][*WEIGHT]", help="A further layer; may be repeated."),
    ] = None,
    weight: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=WEIGHT",
            help="Map units that a unit of a layer counts for.",
        ),
    ] = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Write .geojson, .csv or .json; may be repeated."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the route: .png, .svg, .pdf or .jpg.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> int:
    """Plan one route on a surface.

    Exit codes: 0 solved, 2 bad input, 3 no path found within the limits, 4 proven
    unreachable, 130 interrupted (the best route so far is written).
    """
    from ..planners import make_planner

    outputs = Outputs(output or [], plot)
    outputs.check()
    options = {
        "samples": samples,
        "step": step,
        "seed": seed,
        "spacing": spacing,
        "neighbours": neighbours,
        "directions": directions,
        "radius_factor": radius_factor,
        "goal_bias": goal_bias,
        "informed": informed,
        "time_limit": time_limit,
        "target_length": target_length,
    }
    given = {name: value for name, value in options.items() if value is not None}
    chosen = make_planner(planner, **given)
    problem = Question(where, start, goal, height_band, layer or [], weight or []).problem()
    solution = _solve(chosen, problem, quiet or as_json)
    # Shown before it is written, so that a full disk loses no answer.
    _print(solution, as_json)
    if solution.path is not None:
        outputs.write(solution)
    return exit_code(solution)


def _print(solution: Solution, as_json: bool) -> None:
    if as_json:
        from ..io import route_record

        typer.echo(json.dumps(route_record(solution)))
        return
    from .report import print_report

    print_report(solution)


def exit_code(solution: Solution) -> ExitCode:
    """The documented exit code for a solution."""
    from ..problem import Status

    return {
        Status.SOLVED: ExitCode.SOLVED,
        Status.NOT_FOUND: ExitCode.NOT_FOUND,
        Status.UNREACHABLE: ExitCode.UNREACHABLE,
        Status.INTERRUPTED: ExitCode.INTERRUPTED,
    }[solution.status]
