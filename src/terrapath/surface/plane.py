"""The cells of the planning plane for a map that lies in degrees, turned or distorted."""

from __future__ import annotations

import math

import numpy as np
from rasterio import Affine

from ..errors import MapError
from ..validation import Array
from .raster import SAME_PLACE, Grid

# Cells 100 times longer than wide, turned by 45 degrees, take 50 times as many upright ones.
MOST_MORE = 1_000

OUTLINE = 33  # places on each side of a map at which it is looked where it lies on the plane


def grid_on_plane(grid: Grid) -> Grid:
    """An upright grid over all of a map, with cells that are nowhere wider than the map's own.

    So no row and no column of the map is lost on the plane. Raises MapError where the cells have no
    size on the plane, or are so slanted that it takes far more upright ones.
    """
    corners = np.meshgrid(*(np.linspace(0.0, n, OUTLINE) for n in (grid.columns, grid.rows)))
    x, y = grid.on_plane(*corners)
    known = np.isfinite(x) & np.isfinite(y)
    sides = sides_on_plane(grid)
    if not (known.any() and 0.0 < min(sides) <= max(sides) < math.inf):
        place = ", ".join(f"{value:.6g}" for value in grid.extent())
        raise MapError(
            f"the map covers ({place}) as (x_min, y_min, x_max, y_max), where its cells have no "
            "size; check its CRS and where its cells lie"
        )
    west, east, south, north = x[known].min(), x[known].max(), y[known].min(), y[known].max()
    dx, dy = sides[::-1] if _is_turned(grid) else sides
    rows, columns = whole_cells(
        grid, (north - south) / dy - SAME_PLACE, (east - west) / dx - SAME_PLACE
    )
    transform = Affine(dx, 0.0, float(west), 0.0, dy, float(south))
    return Grid(rows, columns, transform, grid.plane, grid.map_crs or grid.crs)


def whole_cells(grid: Grid, rows: float, columns: float) -> tuple[int, int]:
    """So many rows and columns of upright cells, rounded up, for a map on this grid.

    rows and columns are numbers of NumPy. Raises MapError where there are far too many.
    """
    if not rows * columns <= MOST_MORE * grid.columns * grid.rows:
        raise MapError(
            f"the map has {grid.columns:,} x {grid.rows:,} cells, so slanted or distorted that it "
            f"takes {columns:,.0f} x {rows:,.0f} upright ones; check where its cells lie, or warp "
            "it to an upright grid first (gdalwarp)"
        )
    return math.ceil(rows), math.ceil(columns)


def sides_on_plane(grid: Grid) -> tuple[float, float]:
    """The least sides of a map's cells on the plane, along its rows and along its columns."""
    along, across = (float(np.nanmin(np.hypot(*step))) for step in steps_on_plane(grid))
    return along, across


def _is_turned(grid: Grid) -> bool:
    """Do a map's rows run along y rather than along x?"""
    along, _ = steps_on_plane(grid)
    return bool(np.nansum(np.abs(along[0])) < np.nansum(np.abs(along[1])))


def steps_on_plane(grid: Grid) -> tuple[Array, Array]:
    """How x and y of the plane change from a map's column and from its row to the next.

    Each (2, m, m), at places all over the map.
    """
    column, row = np.meshgrid(
        *(np.linspace(0.5, n - 0.5, OUTLINE) for n in (grid.columns, grid.rows))
    )
    along = grid.on_plane(column + 0.5, row) - grid.on_plane(column - 0.5, row)
    return along, grid.on_plane(column, row + 0.5) - grid.on_plane(column, row - 0.5)
