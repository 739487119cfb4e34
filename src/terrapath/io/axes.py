"""The unit of a map's coordinates, where the map names it beside its CRS, as CF does."""

from __future__ import annotations

from collections.abc import Sequence

from pyproj import CRS

from ..errors import MapError
from ..surface.georeference import metres_of

NO_UNITS = ("", "1", "none", "unknown", "pixel", "pixels", "cell", "cells", "index")
SAME_UNIT = 1e-5  # feet of both kinds count as one here, because few files tell them apart


def is_degrees(unit: str) -> bool:
    """Does a unit mean degrees, as ``degrees_east`` does?"""
    return unit.lower().startswith("deg")


def in_unit_of_axes(crs: CRS | None, units: Sequence[str], label: str) -> CRS | None:
    """The CRS with the unit of the map's coordinates, which need not be the CRS's own.

    units : of x and y, "" where they are not said. Raises MapError where a unit is not known, or
    is none that coordinates in this CRS can have.
    """
    said = [unit for unit in units if unit.lower() not in NO_UNITS]
    sizes = {1.0 if is_degrees(unit) else metres_of(unit) for unit in said}
    if not said:
        return crs
    shown = " and ".join(dict.fromkeys(map(repr, said)))
    if None in sizes or len(sizes) > 1 or len({is_degrees(unit) for unit in said}) > 1:
        raise MapError(
            f"{label} gives its coordinates in {shown}; convert both to metres or degrees, and "
            "name them so in their attribute units"
        )
    if crs is None:
        return None
    if is_degrees(said[0]) != crs.is_geographic:
        raise MapError(
            f"{label} gives its coordinates in {shown}, which are none of {crs.name}; check the "
            "CRS, or the attribute units of the coordinates"
        )
    size = sizes.pop()
    assert size is not None
    if crs.is_geographic or abs(size / crs.axis_info[0].unit_conversion_factor - 1.0) < SAME_UNIT:
        return crs
    return _in_unit(crs, said[0], size)


def _in_unit(crs: CRS, unit: str, metres: float) -> CRS:
    """The same projection, with coordinates in another unit."""
    changed = crs.to_json_dict()
    name = "kilometre" if metres == 1000.0 else unit
    for axis in changed["coordinate_system"]["axis"]:
        axis["unit"] = {"type": "LinearUnit", "name": name, "conversion_factor": metres}
    changed.pop("id", None)
    changed["name"] = f"{crs.name} in {unit}"
    return CRS.from_wkt(CRS.from_json_dict(changed).to_wkt())
