"""Where and what: the problem that a command line describes, and the options it does so with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from ..errors import InputError

if TYPE_CHECKING:
    from ..problem import Problem
    from ..surface import Surface
    from ..validation import Bounds

Where = Annotated[
    str,
    typer.Argument(metavar="WHERE", help="A built-in scene (see `terrapath scenes`) or a raster."),
]
Start = Annotated[
    str | None, typer.Option(metavar="X,Y", help="Start, in the map's own coordinates.")
]
Goal = Annotated[
    str | None, typer.Option(metavar="X,Y", help="Goal, in the map's own coordinates.")
]
HeightBand = Annotated[
    int | None, typer.Option(metavar="BAND", help="Band of the heights [default: 1].")
]
Layers = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=FILE[:BAND][*WEIGHT]", help="A further layer; may be repeated."),
]
Weights = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=WEIGHT", help="Map units that a unit of a layer counts for."),
]


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


class Place(NamedTuple):
    """The ground that is asked about, and what is known of the way over it."""

    surface: Surface
    bounds: Bounds | None
    name: str
    ends: dict[str, tuple[float, float]]  # start and goal of a built-in scene, map units


@dataclass(frozen=True, kw_only=True)
class Question:
    """What the command line asks about."""

    where: str
    start: str | None = None
    goal: str | None = None
    height_band: int | None = None
    layers: list[str] | None = None
    weights: list[str] | None = None

    def problem(self) -> Problem:
        """The problem that is asked about."""
        from ..problem import Problem

        place = self.place()
        start, goal = self._end(place, "start", self.start), self._end(place, "goal", self.goal)
        return Problem(place.surface, start, goal, place.bounds, name=place.name)

    def problem_to_itself(self) -> Problem:
        """The problem that is asked about where there is no goal: from the start to the start."""
        from ..problem import Problem

        place = self.place()
        start = self._end(place, "start", self.start)
        return Problem(place.surface, start, start, place.bounds, name=place.name)

    def place(self) -> Place:
        """The scene or the map."""
        from ..scenes import SCENES

        found = self._scene() if self.where in SCENES else self._map()
        weights = _parse_weights(self.weights or [])
        return found._replace(surface=found.surface.with_weights(weights)) if weights else found

    def _scene(self) -> Place:
        from ..scenes import load

        if self.layers or self.height_band is not None:
            raise InputError(
                f"--layer and --height-band describe a raster, but {self.where!r} is a built-in "
                "scene; leave them out, or name a file"
            )
        scene = load(self.where)
        ends = {"start": scene.start, "goal": scene.goal}
        return Place(scene.surface, scene.bounds, scene.name, ends)

    def _map(self) -> Place:
        from ..io import read_surface
        from ..scenes import names

        path = Path(self.where)
        if not path.exists() and not path.suffix:
            raise InputError(
                f"{self.where!r} is neither a built-in scene ({', '.join(names())}) nor a file"
            )
        form = "NAME=FILE[:BAND][*WEIGHT]"
        pairs = [_parse_pair(text, "--layer", form) for text in self.layers or []]
        layers = dict(pairs)
        if len(layers) < len(pairs):
            raise InputError("--layer gives a name twice; give each layer its own name")
        band = 1 if self.height_band is None else self.height_band
        return Place(read_surface(path, height_band=band, layers=layers), None, path.stem, {})

    @staticmethod
    def _end(place: Place, name: str, text: str | None) -> tuple[float, float]:
        """The start or the goal, map units."""
        if text is not None:
            return _to_plane(place.surface, _parse_point(text, name), name)
        if name in place.ends:
            return place.ends[name]
        raise InputError(
            f"{name} is missing; give --{name} X,Y in map units, within "
            f"{_describe_extent(place.surface)}"
        )


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
