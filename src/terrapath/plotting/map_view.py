"""The map from above: shaded ground, contours, obstacles, tree and path."""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np
import shapely
from matplotlib import colormaps, patheffects
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.patches import Circle as Disc, PathPatch
from matplotlib.path import Path as Outline
from shapely import LineString, Point, Polygon

from ..problem import Problem, Solution
from ..space.free_space import Parts, sort_obstacles
from .labels import format_length, label_axes, straight_name
from .terrain import COST_COLOURS, LAYER_COLOURS, Cells, Terrain, height_colours

SAMPLES = 500
CONTOURS = 14
TITLE_WIDTH = 70  # letters
LAYER_CONTOURS = 5
# In samples. Without it, contours of a layer with rounded values would follow every step of it.
LAYER_SMOOTHING = 8.0
PATH_COLOUR = "#e4002b"
VIA_COLOUR = "#0b3d91"
# Colours of the next best routes; more of them are not drawn.
ALTERNATIVE_COLOURS = ("#0b3dff", "#8a2be2", "#d95f02", "#00868b", "#6b4226")
MARKS = {"markeredgecolor": "white", "markeredgewidth": 1.2, "ls": "none", "zorder": 6}
OBSTACLE_STYLE: dict[str, Any] = {"facecolor": "#3b3b3b", "edgecolor": "black", "linewidth": 0.8}
# Overlapping margins are joined before drawing, unless they have more corners than this.
MOST_JOINED = 100_000
OBSTACLE_COLOUR = (0.23, 0.23, 0.23, 0.9)
MARGIN_COLOUR = (0.23, 0.23, 0.23, 0.35)
STEEP_COLOUR = (0.42, 0.12, 0.52, 0.55)
OUTSIDE_STYLE: dict[str, Any] = {"facecolor": "#ffffffa0", "edgecolor": "#606060", "hatch": "xxx"}
KEEP_IN = "the keep-in area"
CORNERS = {"upper left": (0, 1), "upper right": (1, 1), "lower left": (0, 0), "lower right": (1, 0)}


def _outline(polygon: Polygon) -> PathPatch:
    rings = [polygon.exterior, *polygon.interiors]
    paths = [Outline(np.asarray(ring.coords), closed=True) for ring in rings]
    return PathPatch(Outline.make_compound_path(*paths))


def draw_obstacles(axes: Any, problem: Problem, terrain: Terrain, area: str = KEEP_IN) -> None:
    """Draw obstacles as given, and around them the margin that the radius adds.

    area : what the path is kept in.
    """
    constraints = problem.constraints
    _draw_margins(axes, problem, terrain)
    if constraints.outside is not None:
        parts = [part for part in shapely.get_parts(constraints.outside) if not part.is_empty]
        patches = PatchCollection(map(_outline, parts), zorder=2.9, linewidth=0.8, **OUTSIDE_STYLE)
        axes.add_collection(patches)
        _explain(axes, f"outside {area}", OUTSIDE_STYLE["facecolor"], "#606060")
    if terrain.steep.any():
        _tint(axes, problem, terrain.steep, STEEP_COLOUR)
        _explain(axes, f"steeper than {problem.max_slope:g}°", STEEP_COLOUR)
    _draw_solid(axes, sort_obstacles(constraints.obstacles))
    if terrain.masked.any():
        _tint(axes, problem, terrain.masked, OBSTACLE_COLOUR)


def _draw_solid(axes: Any, parts: Parts) -> None:
    """Draw geometries and discs as they were given."""
    patches = [_outline(g) for g in parts.geometries if isinstance(g, Polygon)]
    discs = [Disc((c.x1, c.x2), c.radius) for c in parts.circles]
    axes.add_collection(PatchCollection([*patches, *discs], zorder=3, **OBSTACLE_STYLE))
    walls = [np.asarray(g.coords) for g in parts.geometries if isinstance(g, LineString)]
    axes.add_collection(LineCollection(walls, colors="black", linewidths=2.0, zorder=3))
    points = np.array([g.coords[0] for g in parts.geometries if isinstance(g, Point)])
    if len(points):
        axes.plot(*points.T, ".", color="black", ms=4, zorder=3)


