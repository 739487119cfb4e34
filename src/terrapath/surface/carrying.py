"""Carries a map that cannot be planned on as it lies onto a plane, without loss.

Heights are laid on a grid that is finer than the map's cells, and corrected until the spline
through them has the map's own heights at the centres of the map's own cells. Cells that are
blocked stay cells of the map's own size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .._kernels.surface.carrying import add_extended, fill_differences
from .._kernels.surface.surfaces import Spline
from ..validation import Array
from .bounds import Mask
from .fitting import interpolate
from .holes import Cells
from .layers import Kind
from .neighbours import bilinear
from .places import Places, cells_along
from .plane import steps_on_plane, whole_cells
from .raster import Grid, Raster
from .surface import Surface

# The grid on the plane is so many times finer than the map's cells. With one correction heights of
# rough terrain are right to 0.03 m (rms) and 0.8 m at their own cells' centres, with two to 0.003 m
# and 0.09 m; without a finer grid they stay 0.4 m and 10 m off, however often they are corrected.
FINER, CORRECTIONS = 1.5, 2

# Beyond the map's edge heights go on as they come, mirrored at the edge, for so many cells.
REACH = 8.0

# So many values at a time are read, computed and written while a processor's cache holds them.
FEW = 2**16


class Native(NamedTuple):
    """The map's own cells, from which a surface was carried over.

    grid : as the map has it. plane : the cells of that size on the plane. missing : (rows,
    columns) of the map, which have no height; None where all have.
    """

    grid: Grid
    plane: Grid
    missing: Cells | None


def carried_surface(
    raster: Raster,
    kinds: Sequence[Kind],
    missing: Cells | None,
    unknown: Cells | None,
    make: Callable[..., Surface],
) -> Surface:
    """The surface of a raster, whose cells all have values, on the plane.

    missing, unknown : (rows, columns), which cells are to be blocked, and whose height is not
    known. make : as ``Surface.from_grid``.
    """
    grid = raster.grid
    plane = grid.planning_grid()
    plane, blocked = _trimmed(plane, _without_data(missing, grid, plane))
    fine = _finer(grid, plane)
    values = np.empty((len(kinds), fine.rows, fine.columns))
    for band, kind, out in zip(raster.bands, kinds, values, strict=True):
        _CARRIERS[kind](band, grid, fine, out)
    nodata = Mask(blocked, *plane.centres()) if blocked.any() else None
    surface = make(values, *fine.centres(), nodata=nodata)
    assert isinstance(surface.data, Spline)
    rises = [band for band, kind in zip(raster.bands, kinds, strict=True) if kind == "rise"]
    method = f"bicubic spline through {grid.columns} x {grid.rows} samples"
    error = _largest_error(rises, grid, missing, fine, surface.data)
    resolution = min(plane.sides)
    if surface.fit.smoothing is not None:
        resolution = surface.fit.smoothing.resolution(resolution)
    return replace(
        surface,
        fit=replace(surface.fit, method=method, value_error=error),
        resolution=resolution,
        native=Native(grid, plane, unknown),
    )


def _finer(grid: Grid, plane: Grid) -> Grid:
    """Cells of the plane that are finer than what the map's own can show along each axis."""
    (along_x, along_y), (across_x, across_y) = steps_on_plane(grid)
    area = np.abs(along_x * across_y - along_y * across_x)
    # A wave along x that the map can show crosses a cell of the plane in so many halves.
    waves_x = plane.transform.a * np.nanmax((np.abs(along_y) + np.abs(across_y)) / area)
    waves_y = plane.transform.e * np.nanmax((np.abs(along_x) + np.abs(across_x)) / area)
    rows, columns = FINER * waves_y * plane.rows, FINER * waves_x * plane.columns
    return plane.in_cells(*whole_cells(grid, rows, columns))


# Blocked cells


def _without_data(missing: Cells | None, grid: Grid, plane: Grid) -> Cells:
    """Which cells of the plane lie with their centre in a missing cell, or outside the map."""
    places, found = Places(grid, plane), np.empty((plane.rows, plane.columns), np.bool_)
    for rows in few_rows(plane):
        column, row = places.of_rows(rows)
        i, inside_columns = cells_along(column, grid.columns)
        j, inside_rows = cells_along(row, grid.rows)
        found[rows] = ~(inside_rows & inside_columns)
        if missing is not None:
            found[rows] |= missing[j, i]
    return found


