"""Rasters: bands on a georeferenced grid, from which surfaces are made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from pyproj import CRS
from rasterio import Affine

from ..errors import InputError, MapError
from ..validation import Array
from .bounds import Mask
from .georeference import Georeference, local_projection, transformer, worst_scale
from .surface import Surface

if TYPE_CHECKING:
    from .holes import Cells
    from .layers import Kind


SAME_PLACE = 1e-6  # places that differ by less count as equal, cells
MOST_DISTORTED = 0.001  # relative error of lengths that is allowed in a map's own projection
MOST_DISTORTED_UTM = 0.003  # in transverse Mercator: 500 km from the central meridian
WORST_SCALE = 0.01  # in a local projection, at the map's edge


@dataclass(frozen=True)
class Grid:
    """Cells in rows and columns, as GDAL orders them.

    transform : from (column, row) of cell corners to map coordinates. crs : None where unknown.
    map_crs : the CRS that the map's file is in, where it is another one.
    """

    rows: int
    columns: int
    transform: Affine
    crs: CRS | None = None
    map_crs: CRS | None = None

    @property
    def is_upright(self) -> bool:
        """Are rows and columns parallel to the axes, with x growing along the rows?"""
        t = self.transform
        return bool(t.b == 0.0 and t.d == 0.0 and t.a > 0.0)

    @property
    def needs_warp(self) -> bool:
        """Is it in degrees, rotated or distorted, so that it must be warped before planning?"""
        return not self.is_upright or self._needs_projection

    @cached_property
    def _needs_projection(self) -> bool:
        """Is it in degrees, or in a projection that distorts lengths, such as Web Mercator?"""
        if self.crs is None:
            return False
        if self.crs.is_geographic:
            return True
        operation = self.crs.coordinate_operation
        is_utm = operation is not None and operation.method_name == "Transverse Mercator"
        return self._distortion() > (MOST_DISTORTED_UTM if is_utm else MOST_DISTORTED)

    def _distortion(self) -> float:
        """The largest relative error of lengths in its projection."""
        assert self.crs is not None
        worst = worst_scale(self.crs, *self.outline(None, points=5))
        if not math.isfinite(worst):
            corners = ", ".join(f"{value:.6g}" for value in self.extent())
            raise MapError(
                f"the map covers ({corners}) as (x_min, y_min, x_max, y_max), where its CRS, "
                f"{self.crs.name}, does not reach; check the CRS"
            )
        return worst

    @property
    def cell(self) -> float:
        """Side of the square with the area of a cell, in the CRS's unit."""
        t = self.transform
        return math.sqrt(abs(t.a * t.e - t.b * t.d))

    def reach(self, length: float) -> tuple[int, int]:
        """The largest numbers of rows and columns that a length on the plane reaches across."""
        columns, rows = np.meshgrid([0, self.columns - 1], [0, self.rows - 1])
        corner = self.on_plane(columns, rows)
        steps = ((columns, rows + 1), (columns + 1, rows))
        sides = [np.hypot(*(self.on_plane(*step) - corner)).min() for step in steps]
        return math.ceil(length / sides[0]), math.ceil(length / sides[1])

    def on_plane(self, columns: Array, rows: Array) -> Array:
        """(2, ...): where corners of cells lie on the planning plane."""
        x, y = self.place(columns, rows)
        plane = self.plane
        if self.crs is not None and plane is not None and plane != self.crs:
            x, y = transformer(self.crs, plane).transform(x, y)
        return np.asarray([x, y])

    def place(self, column: Array | float, row: Array | float) -> tuple[Array, Array]:
        """Map coordinates of the corners of cells."""
        t = self.transform
        columns, rows = np.asarray(column, np.float64), np.asarray(row, np.float64)
        return t.a * columns + t.b * rows + t.c, t.d * columns + t.e * rows + t.f

    def cells(self, x: Array, y: Array) -> tuple[Array, Array]:
        """(column, row) of map coordinates, counted from the first cell's centre."""
        t = self.transform
        area = t.a * t.e - t.b * t.d
        # Differences first, because coordinates are large compared with cells.
        along, across = x - t.c, y - t.f
        return (
            (t.e * along - t.b * across) / area - 0.5,
            (t.a * across - t.d * along) / area - 0.5,
        )

    def extent(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of the cells' outer edges."""
        columns = np.array([0, self.columns, 0, self.columns])
        x, y = self.place(columns, np.array([0, 0, self.rows, self.rows]))
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    def outline(self, crs: CRS | None, *, points: int = 33) -> tuple[Array, Array]:
        """Coordinates in another CRS of points on the grid's edge and inside it."""
        columns, rows = np.meshgrid(
            np.linspace(0.0, self.columns, points), np.linspace(0.0, self.rows, points)
        )
        x, y = self.place(columns.ravel(), rows.ravel())
        if crs is None or self.crs is None or crs == self.crs:
            return x, y
        x, y = transformer(self.crs, crs).transform(x, y)
        known = np.isfinite(x) & np.isfinite(y)
        return x[known], y[known]

    def flipped(self) -> Grid:
        """The same cells with the rows in reverse order."""
        t = self.transform
        x, y = t.b * self.rows + t.c, t.e * self.rows + t.f
        return replace(self, transform=Affine(t.a, -t.b, x, t.d, -t.e, y))

    def southward(self) -> Grid:
        """The same cells with rows from south to north, as surfaces have them."""
        return self if self.transform.e > 0.0 else self.flipped()

    def is_same(self, other: Grid) -> bool:
        """Are the cells the same, in the same order? The CRS is not compared."""
        if (self.rows, self.columns) != (other.rows, other.columns):
            return False
        corners = np.array([0, self.columns, 0]), np.array([0, 0, self.rows])
        ours, theirs = self.place(*corners), other.place(*corners)
        off = max(float(np.abs(a - b).max()) for a, b in zip(ours, theirs, strict=True))
        return off <= SAME_PLACE * self.cell

    def window(self, rows: slice, columns: slice) -> Grid:
        """The grid of some of the rows and columns."""
        t = self.transform
        x, y = self.place(columns.start, rows.start)
        return replace(
            self,
            rows=rows.stop - rows.start,
            columns=columns.stop - columns.start,
            transform=Affine(t.a, t.b, float(x), t.d, t.e, float(y)),
        )

    def coarser(self, factor: int) -> Grid:
        """Cells ``factor`` times as wide and high; rows and columns left over are dropped."""
        t, k = self.transform, factor
        return replace(
            self,
            rows=self.rows // k,
            columns=self.columns // k,
            transform=Affine(k * t.a, k * t.b, t.c, k * t.d, k * t.e, t.f),
        )

    def centres(self) -> tuple[Array, Array]:
        """Coordinates of the cell centres along x and y, for an upright grid."""
        t = self.transform
        x: Array = t.c + t.a * (np.arange(self.columns, dtype=np.float64) + 0.5)
        y: Array = t.f + t.e * (np.arange(self.rows, dtype=np.float64) + 0.5)
        return x, y

    @cached_property
    def plane(self) -> CRS | None:
        """The planning CRS: the grid's own where it is true to scale, else a local projection."""
        if self.crs is None or not self._needs_projection:
            return self.crs
        west, south, east, north = self.extent()
        x, y = 0.5 * (west + east), 0.5 * (south + north)
        if not self.crs.is_geographic:
            x, y = transformer(self.crs, self.crs.geodetic_crs).transform(x, y)
        elif max(abs(south), abs(north)) > 90.0 + self.cell:
            raise MapError(
                f"the map's latitudes are {south:.6g} to {north:.6g}; they must lie between -90 "
                "and 90; check its CRS and the order of its axes"
            )
        body = self.crs.geodetic_crs
        assert body is not None
        plane = local_projection(body, x, y)
        if (self.crs.is_geographic and east - west > 90.0) or self._off(plane) > WORST_SCALE:
            across = f"{east - west:.4g} x {north - south:.4g}"
            raise MapError(
                f"the map reaches over {across} {self.crs.axis_info[0].unit_name}s, too far for "
                "one local projection in metres; read a part of it with within=(x_min, y_min, "
                "x_max, y_max), or bring it onto a projection of your choice first"
            )
        return plane

    def _off(self, plane: CRS) -> float:
        """The largest relative error of lengths in a transverse Mercator projection from here."""
        assert self.crs is not None
        x, _ = self.outline(plane)
        radius = self.crs.ellipsoid.semi_major_metre if self.crs.ellipsoid else 6.37e6
        # The scale is 1 + (x/R)^2/2 at easting x.
        return 0.5 * float(np.square(x).max()) / radius**2 if len(x) else math.inf

    def planning_grid(self) -> Grid:
        """The grid to plan on: upright, rows from south to north; this grid's cells if possible."""
        if not self.needs_warp:
            return self.southward()

        from .plane import grid_on_plane

        return grid_on_plane(self)

    @property
    def sides(self) -> tuple[float, float]:
        """The sides of a cell on the planning plane, along its rows and its columns."""
        if not self.needs_warp:
            return abs(self.transform.a), abs(self.transform.e)

        from .plane import sides_on_plane

        return sides_on_plane(self)

    def in_cells(self, rows: int, columns: int) -> Grid:
        """The same ground in another number of rows and columns."""
        t, across, along = self.transform, self.columns / columns, self.rows / rows
        transform = Affine(t.a * across, t.b * along, t.c, t.d * across, t.e * along, t.f)
        return replace(self, rows=rows, columns=columns, transform=transform)


LEAST_CELLS = 4


@dataclass(frozen=True, eq=False)
class Raster:
    """Bands (layers, rows, columns) as GDAL orders them; NaN is no-data.

    transform, crs, map_crs : as in ``Grid``.
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
        cls, bands: Array, extent: tuple[float, float, float, float], crs: CRS | str | int
    ) -> Raster:
        """A north-up raster over (west, south, east, north), the outer edges of its cells."""
        from rasterio.transform import from_bounds

        rows, columns = bands.shape[1:]
        return cls(bands, from_bounds(*extent, columns, rows), CRS.from_user_input(crs))

    @property
    def grid(self) -> Grid:
        """The grid of its cells."""
        rows, columns = self.bands.shape[1:]
        return Grid(rows, columns, self.transform, self.crs, self.map_crs)

    def needs_warp(self) -> bool:
        """Is it in degrees, rotated or distorted, so that it must be warped before planning?"""
        return self.grid.needs_warp

    def _georeference(self) -> Georeference | None:
        plane = self.grid.plane
        return None if plane is None else Georeference(plane, self.map_crs or self.crs or plane)

    def _southward(self) -> Raster:
        """The raster with rows from south to north."""
        if self.transform.e > 0.0 or not self.grid.is_upright:
            return self
        return Raster.on(self.grid.flipped(), self.bands[:, ::-1])

    @property
    def is_complete(self) -> bool:
        """Does every cell of every layer have data?"""
        return all(bool(np.isfinite(band).all()) for band in self.bands)

    def _require_cells(self) -> None:
        rows, columns = self.bands.shape[1:]
        if min(rows, columns) < LEAST_CELLS:
            raise MapError(
                f"the map has {columns} x {rows} cells; "
                f"a surface needs at least {LEAST_CELLS} x {LEAST_CELLS}"
            )

    def _fill(self, size: float, kinds: Sequence[Kind]) -> tuple[Cells, Cells]:
        """Fill small holes, and continue the ground into large ones.

        Returns the blocked cells, and those among them whose height is not known.

        Costs are filled in their logarithms. They stay within their range, and so above 0. Other
        cells keep their values.
        """
        from .holes import continue_into_holes, fill_small_holes, missing_cells

        gaps = [missing_cells(band) for band in self.bands]
        if np.logical_or.reduce(gaps).all():
            raise MapError("the map holds no data at all: every cell is no-data")
        for band, kind, missing in zip(self.bands, kinds, gaps, strict=True):
            if not missing.any():
                continue
            given = ~missing
            known = band[given] if kind == "cells" else None
            if kind != "rise":
                np.log(band, out=band)
            low, high = np.nanmin(band), np.nanmax(band)
            if size > 0.0:
                fill_small_holes(band, missing, *self.grid.sides, size)
                np.clip(band, low, high, out=band)
            continue_into_holes(band, missing)
            if kind != "rise":
                np.exp(np.clip(band, low, high, out=band), out=band)
            if known is not None:
                band[given] = known
                # What is still missing is blocked, and must lend no low cost to its neighbours.
                band[missing] = known.max()
        return np.logical_or.reduce(gaps), gaps[0]

    def to_surface(
        self,
        *,
        names: Sequence[str],
        units: Sequence[str] | None = None,
        weights: Sequence[float] | None = None,
        kinds: Sequence[Kind] | None = None,
        fill_holes: float = 0.0,
        smoothing: float | None = None,
    ) -> Surface:
        """The spline surface through the cell centres; cells without data are blocked.

        kinds : of each layer, as in ``Surface.from_grid``. fill_holes : holes up to this side are
        filled and become free, map units.
        Do not use the raster after this: its cells without data are given values.
        """
        raster = self._southward()
        raster._require_cells()
        kinds = kinds or ["rise"] * len(names)
        blocked, unknown = (None, None) if raster.is_complete else raster._fill(fill_holes, kinds)
        make = partial(
            Surface.from_grid,
            smoothing=smoothing,
            names=names,
            units=units,
            weights=weights,
            kinds=kinds,
            georeference=raster._georeference(),
        )
        try:
            if raster.needs_warp():
                from .carrying import carried_surface

                return carried_surface(raster, kinds, blocked, unknown, make)
            x, y = raster.grid.centres()
            nodata = None if blocked is None or not blocked.any() else Mask(blocked, x, y)
            surface = make(raster.bands, x, y, nodata=nodata)
            return surface if unknown is None else replace(surface, unknown=unknown)
        except MemoryError:
            rows, columns = raster.bands.shape[1:]
            raise InputError(
                f"a map of {columns:,} x {rows:,} cells needs more memory than there is; read a "
                "part of it (within) or every few cells only (decimate)"
            ) from None
