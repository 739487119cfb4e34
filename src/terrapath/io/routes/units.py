"""Units of length of a plane and of its heights."""

from __future__ import annotations

from ...surface import Surface
from ...surface.georeference import Georeference, metres_of


def plane_metres(reference: Georeference | None) -> float | None:
    """Metres in one unit of the plane, from the CRS, because there are two kinds of feet."""
    if reference is None or not reference.crs.axis_info:
        return None
    return float(reference.crs.axis_info[0].unit_conversion_factor)


def height_metres(surface: Surface) -> float | None:
    """Metres in one unit of height; None where the unit is not known."""
    return metres_of(surface.layers[0].unit)


def height_scale(surface: Surface) -> float:
    """Units of the plane in one unit of height; 1 where either unit is not known."""
    height, plane = height_metres(surface), plane_metres(surface.georeference)
    return 1.0 if height is None or plane is None else height / plane
