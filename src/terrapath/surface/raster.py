"""Rasters: bands on a grid with a place on Earth, on their way to a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pyproj import CRS
from rasterio import Affine

from ..errors import InputError, MapError
from ..validation import Array
from .bounds import Mask
from .georeference import Georeference
from .grid import Grid
from .surface import Surface

if TYPE_CHECKING:
    from .holes import Cells

LEAST_CELLS = 4


@dataclass(frozen=True, eq=False)
class Raster:
    """Bands (layers, rows, columns) as GDAL lays them out; NaN is no-data.

    transform : from (column, row) corners to map coordinates. crs : None where unknown.
    map_crs : the CRS that the data came in, where it is another one.
    """

    bands: Array
    transform: Affine
    crs: CRS | None
    map_crs: CRS | None = None

    @classmethod
    def on(cls, grid: Grid, bands: Array) -> Raster:
        """Bands on a grid."""
        return cls(bands, grid.transform, grid.crs, grid.map_crs)

    @classmethod
    def from_extent(
        cls, bands: Array, extent: tuple[float, float, float, float], crs: Any
    ) -> Raster:
        """A north-up raster over (west, south, east, north), the outer edges of its cells."""
        from rasterio.transform import from_bounds

        rows, columns = bands.shape[1:]
        return cls(bands, from_bounds(*extent, columns, rows), CRS.from_user_input(crs))

    @property
    def grid(self) -> Grid:
        """Where its cells lie."""
        rows, columns = self.bands.shape[1:]
        return Grid(rows, columns, self.transform, self.crs, self.map_crs)

    def needs_warp(self) -> bool:
        """Is it in degrees or turned, so that it cannot be planned on as it is?"""
        return self.grid.needs_warp

    def to_local_metres(self) -> Raster:
        """The same ground on a north-up grid of square cells in a projected CRS (cubic)."""
        from .resampling import resample

        target = self.grid.planning_grid()
        bands = np.empty((len(self.bands), target.rows, target.columns))
        for band, out in zip(self.bands, bands, strict=True):
            resample(np.array(band, dtype=np.float64), self.grid, target, out, linear=False)
        return Raster.on(target, bands).trimmed()

    def trimmed(self) -> Raster:
        """Without outer rows and columns that hold no data at all."""
        some = ~self._missing()
        if not some.any():
            return self
        rows, columns = (np.flatnonzero(some.any(axis=axis)) for axis in (1, 0))
        kept = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        return Raster.on(self.grid.window(*kept), self.bands[:, kept[0], kept[1]])

    def _missing(self) -> Cells:
        """Cells that any layer has no data in."""
        from .holes import missing_cells

        missing = missing_cells(self.bands[0])
        for band in self.bands[1:]:
            missing |= missing_cells(band)
        return missing

    def _georeference(self) -> Georeference | None:
        return None if self.crs is None else Georeference(self.crs, self.map_crs or self.crs)

    def _southward(self) -> Raster:
        """Rows from south to north."""
        if self.transform.e > 0.0:
            return self
        return Raster.on(self.grid.flipped(), self.bands[:, ::-1])

    @property
    def is_complete(self) -> bool:
        """Has each cell of every layer data?"""
        return all(bool(np.isfinite(band).all()) for band in self.bands)

    def _require_cells(self) -> None:
        rows, columns = self.bands.shape[1:]
        if min(rows, columns) < LEAST_CELLS:
            raise MapError(
                f"the map has {columns} x {rows} cells; "
                f"a surface needs at least {LEAST_CELLS} x {LEAST_CELLS}"
            )

    def _fill(self, size: float, kinds: Sequence[str]) -> Mask | None:
        """Fill small holes, continue the ground into large ones; the cells that stay blocked.

        Costs are filled by their logarithms and stay within their range, above 0.
        """
        from .holes import continue_into_holes, fill_small_holes, missing_cells

        if self._missing().all():
            raise MapError("the map holds no data at all: every cell is no-data")
        blocked = np.zeros(self.bands.shape[1:], dtype=bool)
        for band, kind in zip(self.bands, kinds, strict=True):
            missing = missing_cells(band)
            if not missing.any():
                continue
            if kind == "cost":
                np.log(band, out=band)
            low, high = np.nanmin(band), np.nanmax(band)
            if size > 0.0:
                fill_small_holes(band, missing, self.transform.a, self.transform.e, size)
                np.clip(band, low, high, out=band)
            continue_into_holes(band, missing)
            if kind == "cost":
                np.exp(np.clip(band, low, high, out=band), out=band)
            blocked |= missing
        return Mask(blocked, *self.grid.centres()) if blocked.any() else None

    def to_surface(
        self,
        *,
        names: Sequence[str],
        units: Sequence[str] | None = None,
        weights: Sequence[float] | None = None,
        kinds: Sequence[str] | None = None,
        fill_holes: float = 0.0,
        smoothing: float | None = None,
    ) -> Surface:
        """The spline surface through the cell centres; cells without data are blocked.

        kinds : "rise" or "cost" of each layer. fill_holes : the longest side of holes that are
        filled and free, map units.
        The raster is used up: its cells without data are given values.
        """
        raster = self._southward()
        raster._require_cells()
        kinds = kinds or ["rise"] * len(names)
        nodata = None if raster.is_complete else raster._fill(fill_holes, kinds)
        x, y = raster.grid.centres()
        try:
            return Surface.from_grid(
                raster.bands,
                x,
                y,
                smoothing=smoothing,
                names=names,
                units=units,
                weights=weights,
                kinds=kinds,
                nodata=nodata,
                georeference=raster._georeference(),
            )
        except MemoryError:
            raise InputError(
                f"a map of {len(x):,} x {len(y):,} cells needs more memory than there is; read a "
                "part of it (within) or every few cells only (decimate)"
            ) from None
