"""GeoJSON, as RFC 7946 requires: WGS 84, longitude first, cut at the antimeridian."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...problem import Solution
from ...surface import Surface
from ...validation import Array
from .places import DECIMALS, Part, in_degrees, parts_in_degrees
from .record import dump, summary


def _frame(surface: Surface) -> str:
    """The coordinate system, in words."""
    reference = surface.georeference
    if reference is None:
        return "plane, without CRS"
    body = "WGS 84" if reference.is_earth else f"degrees on {reference.crs.ellipsoid}"
    return f"longitude and latitude, {body}"


def _line(parts: list[Part], surface: Surface) -> tuple[dict[str, Any], list[Any]]:
    """The geometry, and heights in the same order and nesting.

    Heights are not third coordinates. Those would be metres above the ellipsoid, but the heights
    of a map are above sea level, or above what the map defines.
    """
    lines = [part.lonlat.tolist() for part in parts]
    heights = [surface.values(part.points)[:, 0].tolist() for part in parts]
    if len(parts) == 1:
        return {"type": "LineString", "coordinates": lines[0]}, heights[0]
    return {"type": "MultiLineString", "coordinates": lines}, heights


def _vias(points: Array, places: Array) -> list[dict[str, Any]]:
    """A feature for each via point."""
    return [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": place.tolist()},
            "properties": {"role": "via", "number": k, "x": float(x), "y": float(y)},
        }
        for k, ((x, y), place) in enumerate(zip(points, places, strict=True), start=1)
    ]


def write(solution: Solution, file: Path) -> None:
    """A collection: the route, and its via points where there are any."""
    assert solution.path is not None
    surface, points, via = solution.problem.surface, solution.path.points, solution.via
    reference, height = surface.georeference, surface.layers[0]
    if reference is None:
        parts, via_places = [Part(points, points)], via
    else:
        parts = parts_in_degrees(reference, points)
        via_places = np.round(in_degrees(reference, via), DECIMALS)
    geometry, heights = _line(parts, surface)
    properties = {
        **summary(solution),
        "coordinates": _frame(surface),
        "heights": heights,
        "height_unit": height.unit,
    }
    route = {"type": "Feature", "geometry": geometry, "properties": properties}
    collection = {"type": "FeatureCollection", "features": [route, *_vias(via, via_places)]}
    file.write_text(dump(collection), encoding="utf-8")
