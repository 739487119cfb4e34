"""The plane from above: shaded map, contours, obstacles, tree and path."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.patches import Circle as Disc
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from scipy.ndimage import gaussian_filter
from shapely import LineString, Polygon

from ..problem import Problem, Solution
from .terrain import LAYER_COLOURS, Terrain, format_length, height_colours, label_axes

SAMPLES = 500
CONTOURS = 14
LAYER_CONTOURS = 5
# In samples: without it the steps of a quantised layer draw a maze instead of contours.
LAYER_SMOOTHING = 8.0
PATH_COLOUR = "#e4002b"
# Of the next best routes; further ones are not drawn.
ALTERNATIVE_COLOURS = ("#0b3dff", "#8a2be2", "#d95f02", "#00868b", "#6b4226")
MARKS = {"markeredgecolor": "white", "markeredgewidth": 1.2, "ls": "none", "zorder": 6}
OBSTACLE_STYLE: dict[str, Any] = {"facecolor": "#3b3b3b", "edgecolor": "black", "linewidth": 0.8}


def _outline(polygon: Polygon) -> PathPatch:
    rings = [polygon.exterior, *polygon.interiors]
    paths = [Outline(np.asarray(ring.coords), closed=True) for ring in rings]
    return PathPatch(Outline.make_compound_path(*paths))


def draw_obstacles(axes: Any, problem: Problem, terrain: Terrain) -> None:
    """Polygons, discs, walls and blocked cells."""
    space = problem.free_space
    patches = [_outline(g) for g in space.geometries if isinstance(g, Polygon)]
    discs = [Disc((c.x1, c.x2), c.radius) for c in space.circles]
    axes.add_collection(PatchCollection([*patches, *discs], zorder=3, **OBSTACLE_STYLE))
    walls = [np.asarray(g.coords) for g in space.geometries if isinstance(g, LineString)]
    axes.add_collection(LineCollection(walls, colors="black", linewidths=2.0, zorder=3))
    if terrain.masked.any():
        shown = np.where(terrain.masked[..., None], [0.23, 0.23, 0.23, 0.9], 0.0)
        axes.imshow(shown, extent=_extent(problem), origin="lower", zorder=3)


def _extent(problem: Problem) -> tuple[float, float, float, float]:
    b = problem.bounds
    return b.x1_min, b.x1_max, b.x2_min, b.x2_max


def _draw_contours(axes: Any, terrain: Terrain) -> None:
    """Heights in black, the second layer, where there is one, in its colours."""
    heights, *others = terrain.values
    if np.ptp(heights) > 0.0:
        style = {"colors": "black", "linewidths": 0.45, "alpha": 0.45, "linestyles": "solid"}
        axes.contour(terrain.x, terrain.y, heights, CONTOURS, **style)
    if others and np.ptp(others[0]) > 0.0:
        style = {"cmap": LAYER_COLOURS, "linewidths": 0.8, "alpha": 0.9}
        smooth = gaussian_filter(others[0], LAYER_SMOOTHING)
        axes.contour(terrain.x, terrain.y, smooth, LAYER_CONTOURS, **style)


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
        straight = np.array([problem.start, problem.goal])
        axes.plot(*straight.T, color="white", lw=1.1, ls=(0, (4, 3)), zorder=4, label="straight")
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


def _draw_alternatives(axes: Any, solution: Solution) -> None:
    """The next best routes, thin and dashed, their lengths in the legend."""
    halo = [patheffects.withStroke(linewidth=2.8, foreground="white", alpha=0.8)]
    for path, colour in zip(solution.alternatives, ALTERNATIVE_COLOURS, strict=False):
        style = {"color": colour, "lw": 1.5, "ls": (0, (5, 2)), "path_effects": halo}
        label = f"next best, {format_length(path.length, solution.problem.surface.unit)}"
        axes.plot(*path.points.T, zorder=4.5, label=label, **style)


def draw_ends(axes: Any, problem: Problem) -> None:
    """Start and goal."""
    draw_start(axes, problem)
    axes.plot(*problem.goal, "*", color="#ffb000", ms=15, label="goal", **MARKS)


def draw_start(axes: Any, problem: Problem) -> None:
    """The start alone."""
    axes.plot(*problem.start, "o", color="#0b6e4f", ms=9, label="start", **MARKS)


def draw_ground(
    axes: Any, problem: Problem, opacity: float = 1.0, *, contours: bool = True
) -> Terrain:
    """The region without a route: shade, contours, obstacles, limits and labels."""
    terrain = Terrain.sample(problem, SAMPLES)
    style = {"extent": _extent(problem), "origin": "lower", "interpolation": "bilinear"}
    axes.imshow(terrain.shaded(0), alpha=opacity, **style)
    if contours:
        _draw_contours(axes, terrain)
    draw_obstacles(axes, problem, terrain)
    axes.set(xlim=_extent(problem)[:2], ylim=_extent(problem)[2:], aspect="equal")
    label_axes(axes, problem)
    return terrain


def draw_map(axes: Any, solution: Solution) -> None:
    """Draw everything onto two-dimensional axes."""
    terrain = draw_ground(axes, solution.problem)
    _draw_tree(axes, solution)
    _draw_path(axes, solution)
    axes.legend(loc="upper left", fontsize=8, framealpha=0.85)
    colours = ScalarMappable(terrain.norm(0), height_colours())
    axes.figure.colorbar(colours, ax=axes, label=terrain.label(0), shrink=0.72, pad=0.02)
