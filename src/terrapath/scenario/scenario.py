"""A question to Terrapath: its map and all options together, and how it is put together."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, TypeAlias

from ..errors import InputError
from .option import (
    NUMBER,
    STRICT,
    TEXT,
    WHOLE,
    Declared,
    Extent,
    Files,
    Interval,
    Option,
    a_file,
    a_number,
    a_switch,
    declared,
)
from .sections import (
    ConstraintsSection,
    OutputSection,
    PlannerSection,
    RouteSection,
    TravelSection,
)

# Values by section and key.
Given: TypeAlias = Mapping[str, Mapping[str, object]]


@dataclass(frozen=True, kw_only=True)
class LayerTable:
    """A band of a raster as a layer."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    file: Annotated[str, a_file("The raster.", '"layer.tif"')]
    band: Annotated[int, Option("Its band, 1-based.", WHOLE)] = 1
    weight: Annotated[
        float,
        Option(
            "Of a layer: the map units of travel that a change of one unit counts as. Of a cost: "
            "the exponent of the multiplier.",
            NUMBER,
        ),
    ] = 1.0


LayerTables: TypeAlias = dict[str, LayerTable]
Weights: TypeAlias = dict[str, float]
A_LAYER = "a table with file, band and weight"


@dataclass(frozen=True, kw_only=True)
class MapSection:
    """The ground: a raster with its layers, or a built-in scene."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    path: Annotated[str | None, a_file("A raster that GDAL can read.", '"dem.tif"')] = None
    scene: Annotated[
        str | None, Option("A built-in scene, see `terrapath scenes`.", TEXT, example='"six-peaks"')
    ] = None
    height_band: Annotated[
        int | str | None,
        Option(
            "Band of the heights: its number, or the name of a variable [default: 1].",
            "a whole number, or the name of a variable as text",
            form="BAND",
            example="1",
        ),
    ] = None
    fill_holes: Annotated[
        float,
        a_number(
            "Fill holes without data whose longer side is at most this long, map units; larger "
            "holes stay blocked [default: 0, none].",
            "SIZE",
        ),
    ] = 0.0
    smooth: Annotated[
        Extent,
        Option(
            "Smooth over this length (standard deviation, map units); auto takes the least that "
            "heights rounded to a step need [default], none leaves the map as it is.",
            'a finite number, "auto" or "none"',
            form="LENGTH|auto|none",
        ),
    ] = "auto"
    crs: Annotated[
        str | None,
        Option(
            "CRS of a map that has none, as EPSG:32617; none for a plane of its own, without a "
            "place on Earth.",
            TEXT,
            "CRS",
            (),
            '"EPSG:32617"',
        ),
    ] = None
    nodata: Annotated[
        Extent,
        Option(
            "Heights with this value are no data; auto finds such values where they stand out and "
            "says so [default], none takes only what the map declares.",
            'a finite number, "auto" or "none"',
            form="VALUE|auto|none",
        ),
    ] = "auto"
    height_unit: Annotated[
        str | None,
        Option("Unit of heights that have none, as ft.", TEXT, "UNIT", (), '"ft"'),
    ] = None
    cell_size: Annotated[
        float | None,
        a_number("Side of the cells of a picture, which does not say it, map units.", "D", "0.5"),
    ] = None
    height_range: Annotated[
        Interval | None,
        Option(
            "The heights of a picture's darkest and brightest numbers.",
            "two finite numbers, [LOW, HIGH]",
            form="LOW,HIGH",
            example="[0.0, 120.0]",
        ),
    ] = None
    allow_external: Annotated[
        bool,
        a_switch(
            "Let a scenario name files outside its folder, and virtual files take their data from "
            "there or from the network. Not in a scenario file, from which it protects.",
            "--allow-external/--no-allow-external",
        ),
    ] = False
    layers: Annotated[
        LayerTables,
        Option(
            "A further layer: a change of its value costs, as a change of height does; may be "
            "repeated.",
            A_LAYER,
            form="NAME=FILE[:BAND][*WEIGHT]",
            flags=("--layer",),
        ),
    ] = field(default_factory=dict)
    costs: Annotated[
        LayerTables,
        Option(
            "A cost layer, whose value, above 0, multiplies the length; may be repeated.",
            A_LAYER,
            form="NAME=FILE[:BAND][*EXPONENT]",
            flags=("--cost",),
        ),
    ] = field(default_factory=dict)
    smooth_costs: Annotated[
        bool,
        a_switch(
            "Interpolate costs between the centres of their cells; otherwise each cell costs what "
            "its raster says.",
            "--smooth-costs/--cost-cells",
        ),
    ] = False
    weights: Annotated[
        Weights,
        Option(
            "Map units of travel that a change of one unit of a layer counts as; height is a "
            "layer, too; may be repeated.",
            "a table of numbers, NAME = WEIGHT",
            form="NAME=WEIGHT",
            flags=("--weight",),
        ),
    ] = field(default_factory=dict)


# The sections of a scenario file, in its order.
SECTIONS: Mapping[str, type] = {
    "map": MapSection,
    "route": RouteSection,
    "constraints": ConstraintsSection,
    "travel": TravelSection,
    "planner": PlannerSection,
    "output": OutputSection,
}


def options(*sections: str) -> Iterator[Declared]:
    """The options of these sections; of all where none is named."""
    for name in sections or SECTIONS:
        for key, kind, default, option in declared(SECTIONS[name]):
            yield Declared(name, key, kind, default, option)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A question to Terrapath: the values of all options of ``terrapath plan``."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    map: MapSection = field(default_factory=MapSection)
    route: RouteSection = field(default_factory=RouteSection)
    constraints: ConstraintsSection = field(default_factory=ConstraintsSection)
    travel: TravelSection = field(default_factory=TravelSection)
    planner: PlannerSection = field(default_factory=PlannerSection)
    output: OutputSection = field(default_factory=OutputSection)

    def files(self) -> Iterator[str]:
        """All files that are named, to be read or written."""
        yield from self.inputs()
        yield from self.outputs()

    def inputs(self) -> Iterator[str]:
        """The files that are named to be read."""
        yield from self._named(*(name for name in SECTIONS if name != "output"))
        for table in (*self.map.layers.values(), *self.map.costs.values()):
            yield table.file

    def outputs(self) -> Iterator[str]:
        """The files that are named to be written."""
        yield from self._named("output")

    def _named(self, *sections: str) -> Iterator[str]:
        for entry in options(*sections):
            value = getattr(getattr(self, entry.section), entry.key)
            if entry.option.is_file and value:
                yield from [value] if isinstance(value, str) else value

    def overridden(self, given: Given) -> Scenario:
        """The scenario with the given values in place of its own; tables are merged by name."""
        changed = {}
        for name, values in given.items():
            section = getattr(self, name)
            merged = {
                key: {**getattr(section, key), **value} if isinstance(value, dict) else value
                for key, value in values.items()
            }
            changed[name] = dataclasses.replace(section, **merged)
        return dataclasses.replace(self, **changed)


def require_scenario(value: object) -> None:
    """Raise InputError for what is no scenario."""
    if not isinstance(value, Scenario):
        raise InputError(f"scenario={value!r:.60} is none; make one with tp.scenario.load")


# From what a user names and asks

# The map is named by itself, and how an answer is printed is the command's matter.
_NO_KEYWORDS = {"path", "scene", "json", "quiet"}


def load(where: str | Path, **given: object) -> Scenario:
    """A question to Terrapath, ready for ``answer``.

    where : a scenario file (``.toml``), a raster, or the name of a built-in scene.
    given : options that override the file's. Their names are the keys of a scenario file, but
    ``planner`` is the planner's name and ``output`` the files of the route: ``start=(0, 0)``,
    ``planner="optimal"``, ``weights={"height": 10}``, ``max_slope=25``. Paths are relative to the
    working directory.
    Raises InputError for an unknown option, with the nearest known one, and for a value of the
    wrong kind; ScenarioError with the line of a scenario file.
    """
    if not isinstance(where, str | Path):
        raise InputError(
            f"where={type(where).__name__} is no path; name a scenario file, a raster or a scene, "
            "or plan on arrays with tp.read_surface, tp.Problem and tp.plan"
        )
    return assembled(str(where), _checked(given))


def assembled(where: str, given: Given) -> Scenario:
    """The scenario of a scenario file, a map or a scene, with the given values instead of its own.

    given : checked values by section and key. Raises InputError for a name no file can have.
    """
    scenario = _at(where, given).overridden(given)
    for file in scenario.files():
        _require_name(Path(file))
    return scenario


def _require_name(path: Path) -> None:
    """Raise InputError for a name that no file can have."""
    try:
        path.exists()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{str(path)[:60]!r} cannot be a file: {reason}; check the path") from None


def _at(where: str, given: Given) -> Scenario:
    ending = Path(where).suffix.lower()
    if ending == ".toml":
        from .toml import read_scenario

        is_allowed = bool(given.get("map", {}).get("allow_external"))
        return read_scenario(where, None if is_allowed else given)
    if ".scen" in where.lower():
        from .scen import is_scen, read_scen

        if is_scen(where):
            return read_scen(where)
    if not ending:  # names of scenes have none
        from ..problem.scenes import SCENES

        if where in SCENES:
            return Scenario(map=MapSection(scene=where))
    return Scenario(map=MapSection(path=where))


def _checked(given: Mapping[str, object]) -> Given:
    """Keyword arguments as checked values by section and key."""
    from .checked import WrongValueError, nearest_keyword, validated

    known = {entry.keyword: entry for entry in options() if entry.keyword not in _NO_KEYWORDS}
    values: dict[str, dict[str, object]] = {}
    for keyword, value in given.items():
        if keyword not in known:
            raise InputError(
                f"there is no option {keyword!r}; {nearest_keyword(keyword, known.values())}"
            )
        entry = known[keyword]
        several = entry.type == Files and isinstance(value, str | Path)
        values.setdefault(entry.section, {})[entry.key] = _plain([value] if several else value)
    try:
        checked = validated(values)
    except WrongValueError as mistake:
        raise InputError(mistake.reason) from None
    return {
        section: {key: getattr(getattr(checked, section), key) for key in keys}
        for section, keys in values.items()
    }


def _plain(value: object) -> object:
    """A value with paths as text, and arrays and their numbers as Python's own types."""
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple | Iterator):
        return [_plain(entry) for entry in value]
    return value.tolist() if hasattr(value, "tolist") else value
