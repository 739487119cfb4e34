"""Rasters: bands on a grid with a place on Earth, on their way to a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from affine import Affine
from pyproj import CRS
from pyproj.exceptions import CRSError
from scipy.ndimage import distance_transform_edt

from ..errors import MapError
from ..validation import Array
from .georeference import Georeference, local_projection
from .mask import Mask
from .surface import Surface

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
    def from_extent(
        cls, bands: Array, extent: tuple[float, float, float, float], crs: Any
    ) -> Raster:
        """A north-up raster over (west, south, east, north), the outer edges of its cells."""
        from rasterio.transform import from_bounds

        rows, columns = bands.shape[1:]
        return cls(bands, from_bounds(*extent, columns, rows), CRS.from_user_input(crs))

    @property
    def is_north_up(self) -> bool:
        """Are rows and columns parallel to the axes, with x growing along the rows?"""
        t = self.transform
        return bool(t.b == 0.0 and t.d == 0.0 and t.a > 0.0)

    def needs_warp(self) -> bool:
        """Is it in degrees or turned, so that it cannot be planned on as it is?"""
        return not self.is_north_up or (self.crs is not None and self.crs.is_geographic)

    def _place(self, column: float, row: float) -> tuple[float, float]:
        """Map coordinates of the corner between cells."""
        t = self.transform
        return t.a * column + t.b * row + t.c, t.d * column + t.e * row + t.f

    def _extent(self) -> tuple[float, float, float, float]:
        rows, columns = self.bands.shape[1:]
        corners = [self._place(c, r) for c in (0, columns) for r in (0, rows)]
        x, y = zip(*corners, strict=True)
        return min(x), min(y), max(x), max(y)

    def _plane(self) -> CRS | None:
        """The CRS to plan in: a local projection for degrees, its own otherwise."""
        if self.crs is None or not self.crs.is_geographic:
            return self.crs
        west, south, east, north = self._extent()
        return local_projection(self.crs, 0.5 * (west + east), 0.5 * (south + north))

    def to_local_metres(self) -> Raster:
        """The same ground on a north-up grid of square cells in a projected CRS (cubic)."""
        from rasterio.warp import Resampling, calculate_default_transform, reproject

        plane = self._plane()
        source_crs = self.crs.to_wkt() if self.crs else 'LOCAL_CS["plane"]'
        plane_crs = plane.to_wkt() if plane else source_crs
        rows, columns = self.bands.shape[1:]
        transform, width, height = calculate_default_transform(
            source_crs, plane_crs, columns, rows, *self._extent()
        )
        bands = np.full((len(self.bands), height, width), np.nan)
        reproject(
            self.bands,
            bands,
            src_transform=self.transform,
            src_crs=source_crs,
            src_nodata=np.nan,
            dst_transform=transform,
            dst_crs=plane_crs,
            dst_nodata=np.nan,
            resampling=Resampling.cubic,
        )
        return Raster(bands, transform, plane, self.crs)._trimmed()

    def _trimmed(self) -> Raster:
        """Without outer rows and columns that hold no data at all."""
        some = np.all(np.isfinite(self.bands), axis=0)
        if not np.any(some):
            return self
        rows, columns = (np.flatnonzero(np.any(some, axis=axis)) for axis in (1, 0))
        window = np.s_[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        x, y = self._place(columns[0], rows[0])
        t = self.transform
        transform = Affine(t.a, t.b, x, t.d, t.e, y)
        return Raster(self.bands[window], transform, self.crs, self.map_crs)

    def _georeference(self) -> Georeference | None:
        return None if self.crs is None else Georeference(self.crs, self.map_crs or self.crs)

    def _centres(self) -> tuple[Array, Array]:
        rows, columns = self.bands.shape[1:]
        t = self.transform
        x: Array = t.c + t.a * (np.arange(columns, dtype=np.float64) + 0.5)
        y: Array = t.f + t.e * (np.arange(rows, dtype=np.float64) + 0.5)
        return x, y

    def to_surface(
        self,
        *,
        names: Sequence[str],
        units: Sequence[str] | None = None,
        weights: Sequence[float] | None = None,
    ) -> Surface:
        """The spline surface through the cell centres; cells without data are blocked."""
        x, y = self._centres()
        bands = self.bands
        if self.transform.e < 0.0:
            y, bands = y[::-1], bands[:, ::-1]
        if min(bands.shape[1:]) < LEAST_CELLS:
            raise MapError(
                f"the map has {bands.shape[2]} x {bands.shape[1]} cells; "
                f"a surface needs at least {LEAST_CELLS} x {LEAST_CELLS}"
            )
        missing: npt.NDArray[np.bool_] = np.any(~np.isfinite(bands), axis=0)
        if missing.all():
            raise MapError("the map holds no data at all: every cell is no-data")
        return Surface.from_grid(
            _filled(bands, missing),
            x,
            y,
            names=names,
            units=units,
            weights=weights,
            nodata=Mask(missing, x, y) if missing.any() else None,
            georeference=self._georeference(),
        )


def _filled(bands: Array, missing: npt.NDArray[np.bool_]) -> Array:
    """No-data cells take the nearest cell's value: no cliff at their edge, no ringing from it."""
    if not missing.any():
        return bands
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.ascontiguousarray(bands[:, nearest[0], nearest[1]])


def parse_crs(text: Any) -> CRS | None:
    """A CRS as rasterio gives it; None where there is none."""
    if text is None:
        return None
    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        raise MapError(f"the CRS is not understood: {error}") from None
