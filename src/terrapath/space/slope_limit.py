"""Ground that is too steep for a vehicle, as cells that it may not enter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._kernels.surface.surfaces import Spline
from ..errors import InputError
from ..surface import Mask, Surface
from ..surface.bounds import Bounds
from ..surface.georeference import metres_of
from ..validation import Array

# A cell's slope is measured at 5 x 5 points, four steps along each side.
STEPS = 4
# This many samples are computed at once; they fit into a processor's cache.
SAMPLES_AT_ONCE = 2**16
# Exact peaks are cut into cells, this many along their finest feature.
CELLS_PER_FEATURE = 4.0
MOST_CELLS = 2**26
# A cell may be blocked because of steep ground up to this many cells away.
REACH = 2


@dataclass(frozen=True, eq=False)
class SlopeLimit:
    """The cells of a surface that are steeper than a vehicle can climb.

    surface : its first layer is the height. max_slope : degrees, above 0 and at most 90.
    bounds : where exact peaks are cut into cells.

    On a spline there is a cell around each knot; for a map these are the map's own cells. Exact
    peaks are cut into cells that are finer than any peak. A cell's slope is the largest of the
    surface's slope at 5 x 5 points of the cell and, on a spline, of Horn's estimate from the
    eight neighbours and of the differences between neighbours along each axis.
    Raises InputError for a slope out of range, and for units that cannot be compared.
    """

    surface: Surface
    max_slope: float
    bounds: Bounds

    def __post_init__(self) -> None:
        value = self.max_slope
        if isinstance(value, bool) or not isinstance(value, int | float | np.number):
            raise InputError(f"max_slope={value!r} must be a number of degrees")
        if not 0.0 < value <= 90.0:
            raise InputError(f"max_slope={value:g} must be above 0 and at most 90 degrees")
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
        steep = np.empty((len(y), len(x)), np.bool_)
        for first, last in self._blocks():
            steep[first:last] = self._slopes_of_rows(first, last) > limit
        nodata = self.surface.nodata
        georeference = self.surface.georeference
        if georeference is not None and not georeference.is_map_crs:
            # The map's own cells are turned against these.
            from scipy import ndimage

            steep = ndimage.binary_dilation(steep, np.ones((3, 3), np.bool_))
        if nodata is not None and _on_same_grid(nodata, x, y):
            steep &= ~nodata.blocked
            x, y = nodata.x, nodata.y
        return Mask(steep, x, y) if steep.any() else None

    @property
    def _limit(self) -> float:
        """The largest square of a slope that is allowed, with a margin for rounding."""
        if self.max_slope == 90.0:
            return math.inf
        return (math.tan(math.radians(self.max_slope)) / self._scale) ** 2 * (1.0 + 1e-12)

    @cached_property
    def _axes(self) -> tuple[Array, Array] | None:
        """Centres of the cells along both axes; None for a surface that is flat everywhere."""
        data = self.surface.data
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

    @cached_property
    def _slopes_of_rows(self) -> Callable[[int, int], Array]:
        """(first row, one past the last) -> (rows, nx), squares of the cells' slopes."""
        assert self._axes is not None
        data = self.surface.data
        if isinstance(data, Spline):
            return _SplineRows(data.coefficients[0], data.dx, data.dy)
        return _SampledRows(self.surface, *self._axes)

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
        low, high = max(j - REACH, 0), min(j + REACH + 1, len(y))
        around = self._slopes_of_rows(low, high)[:, max(i - REACH, 0) : i + REACH + 1]
        own = self._slopes_of_rows(j, j + 1)[0, i]
        where, square = ("on", own) if own > self._limit else ("beside", around.max())
        degrees = math.degrees(math.atan(self._scale * math.sqrt(square)))
        return f"{where} ground of {degrees:.4g} degrees, steeper than max_slope={self.max_slope:g}"


def _on_same_grid(mask: Mask, x: Array, y: Array) -> bool:
    dx, dy = mask.spacing
    return (
        mask.blocked.shape == (len(y), len(x))
        and bool(np.allclose(mask.x, x, rtol=0.0, atol=1e-6 * dx))
        and bool(np.allclose(mask.y, y, rtol=0.0, atol=1e-6 * dy))
    )


@dataclass(frozen=True, eq=False)
class _SampledRows:
    """Slopes of cells from the surface's gradients, sampled."""

    surface: Surface
    x: Array
    y: Array

    def __call__(self, first: int, last: int) -> Array:
        x, y = self._places(self.x), self._places(self.y[first:last])
        points = np.stack(np.meshgrid(x, y), axis=-1)
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


# Splines


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


@dataclass(frozen=True, eq=False)
class _SplineRows:
    """Slopes of the cells around a spline's knots, whole rows at a time."""

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
        """Horn's estimate, and the differences of the neighbours, from the heights at the knots."""
        at_knot = _basis(0.0)[0]
        rows, _ = self._rows(first, last)
        heights = _filtered(_filtered(rows.T, at_knot).T, at_knot)
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