def _draw_margins(axes: Any, problem: Problem, terrain: Terrain) -> None:
    """Tint the ground that is within the vehicle's radius of an obstacle."""
    if problem.radius == 0.0:
        return
    space = problem.free_space
    discs = [shapely.Point(c.x1, c.x2).buffer(c.radius) for c in space.circles]
    shapes = np.array([*space.geometries, *discs], np.object_)
    if shapely.get_num_coordinates(shapes).sum() < MOST_JOINED:
        shapes = shapely.get_parts(shapely.union_all(shapes))
    patches = PatchCollection(
        [_outline(g) for g in shapes if isinstance(g, Polygon)],
        facecolor=MARGIN_COLOUR,
        edgecolor="black",
        linewidth=0.4,
        zorder=2.8,
    )
    axes.add_collection(patches)
    if terrain.in_mask_margin.any():
        _tint(axes, problem, terrain.in_mask_margin, MARGIN_COLOUR)
    if len(shapes) or space.masks:
        label = f"radius {problem.radius:g} {problem.surface.unit}".rstrip()
        _explain(axes, label, MARGIN_COLOUR)


def _tint(axes: Any, problem: Problem, cells: Cells, colour: tuple[float, ...]) -> None:
    shown = np.where(cells[..., None], colour, 0.0)
    axes.imshow(shown, extent=_extent(problem), origin="lower", zorder=2.8)


def _explain(axes: Any, text: str, colour: Any, edge: Any = "none") -> None:
    """Add an entry for a colour of the map to the legend."""
    axes.plot([], [], "s", color=colour, ms=9, markeredgecolor=edge, label=text)


def _extent(problem: Problem) -> tuple[float, float, float, float]:
    b = problem.bounds
    return b.x1_min, b.x1_max, b.x2_min, b.x2_max


def _draw_contours(axes: Any, terrain: Terrain) -> None:
    """Draw contours: heights in black, and the second layer, if there is one, in its colours."""
    heights, *others = terrain.values
    if np.ptp(heights) > 0.0:
        style = {"colors": "black", "linewidths": 0.45, "alpha": 0.45, "linestyles": "solid"}
        axes.contour(terrain.x, terrain.y, heights, CONTOURS, **style)
        if terrain.costs is not None:
            axes.plot([], [], color="black", lw=0.8, label=f"contours: {terrain.label(0)}")
    if others and np.ptp(others[0]) > 0.0:
        from scipy.ndimage import gaussian_filter

        style = {"cmap": LAYER_COLOURS, "linewidths": 0.8, "alpha": 0.9}
        smooth = gaussian_filter(others[0], LAYER_SMOOTHING)
        axes.contour(terrain.x, terrain.y, smooth, LAYER_CONTOURS, **style)
        colour, label = colormaps[LAYER_COLOURS](0.5), f"contours: {terrain.label(1)}"
        axes.plot([], [], color=colour, lw=1.5, label=label)


def _draw_tree(axes: Any, solution: Solution) -> None:
    if solution.tree is None:
        return
    segments = solution.tree.segments
    opacity = float(np.clip(2000.0 / (len(segments) + 1), 0.14, 0.6))
    axes.add_collection(
        LineCollection(list(segments), colors="black", linewidths=0.35, alpha=opacity, zorder=2)
    )


def _draw_path(axes: Any, solution: Solution) -> None:
    problem = solution.problem
    halo = [patheffects.withStroke(linewidth=4.6, foreground="white")]
    if solution.path is not None:
        # White is visible on dark ground; the outline is, on bright ground and in the legend.
        outline = [patheffects.withStroke(linewidth=3.2, foreground="#303030")]
        style = {"color": "white", "lw": 1.6, "ls": (0, (4, 3)), "path_effects": outline}
        axes.plot(*solution.stops.T, zorder=4, label=straight_name(solution), **style)
        _draw_alternatives(axes, solution)
        axes.plot(
            *solution.path.points.T,
            color=PATH_COLOUR,
            lw=2.4,
            zorder=5,
            path_effects=halo,
            solid_capstyle="round",
            label="route",
        )
    draw_ends(axes, problem)
    if len(solution.via):
        axes.plot(*solution.via.T, "D", color=VIA_COLOUR, ms=7, label="via", **MARKS)


