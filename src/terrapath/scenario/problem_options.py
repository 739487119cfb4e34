"""The options that make a problem: the ground, the route that is asked for, where it may not go."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, TypeAlias

from .option import A_POINT, FILE, FILES, NUMBER, STRICT, SWITCH, TEXT, WHOLE, Extent, Files, Option

Point: TypeAlias = tuple[float, float]
Points: TypeAlias = tuple[Point, ...]
Rectangle: TypeAlias = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class LayerTable:
    """A band of a raster as a layer."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    file: Annotated[str, Option("The raster.", FILE, is_file=True)]
    band: Annotated[int, Option("Its band, 1-based.", WHOLE)] = 1
    weight: Annotated[
        float,
        Option(
            "Of a layer: map units of way that a change of one unit counts for. Of a cost: the "
            "exponent of the multiplier.",
            NUMBER,
        ),
    ] = 1.0


LayerTables: TypeAlias = dict[str, LayerTable]
Weights: TypeAlias = dict[str, float]
A_LAYER = "a table with file, band and weight"


@dataclass(frozen=True, kw_only=True)
class MapSection:
    """The ground: a raster with its layers, or a built-in scene."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    path: Annotated[
        str | None,
        Option("A raster, anything GDAL reads.", FILE, is_file=True, example='"dem.tif"'),
    ] = None
    scene: Annotated[
        str | None,
        Option("A built-in scene, see `terrapath scenes`.", TEXT, example='"six-peaks"'),
    ] = None
    height_band: Annotated[
        int | str | None,
        Option(
            "Band of the heights, its number or the name of a variable [default: 1].",
            "a whole number, or the name of a variable as text",
            form="BAND",
            example="1",
        ),
    ] = None
    fill_holes: Annotated[
        float,
        Option(
            "Fill holes without data whose longer side is at most this, map units; larger ones "
            "stay blocked [default: 0, none].",
            NUMBER,
            form="SIZE",
        ),
    ] = 0.0
    smooth: Annotated[
        Extent,
        Option(
            "Smooth over this length (standard deviation, map units); auto is the least that "
            "heights rounded to a step need [default], none leaves the map as it is.",
            'a finite number, "auto" or "none"',
            form="LENGTH|auto|none",
        ),
    ] = "auto"
    crs: Annotated[
        str | None,
        Option(
            "CRS of a map that names none, as EPSG:32617.",
            TEXT,
            form="CRS",
            example='"EPSG:32617"',
        ),
    ] = None
    layers: Annotated[
        LayerTables,
        Option(
            "A further layer, whose change costs; may be repeated.",
            A_LAYER,
            form="NAME=FILE[:BAND][*WEIGHT]",
            flags=("--layer",),
        ),
    ] = field(default_factory=dict)
    costs: Annotated[
        LayerTables,
        Option(
            "A multiplier above 0 of the length, whose level costs; may be repeated.",
            A_LAYER,
            form="NAME=FILE[:BAND][*EXPONENT]",
            flags=("--cost",),
        ),
    ] = field(default_factory=dict)
    weights: Annotated[
        Weights,
        Option(
            "Map units that a unit of a layer counts for, the height's too; may be repeated.",
            "a table of numbers, NAME = WEIGHT",
            form="NAME=WEIGHT",
            flags=("--weight",),
        ),
    ] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class RouteSection:
    """From where to where."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    start: Annotated[
        Point | None,
        Option("Start, in the map's own coordinates.", A_POINT, form="X,Y", example="[0.0, 0.0]"),
    ] = None
    goal: Annotated[
        Point | Points,
        Option(
            "Goal, in the map's own coordinates; of several the nearest by true length wins.",
            "a point, [X, Y], or a list of points",
            form="X,Y",
            example="[10.0, 10.0]",
        ),
    ] = ()
    all_goals: Annotated[
        bool,
        Option(
            "Plan to each of several goals and report all, or only as far as is needed to know "
            "the nearest [default].",
            SWITCH,
            flags=("--all-goals/--nearest-goal",),
        ),
    ] = False
    via: Annotated[
        Points,
        Option(
            "Pass here on the way; may be repeated, in order.",
            "a list of points, [[X, Y], ...]",
            form="X,Y",
            example="[[5.0, 2.0]]",
        ),
    ] = ()
    latlon: Annotated[
        bool,
        Option(
            "Start, goal and via are latitude,longitude in degrees: WGS 84 on Earth, the body's "
            "own elsewhere.",
            SWITCH,
            flags=("--latlon/--no-latlon",),
        ),
    ] = False
    bounds: Annotated[
        Rectangle | None,
        Option(
            "Plan within this rectangle, in the map's own coordinates [default: the whole map].",
            "four finite numbers, [X1, Y1, X2, Y2]",
            form="X1,Y1,X2,Y2",
            example="[-1.0, -1.0, 11.0, 11.0]",
        ),
    ] = None

    @property
    def goals(self) -> Points:
        """The goals, also where there is one."""
        if self.goal and not isinstance(self.goal[0], tuple):
            return (self.goal,)
        return self.goal


@dataclass(frozen=True, kw_only=True)
class ConstraintsSection:
    """Where the route may not go."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    obstacles: Annotated[
        Files,
        Option(
            "A vector file of obstacles, in any CRS; may be repeated.",
            FILES,
            form="FILE",
            is_file=True,
            example='["obstacles.geojson"]',
        ),
    ] = ()
    radius: Annotated[
        float,
        Option(
            "Of the vehicle: the least distance to every obstacle, map units [default: 0].",
            NUMBER,
            form="R",
        ),
    ] = 0.0
    max_slope: Annotated[
        float | None,
        Option(
            "The steepest ground that may be entered, degrees.",
            NUMBER,
            form="DEGREES",
            example="25.0",
        ),
    ] = None
    keep_in: Annotated[
        str | None,
        Option(
            "A vector file of the area that may not be left, in any CRS.",
            FILE,
            form="FILE",
            is_file=True,
            example='"area.geojson"',
        ),
    ] = None
