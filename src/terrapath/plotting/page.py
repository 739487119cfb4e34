"""An interactive page: terrain and route in 3-D, in one file that needs no network."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from matplotlib.colors import to_hex

from .._support.extras import require_packages
from .._support.files import written_whole
from ..errors import MapError
from ..io.routes.profile import clean, slopes
from ..problem import Path as Route, Solution
from ..space.free_space import sort_obstacles
from ..surface.ground import height_scale
from ..validation import Array
from .labels import format_length, lengths_in_words, nothing_in_words
from .map_view import ALTERNATIVE_COLOURS, PATH_COLOUR
from .terrain import LAYER_COLOURS, Terrain, height_colours

ENDING = ".html"
SAMPLES = 300  # of the terrain, along the longer side
ROUTE_POINTS = 5000
LIFT = 0.004  # how far lines are drawn above the terrain, as a share of the longer side
EXAGGERATIONS = (1, 2, 5)
RELIEF = 0.35  # heights reach at most this share of the side with the first exaggeration
EDGE_COLOUR = "#101010"
# Why ground is not free, and its colour, the same as on the maps.
REASONS = (
    ("blocked or no data", "#3b3b3b"),
    ("too steep", "#6b1f85"),
    ("too close to an obstacle, or outside", "#8f8f8f"),
)
# Graphics cards compute in 32 bits: coordinates far from zero are drawn from a closer origin.
FAR = 1000.0
STYLE = "<style>body { margin: 0 }</style>"
CAMERA = {"eye": {"x": -0.55, "y": -1.3, "z": 0.85}, "center": {"x": 0.0, "y": 0.0, "z": -0.12}}
# The text that shows where a marker is.
AT = "%{customdata[0]:.10g}, %{customdata[1]:.10g}"


class Stage(NamedTuple):
    """What all parts of the 3-D scene share."""

    solution: Solution
    terrain: Terrain
    origin: Array  # (2,), map units: what drawn coordinates are counted from
    scale: float  # units of height in one unit of the plane
    lift: float  # units of height

    @classmethod
    def of(cls, solution: Solution) -> Stage:
        """Sample the terrain and choose the origin."""
        problem = solution.problem
        bounds = problem.bounds
        side = max(bounds.width, bounds.height)
        corner = np.array([bounds.x1_min, bounds.x2_min])
        origin = np.where(np.abs(corner).max() > FAR * side, np.floor(corner), 0.0)
        scale = 1.0 / height_scale(problem.surface, problem.surface.layers[0])
        terrain = Terrain.sample(problem, SAMPLES)
        return cls(solution, terrain, origin, scale, LIFT * side * scale)

    def drawn(self, points: Array, lifts: float = 1.0) -> dict[str, Array]:
        """x, y, z of lines above the terrain, and never below its mesh, which is coarser."""
        mesh = self.terrain.drawn_heights(*points.T)
        heights = self.solution.problem.surface.values(points)[:, 0]
        x, y = (points - self.origin).T
        return {"x": x, "y": y, "z": np.maximum(mesh, heights) + lifts * self.lift}


def _shown(text: str) -> str:
    """A name from a file, without markup and without characters that cannot be printed."""
    return escape(clean(text))


def _with_unit(name: str, unit: str) -> str:
    return _shown(f"{name} ({unit})" if unit else name)


def _suffix(unit: str) -> str:
    return f" {_shown(unit)}" if unit else ""


def _colour_scale(layer: int) -> list[tuple[float, str]] | str:
    if layer > 0:
        return LAYER_COLOURS
    colours = height_colours()
    return [(at, to_hex(colours(at))) for at in np.linspace(0.0, 1.0, 33).tolist()]


def _terrain_traces(stage: Stage) -> list[Any]:
    """The ground, coloured by the second layer where there is one, and what is blocked."""
    import plotly.graph_objects as go

    terrain, surface = stage.terrain, stage.solution.problem.surface
    layer = min(1, len(surface.layers) - 1)
    height, shown, norm = surface.layers[0], surface.layers[layer], terrain.norm(layer)
    points = np.stack(np.meshgrid(terrain.x, terrain.y), axis=-1)
    gradients = height_scale(surface, height) * surface.gradients(points)[..., 0, :]
    steepness = np.degrees(np.arctan(np.hypot(gradients[..., 0], gradients[..., 1])))
    place: dict[str, Any] = {"x": terrain.x - stage.origin[0], "y": terrain.y - stage.origin[1]}
    hover = f"{_shown(height.name)} %{{z:.6g}}{_suffix(height.unit)}"
    if layer > 0:
        hover += f"<br>{_shown(shown.name)} %{{surfacecolor:.6g}}{_suffix(shown.unit)}"
    ground = go.Surface(
        **place,
        z=terrain.values[0].astype(np.float32),
        surfacecolor=terrain.values[layer].astype(np.float32),
        customdata=steepness.astype(np.float32),
        cmin=norm.vmin,
        cmax=norm.vmax,
        colorscale=_colour_scale(layer),
        colorbar={"title": {"text": _with_unit(shown.name, shown.unit)}, "len": 0.7},
        name="terrain",
        hovertemplate=f"{hover}<br>slope %{{customdata:.1f}} degrees<extra></extra>",
    )
    return [ground, *_blocked_traces(stage, place)]


def _blocked_traces(stage: Stage, place: dict[str, Any]) -> list[Any]:
    """Ground that is not free, drawn slightly higher; the legend shows the reasons."""
    import plotly.graph_objects as go

    terrain = stage.terrain
    if not terrain.blocked.any():
        return []
    over = np.where(terrain.blocked, terrain.values[0] + 0.5 * stage.lift, np.nan)
    reason = np.select([terrain.solid, terrain.steep], [0, 1], default=2)
    last = len(REASONS) - 1
    blocked = go.Surface(
        **place,
        z=over.astype(np.float32),
        surfacecolor=reason.astype(np.uint8),
        cmin=0,
        cmax=last,
        colorscale=[(k / last, colour) for k, (_, colour) in enumerate(REASONS)],
        showscale=False,
        hoverinfo="skip",
        name="blocked",
    )
    keys = [
        go.Scatter3d(
            x=[None],
            y=[None],
            z=[None],
            mode="markers",
            marker={"color": colour, "symbol": "square", "size": 8},
            name=name,
        )
        for k, (name, colour) in enumerate(REASONS)
        if (terrain.blocked & (reason == k)).any()
    ]
    return [blocked, *keys]


def _reached_traces(stage: Stage) -> list[Any]:
    """Where there is no path, what can be reached from the start and from the goal."""
    if stage.solution.path is not None:
        return []
    import plotly.graph_objects as go

    from .blocked import Blockage

    terrain = stage.terrain
    traces: list[Any] = []
    for cells, colour, label in Blockage(terrain).reached:
        over = np.where(cells, terrain.values[0] + 0.5 * stage.lift, np.nan)
        traces.append(
            go.Surface(
                x=terrain.x - stage.origin[0],
                y=terrain.y - stage.origin[1],
                z=over.astype(np.float32),
                surfacecolor=np.zeros(over.shape, np.uint8),
                colorscale=[(0.0, colour), (1.0, colour)],
                showscale=False,
                showlegend=True,
                opacity=0.8,
                hoverinfo="skip",
                name=label,
            )
        )
    return traces


def _outlines(stage: Stage) -> list[Any]:
    """Edges of polygons, walls and discs as given, drawn on the terrain as one line with gaps."""
    import plotly.graph_objects as go

    problem = stage.solution.problem
    given, bounds = sort_obstacles(problem.constraints.obstacles), problem.bounds
    shapes = [g.boundary if g.geom_type == "Polygon" else g for g in given.geometries]
    shapes += [shapely.Point(c.x1, c.x2).buffer(c.radius).exterior for c in given.circles]
    step = max(bounds.width, bounds.height) / SAMPLES
    region = shapely.box(bounds.x1_min, bounds.x2_min, bounds.x1_max, bounds.x2_max)
    pieces = shapely.get_parts(shapely.segmentize(shapely.intersection(shapes, region), step))
    lines = [shapely.get_coordinates(piece) for piece in pieces]
    drawn = [stage.drawn(line) for line in lines if len(line) > 1]
    if not drawn:
        return []
    broken = {
        axis: np.concatenate([np.append(line[axis], np.nan) for line in drawn]) for axis in "xyz"
    }
    style = {"color": EDGE_COLOUR, "width": 4}
    return [go.Scatter3d(**broken, mode="lines", line=style, name="outlines", hoverinfo="skip")]


def _drawn_indices(route: Route) -> npt.NDArray[np.intp]:
    """Indices of the profile's points that are drawn."""
    count = len(route.profile.points)
    return np.unique(np.linspace(0, count - 1, min(count, ROUTE_POINTS)).round().astype(np.intp))


