"""Units of length by their names."""

from __future__ import annotations

from functools import cache

from ...surface import Surface

_SPELLINGS = {"meter": "metre", "kilometer": "kilometre", "feet": "foot", "us-ft": "US survey foot"}


@cache
def _lengths() -> dict[str, float]:
    """Metres of each unit that PROJ knows, by its name and its short name."""
    from pyproj.database import get_units_map

    units = get_units_map(category="linear")
    short = {unit.proj_short_name: unit.conv_factor for unit in units.values()}
    named = {name: unit.conv_factor for name, unit in units.items()}
    return named | {name: metres for name, metres in short.items() if name}


def metres_per(unit: str) -> float | None:
    """Metres in one of a unit of length; None where it is not known."""
    for name in (unit, unit.lower(), unit.lower().removesuffix("s")):
        found = _lengths().get(_SPELLINGS.get(name, name))
        if name and found is not None:
            return float(found)
    return None


def height_scale(surface: Surface) -> float:
    """What a unit of height is in units of the plane; 1 where either is not known."""
    height, plane = metres_per(surface.layers[0].unit), metres_per(surface.unit)
    return 1.0 if height is None or plane is None else height / plane
