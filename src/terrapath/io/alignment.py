"""Brings further layers onto the grid of the heights."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pyproj import CRS

from .._support.memory import blocks
from ..errors import MapError
from ..surface.costs import CellLayers
from ..surface.raster import Grid
from ..surface.resampling import require_overlap, resample
from ..validation import Array
from .bands import Band, Part, View

if TYPE_CHECKING:
    from .undeclared import Meaning


def placed(name: str, band: Band, base: Grid, crs: CRS | None) -> Band:
    """The layer with a CRS: its own, the given one, or that of heights with the same cells."""
    grid = band.grid
    if grid.crs is None and crs is not None:
        return replace(band, grid=replace(grid, crs=crs))
    if grid.crs is not None and base.crs is not None:
        return band
    if not _has_cells_of(grid, base):
        raise MapError(
            f"layer {name!r} lies on another grid than the heights and at least one of them has "
            "no CRS, so they cannot be aligned; give the CRS, as in crs='EPSG:32633'"
        )
    return replace(band, grid=replace(grid, crs=base.crs))


def _has_cells_of(grid: Grid, other: Grid) -> bool:
    return grid.is_same(other) or grid.flipped().is_same(other)


def read_all(
    parts: Sequence[Part],
    base: View,
    target: Grid,
    most_cells: int,
    without_fills: Callable[[View, Meaning], View],
) -> Array:
    """All layers (layers, rows, columns) on the cells of the target.

    The first layer is the heights; ``base`` is the part of them that is read. most_cells : a layer
    that needs more cells is refused before memory is allocated. without_fills : a view with what
    is no data without being declared as such.
    """
    views = [base, *(_view_onto(part, base, target) for part in parts[1:])]
    for view in views:
        view.require_size(most_cells)
    meanings: list[Meaning] = ["layer" if p.kind == "rise" else "costs" for p in parts[1:]]
    views[1:] = map(without_fills, views[1:], meanings)
    bands = np.empty((len(parts), target.rows, target.columns))
    for part, view, out in zip(parts, views, bands, strict=True):
        if part.kind == "cost":
            _costs_onto(part.name, view, target, out)
        elif part.kind == "cells":
            _cells_onto(part.name, view, target, out)
        elif not view.read_as(target, out):
            resample(_read(view), view.grid, target, out, linear=False)
    return bands


def _view_onto(part: Part, base: View, target: Grid) -> View:
    """The part of a layer that covers the map, with cells no finer than the map's."""
    grid = part.band.grid
    if grid.crs == base.band.grid.crs and grid.is_same(base.band.grid):
        return replace(base, band=part.band)
    require_overlap(f"layer {part.name!r} ({part.band.label})", grid, target)
    x, y = target.outline(grid.crs)
    if grid.crs is not None and grid.crs.is_geographic:
        west, _, east, _ = grid.extent()
        x = x + 360.0 * np.rint((0.5 * (west + east) - x) / 360.0)
    column, row = grid.cells(x, y)
    ratio = max(float(np.ptp(column)) / target.columns, float(np.ptp(row)) / target.rows)
    view = View.whole(part.band).coarser(max(1, math.floor(ratio + 0.01)))
    return view.around(x, y) or view


def _costs_onto(name: str, view: View, target: Grid, out: Array) -> None:
    """Resample costs to the target's cells: bilinear in their logarithms, so within their range."""
    values = _read(view)
    _require_costs(name, values, view.grid)
    np.log(values, out=values)
    resample(values, view.grid, target, out, linear=True)
    np.exp(out, out=out)


def _cells_onto(name: str, view: View, target: Grid, out: Array) -> None:
    """Bring the costs of cells to the target's cells: each has the cost where its centre lies."""
    values = _read(view)
    _require_costs(name, values, view.grid)
    if (order := view.order_in(target)) is not None:
        out[order] = values
    else:
        resample(values, view.grid, target, out, nearest=True)


def own_cells(
    parts: Sequence[Part],
    base: View,
    target: Grid,
    most_cells: int,
    without_fills: Callable[[View, Meaning], View],
) -> CellLayers | None:
    """The costs of the cells of a raster whose cells are not those of the heights.

    None where they are; where there are several such rasters with different cells, or where
    these are not upright on the map's plane. Then the cells are those of the heights.
    """
    cells = [part for part in parts if part.kind == "cells"]
    if not cells or base.factor > 1 or base.grid.needs_warp:
        return None
    grid = cells[0].band.grid
    if grid.needs_warp or grid.crs != target.crs or _has_cells_of(grid, base.band.grid):
        return None
    if not all(part.band.grid.is_same(grid) for part in cells[1:]):
        return None
    views = [View.whole(part.band).around(*target.outline(None)) for part in cells]
    found = [without_fills(view, "costs") for view in views if view is not None]
    values = []
    for view in found:
        view.require_size(most_cells)
        given = _read(view)
        # Where a cell has no cost, the cells of the heights there are blocked.
        given[~np.isfinite(given)] = np.nanmax(given)
        values.append(given if view.grid.transform.e > 0.0 else given[::-1])
    t = found[0].grid.southward().transform
    return CellLayers(np.ascontiguousarray(values), t.c, t.f, t.a, t.e)


def _read(view: View) -> Array:
    values = np.empty((view.grid.rows, view.grid.columns))
    view.read_into(values)
    return values


def _require_costs(name: str, values: Array, grid: Grid) -> None:
    """Raise MapError with the place of a cost that is not above 0."""
    for rows in blocks(grid.rows, grid.columns):
        wrong = np.argwhere(values[rows] <= 0.0)
        if len(wrong):
            row, column = wrong[0]
            x, y = grid.place(column + 0.5, rows.start + row + 0.5)
            raise MapError(
                f"cost {name!r} is {values[rows.start + row, column]:g} at x={x:.10g}, "
                f"y={y:.10g}; costs multiply lengths and must be above 0: mark forbidden ground as "
                "no-data, and raise the rest"
            )
