"""Resamples values from one grid to another, at exactly transformed coordinates."""

from __future__ import annotations

import numpy as np

from .._kernels.surface.points import fill_values
from .._kernels.surface.surfaces import Spline
from .._support.memory import blocks
from ..errors import MapError
from ..validation import Array
from .fitting import interpolate
from .holes import continue_into_holes, missing_cells
from .neighbours import bilinear
from .places import Places, cells_along
from .raster import Grid

LEAST_FOR_SPLINE = 4  # cells on a side that a spline needs


def _spline_through(values: Array) -> Spline:
    """The bicubic spline over (column, row), where the first cell's centre is (0, 0)."""
    rows, columns = values.shape
    x, y = np.arange(columns, dtype=np.float64), np.arange(rows, dtype=np.float64)
    return interpolate(values[None], x, y, np.ones(1))


def _spline_at(spline: Spline, column: Array, row: Array, shape: tuple[int, int]) -> Array:
    """The spline at points; up to half a cell beyond its edge it is extended by odd reflection."""
    points = np.stack([column, row], axis=-1)
    nearest = np.clip(points, 0.0, [shape[1] - 1.0, shape[0] - 1.0])
    inside, mirrored = np.empty((len(points), 1)), np.empty((len(points), 1))
    fill_values(spline, nearest, inside)
    beyond = np.flatnonzero((nearest != points).any(axis=1))
    fill_values(spline, 2.0 * nearest[beyond] - points[beyond], mirrored[: len(beyond)])
    inside[beyond] = 2.0 * inside[beyond] - mirrored[: len(beyond)]
    return inside[:, 0]


def resample(
    values: Array,
    source: Grid,
    target: Grid,
    out: Array,
    *,
    linear: bool = False,
    nearest: bool = False,
) -> None:
    """Resample values (rows, columns) of one grid to another, into ``out``; NaN is no-data.

    By a bicubic spline; or, if ``linear``, bilinearly, so that the range of the values is kept; or,
    if ``nearest``, by the value of the cell that the centre lies in.
    Each target cell takes the value at its centre; it is no-data where the centre lies in a cell
    without data, or outside. ``values`` is changed: cells without data are given values.
    """
    missing = missing_cells(values)
    if missing.all():
        out[...] = np.nan
        return
    continue_into_holes(values, missing)
    linear = linear or min(values.shape) < LEAST_FOR_SPLINE
    spline = None if linear or nearest else _spline_through(values)
    places = Places(source, target)
    for rows in blocks(target.rows, target.columns):
        column, row = places.of_rows(rows)
        with np.errstate(invalid="ignore"):
            i, is_in_columns = cells_along(column, source.columns)
            j, is_in_rows = cells_along(row, source.rows)
        inside = is_in_columns & is_in_rows
        column, row, cell = column[inside], row[inside], (j[inside], i[inside])
        if nearest:
            sampled = values[cell]
        elif spline is None:
            sampled = bilinear(values, row, column)
        else:
            sampled = _spline_at(spline, column, row, (values.shape[0], values.shape[1]))
        sampled[missing[cell]] = np.nan
        block = np.full(inside.shape, np.nan)
        block[inside] = sampled
        out[rows] = block


def require_overlap(name: str, source: Grid, target: Grid) -> None:
    """Raise MapError where a layer covers no part of the map."""
    x, y = target.outline(source.crs)
    column, row = source.cells(x, y)
    if source.crs is not None and source.crs.is_geographic:
        turn = 360.0 / abs(source.transform.a)
        column = column - turn * np.rint((column - 0.5 * source.columns) / turn)
    overlaps = (
        len(x) > 0
        and column.min() < source.columns - 0.5
        and column.max() > -0.5
        and row.min() < source.rows - 0.5
        and row.max() > -0.5
    )
    if not overlaps:
        ours = ", ".join(f"{value:.6g}" for value in source.extent())
        theirs = ", ".join(f"{value:.6g}" for value in target.extent())
        raise MapError(
            f"{name} does not overlap the heights: it covers ({ours}), they cover ({theirs}), as "
            "(x_min, y_min, x_max, y_max) each in its own CRS; check the CRS of both"
        )
