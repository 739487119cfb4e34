"""A surface sampled for drawing: values, hill shade, colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from matplotlib import colormaps
from matplotlib.colors import LightSource, LogNorm, Normalize
from shapely.geometry.base import BaseGeometry

from ..problem import Problem
from ..space.free_space import Circle, Geometries, sort_obstacles
from ..surface import Mask
from ..surface.neighbours import bilinear
from ..validation import Array
from .labels import in_words, with_unit

Cells: TypeAlias = npt.NDArray[np.bool_]

HEIGHT_COLOURS = "gist_earth"
LAYER_COLOURS = "plasma"
# Cheap ground is light, and dear ground dark. Costs with a wider range have a logarithmic scale;
# of few costs each is named.
COST_COLOURS = "YlGnBu"
WIDE_RANGE, FEW_COSTS = 8.0, 7
# Hill shade changes colours; of costs it must not hide which is which.
COST_SHADE = 0.4
# The surface is shaded as if its range of heights were this share of its extent, so that the
# relief is visible on flat and on steep ground.
SHADED_RELIEF = 0.12


@dataclass(frozen=True, eq=False)
class Terrain:
    """The layers of a problem's region on a regular grid."""

    problem: Problem
    x: Array  # (nx,), map units
    y: Array  # (ny,)
    values: Array  # (layers, ny, nx), in the layers' units

    @classmethod
    def sample(cls, problem: Problem, side: int) -> Terrain:
        """At most ``side`` samples along the longer side of the region."""
        bounds = problem.bounds
        longer = max(bounds.width, bounds.height)
        columns = max(8, round(side * bounds.width / longer))
        rows = max(8, round(side * bounds.height / longer))
        x = np.linspace(bounds.x1_min, bounds.x1_max, columns)
        y = np.linspace(bounds.x2_min, bounds.x2_max, rows)
        points = np.stack(np.meshgrid(x, y), axis=-1)
        return cls(problem, x, y, np.moveaxis(problem.surface.values(points), -1, 0))

    def drawn_heights(self, x: Array, y: Array) -> Array:
        """Heights of the ground as it is drawn, bilinear between the samples; map units."""
        column = (x - self.x[0]) / (self.x[1] - self.x[0])
        row = (y - self.y[0]) / (self.y[1] - self.y[0])
        return bilinear(self.values[0], row, column)

    @cached_property
    def blocked(self) -> Cells:
        """(ny, nx): samples that are not free."""
        space = self.problem.free_space
        return self._inside(space.geometries, space.circles, space.masks)

    @cached_property
    def solid(self) -> Cells:
        """(ny, nx): samples inside a given obstacle (without its margin), or without data."""
        constraints = self.problem.constraints
        parts = sort_obstacles(constraints.obstacles)
        nodata = [] if constraints.nodata is None else [constraints.nodata]
        return self._inside(parts.geometries, parts.circles, [*parts.masks, *nodata])

    @cached_property
    def masked(self) -> Cells:
        """(ny, nx): samples in a blocked cell of a given mask, or without data."""
        constraints = self.problem.constraints
        given = [*constraints.obstacles, constraints.nodata]
        return self._inside([], [], [mask for mask in given if isinstance(mask, Mask)])

    @cached_property
    def steep(self) -> Cells:
        """(ny, nx): samples on ground that is too steep."""
        mask = self.problem.constraints.steep
        return self._inside([], [], [] if mask is None else [mask])

    @cached_property
    def in_mask_margin(self) -> Cells:
        """(ny, nx): samples closer than the radius to a blocked cell, but not in one."""
        inflated = self._inside([], [], self.problem.free_space.masks)
        return inflated & ~self.masked & ~self.steep

    def _inside(
        self,
        geometries: Sequence[BaseGeometry] | Geometries,
        circles: Sequence[Circle],
        masks: Sequence[Mask],
    ) -> Cells:
        """(ny, nx): samples in any of the obstacles."""
        inside = np.zeros((len(self.y), len(self.x)), bool)
        for mask in masks:
            inside |= self._in_mask(mask)
        x, y = np.meshgrid(self.x, self.y)
        for circle in circles:
            inside |= np.hypot(x - circle.x1, y - circle.x2) <= circle.radius
        if len(geometries):
            samples = shapely.points(x.ravel(), y.ravel())
            held, _ = shapely.STRtree(geometries).query(samples, predicate="within")
            inside.ravel()[held] = True
        return inside

    def _in_mask(self, mask: Mask) -> Cells:
        inside = np.zeros((len(self.y), len(self.x)), bool)
        dx, dy = mask.spacing
        i = np.floor((self.x - mask.x[0]) / dx + 0.5).astype(int)
        j = np.floor((self.y - mask.y[0]) / dy + 0.5).astype(int)
        rows, columns = mask.blocked.shape
        on_grid = np.ix_((j >= 0) & (j < rows), (i >= 0) & (i < columns))
        cells = mask.blocked[np.clip(j, 0, rows - 1)][:, np.clip(i, 0, columns - 1)]
        inside[on_grid] = cells[on_grid]
        return inside

    def label(self, layer: int) -> str:
        """Name and unit of a layer."""
        shown = self.problem.surface.layers[layer]
        return with_unit(shown.name, shown.unit)

    def norm(self, layer: int) -> Normalize:
        """The colour scale of a layer, from the part of it that is not blocked."""
        shown = ~self.masked
        values = self.values[layer][shown if shown.any() else ~shown]
        low, high = float(values.min()), float(values.max())
        return Normalize(low, high if high > low else low + 1.0)

    def shaded(self, layer: int) -> Array:
        """(ny, nx, 3): a layer's colours, with the hill shade of the first layer."""
        name = HEIGHT_COLOURS if layer == 0 else LAYER_COLOURS
        norm = self.norm(layer)
        fraction = norm(self.values[layer])
        if layer == 0:  # leave out the blue and the white end of the colour map
            fraction = 0.22 + 0.68 * np.asarray(fraction)
        colours = colormaps[name](fraction)[..., :3]
        return self._lit(colours)

    def _lit(self, colours: Array) -> Array:
        """Colours (ny, nx, 3) in the hill shade of the first layer."""
        height = self.values[0]
        extent = max(self.problem.bounds.width, self.problem.bounds.height)
        spread = float(np.ptp(height)) or 1.0
        light = LightSource(azdeg=315, altdeg=40)
        lit = light.shade_rgb(
            colours,
            height * (SHADED_RELIEF * extent / spread),
            blend_mode="soft",
            dx=float(self.x[1] - self.x[0]),
            dy=-float(self.y[1] - self.y[0]),
        )
        return np.clip(np.asarray(lit, np.float64), 0.0, 1.0)

    @cached_property
    def costs(self) -> Array | None:
        """(ny, nx): the product of all cost layers; None where there are none."""
        if not self.problem.surface.costs:
            return None
        return self.problem.surface.cost(np.stack(np.meshgrid(self.x, self.y), axis=-1))

    @property
    def cost_label(self) -> str:
        """The names of the cost layers, with their weights."""
        named = [
            in_words(cost.name) + (f"^{cost.weight:g}" if cost.weight != 1.0 else "")
            for cost in self.problem.surface.costs
        ]
        return f"cost: {' x '.join(named)}"

    @cached_property
    def cost_norm(self) -> Normalize:
        """The colour scale of costs, from the part of the region that is not blocked."""
        shown = self._open_costs
        low, high = float(shown.min()), float(shown.max())
        norm = LogNorm if high > WIDE_RANGE * low else Normalize
        return norm(low, high if high > low else 2.0 * low)

    @property
    def few_costs(self) -> list[float] | None:
        """All costs, where they are few."""
        different = np.unique(self._open_costs)
        return different.tolist() if len(different) <= FEW_COSTS else None

    @property
    def _open_costs(self) -> Array:
        assert self.costs is not None
        return self.costs[~self.masked if not self.masked.all() else ...]

    def shaded_costs(self) -> Array:
        """(ny, nx, 3): the colours of costs, with some of the hill shade of the first layer."""
        assert self.costs is not None
        fraction = np.clip(np.asarray(self.cost_norm(self.costs)), 0.0, 1.0)
        colours = colormaps[COST_COLOURS](fraction)[..., :3]
        return np.asarray((1.0 - COST_SHADE) * colours + COST_SHADE * self._lit(colours))


def height_colours() -> Any:
    """The part of the colour map that heights are drawn in."""
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps[HEIGHT_COLOURS](np.linspace(0.22, 0.90, 256)))