def _route_traces(stage: Stage) -> list[Any]:
    """The route, with the text that the pointer shows on it, and the next best routes."""
    import plotly.graph_objects as go

    solution = stage.solution
    if solution.path is None:
        return []
    surface, profile, kept = (
        solution.problem.surface,
        solution.path.profile,
        _drawn_indices(solution.path),
    )
    height, unit = surface.layers[0], solution.path.ground_unit
    along, ground, side = slopes(solution.path)
    # Distance, height, slopes, place, value.
    shown = np.column_stack([profile.distance, profile.values[:, 0], along, ground])
    shown = np.column_stack([shown, profile.points, side, profile.value])[kept]
    template = (
        f"distance %{{customdata[0]:.6g}}{_suffix(unit)}"
        f"<br>value %{{customdata[7]:.6g}}{_suffix(solution.unit)}"
        f"<br>{_shown(height.name)} %{{customdata[1]:.6g}}{_suffix(height.unit)}"
        "<br>slope %{customdata[2]:.1f} degrees, of the ground %{customdata[3]:.1f}, "
        "to the side %{customdata[6]:.1f}"
        "<br>at %{customdata[4]:.10g}, %{customdata[5]:.10g}<extra></extra>"
    )
    traces = []
    for route, colour in zip(solution.alternatives, ALTERNATIVE_COLOURS, strict=False):
        name = f"next best, {format_length(route.value, escape(solution.unit))}"
        line = {"color": colour, "width": 4, "dash": "dash"}
        points = route.profile.points[_drawn_indices(route)]
        traces.append(
            go.Scatter3d(
                **stage.drawn(points), mode="lines", line=line, name=name, hoverinfo="name"
            )
        )
    traces.append(
        go.Scatter3d(
            **stage.drawn(profile.points[kept]),
            mode="lines",
            line={"color": PATH_COLOUR, "width": 7},
            name="route",
            customdata=shown,
            hovertemplate=template,
        )
    )
    return traces


