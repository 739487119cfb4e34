"""A distance field from above: lines of equal distance over the shaded ground."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.ticker import MaxNLocator

from ..distance.field import DistanceField
from ..problem import Problem
from ..surface.ground import quantity, value_unit
from ..validation import Array
from .labels import AxisUnit
from .map_view import draw_ground, draw_scale, draw_start

LINES = 24
LINE_COLOURS = "plasma"
PALE = 0.75  # opacity of the ground
HATCH = "////"


def _as_problem(field: DistanceField) -> Problem:
    """The ground of a field, as a problem whose start and goal are the field's source."""
    if field.problem is not None:
        return field.problem
    space, nodata = field.free_space, field.surface.nodata
    masks = [mask for mask in space.masks if mask is not nodata]
    obstacles = [*space.geometries, *space.circles, *masks]
    return Problem(field.surface, field.source, field.source, field.lattice.bounds, obstacles)


def _draw_lines(axes: Any, field: DistanceField, values: Array, unit: str) -> None:
    """Draw lines of equal distance, with labels."""
    lattice = field.lattice
    ticks = MaxNLocator(LINES, steps=[1, 2, 5, 10]).tick_values(0.0, float(values.max()))
    levels = [level for level in ticks if level > 0.0]
    style = {"levels": levels, "cmap": LINE_COLOURS, "linewidths": 1.3}
    lines = axes.contour(lattice.x, lattice.y, values, zorder=4, **style)
    halo = patheffects.withStroke(linewidth=2.4, foreground="white", alpha=0.8)
    lines.set_path_effects([halo])
    shown = AxisUnit.for_lengths(float(values.max()), unit)
    for text in lines.clabel(fontsize=8, fmt=shown.format):
        text.set(color="black", path_effects=[halo])
    label = shown.label(quantity(field.surface))
    bar = axes.figure.colorbar(lines, ax=axes, label=label, shrink=0.72, pad=0.02)
    shown.apply(bar.ax.yaxis)


def _hatch(axes: Any, field: DistanceField) -> None:
    """Hatch the region where no node was reached."""
    missing = ~np.isfinite(field.values)
    if missing.any():
        lattice = field.lattice
        style = {"levels": [0.5, 1.5], "colors": "none", "hatches": [HATCH], "zorder": 5}
        axes.contourf(lattice.x, lattice.y, missing.astype(np.float64), **style)


def draw_distances(axes: Any, field: DistanceField) -> None:
    """Draw a field on two-dimensional axes; regions that were not reached are hatched."""
    problem = _as_problem(field)
    terrain = draw_ground(axes, problem, PALE, contours=False)
    if terrain.costs is not None:
        draw_scale(axes, terrain)
    values = np.ma.masked_invalid(field.values)
    _hatch(axes, field)
    if values.count() and values.max() > 0.0:
        _draw_lines(axes, field, values, value_unit(problem.surface))
    draw_start(axes, problem)
    if len(axes.get_legend_handles_labels()[1]) > 1:  # not only the start has an entry
        axes.legend(loc="upper left", fontsize=8, framealpha=0.85).set_zorder(7)
