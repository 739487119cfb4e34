"""Ground that is too steep for a vehicle, as cells that it may not enter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from .._kernels.surface.surfaces import Spline
from ..errors import InputError
from ..surface import Mask, Surface
from ..surface.bounds import Bounds
from ..surface.georeference import metres_of
from ..surface.raster import Grid
from ..validation import Array, require_choice
from .slopes import STEPS, CarriedHornRows, HornRows, Largest, Rows, SampledRows, SplineRows

# How the slope of a cell is measured: by Horn's formula, or where the surface is steepest in it.
SlopeMeasure = Literal["horn", "steepest"]

# This many samples are computed at once; they fit into a processor's cache.
SAMPLES_AT_ONCE = 2**16
# Exact peaks are cut into cells, this many along their finest feature.
CELLS_PER_FEATURE = 4.0
MOST_CELLS = 2**26
# A map's own cells do not fit the cells of the plane that it was carried onto. So these are cut
# into so many along each side, as long as there are no more than so many in all. Then 97 % of the
# places on real terrain are on the right side of a limit; with whole cells 93 % are.
FINER, MOST_FINER = 4, 2**23


@dataclass(frozen=True, eq=False)
class SlopeLimit:
    """The cells of a surface that are steeper than a vehicle can climb.

    surface : its first layer is the height. max_slope : degrees, above 0 and at most 90.
    bounds : where exact peaks are cut into cells. measure : how the slope of a cell is measured.
    "horn", as ``gdaldem slope -compute_edges`` and QGIS do, from the heights of the map's own
    cells, with their true sizes; "steepest" is the largest slope of the surface in the cell.

    The cells are those of the map; on a spline that was not made of a grid, those around its knots.
    Exact peaks are cut into cells that are finer than any peak. On surfaces that were not made of a
    grid each slope is the largest in the cell, because their samples are not the user's.
    Raises InputError for a slope out of range, and for units that cannot be compared.
    """

    surface: Surface
    max_slope: float
    bounds: Bounds
    measure: SlopeMeasure = "horn"

    def __post_init__(self) -> None:
        value = self.max_slope
        if isinstance(value, bool) or not isinstance(value, int | float | np.number):
            raise InputError(f"max_slope={value!r} must be a number of degrees")
        if not 0.0 < value <= 90.0:
            raise InputError(f"max_slope={value:g} must be above 0 and at most 90 degrees")
        require_choice(get_args(SlopeMeasure), slope_measure=self.measure)
        self._scale  # noqa: B018 -- raises InputError for units that cannot be compared

    @cached_property
    def _scale(self) -> float:
        """How many units of the plane are one unit of height."""
        plane, height = self.surface.unit, self.surface.layers[0].unit
        if plane == height or not plane or not height:
            return 1.0
        theirs, ours = metres_of(height), metres_of(plane)
        if theirs is None or ours is None:
            raise InputError(
                f"max_slope={self.max_slope:g} cannot be compared with heights in {height!r} on "
                f"a plane in {plane!r}; give both in metres"
            )
        return theirs / ours

    @cached_property
    def mask(self) -> Mask | None:
        """The cells that are too steep, None where there are none."""
        limit = self._limit
        if self._axes is None:
            return None
        x, y = self._axes
        steep, slopes = np.empty((len(y), len(x)), np.bool_), self._slopes_of_rows()
        for first, last in self._blocks():
            steep[first:last] = slopes(first, last) > limit  # not where there is no data
        if (nodata := self._nodata(x, y)) is not None:
            steep &= ~nodata.blocked
            x, y = nodata.x, nodata.y
        return Mask(steep, x, y) if steep.any() else None

    def _nodata(self, x: Array, y: Array) -> Mask | None:
        """The surface's cells without data, where they are the same cells."""
        nodata = self.surface.nodata
        return nodata if nodata is not None and _on_same_grid(nodata, x, y) else None

    def _unknown(self, x: Array, y: Array) -> npt.NDArray[np.bool_] | None:
        """Cells whose height is not known. Where only other layers have no data, it is."""
        nodata, unknown = self._nodata(x, y), self.surface.unknown
        return None if nodata is None else nodata.blocked if unknown is None else unknown

    @property
    def by_horn(self) -> bool:
        """Are slopes by Horn's formula?"""
        return self.measure == "horn" and self.surface.is_raster

    @property
    def _limit(self) -> float:
        """The largest square of a slope that is allowed, with a margin for rounding."""
        if self.max_slope == 90.0:
            return math.inf
        return (math.tan(math.radians(self.max_slope)) / self._scale) ** 2 * (1.0 + 1e-12)

    @cached_property
    def _cells(self) -> Grid | None:
        """The cells of the plane for a map that was carried onto it."""
        native = self.surface.native
        if native is None or not self.by_horn:
            return None if native is None else native.plane
        rows, columns = native.plane.rows, native.plane.columns
        finer = min(max(math.isqrt(MOST_FINER // (rows * columns)), 1), FINER)
        return native.plane.in_cells(finer * rows, finer * columns)

    @cached_property
    def _axes(self) -> tuple[Array, Array] | None:
        """Centres of the cells along both axes; None for a surface that is flat everywhere."""
        data = self.surface.data
        if (cells := self._cells) is not None:
            return cells.centres()
        if isinstance(data, Spline):
            rows, columns = data.coefficients.shape[1] - 2, data.coefficients.shape[2] - 2
            x = np.asarray(data.x0 + data.dx * np.arange(columns))
            return x, np.asarray(data.y0 + data.dy * np.arange(rows))
        if math.isinf(self.surface.resolution):
            return None
        size = self.surface.resolution / CELLS_PER_FEATURE
        columns = max(math.ceil(self.bounds.width / size), 2)
        rows = max(math.ceil(self.bounds.height / size), 2)
        if rows * columns > MOST_CELLS:
            raise InputError(
                f"max_slope={self.max_slope:g} needs {columns:,} x {rows:,} cells to look at peaks "
                f"as sharp as {self.surface.resolution:g}; give narrower bounds"
            )
        dx, dy = self.bounds.width / columns, self.bounds.height / rows
        x = np.asarray(self.bounds.x1_min + dx * (np.arange(columns) + 0.5))
        return x, np.asarray(self.bounds.x2_min + dy * (np.arange(rows) + 0.5))

    def _slopes_of_rows(self) -> Rows:
        """(first row, one past the last) -> (rows, nx), squares of the cells' slopes."""
        assert self._axes is not None
        data = self.surface.data
        if self._cells is not None:
            horn = CarriedHornRows(self.surface, self._cells)
            return horn if self.by_horn else Largest(horn, SampledRows(self.surface, *self._axes))
        if not isinstance(data, Spline):
            return SampledRows(self.surface, *self._axes)
        if not self.by_horn:
            return SplineRows(data.coefficients[0], data.dx, data.dy)
        return HornRows(data.coefficients[0], data.dx, data.dy, self._unknown(*self._axes))

    def _blocks(self) -> Iterator[tuple[int, int]]:
        """First row, and one past the last, of each block that is computed at once."""
        assert self._axes is not None
        x, y = self._axes
        samples = len(x) * (1 if isinstance(self.surface.data, Spline) else STEPS**2)
        rows = max(SAMPLES_AT_ONCE // samples, 8)
        for first in range(0, len(y), rows):
            yield first, min(first + rows, len(y))

    def describe(self, point: tuple[float, float]) -> str:
        """How steep the ground is at a point in a blocked cell, in words."""
        assert self._axes is not None
        x, y = self._axes
        i = min(max(round((point[0] - x[0]) / (x[1] - x[0])), 0), len(x) - 1)
        j = min(max(round((point[1] - y[0]) / (y[1] - y[0])), 0), len(y) - 1)
        low, high = max(j - 1, 0), min(j + 2, len(y))
        around = self._slopes_of_rows()(low, high)[:, max(i - 1, 0) : i + 2]
        own = around[j - low, min(i, 1)]
        # On a side of a cell the one beyond it may be the steep one.
        square = own if own > self._limit else np.nanmax(around)
        degrees = math.degrees(math.atan(self._scale * math.sqrt(square)))
        by = " by Horn's formula" if self.by_horn else ""
        return f"on ground of {degrees:.4g} degrees{by}, steeper than max_slope={self.max_slope:g}"


def _on_same_grid(mask: Mask, x: Array, y: Array) -> bool:
    dx, dy = mask.spacing
    return (
        mask.blocked.shape == (len(y), len(x))
        and bool(np.allclose(mask.x, x, rtol=0.0, atol=1e-6 * dx))
        and bool(np.allclose(mask.y, y, rtol=0.0, atol=1e-6 * dy))
    )
