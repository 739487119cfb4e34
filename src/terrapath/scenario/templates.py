"""Scenario files to begin with: every key with its help, and a route that can be planned."""

from __future__ import annotations

import itertools
import json
import os
import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import MapError
from ..planners.corridor import factor
from ..problem.scenes import SCENES, load
from ..space.free_space import FreeSpace
from ..surface import Surface
from ..surface.bounds import Bounds
from ..validation import require_not_negative
from .answers import MOST_CELLS
from .option import Declared, Point, declared
from .question import require_map
from .scenario import SECTIONS, LayerTable, options
from .sections import ConstraintsSection

# Words that name heights in the description of a band.
HEIGHT_WORDS = ("height", "elevation", "altitude", "dem", "dtm", "dsm", "topograph")
# Words that name what is computed from heights, and is not height.
DERIVED_WORDS = ("slope", "aspect", "rough", "shade", "curvature", "error", "count")
# Start and goal are guessed among a grid of places; this many lie along each side of the map.
PLACES = 9
# An entry of each table that is not of layers.
TABLES = {"weights": "height = 1.0", "options": "factor = 0.6"}
WIDTH = 88

Values = Mapping[tuple[str, str], str]


class Band(NamedTuple):
    """A band of a raster, as its file describes it."""

    number: int
    description: str
    unit: str

    def __str__(self) -> str:
        unit = f" [{self.unit}]" if self.unit else ""
        return f"{self.number} {self.description or 'without a description'}{unit}"


def template(
    where: str,
    file: str | Path = "scenario.toml",
    *,
    crs: str | None = None,
    constraints: Mapping[str, object] | None = None,
) -> str:
    """The text of a scenario to begin with: every key with its help, and a route.

    where : a built-in scene, a raster, or another name that GDAL can read. file : the file that
    the text is for; paths in it are relative to its folder. crs : of a raster that has none.
    constraints : values of that section by key, which the text has and the route keeps to.
    Start and goal on a raster are guessed: free places far apart that a path connects.
    Raises MapError where the raster cannot be read, or has no two such places.
    """
    limits = ConstraintsSection(**(constraints or {}))  # type: ignore[arg-type] # checked in use
    if where in SCENES:
        return _of_scene(where, Path(file), limits)
    return _of_map(where, Path(file), crs, limits)


def _of_scene(name: str, file: Path, limits: ConstraintsSection) -> str:
    problem = load(name)
    ends = problem.start, problem.goal
    if limits != ConstraintsSection():
        ends = _guess(problem.surface, _free_space(problem.surface, problem.bounds, limits))
    values = {
        ("map", "scene"): _text(name),
        **_ends(problem.surface, ends),
        **_given(limits, file),
    }
    return _template(values, f"the built-in scene {name}", [])


def _of_map(where: str, file: Path, crs: str | None, limits: ConstraintsSection) -> str:
    from ..io.maps import open_map
    from ..io.sources import require_safe

    require_map(where)
    require_safe(where, allow_external=False)
    bands = _bands(where)
    height = _height_band(bands)
    with open_map(where, height_band=height, crs=crs) as opened:
        # On a large map, start and goal are guessed on a coarser copy.
        surface = opened.surface(decimate=factor(opened.cells(), MOST_CELLS))
    assert surface.bounds is not None
    name = _relative(where, file)
    values = {
        ("map", "path"): _text(name),
        ("map", "height_band"): str(height),
        **_ends(surface, _guess(surface, _free_space(surface, surface.bounds, limits))),
        **_given(limits, file),
    }
    if crs is not None:
        values["map", "crs"] = _text(crs)
    return _template(values, Path(where).name, _band_lines(bands, height, name))


def _relative(name: str, file: Path) -> str:
    """A path as a file names it; a name that is no path stays as it is."""
    path = Path(name)
    return Path(os.path.relpath(path, file.parent)).as_posix() if path.exists() else name


def _given(limits: ConstraintsSection, file: Path) -> dict[tuple[str, str], str]:
    """The constraints that are given, as TOML, with paths relative to the folder of a file."""
    values = {}
    for entry in options("constraints"):
        value = getattr(limits, entry.key)
        if value == entry.default:
            continue
        if entry.option.is_file:
            is_one = isinstance(value, str)
            names = [_relative(name, file) for name in ([value] if is_one else value)]
            value = names[0] if is_one else names
        values["constraints", entry.key] = json.dumps(value, ensure_ascii=False)
    return values


def _free_space(surface: Surface, bounds: Bounds, limits: ConstraintsSection) -> FreeSpace:
    """Where the vehicle's centre may be."""
    from ..io import read_area, read_obstacles
    from ..space.constraints import Constraints

    require_not_negative(radius=limits.radius)
    return Constraints.of(
        surface,
        bounds,
        tuple(shape for name in limits.obstacles for shape in read_obstacles(name, surface)),
        radius=limits.radius,
        max_slope=limits.max_slope,
        slope_measure=limits.slope_measure,
        keep_in=None if limits.keep_in is None else read_area(limits.keep_in, surface),
    ).free_space()


def _bands(where: str) -> list[Band]:
    from rasterio.errors import RasterioError

    from ..io.rasters import gdal, open_dataset

    try:
        with gdal(), open_dataset(where) as dataset:
            described = zip(dataset.descriptions, dataset.units, strict=True)
            return [Band(k, d or "", u or "") for k, (d, u) in enumerate(described, start=1)]
    except (RasterioError, OSError):
        return []  # opening it as a map raises the error


