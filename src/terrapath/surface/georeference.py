"""Where a planning plane lies on Earth, or on another body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pyproj import CRS, Transformer
from pyproj.crs import ProjectedCRS
from pyproj.crs.coordinate_operation import TransverseMercatorConversion
from pyproj.exceptions import CRSError

from ..errors import MapError
from ..validation import Array, Bounds


def local_projection(map_crs: CRS, longitude: float, latitude: float) -> CRS:
    """Transverse Mercator in metres, true to scale at the given point of a geographic CRS.

    Conformal, so directions and slopes are right, and unlike UTM without a scale factor:
    30 km from the centre lengths are off by 1e-5. The datum stays the map's own.
    """
    centre = TransverseMercatorConversion(round(latitude, 6), round(longitude, 6))
    return ProjectedCRS(centre, name="local transverse Mercator", geodetic_crs=map_crs)


@dataclass(frozen=True)
class Georeference:
    """The CRS that is planned in, and the CRS that the map came in."""

    crs: CRS
    map_crs: CRS

    @classmethod
    def from_projected(cls, crs: Any) -> Georeference:
        """A map that is planned in its own, projected CRS."""
        try:
            parsed = CRS.from_user_input(crs)
        except CRSError as error:
            raise MapError(f"crs={crs!r} is not understood: {error}") from None
        return cls(parsed, parsed)

    @property
    def is_map_crs(self) -> bool:
        """Is the map planned in the CRS that it came in?"""
        return bool(self.crs == self.map_crs)

    @property
    def unit(self) -> str:
        """Unit of the plane."""
        name = self.crs.axis_info[0].unit_name if self.crs.axis_info else ""
        return {"metre": "m", "kilometre": "km", "foot": "ft", "US survey foot": "ft"}.get(
            name, name
        )

    @property
    def is_earth(self) -> bool:
        """Is the body Earth? Its radius tells."""
        radius = self.crs.ellipsoid.semi_major_metre if self.crs.ellipsoid else 0.0
        return bool(6.3e6 < radius < 6.4e6)

    @property
    def name(self) -> str:
        """What the plane is, for people."""
        if self.is_map_crs:
            operation = self.crs.coordinate_operation
            if self.crs.name in {"unknown", "unnamed"} and operation is not None:
                return f"the map's own {operation.method_name} projection"
            return str(self.crs.name)
        return f"{self.crs.name} on {self.map_crs.name}"

    @cached_property
    def _to_map(self) -> Transformer:
        return Transformer.from_crs(self.crs, self.map_crs, always_xy=True)

    @cached_property
    def _to_lonlat(self) -> Transformer:
        target = CRS.from_epsg(4326) if self.is_earth else self.crs.geodetic_crs
        return Transformer.from_crs(self.crs, target, always_xy=True)

    def to_map(self, points: Array) -> Array:
        """Plane (..., 2) -> the map's own coordinates, x (longitude) before y (latitude)."""
        return np.stack(self._to_map.transform(points[..., 0], points[..., 1]), axis=-1)

    def from_map(self, points: Array) -> Array:
        """The map's own coordinates (..., 2) -> the plane."""
        return np.stack(
            self._to_map.transform(points[..., 0], points[..., 1], direction="INVERSE"), axis=-1
        )

    def rectangle_from_map(self, bounds: Bounds) -> Bounds:
        """The upright rectangle of the plane around one of the map's own coordinates."""
        return Bounds(*self._to_map.transform_bounds(*bounds, direction="INVERSE"))

    def to_lonlat(self, points: Array) -> Array:
        """Plane (..., 2) -> longitude and latitude in degrees: WGS 84 on Earth."""
        return np.stack(self._to_lonlat.transform(points[..., 0], points[..., 1]), axis=-1)

    def from_lonlat(self, lonlat: Array) -> Array:
        """Longitude and latitude in degrees (..., 2), as ``to_lonlat`` gives them -> the plane."""
        return np.stack(
            self._to_lonlat.transform(lonlat[..., 0], lonlat[..., 1], direction="INVERSE"), axis=-1
        )
