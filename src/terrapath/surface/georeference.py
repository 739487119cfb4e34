"""Where a planning plane lies on Earth, or on another body."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import MapError
from ..validation import Array
from .bounds import Bounds

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

# Units of length, as CRSs and maps write them, and their size in metres.
LENGTH_UNITS = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("km", "kilometre", "kilometres", "kilometer", "kilometers"), 1000.0),
    **dict.fromkeys(("dm", "decimetre", "decimeter", "decimetres", "decimeters"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimeter", "centimetres", "centimeters"), 0.01),
    **dict.fromkeys(("mm", "millimetre", "millimeter", "millimetres", "millimeters"), 0.001),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "international feet"), 0.3048),
    **dict.fromkeys(
        ("us survey foot", "us survey feet", "us-ft", "ftus", "foot_us", "survey foot"),
        1200.0 / 3937.0,
    ),
    **dict.fromkeys(("yd", "yard", "yards"), 0.9144),
}

# A projection's scale is measured over this distance, metres: far above rounding, and so short
# that the scale hardly changes over it.
SCALE_STEP = 100.0


def metres_of(unit: str) -> float | None:
    """Length of a unit in metres; None where it is not a known unit of length."""
    return LENGTH_UNITS.get(unit.strip().lower())


def amount(value: float, unit: str) -> str:
    """A number with its unit: three digits after the point, six where it is small.

    It is small below 1, and below 1,000 where the unit is none that is measured in. Seconds are
    also given in hours and minutes, joules in watt-hours.
    """
    others = {"s": in_hours, "J": in_watt_hours}
    is_measured = unit in others or metres_of(unit.removeprefix("weighted ")) is not None
    text = f"{value:{',.3f' if abs(value) >= (1.0 if is_measured else 1000.0) else '.6f'}} {unit}"
    return f"{others[unit](value)} ({text})" if unit in others else text.rstrip()


def in_hours(seconds: float) -> str:
    """A time as hours and minutes, h:min."""
    if not math.isfinite(seconds):
        return f"{seconds} h"
    minutes = round(abs(seconds) / 60.0)
    return f"{'-' if seconds < 0.0 and minutes else ''}{minutes // 60}:{minutes % 60:02d} h"


def in_watt_hours(joules: float) -> str:
    """An energy in watt-hours, four digits."""
    return f"{joules / 3600.0:,.4g} Wh"


def parse_crs(text: object, name: str = "the CRS") -> CRS | None:
    """A horizontal CRS from anything that names one; None where there is none.

    For a compound CRS the horizontal part, for a bound CRS its source. Raises MapError.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError, ProjError

    if text is None:
        return None
    try:
        crs = text if isinstance(text, CRS) else CRS.from_user_input(text)
    except (CRSError, ProjError) as error:
        reason = " ".join(str(error).split())
        raise MapError(f"{name} is not understood: {reason:.200}") from None
    while crs.is_compound or crs.is_bound:
        part = crs.sub_crs_list[0] if crs.is_compound else crs.source_crs
        assert part is not None
        crs = part
    if crs.is_geocentric or crs.is_vertical:
        raise MapError(
            f"{name} ({crs.name}) is not horizontal; give a projected or a geographic CRS"
        )
    if crs.geodetic_crs is None:
        return None  # an engineering CRS: its place on Earth is not known
    if crs.is_geographic and len(crs.axis_info) > 2:
        crs = crs.to_2d()
    if crs.is_geographic and any(axis.unit_name != "degree" for axis in crs.axis_info):
        raise MapError(
            f"{name} ({crs.name}) counts angles in {crs.axis_info[0].unit_name}; give one in "
            "degrees, or a projected one"
        )
    return crs


@cache
def transformer(source: CRS, target: CRS) -> Transformer:
    """From one CRS to another, x (longitude) first. Raises MapError where this cannot be done."""
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        return Transformer.from_crs(source, target, always_xy=True)
    except ProjError as error:
        reason = " ".join(str(error).split())
        raise MapError(
            f"the CRS {source.name} cannot be transformed to {target.name}: {reason:.120}; "
            "check that both are of the same body"
        ) from None


def worst_scale(crs: CRS, x: Array, y: Array) -> float:
    """The largest relative error of lengths on a projection at points: 0.01 for 1 %.

    From Tissot's ellipse by finite differences. ``pyproj.Proj`` computes it too, but changes the
    warning filters of the whole process meanwhile, and so of other threads. Infinite where the
    projection is not defined at the points.
    """
    step = SCALE_STEP / crs.axis_info[0].unit_conversion_factor
    along_x = _on_body(crs, x + step, y) - _on_body(crs, x - step, y)
    along_y = _on_body(crs, x, y + step) - _on_body(crs, x, y - step)
    # Metres on the ground for each metre on the plane, (points, 3, 2).
    ground = np.stack([along_x, along_y], axis=-1).swapaxes(0, 1) / (2.0 * SCALE_STEP)
    if not np.isfinite(ground).all():
        return np.inf
    with np.errstate(divide="ignore"):
        scales = 1.0 / np.linalg.svd(ground, compute_uv=False)
    return float(np.abs(scales - 1.0).max())