def _marks(stage: Stage) -> list[Any]:
    """Start, via points and goal."""
    import plotly.graph_objects as go

    problem, via = stage.solution.problem, stage.solution.via
    marks = [("start", np.array([problem.start]), "#0b6e4f", "circle")]
    if len(via):
        marks.append(("via", via, "#ffffff", "square"))
    marks.append(("goal", np.array([problem.goal]), "#ffb000", "diamond"))
    return [
        go.Scatter3d(
            **stage.drawn(points, lifts=2.0),
            mode="markers",
            marker={
                "size": 5 if name == "via" else 7,
                "color": colour,
                "symbol": symbol,
                "line": {"width": 1},
            },
            name=name,
            customdata=points,
            hovertemplate=f"{name}, {AT}<extra></extra>",
        )
        for name, points, colour, symbol in marks
    ]


def _title(solution: Solution) -> str:
    unit, length = solution.unit, solution.value
    name = f"{solution.problem.name}: " if solution.problem.name else ""
    if length is None:
        return f"{name}{nothing_in_words(solution)}"
    text = f"{name}{solution.planner}, {lengths_in_words(solution)}"
    if solution.lower_bound is None or solution.gap is None:
        return text
    bound = format_length(solution.lower_bound, unit)
    return f"{text}; {solution.bound_in_words} than {bound}, a gap of {solution.gap_in_words}"


