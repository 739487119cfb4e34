"""Units of length of a plane and of its heights."""

from __future__ import annotations

from ...surface import Surface
from ...surface.georeference import Georeference, metres_of


def plane_metres(reference: Georeference | None) -> float | None:
    """Metres in a unit of the plane, by its CRS: there are two kinds of feet."""
    if reference is None or not reference.crs.axis_info:
        return None
    return float(reference.crs.axis_info[0].unit_conversion_factor)


def height_metres(surface: Surface) -> float | None:
    """Metres in a unit of height; None where it is not known."""
    return metres_of(surface.layers[0].unit)


def height_scale(surface: Surface) -> float:
    """What a unit of height is in units of the plane; 1 where either is not known."""
    height, plane = height_metres(surface), plane_metres(surface.georeference)
    return 1.0 if height is None or plane is None else height / plane
