"""The options of ``terrapath plan`` and of scenario files, each declared once.

The command line, scenario files, their JSON Schema, ``tp.scenario.load`` and the template of
``terrapath init`` are all made from these declarations. Nothing slow is imported here, because
typer reads them to print the help; pydantic is imported when there are values to check.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

from .option import (
    A_POINT,
    STRICT,
    WHOLE,
    Extent,
    Files,
    ModelOptions,
    Option,
    Point,
    Points,
    Rectangle,
    SlopeMeasure,
    a_count,
    a_file,
    a_number,
    a_switch,
    some_files,
)


@dataclass(frozen=True, kw_only=True)
class RouteSection:
    """Start, goals and the points between them."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    start: Annotated[
        Point | None,
        Option("Start, in the map's own coordinates.", A_POINT, "X,Y", example="[0.0, 0.0]"),
    ] = None
    goal: Annotated[
        Point | Points,
        Option(
            "Goal, in the map's own coordinates; of several, the nearest by true length is chosen.",
            "a point, [X, Y], or a list of points",
            form="X,Y",
            example="[10.0, 10.0]",
        ),
    ] = ()
    all_goals: Annotated[
        bool,
        a_switch(
            "Plan to each of several goals and report all, or plan only as far as is needed to "
            "know the nearest [default].",
            "--all-goals/--nearest-goal",
        ),
    ] = False
    via: Annotated[
        Points,
        Option(
            "Pass through this point; may be repeated, in order.",
            "a list of points, [[X, Y], ...]",
            form="X,Y",
            example="[[5.0, 2.0]]",
        ),
    ] = ()
    latlon: Annotated[
        bool,
        a_switch(
            "Start, goal and via are latitude,longitude in degrees: WGS 84 on Earth, the body's "
            "own elsewhere.",
            "--latlon/--no-latlon",
        ),
    ] = False
    snap: Annotated[
        float,
        a_number(
            "Move start, goal and via to the nearest free ground, no farther than this, map units "
            "[default: 0, refuse them].",
            "DISTANCE",
        ),
    ] = 0.0
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

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    obstacles: Annotated[
        Files,
        some_files(
            "A vector file of obstacles, in any CRS; may be repeated.", '["obstacles.geojson"]'
        ),
    ] = ()
    radius: Annotated[
        float,
        a_number(
            "Radius of the vehicle: the least distance to every obstacle, map units [default: 0].",
            "R",
        ),
    ] = 0.0
    max_slope: Annotated[
        float | None,
        a_number("The steepest ground that may be entered, degrees.", "DEGREES", "25.0"),
    ] = None
    slope_measure: Annotated[
        SlopeMeasure,
        Option(
            "How steep a cell is: horn, as gdaldem and QGIS compute it [default], or steepest, the "
            "steepest place of the surface in the cell.",
            '"horn" or "steepest"',
            form="horn|steepest",
        ),
    ] = "horn"
    keep_in: Annotated[
        str | None,
        a_file(
            "A vector file of the area that the route may not leave, in any CRS.", '"area.geojson"'
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class TravelSection:
    """Time or energy, to be minimised in place of length."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    model: Annotated[
        str | None,
        Option(
            "Minimise time or energy by this travel model: tobler, naismith, langmuir, "
            "irmischer_clarke, campbell, minetti, pandolf, llobera_sluckin or vehicle; see "
            "`terrapath travel` [default: minimise length].",
            "the name of a travel model, as text",
            form="MODEL",
            flags=("--travel",),
            example='"tobler"',
        ),
    ] = None
    options: Annotated[
        ModelOptions,
        Option(
            "An option of the travel model, as factor=0.6 or mass=900; may be repeated.",
            "a table of numbers and texts, NAME = VALUE",
            form="NAME=VALUE",
            flags=("--travel-option",),
        ),
    ] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class PlannerSection:
    """How the route is planned, and what is proven about it."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    name: Annotated[
        str,
        Option(
            "rrt-star-r, rrt-star (chord baseline), rrt, dijkstra, a-star, fast-marching, "
            "geodesic-traversal or optimal.",
            "the name of a planner, as text",
            form="NAME",
            flags=("--planner",),
        ),
    ] = "rrt-star-r"
    refine: Annotated[
        bool,
        a_switch(
            "Refine the planner's path to the locally shortest one near it [default], or not.",
            "--refine/--no-refine",
        ),
    ] = True
    bound: Annotated[
        bool,
        a_switch(
            "Prove a lower bound on the length of every path [default], or not.",
            "--bound/--no-bound",
        ),
    ] = True
    target_gap: Annotated[
        float | None,
        a_number(
            "Raise the lower bound until the gap, (length - bound) / bound, is at most G "
            "[default: 0.001 with optimal, else the first bound is kept].",
            "G",
            "0.01",
        ),
    ] = None
    routes: Annotated[
        int | None, a_count("Distinct routes that optimal looks for [default: 3].", "3")
    ] = None
    samples: Annotated[int | None, a_count("Samples to draw [default: 10000].", "10000")] = None
    step: Annotated[
        float | None,
        a_number("Longest edge, map units [default: a twelfth of the region's side].", "S", "1.0"),
    ] = None
    seed: Annotated[
        int | None, Option("The same seed, the same route [default: 0].", WHOLE, "K", example="0")
    ] = None
    spacing: Annotated[
        float | None,
        a_number(
            "Distance between nodes of dijkstra, a-star, fast-marching, optimal and `terrapath "
            "field`, map units [default: a 250th of the region's longer side, or a cell of a "
            "finer map].",
            "D",
            "0.05",
        ),
    ] = None
    neighbours: Annotated[
        int | None,
        a_count("Neighbours of a node of dijkstra and a-star: 8, 16 or 32 [default: 16].", "16"),
    ] = None
    directions: Annotated[
        int | None, a_count("Rays of geodesic-traversal [default: 600].", "600")
    ] = None
    radius_factor: Annotated[
        float | None,
        a_number(
            "The radius in which a new vertex looks for neighbours, as a multiple of the least "
            "that theory allows [default: 1.5].",
            "F",
            "1.5",
        ),
    ] = None
    goal_bias: Annotated[
        float | None, a_number("Share of samples that are the goal [default: 0.05].", "P", "0.05")
    ] = None
    informed: Annotated[
        bool | None,
        a_switch(
            "Sample where better paths can be [default], or everywhere.",
            "--informed/--uniform",
            example="true",
        ),
    ] = None
    time_limit: Annotated[
        float | None,
        a_number(
            "Stop after this time with the best path so far; legs and goals share it.",
            "SECONDS",
            "60.0",
        ),
    ] = None
    corridor: Annotated[
        Extent,
        Option(
            "On maps of over 16 million cells, plan a coarse route, and then the route within this "
            "distance of it, map units; auto is 40 coarse cells [default], none plans on the whole "
            "map at once.",
            'a finite number, "auto" or "none"',
            form="WIDTH|auto|none",
        ),
    ] = "auto"
    target_length: Annotated[
        float | None, a_number("Stop at a path at most this long, map units.", "LENGTH", "17.2")
    ] = None

    @property
    def own(self) -> dict[str, Any]:
        """The given options that belong to the planner itself."""
        general = {"name", "refine", "bound", "target_gap", "corridor"}
        given = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {k: v for k, v in given.items() if k not in general and v is not None}


@dataclass(frozen=True, kw_only=True)
class OutputSection:
    """What is printed and written."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

    files: Annotated[
        Files,
        some_files(
            "Write the route; the file's ending chooses the format; may be repeated.",
            '["route.geojson"]',
            "--output",
        ),
    ] = ()
    simplify: Annotated[
        Extent,
        Option(
            "How far the route may be from the lines between the points written, map units; auto "
            "is a tenth of a cell [default], none writes all points. .json has all points.",
            'a finite number, "auto" or "none"',
            form="LENGTH|auto|none",
        ),
    ] = "auto"
    plot: Annotated[
        str | None,
        a_file("Draw the route on the map: .png, .svg, .pdf or .jpg.", '"route.png"'),
    ] = None
    profile: Annotated[
        str | None,
        a_file(
            "Draw heights and slopes along the route: .png, .svg, .pdf or .jpg.", '"profile.png"'
        ),
    ] = None
    page: Annotated[
        str | None,
        a_file(
            "Write an interactive 3-D page of terrain and route, .html.",
            '"route.html"',
            "FILE.html",
        ),
    ] = None
    certificate: Annotated[
        str | None,
        a_file(
            "Write the proof of the lower bound, .npz, for `terrapath check`; a tour has one "
            "numbered file for each leg.",
            '"proof.npz"',
        ),
    ] = None
    json: Annotated[
        bool, a_switch("Print one JSON object and nothing else.", "--json/--no-json")
    ] = False
    quiet: Annotated[bool, a_switch("No progress bar.", "--quiet/--no-quiet", "-q")] = False

    @property
    def names_files(self) -> bool:
        """Is any file named to be written? One without a name is named, too, and refused."""
        others = (self.plot, self.profile, self.page, self.certificate)
        return bool(self.files) or any(file is not None for file in others)