def _axis_title(name: str, unit: str, origin: float) -> dict[str, str]:
    return {"text": _with_unit(f"{name} - {origin:.0f}" if origin else name, unit)}


def _layout(stage: Stage) -> dict[str, Any]:
    """Axes at the same scale, and buttons that exaggerate the heights."""
    solution, bounds = stage.solution, stage.solution.problem.bounds
    surface, heights = solution.problem.surface, stage.terrain.values[0]
    side = max(bounds.width, bounds.height)
    # The bottom of the box is a little below the ground, or its lines would show through.
    low, high = float(heights.min()) - stage.lift, float(heights.max()) + 3.0 * stage.lift
    true = (high - low) / stage.scale / side
    flat = {"x": bounds.width / side, "y": bounds.height / side}
    ratios = [{**flat, "z": k * true} for k in EXAGGERATIONS]
    first = max([k for k, r in enumerate(ratios) if r["z"] <= RELIEF], default=0)
    buttons = [
        {"label": f"{k}x", "method": "relayout", "args": [{"scene.aspectratio": ratio}]}
        for k, ratio in zip(EXAGGERATIONS, ratios, strict=True)
    ]
    unit, height, (west, south) = surface.unit, surface.layers[0], stage.origin.tolist()
    ranges = [[bounds.x1_min - west, bounds.x1_max - west], [bounds.x2_min - south] * 2]
    ranges[1][1] = bounds.x2_max - south
    return {
        "title": {"text": _shown(_title(solution)), "font": {"size": 16}},
        "scene": {
            "xaxis": {"title": _axis_title("x1", unit, west), "range": ranges[0]},
            "yaxis": {"title": _axis_title("x2", unit, south), "range": ranges[1]},
            "zaxis": {"title": _axis_title(height.name, height.unit, 0.0), "range": [low, high]},
            "aspectmode": "manual",
            "aspectratio": ratios[first],
            "camera": {
                "eye": {"x": -0.6, "y": -1.4, "z": 0.95},
                "center": {"x": 0, "y": 0, "z": -0.2},
            },
        },
        "updatemenus": [
            {
                "type": "buttons",
                "direction": "right",
                "buttons": buttons,
                "active": first,
                "x": 0.0,
                "y": 0.0,
                "xanchor": "left",
                "yanchor": "bottom",
            }
        ],
        "annotations": [
            {
                "text": "height exaggeration",
                "showarrow": False,
                "xref": "paper",
                "yref": "paper",
                "x": 0.0,
                "y": 0.06,
                "xanchor": "left",
                "yanchor": "bottom",
            }
        ],
        "legend": {"x": 0.0, "y": 1.0, "bgcolor": "rgba(255,255,255,0.7)"},
        "margin": {"l": 0, "r": 0, "t": 50, "b": 0},
    }


def draw_page(solution: Solution) -> Any:
    """A plotly figure of terrain, obstacles, route, start and goal."""
    require_packages("a page", "plotly")
    import plotly.graph_objects as go

    stage = Stage.of(solution)
    traces = [*_terrain_traces(stage), *_outlines(stage), *_route_traces(stage), *_marks(stage)]
    traces += _reached_traces(stage)
    return go.Figure(traces, _layout(stage))


def require_known_page(path: Path) -> None:
    """Raise MapError for a file ending other than .html, MissingExtraError without plotly."""
    if path.suffix.lower() != ENDING:
        raise MapError(f"page={str(path)!r} has no known format; end it in {ENDING}")
    require_packages(f"page={str(path)!r}", "plotly")


def plot_page(solution: Solution, path: str | Path) -> None:
    """Write an interactive 3-D page (.html) that needs no other file, completely or not at all."""
    target = Path(path)
    require_known_page(target)
    page = draw_page(solution).to_html(
        include_plotlyjs=True,
        include_mathjax=False,
        full_html=True,
        default_height="100vh",
        div_id="terrapath",
    )
    head = f"<head><title>{_shown(_title(solution))}</title>{STYLE}"
    with written_whole(target) as temporary:
        temporary.write_text(page.replace("<head>", head, 1), encoding="utf-8")
