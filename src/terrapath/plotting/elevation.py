"""The chart of a route: height, slope and further layers against the distance."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..io.routes.profile import Column, Slopes, further_layers, heights, slopes
from ..problem import Path, Solution
from ..surface.ground import height_layer
from ..validation import Array
from .labels import AxisUnit, with_unit
from .map_view import PATH_COLOUR

HEIGHT_COLOUR, GROUND_COLOUR, LIMIT_COLOUR = "#6b5b3e", "#9a9a9a", "#8a2be2"
LAYER_COLOUR, SIDE_COLOUR = "#0b6e4f", "#0b3dff"
# Heights of the panels, inches.
HEIGHT_PANEL, SLOPE_PANEL, LAYER_PANEL, TITLE = 2.6, 1.8, 1.2, 1.2
WIDTH = 10.0


def _draw_height(axes: Any, path: Path) -> None:
    profile, layer = path.profile, height_layer(path.surface)
    height = "" if layer is None else path.surface.layers[layer].name
    values = heights(path, profile.points)
    axes.plot(profile.distance, values, color=HEIGHT_COLOUR, lw=1.6)
    spread = float(np.ptp(values)) or 1.0
    floor = float(values.min()) - 0.08 * spread
    axes.fill_between(profile.distance, floor, values, color=HEIGHT_COLOUR, alpha=0.25, lw=0)
    axes.set_ylim(floor, float(values.max()) + 0.08 * spread)
    axes.set_ylabel(with_unit(height or "no height", path.ground_unit))


def _draw_slopes(axes: Any, distance: Array, slope: Slopes, limit: float | None) -> None:
    """The signed slope along the path, and the ground's steepest slope on both sides of zero."""
    band = {"color": GROUND_COLOUR, "alpha": 0.35, "lw": 0}
    axes.fill_between(distance, -slope.ground, slope.ground, label="of the ground", **band)
    axes.plot(distance, slope.along, color=PATH_COLOUR, lw=1.0, label="along the route", zorder=3)
    axes.plot(distance, slope.side, color=SIDE_COLOUR, lw=0.8, label="to the side")
    axes.axhline(0.0, color="black", lw=0.6)
    if limit is not None:
        style = {"color": LIMIT_COLOUR, "ls": "--", "lw": 1.2}
        axes.axhline(limit, label=f"limit of the ground, {limit:g} degrees", **style)
        axes.axhline(-limit, **style)
    axes.set_ylabel("slope (degrees)")
    axes.legend(fontsize=8, loc="upper right", ncols=4, framealpha=0.85)
    low, high = axes.get_ylim()
    # Leave space for the line of the limit below, and for the legend above.
    axes.set_ylim(low - 0.04 * (high - low), high + 0.25 * (high - low))


def _draw_layer(axes: Any, distance: Array, shown: Column) -> None:
    axes.plot(distance, shown.values, color=LAYER_COLOUR, lw=1.2)
    axes.set_ylabel(with_unit(shown.name, shown.unit, "\n"))


def _mark_vias(axes: Any, solution: Solution, path: Path) -> None:
    """Dashed lines where legs end, numbered on the first panel."""
    for k, via in enumerate(solution.via, start=1):
        nearest = int(np.argmin(np.hypot(*(path.profile.points - via).T)))
        distance = path.profile.distance[nearest]
        for panel in axes:
            panel.axvline(distance, color="black", ls=":", lw=1.0)
        where = {"xycoords": axes[0].get_xaxis_transform(), "va": "top", "fontsize": 8}
        axes[0].annotate(
            f"via {k}", (distance, 0.98), xytext=(3, 0), textcoords="offset points", **where
        )


def draw_charts(figure: Any, solution: Solution, path: Path) -> None:
    """Draw panels below one another that share one axis of distance."""
    problem, distance = solution.problem, path.profile.distance
    more = further_layers(path)
    ratios = [HEIGHT_PANEL, SLOPE_PANEL, *[LAYER_PANEL] * len(more)]
    axes = figure.subplots(
        len(ratios), sharex=True, squeeze=False, gridspec_kw={"height_ratios": ratios}
    )[:, 0]
    _draw_height(axes[0], path)
    _draw_slopes(axes[1], distance, slopes(path), problem.max_slope)
    for panel, shown in zip(axes[2:], more, strict=True):
        _draw_layer(panel, distance, shown)
    _mark_vias(axes, solution, path)
    unit = AxisUnit.for_lengths(distance[-1], path.ground_unit)
    unit.apply(axes[-1].xaxis)
    axes[-1].set_xlabel(unit.label("distance on the ground"))
    axes[-1].set_xlim(0.0, distance[-1] or 1.0)
    for panel in axes:
        panel.grid(alpha=0.3)
    figure.align_ylabels(axes)


def chart_size(path: Path) -> tuple[float, float]:
    """Width and height of the figure, inches."""
    more = len(further_layers(path))
    return WIDTH, TITLE + HEIGHT_PANEL + SLOPE_PANEL + more * LAYER_PANEL