def _trimmed(plane: Grid, blocked: Cells) -> tuple[Grid, Cells]:
    """Without the outer rows and columns that are wholly blocked, but for the innermost."""
    kept = []
    for axis in (1, 0):
        some = np.flatnonzero(~blocked.all(axis=axis))
        size = blocked.shape[1 - axis]
        first, last = (max(some[0] - 1, 0), some[-1] + 2) if len(some) else (0, size)
        kept.append(slice(int(first), int(min(last, size))))
    return plane.window(kept[0], kept[1]), blocked[kept[0], kept[1]]


# Values


def _carry_heights(heights: Array, grid: Grid, fine: Grid, out: Array) -> None:
    """Heights at the centres of the fine grid, whose spline has those of the map at its own."""
    out[...] = 0.0
    _add(heights, grid, fine, out)
    rest = np.empty(heights.shape)
    for _ in range(CORRECTIONS):
        spline = interpolate(out[None], *fine.centres(), np.ones(1))
        for rows, part in _differences(heights, 0, grid, fine, spline):
            rest[rows] = np.nan_to_num(part, copy=False)
        del spline
        if not rest.any():
            return
        _add(rest, grid, fine, out)


def _add(values: Array, grid: Grid, fine: Grid, out: Array) -> None:
    """Add the spline through values at a map's cells at the fine grid's centres."""
    last_row, last_column = (n - 1.0 for n in values.shape)
    y, x = (np.arange(n, dtype=np.float64) for n in values.shape)
    spline = interpolate(values[None], x, y, np.ones(1))
    places = Places(grid, fine)
    for rows in few_rows(fine):
        column, row = places.of_rows(rows)
        add_extended(spline, column, row, REACH, last_column, last_row, out[rows])


def sampled(values: Array, grid: Grid, target: Grid) -> Array:
    """The spline through values at a map's cells at the centres of the cells of another grid."""
    _add(values, grid, target, out := np.zeros((target.rows, target.columns)))
    return out


def _differences(
    values: Array, layer: int, grid: Grid, fine: Grid, spline: Spline
) -> Iterator[tuple[slice, Array]]:
    """Values at a map's cells less a layer of a spline over the fine grid, a few rows at a time.

    NaN where the spline does not reach.
    """
    places = Places(fine, grid)
    for rows in few_rows(grid):
        column, row = places.of_rows(rows)
        part = np.empty(column.shape)
        last = fine.columns - 1.0, fine.rows - 1.0
        fill_differences(spline, layer, column, row, *last, values[rows], part)
        yield rows, part


def few_rows(grid: Grid) -> Iterator[slice]:
    """All rows of a grid, as few at a time as a processor's cache holds."""
    size = max(1, FEW // grid.columns)
    for first in range(0, grid.rows, size):
        yield slice(first, min(first + size, grid.rows))


def heights_at(surface: Surface, native: Native) -> Array:
    """(rows, columns): a surface's heights at the centres of the map's cells; NaN without data."""
    assert isinstance(surface.data, Spline)
    ny, nx = surface.data.coefficients.shape[1:]
    fine = native.plane.in_cells(ny - 2, nx - 2)
    heights = np.zeros((native.grid.rows, native.grid.columns))
    for rows, part in _differences(heights, 0, native.grid, fine, surface.data):
        heights[rows] = -part
    if native.missing is not None:
        heights[native.missing] = np.nan
    return heights


def _largest_error(
    rises: Sequence[Array], grid: Grid, missing: Cells | None, fine: Grid, data: Spline
) -> float:
    """The largest difference of a surface's layers from the map's, at the map's own cells."""
    worst = 0.0
    for layer, values in enumerate(rises):
        for rows, part in _differences(values, layer, grid, fine, data):
            if missing is not None:
                part[missing[rows]] = np.nan
            worst = np.fmax(worst, np.nanmax(np.abs(part, out=part), initial=0.0))
    return float(worst)


def _carry_costs(costs: Array, grid: Grid, fine: Grid, out: Array) -> None:
    """Costs at the fine grid's centres: bilinear in their logarithms, so within their range."""
    logs, places = np.log(costs), Places(grid, fine)
    for rows in few_rows(fine):
        column, row = places.of_rows(rows)
        out[rows] = np.exp(bilinear(logs, row, column))


def _carry_cells(costs: Array, grid: Grid, fine: Grid, out: Array) -> None:
    """The costs of the map's cells that hold the fine grid's centres, or are nearest to them."""
    places = Places(grid, fine)
    for rows in few_rows(fine):
        column, row = places.of_rows(rows)
        out[rows] = costs[cells_along(row, grid.rows)[0], cells_along(column, grid.columns)[0]]


_CARRIERS: dict[Kind, Callable[[Array, Grid, Grid, Array], None]] = {
    "rise": _carry_heights,
    "cost": _carry_costs,
    "cells": _carry_cells,
}