def _draw_alternatives(axes: Any, solution: Solution) -> None:
    """Draw the next best routes, thin and dashed, with their lengths in the legend."""
    halo = [patheffects.withStroke(linewidth=2.8, foreground="white", alpha=0.8)]
    for path, colour in zip(solution.alternatives, ALTERNATIVE_COLOURS, strict=False):
        style = {"color": colour, "lw": 1.5, "ls": (0, (5, 2)), "path_effects": halo}
        label = f"next best, {format_length(path.value, solution.unit)}"
        axes.plot(*path.points.T, zorder=4.5, label=label, **style)


def draw_ends(axes: Any, problem: Problem) -> None:
    """Draw the start and the goal."""
    draw_start(axes, problem)
    axes.plot(*problem.goal, "*", color="#ffb000", ms=15, label="goal", **MARKS)


def draw_start(axes: Any, problem: Problem) -> None:
    """Draw the start alone."""
    axes.plot(*problem.start, "o", color="#0b6e4f", ms=9, label="start", **MARKS)


def draw_ground(
    axes: Any,
    problem: Problem,
    opacity: float = 1.0,
    *,
    contours: bool = True,
    area: str = KEEP_IN,
) -> Terrain:
    """Draw the region without a route: shaded ground, contours, obstacles, limits and labels.

    The ground is coloured by its height, or by what it costs where there are cost layers.
    """
    terrain = Terrain.sample(problem, SAMPLES)
    has_costs = terrain.costs is not None
    shown = terrain.shaded_costs() if has_costs else terrain.shaded(0)
    style = {"extent": _extent(problem), "origin": "lower"}
    style["interpolation"] = "nearest" if has_costs else "bilinear"
    axes.imshow(shown, alpha=opacity, **style)
    if contours:
        _draw_contours(axes, terrain)
    draw_obstacles(axes, problem, terrain, area)
    axes.set(xlim=_extent(problem)[:2], ylim=_extent(problem)[2:], aspect="equal")
    label_axes(axes, problem)
    return terrain


def _emptiest_corner(solution: Solution) -> str:
    """The corner that is farthest from start, goal and all routes, as matplotlib names it."""
    problem = solution.problem
    shown = [problem.start, problem.goal]
    for path in (solution.path, *solution.alternatives):
        shown.extend([] if path is None else path.points.tolist())
    x_min, x_max, y_min, y_max = _extent(problem)
    places = (np.array(shown) - [x_min, y_min]) / [x_max - x_min, y_max - y_min]
    clear = {name: np.hypot(*(places - at).T).min() for name, at in CORNERS.items()}
    return max(clear, key=lambda name: float(clear[name]))


def draw_map(axes: Any, solution: Solution) -> None:
    """Draw ground, tree and path on two-dimensional axes, or what blocks where there is no path."""
    area = KEEP_IN if solution.corridor is None else "the corridor of the coarse route"
    terrain = draw_ground(axes, solution.problem, area=area)
    if solution.path is None:
        from .blocked import Blockage, draw_blockage

        blockage = Blockage(terrain)
        draw_blockage(axes, blockage, _extent(solution.problem))
        axes.set_title(fill(blockage.in_words, TITLE_WIDTH), fontsize=9)
    _draw_tree(axes, solution)
    _draw_path(axes, solution)
    axes.legend(loc=_emptiest_corner(solution), fontsize=8, framealpha=0.85)
    draw_scale(axes, terrain)


def draw_scale(axes: Any, terrain: Terrain) -> None:
    """Draw what the ground's colours mean: heights, or costs where there are cost layers."""
    where = {"ax": axes, "shrink": 0.72, "pad": 0.02}
    if terrain.costs is None:
        colours = ScalarMappable(terrain.norm(0), height_colours())
        axes.figure.colorbar(colours, label=terrain.label(0), **where)
        return
    colours = ScalarMappable(terrain.cost_norm, colormaps[COST_COLOURS])
    bar = axes.figure.colorbar(colours, label=terrain.cost_label, **where)
    if (few := terrain.few_costs) is not None:
        bar.set_ticks(few, labels=[f"{cost:.6g}" for cost in few])
        bar.minorticks_off()