def _on_body(crs: CRS, x: Array, y: Array) -> Array:
    """(3, points): where on the ellipsoid points of a projection lie, metres from its centre."""
    geodetic, body = crs.geodetic_crs, crs.ellipsoid
    assert geodetic is not None
    assert body is not None
    radians = geodetic.axis_info[0].unit_conversion_factor
    longitude, latitude = radians * np.asarray(transformer(crs, geodetic).transform(x, y))
    # Some projections give latitudes beyond the poles where they are not defined.
    reached = np.isfinite(longitude) & (np.abs(latitude) < 0.5 * np.pi + 1e-9)
    longitude, latitude = np.where(reached, [longitude, latitude], np.nan)
    a, b = body.semi_major_metre, body.semi_minor_metre
    across = a**2 / np.hypot(a * np.cos(latitude), b * np.sin(latitude))
    flat = across * np.cos(latitude)
    height = (b / a) ** 2 * across * np.sin(latitude)
    return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), height])


def local_projection(map_crs: CRS, longitude: float, latitude: float) -> CRS:
    """Transverse Mercator in metres, true to scale at the given point of a geographic CRS.

    It is conformal, so angles are right. Unlike UTM it has no scale factor: 30 km from the centre
    lengths are wrong by 1e-5. The datum stays the map's own.
    """
    from pyproj.crs import ProjectedCRS
    from pyproj.crs.coordinate_operation import TransverseMercatorConversion

    centre = TransverseMercatorConversion(round(latitude, 6), round(longitude, 6))
    return ProjectedCRS(centre, name="local transverse Mercator", geodetic_crs=map_crs)


@dataclass(frozen=True)
class Georeference:
    """Two CRSs: that of the planning plane, and the map's own."""

    crs: CRS
    map_crs: CRS

    @classmethod
    def from_projected(cls, crs: CRS | str | int) -> Georeference:
        """For a map with a projected CRS, which the planning plane shares."""
        from pyproj import CRS
        from pyproj.exceptions import CRSError

        try:
            parsed = CRS.from_user_input(crs)
        except CRSError as error:
            raise MapError(f"crs={crs!r} is not understood: {error}") from None
        return cls(parsed, parsed)

    @property
    def is_map_crs(self) -> bool:
        """Is the CRS of the planning plane the map's own?"""
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
        """Is the body Earth? Decided by its radius."""
        radius = self.crs.ellipsoid.semi_major_metre if self.crs.ellipsoid else 0.0
        return bool(6.3e6 < radius < 6.4e6)

    @property
    def name(self) -> str:
        """The name of the plane, for people."""
        if self.is_map_crs:
            operation = self.crs.coordinate_operation
            if self.crs.name in {"unknown", "unnamed"} and operation is not None:
                return f"the map's own {operation.method_name} projection"
            return str(self.crs.name)
        return f"{self.crs.name} on {self.map_crs.name}"

    @cached_property
    def text(self) -> str:
        """The plane's CRS, for programs: its code where it has one, else its definition.

        A local projection has no code, and searching for one takes longer than planning a route.
        """
        return str(self.crs.to_string() if self.is_map_crs else self.crs.srs)

    @property
    def _to_map(self) -> Transformer:
        return transformer(self.crs, self.map_crs)

    @cached_property
    def _to_lonlat(self) -> Transformer:
        from pyproj import CRS

        return transformer(
            self.crs, CRS.from_epsg(4326) if self.is_earth else self.crs.geodetic_crs
        )

    def to_map(self, points: Array) -> Array:
        """Plane (..., 2) -> the map's own coordinates, x (longitude) before y (latitude)."""
        return np.stack(self._to_map.transform(points[..., 0], points[..., 1]), axis=-1)

    def from_map(self, points: Array) -> Array:
        """The map's own coordinates (..., 2) -> the plane."""
        return np.stack(
            self._to_map.transform(points[..., 0], points[..., 1], direction="INVERSE"), axis=-1
        )

    def rectangle_from_map(self, bounds: Bounds) -> Bounds:
        """The smallest rectangle on the plane around a rectangle in the map's own coordinates."""
        return Bounds(*self._to_map.transform_bounds(*bounds, direction="INVERSE"))

    def to_lonlat(self, points: Array) -> Array:
        """Plane (..., 2) -> longitude and latitude in degrees; on Earth, of WGS 84."""
        return np.stack(self._to_lonlat.transform(points[..., 0], points[..., 1]), axis=-1)

    def from_lonlat(self, lonlat: Array) -> Array:
        """Longitude and latitude in degrees (..., 2), as ``to_lonlat`` gives them -> the plane."""
        return np.stack(
            self._to_lonlat.transform(lonlat[..., 0], lonlat[..., 1], direction="INVERSE"), axis=-1
        )
