"""A user's own coordinates, on the map or in degrees, and the plane that is planned in."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from .option import Point, Rectangle

if TYPE_CHECKING:
    from ..surface import Surface
    from ..surface.bounds import Bounds


def on_plane(surface: Surface, point: Point, name: str, *, latlon: bool) -> Point:
    """A point of the map, or a latitude and a longitude in degrees, on the plane.

    Raises InputError, which calls the point by its name, where it is off the map.
    """
    return _from_latlon(surface, point, name) if latlon else _from_map(surface, point, name)


def _shown(name: str, point: Point) -> str:
    return f"{name}=({point[0]:.10g}, {point[1]:.10g})"


def _from_latlon(surface: Surface, point: Point, name: str) -> Point:
    reference = surface.georeference
    if reference is None:
        raise InputError(
            f"--latlon: the map has no CRS, so {_shown(name, point)} has no place on it; give "
            "--crs, or coordinates of the map without --latlon"
        )
    latitude, longitude = point
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0):
        raise InputError(
            f"{_shown(name, point)} is not a latitude and a longitude in degrees; the order is "
            "lat,lon: latitude (-90 to 90) first"
        )
    x, y = reference.from_lonlat(np.array([longitude, latitude]))
    return _inside(surface, (float(x), float(y)), point, name, "the order is lat,lon")


def _from_map(surface: Surface, point: Point, name: str) -> Point:
    reference = surface.georeference
    if reference is None or reference.is_map_crs:
        return point
    x, y = reference.from_map(np.array(point))
    remedy = "check the axis order: X is the longitude"
    return _inside(surface, (float(x), float(y)), point, name, remedy)


def _inside(surface: Surface, place: Point, point: Point, name: str, remedy: str) -> Point:
    inside = surface.bounds is None or surface.bounds.contains(np.array(place))
    if not (all(map(math.isfinite, place)) and inside):
        raise InputError(
            f"{_shown(name, point)} is outside the map, {describe_extent(surface)}; {remedy}"
        )
    return place


def region(surface: Surface, rectangle: Rectangle) -> Bounds:
    """A rectangle of the map's own coordinates on the plane; what is off the map is cut off."""
    from ..surface.bounds import Bounds, as_bounds

    given, whole, reference = as_bounds(rectangle), surface.bounds, surface.georeference
    around = given
    if reference is not None and not reference.is_map_crs:
        around = reference.rectangle_from_map(given)
    if whole is None:
        return around
    low = [max(a, b) for a, b in zip(around[:2], whole[:2], strict=True)]
    high = [min(a, b) for a, b in zip(around[2:], whole[2:], strict=True)]
    if not (low[0] < high[0] and low[1] < high[1]):
        raise InputError(
            f"bounds={tuple(given)} are off the map, {describe_extent(surface)}; "
            "check the axis order and the CRS"
        )
    return Bounds(*low, *high)


def describe_extent(surface: Surface) -> str:
    """The surface's extent in the map's own coordinates."""
    reference, bounds = surface.georeference, surface.bounds
    if reference is None or reference.is_map_crs or bounds is None:
        return str(bounds)
    (west, south), (east, north) = reference.to_map(np.array([bounds[:2], bounds[2:]]))
    if not reference.map_crs.is_geographic:
        return f"x from {west:.10g} to {east:.10g}, y from {south:.10g} to {north:.10g}"
    return f"longitude {west:.5f} to {east:.5f}, latitude {south:.5f} to {north:.5f}"
