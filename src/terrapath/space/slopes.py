"""How steep cells are: by Horn's formula as in GIS tools, or at the steepest place in each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from ..surface import Surface
from ..surface.carrying import Native, few_rows, heights_at, sampled
from ..surface.holes import continue_into_holes
from ..surface.layers import at_knots
from ..surface.places import Places
from ..surface.raster import Grid
from ..validation import Array

# (first row, one past the last) -> (rows, nx), squares of the cells' slopes.
Rows: TypeAlias = Callable[[int, int], Array]

# A cell's slope is measured at 5 x 5 points, four steps along each side.
STEPS = 4


def _basis(u: float) -> tuple[Array, Array]:
    """The cubic B-splines that are not 0 at u in [0, 1), and their slopes; knots are 1 apart."""
    r = 1.0 - u
    values = [r**3, 4.0 - 6.0 * u**2 + 3.0 * u**3, 4.0 - 6.0 * r**2 + 3.0 * r**3, u**3]
    slopes = [-0.5 * r**2, u * (1.5 * u - 2.0), r * (2.0 - 1.5 * r), 0.5 * u**2]
    return np.array(values) / 6.0, np.array(slopes)


def _filtered(array: Array, weights: Array) -> Array:
    """Sums of neighbouring rows: (n + 3, m) -> (n, m); with no last weight (n + 2, m)."""
    used = weights if weights[-1] != 0.0 else weights[:-1]
    count = len(array) - len(used) + 1
    total = used[0] * array[:count]
    for k in range(1, len(used)):
        if used[k] != 0.0:
            total += used[k] * array[k : k + count]
    return np.asarray(total)


# Horn's formula


def rises(heights: Array, first: int, last: int) -> tuple[Array, Array]:
    """How much heights rise from a column and from a row to the next, by Horn's formula (1981).

    heights : (ny, nx), NaN without data. Returns both for the rows [first, last), (rows, nx). Of
    three by three heights, those of the middle row and column count twice. Beyond the edge, heights
    continue by a straight line; where one is missing, that of the middle stands for it, as in
    ``gdaldem slope -compute_edges``.
    """
    low, high = max(first - 1, 0), min(last + 1, len(heights))
    around = heights[low:high]
    if first == 0:
        around = np.concatenate([2.0 * heights[:1] - heights[1:2], around])
    if last == len(heights):
        around = np.concatenate([around, 2.0 * heights[-1:] - heights[-2:-1]])
    west, east = 2.0 * around[:, :1] - around[:, 1:2], 2.0 * around[:, -1:] - around[:, -2:-1]
    around = np.concatenate([west, around, east], axis=1)
    middle = around[1:-1, 1:-1]

    def at(row: int, column: int) -> Array:
        ny, nx = middle.shape
        found = around[1 + row : 1 + row + ny, 1 + column : 1 + column + nx]
        return np.where(np.isnan(found), middle, found)

    corners = {(j, i): at(j, i) for j in (-1, 1) for i in (-1, 1)}
    across = corners[-1, 1] + corners[1, 1] - corners[-1, -1] - corners[1, -1]
    along = corners[1, -1] + corners[1, 1] - corners[-1, -1] - corners[-1, 1]
    across += 2.0 * (at(0, 1) - at(0, -1))
    along += 2.0 * (at(1, 0) - at(-1, 0))
    return across / 8.0, along / 8.0


@dataclass(frozen=True, eq=False)
class HornRows:
    """Slopes by Horn's formula of the cells of a map that is planned on as it lies."""

    coefficients: Array  # (ny + 2, nx + 2), of the spline through the cells' heights
    dx: float
    dy: float
    missing: npt.NDArray[np.bool_] | None  # (ny, nx), cells without data

    def __call__(self, first: int, last: int) -> Array:
        """(last - first, nx)."""
        low, high = max(first - 1, 0), min(last + 1, len(self.coefficients) - 2)
        heights = at_knots(self.coefficients[low : high + 2])
        if self.missing is not None:
            heights[self.missing[low:high]] = np.nan
        across, along = rises(heights, first - low, last - low)
        return np.asarray((across / self.dx) ** 2 + (along / self.dy) ** 2)


@dataclass(frozen=True, eq=False)
class CarriedHornRows:
    """Slopes by Horn's formula on a map that was carried onto the plane.

    They are those of the map's own cells, with their true sizes, interpolated at the centres of
    cells of the plane.
    """

    surface: Surface
    cells: Grid  # of the plane

    def __call__(self, first: int, last: int) -> Array:
        """(last - first, nx)."""
        return np.asarray(self._slopes[first:last] ** 2)

    @cached_property
    def _slopes(self) -> Array:
        native = self.surface.native
        assert native is not None
        slopes = horn_of_map(self.surface, native)
        if native.missing is not None:
            continue_into_holes(slopes, native.missing)
        # Beyond the map and in holes they go on, so that no slit is left beside cells without data.
        return np.maximum(sampled(slopes, native.grid, self.cells), 0.0)