def _height_band(bands: list[Band]) -> int:
    """The band that is described as heights, else the first."""
    for band in bands:
        text = band.description.lower()
        is_derived = any(word in text for word in DERIVED_WORDS)
        if not is_derived and any(word in text for word in HEIGHT_WORDS):
            return band.number
    return 1


# Start and goal


def _guess(surface: Surface, space: FreeSpace) -> tuple[Point, Point]:
    """Two free places far apart that a path connects, on the plane."""
    bounds = space.bounds
    along = np.linspace(0.1, 0.9, PLACES)
    places = [
        (bounds.x1_min + u * bounds.width, bounds.x2_min + v * bounds.height)
        for v, u in itertools.product(along, along)
    ]
    connected: list[list[Point]] = []
    for place in (_rounded(surface, place) for place in places):
        if not bounds.contains(np.array(place)) or space.blocker(place) is not None:
            continue
        group = next((g for g in connected if not space.separates(g[0], place)), None)
        if group is None:
            connected.append([place])
        else:
            group.append(place)
    pairs = [pair for group in connected for pair in itertools.combinations(group, 2)]
    if not pairs:
        raise MapError("no two free places of the map could be found that a path connects")
    return max(pairs, key=lambda pair: np.hypot(*np.subtract(*pair)))


def _digits(surface: Surface) -> int:
    """The decimals that a hundredth of a cell needs in the map's own coordinates."""
    reference = surface.georeference
    in_degrees = reference is not None and reference.map_crs.is_geographic
    cell = surface.resolution / (111_000.0 if in_degrees else 1.0)
    return max(0, int(np.ceil(-np.log10(cell))) + 2)


def _rounded(surface: Surface, place: Point) -> Point:
    """The place on the plane that the scenario's rounded coordinates stand for."""
    reference = surface.georeference
    if reference is None or reference.is_map_crs:
        x, y = np.round(place, _digits(surface)).tolist()
        return x, y
    rounded = np.round(reference.to_map(np.array(place)), _digits(surface))
    x, y = reference.from_map(rounded).tolist()
    return x, y


def _ends(surface: Surface, ends: tuple[Point, Point]) -> dict[tuple[str, str], str]:
    """Start and goal as TOML, in the map's own coordinates."""
    reference = surface.georeference
    points = np.array(ends, np.float64)
    if reference is not None and not reference.is_map_crs:
        points = reference.to_map(points)
    start, goal = np.round(points, _digits(surface)).tolist()
    return {("route", "start"): json.dumps(start), ("route", "goal"): json.dumps(goal)}


# Text


def _text(value: str) -> str:
    """A string in TOML. It is written as in JSON, except for one character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _template(values: Values, what: str, bands: list[str]) -> str:
    lines = [
        f"# Scenario: a route over {what}.",
        "# This file has every option of `terrapath plan`. An option behind # is not given: remove",
        "# the # to give it. Lengths are in map units. Paths are relative to the folder of this",
        "# file. Options on the command line override those in this file.",
    ]
    for section, kind in SECTIONS.items():
        lines += ["", "", f"# {kind.__doc__}", f"[{section}]"]
        entries = list(options(section))
        plain = [e for e in entries if not (_is_table(e) or e.key == "allow_external")]
        for entry in plain:
            lines += ["", *_entry(entry, values.get((section, entry.key)))]
        for entry in entries:
            if _is_table(entry):
                lines += ["", *_table(entry, bands)]
    return "\n".join(lines) + "\n"


def _is_table(entry: Declared) -> bool:
    return isinstance(entry.default, dict)


def _comment(text: str) -> list[str]:
    return [
        f"# {line}" for line in textwrap.wrap(" ".join(text.split()), WIDTH, break_on_hyphens=False)
    ]


def _entry(entry: Declared, value: str | None) -> list[str]:
    help_text = _comment(entry.option.help.replace("; may be repeated", ""))
    if value is not None:
        return [*help_text, f"{entry.key} = {value}"]
    example = entry.option.example or _as_toml(entry.default)
    return [*help_text, f"# {entry.key} = {example}"]


def _as_toml(value: object) -> str:
    return json.dumps("" if value is None else value)


def _table(entry: Declared, bands: list[str]) -> list[str]:
    lines = _comment(entry.option.help.replace("; may be repeated", ""))
    if entry.key in TABLES:
        return [*lines, f"# [{entry.section}.{entry.key}]", f"# {TABLES[entry.key]}"]
    if entry.key == "layers" and bands:
        return [*lines, *bands]
    return [*lines, *_layer(entry.key, "NAME", "layer.tif", 1)]


def _layer(key: str, name: str, file: str, band: int) -> list[str]:
    shown = {"file": _text(file), "band": str(band), "weight": "1.0"}
    keys = [f"# {name} = {shown[name]}" for name, *_ in declared(LayerTable)]
    return [f"# [map.{key}.{name}]", *keys]


def _band_lines(bands: list[Band], height: int, file: str) -> list[str]:
    """The other bands of the map, as layers that can be switched on."""
    lines = _comment(f"Bands of {file}: {'; '.join(map(str, bands))}.")
    for band in bands:
        if band.number != height:
            name = re.sub(r"[^A-Za-z0-9_-]+", "_", band.description).strip("_")
            lines += _layer("layers", name or f"band_{band.number}", file, band.number)
    return lines
