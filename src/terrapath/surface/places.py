"""Where the cells of one grid lie in another, at exactly transformed coordinates."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from ..validation import Array
from .georeference import transformer
from .raster import SAME_PLACE, Grid

# Coordinates are interpolated between so many nodes on a side, the fewest that are right to so many
# cells at other places, in a twentieth of the time. Where none are, as beside a pole, each is
# transformed.
NODES, CHECKED, CLOSE = (8, 16, 32), 9, 1e-7


def cells_along(at: Array, count: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """The nearest of ``count`` cells along an axis, and whether a place lies in it."""
    nearest = np.rint(np.nan_to_num(at, nan=-1.0)).astype(np.intp)
    is_inside = np.abs(at + 0.5 - 0.5 * count) <= 0.5 * count + SAME_PLACE
    return np.clip(nearest, 0, count - 1), np.asarray(is_inside)


class Places:
    """The centres of a grid's cells, in columns and rows of another grid's.

    They are counted from the other grid's first centre.
    """

    def __init__(self, source: Grid, target: Grid) -> None:
        self._source, self._target = source, target

    def of_rows(self, rows: slice) -> tuple[Array, Array]:
        """(column, row) of the centres of some rows of the target, each (rows, columns)."""
        column = np.arange(self._target.columns, dtype=np.float64) + 0.5
        row = np.arange(rows.start, rows.stop, dtype=np.float64) + 0.5
        if self._polynomials is None:
            return self._exact(column, row)
        return self._interpolated(*self._polynomials, column, row)

    def _exact(self, column: Array, row: Array) -> tuple[Array, Array]:
        """At the product of columns and rows of the target, which count from its corner."""
        source, target = self._source, self._target
        x, y = target.place(*np.meshgrid(column, row))
        if source.crs is not None and target.crs is not None and source.crs != target.crs:
            x, y = transformer(target.crs, source.crs).transform(x, y)
            if source.crs.is_geographic:  # any longitude is also one 360 degrees on
                west, _, east, _ = source.extent()
                x = x + 360.0 * np.rint((0.5 * (west + east) - x) / 360.0)
        return source.cells(x, y)

    @cached_property
    def _polynomials(self) -> tuple[Array, Array] | None:
        """Coefficients of the column and of the row; None where they would not be close."""
        rows, columns = self._target.rows, self._target.columns
        checked = np.linspace(0.0, columns, CHECKED), np.linspace(0.0, rows, CHECKED)
        exact = self._exact(*checked)
        for count in NODES:
            nodes = chebyshev.chebpts1(count)
            there = self._exact(0.5 * (nodes + 1.0) * columns, 0.5 * (nodes + 1.0) * rows)
            if not np.isfinite(there).all():
                return None
            inverse = np.linalg.inv(chebyshev.chebvander(nodes, count - 1))
            found = inverse @ there[0] @ inverse.T, inverse @ there[1] @ inverse.T
            if np.abs(np.subtract(self._interpolated(*found, *checked), exact)).max() <= CLOSE:
                return found
        return None

    def _interpolated(
        self, columns: Array, rows: Array, column: Array, row: Array
    ) -> tuple[Array, Array]:
        """The polynomials with these coefficients at columns and rows of the target."""
        degree, target = len(rows) - 1, self._target
        across = chebyshev.chebvander(2.0 * column / target.columns - 1.0, degree).T
        along = chebyshev.chebvander(2.0 * row / target.rows - 1.0, degree)
        return (along @ columns) @ across, (along @ rows) @ across