def horn_of_map(surface: Surface, native: Native) -> Array:
    """(rows, columns) of the map: the slopes of its own cells; NaN without data."""
    heights = heights_at(surface, native)
    slopes, places = np.empty(heights.shape), Places(native.plane, native.grid)
    for rows in few_rows(native.grid):
        across, along = rises(heights, rows.start, rows.stop)
        low, high = max(rows.start - 1, 0), min(rows.stop + 1, native.grid.rows)
        kept = slice(rows.start - low, rows.stop - low)
        # How far the plane's x and y change from row to row and from column to column.
        x, y = (
            side * at
            for side, at in zip(native.plane.sides, places.of_rows(slice(low, high)), strict=True)
        )
        (down_x, down_y), (over_x, over_y) = (
            [np.gradient(at, axis=axis)[kept] for at in (x, y)] for axis in (0, 1)
        )
        slope_x = across * down_y - along * over_y
        slope_y = along * over_x - across * down_x
        slopes[rows] = np.hypot(slope_x, slope_y) / np.abs(over_x * down_y - over_y * down_x)
    return slopes


# The steepest place


@dataclass(frozen=True, eq=False)
class Largest:
    """The larger of two slopes of each cell."""

    one: Rows
    other: Rows

    def __call__(self, first: int, last: int) -> Array:
        """(last - first, nx)."""
        return np.asarray(np.fmax(self.one(first, last), self.other(first, last)))


@dataclass(frozen=True, eq=False)
class SampledRows:
    """The largest slope in each cell at the surface's gradients, sampled."""

    surface: Surface
    x: Array
    y: Array

    def __call__(self, first: int, last: int) -> Array:
        """(last - first, nx)."""
        x, y = self._places(self.x), self._places(self.y[first:last])
        points = np.stack(np.meshgrid(x, y), axis=-1)
        if (bounds := self.surface.bounds) is not None:
            points = np.clip(points, bounds[:2], bounds[2:])
        gradients = self.surface.gradients(points)[..., 0, :]
        squares = (gradients**2).sum(axis=-1)
        along = _largest_of_five(squares.T).T
        return np.asarray(_largest_of_five(along))

    def _places(self, centres: Array) -> Array:
        """(4 n + 1,), the sample points along an axis; neighbouring cells share an edge."""
        step = float(self.x[1] - self.x[0] if centres is self.x else self.y[1] - self.y[0])
        count = STEPS * len(centres) + 1
        return np.asarray(centres[0] - 0.5 * step + step / STEPS * np.arange(count))


def _largest_of_five(samples: Array) -> Array:
    """(4 n + 1, m) -> (n, m)."""
    four = samples[:-1].reshape(-1, STEPS, samples.shape[1]).max(axis=1)
    return np.asarray(np.maximum(four, samples[STEPS::STEPS]))


@dataclass(frozen=True, eq=False)
class SplineRows:
    """The largest slope in each of the cells around a spline's knots, whole rows at a time.

    It is the largest of the surface's slope at 5 x 5 points of the cell, of Horn's estimate from
    the eight neighbours and of the differences between neighbours along each axis.
    """

    coefficients: Array  # (ny + 2, nx + 2)
    dx: float
    dy: float

    def __call__(self, first: int, last: int) -> Array:
        """(last - first, nx): the largest square of a slope in each cell."""
        return np.maximum(self._of_surface(first, last), self._of_heights(first, last))

    def _of_surface(self, first: int, last: int) -> Array:
        """The surface's own slope, at five by five places of each cell."""
        rows, skipped = self._rows(first, last)
        found: Array | None = None
        for step in range(STEPS):
            values, slopes = _basis(step / STEPS)
            level = _filtered(rows.T, values).T
            rising = _filtered(rows.T, slopes).T / self.dx
            found = _gathered(found, self._largest_along_y(rising, level).T, step)
        assert found is not None
        return np.asarray(found.T[skipped : skipped + last - first])

    def _rows(self, first: int, last: int) -> tuple[Array, int]:
        """Coefficients around the cells, with a row before and after; how many rows are before."""
        before = max(first - 1, 0)
        return self.coefficients[before : last + 3], first - before

    def _largest_along_y(self, rising: Array, level: Array) -> Array:
        """(n, m), the largest square of each knot's cell; what comes in is filtered along x."""
        found: Array | None = None
        for step in range(STEPS):
            values, slopes = _basis(step / STEPS)
            squares = _filtered(rising, values) ** 2
            squares += (_filtered(level, slopes) / self.dy) ** 2
            found = _gathered(found, squares, step)
        return np.asarray(found)

    def _of_heights(self, first: int, last: int) -> Array:
        """Horn's formula, and the differences of the neighbours, from the heights at the knots."""
        heights = at_knots(self._rows(first, last)[0])
        ends = (int(first == 0), int(last == len(self.coefficients) - 2))
        h = np.pad(heights, (ends, (1, 1)), mode="reflect", reflect_type="odd")
        across, along = 0.5 * (h[:, 2:] - h[:, :-2]) / self.dx, 0.5 * (h[2:] - h[:-2]) / self.dy
        central = across[1:-1] ** 2 + along[:, 1:-1] ** 2
        horn_x = 0.25 * (across[:-2] + 2.0 * across[1:-1] + across[2:])
        horn_y = 0.25 * (along[:, :-2] + 2.0 * along[:, 1:-1] + along[:, 2:])
        return np.asarray(np.maximum(central, horn_x**2 + horn_y**2))


def _gathered(found: Array | None, samples: Array, step: int) -> Array:
    """The largest of the samples of each cell so far, (n, m).

    samples : (n, m) at the knots in step 0; then (n - 1, m), ``step`` quarters from one knot to
    the next. Those in the middle belong to the cells on both sides.
    """
    if found is None:
        return samples
    if step <= STEPS // 2:
        np.maximum(found[:-1], samples, out=found[:-1])
    if step >= STEPS // 2:
        np.maximum(found[1:], samples, out=found[1:])
    return found
