"""The options of a solution: how it is looked for, what is proven of it, where it goes."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from .option import COUNT, FILE, FILES, NUMBER, STRICT, SWITCH, WHOLE, Extent, Files, Option


@dataclass(frozen=True, kw_only=True)
class PlannerSection:
    """How the route is looked for, and what is proven of it."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

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
        Option(
            "Take the planner's path to the locally shortest one [default], or not.",
            SWITCH,
            flags=("--refine/--no-refine",),
        ),
    ] = True
    bound: Annotated[
        bool,
        Option(
            "Prove how short any path can be [default], or not.",
            SWITCH,
            flags=("--bound/--no-bound",),
        ),
    ] = True
    target_gap: Annotated[
        float | None,
        Option(
            "Refine the bound until (length - bound) / bound is G "
            "[default: 0.001 with optimal, else the first bound will do].",
            NUMBER,
            form="G",
            example="0.01",
        ),
    ] = None
    routes: Annotated[
        int | None, COUNT("Distinct routes that optimal looks for [default: 3].", example="3")
    ] = None
    samples: Annotated[int | None, COUNT("Samples to draw [default: 10000].", example="10000")] = (
        None
    )
    step: Annotated[
        float | None,
        Option(
            "Longest edge, map units [default: a twelfth of the region's side].",
            NUMBER,
            form="S",
            example="1.0",
        ),
    ] = None
    seed: Annotated[
        int | None,
        Option("The same seed, the same route [default: 0].", WHOLE, form="K", example="0"),
    ] = None
    spacing: Annotated[
        float | None,
        Option(
            "Of the nodes of dijkstra, a-star, fast-marching, optimal and `terrapath field`, map "
            "units [default: a 250th of the region's longer side, or a cell of a finer map].",
            NUMBER,
            form="D",
            example="0.05",
        ),
    ] = None
    neighbours: Annotated[
        int | None,
        COUNT("Of a node of dijkstra and a-star: 8, 16 or 32 [default: 16].", example="16"),
    ] = None
    directions: Annotated[
        int | None, COUNT("Rays of geodesic-traversal [default: 600].", example="600")
    ] = None
    radius_factor: Annotated[
        float | None,
        Option(
            "Times the least near radius of the theory [default: 1.5].",
            NUMBER,
            form="F",
            example="1.5",
        ),
    ] = None
    goal_bias: Annotated[
        float | None,
        Option(
            "Share of samples that are the goal [default: 0.05].",
            NUMBER,
            form="P",
            example="0.05",
        ),
    ] = None
    informed: Annotated[
        bool | None,
        Option(
            "Sample where better paths can be [default], or everywhere.",
            SWITCH,
            flags=("--informed/--uniform",),
            example="true",
        ),
    ] = None
    time_limit: Annotated[
        float | None,
        Option(
            "Stop then, with the best so far; legs and goals share it.",
            NUMBER,
            form="SECONDS",
            example="60.0",
        ),
    ] = None
    corridor: Annotated[
        Extent,
        Option(
            "Maps of over 16 million cells are planned on coarse to fine: then around the coarse "
            "route alone, within this distance, map units; auto is 40 coarse cells [default], none "
            "plans on all of the map at once.",
            'a finite number, "auto" or "none"',
            form="WIDTH|auto|none",
        ),
    ] = "auto"
    target_length: Annotated[
        float | None,
        Option("Stop at a path this short, map units.", NUMBER, form="LENGTH", example="17.2"),
    ] = None

    @property
    def own(self) -> dict[str, Any]:
        """The options of the planner itself that were given."""
        general = {"name", "refine", "bound", "target_gap", "corridor"}
        given = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {k: v for k, v in given.items() if k not in general and v is not None}


@dataclass(frozen=True, kw_only=True)
class OutputSection:
    """Where the answer goes."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    files: Annotated[
        Files,
        Option(
            "Write the route, in the format of the ending; may be repeated.",
            FILES,
            form="FILE",
            flags=("--output",),
            is_file=True,
            example='["route.geojson"]',
        ),
    ] = ()
    plot: Annotated[
        str | None,
        Option(
            "Draw the route on the map: .png, .svg, .pdf or .jpg.",
            FILE,
            form="FILE",
            is_file=True,
            example='"route.png"',
        ),
    ] = None
    profile: Annotated[
        str | None,
        Option(
            "Draw heights and slopes along the route: .png, .svg, .pdf or .jpg.",
            FILE,
            form="FILE",
            is_file=True,
            example='"profile.png"',
        ),
    ] = None
    page: Annotated[
        str | None,
        Option(
            "Write an interactive 3-D page of terrain and route, .html.",
            FILE,
            form="FILE.html",
            is_file=True,
            example='"route.html"',
        ),
    ] = None
    certificate: Annotated[
        str | None,
        Option(
            "Write the proof of the bound, .npz, for `terrapath check`; of several legs "
            "numbered files.",
            FILE,
            form="FILE",
            is_file=True,
            example='"proof.npz"',
        ),
    ] = None
    json: Annotated[
        bool,
        Option("Print one JSON object and nothing else.", SWITCH, flags=("--json/--no-json",)),
    ] = False
    quiet: Annotated[
        bool, Option("No progress bar.", SWITCH, flags=("--quiet/--no-quiet", "-q"))
    ] = False
