"""GeoJSON, as RFC 7946 requires: WGS 84, longitude first, cut at the antimeridian."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...problem import Path as PlannedPath
from ...surface import Surface
from ...surface.ground import height_layer
from ...validation import Array
from .places import DECIMALS, Part, in_degrees, parts_in_degrees
from .profile import heights
from .record import dump, summary
from .route import Route


def _frame(surface: Surface) -> str:
    """The coordinate system, in words."""
    reference = surface.georeference
    if reference is None:
        return "plane, without CRS"
    body = "WGS 84" if reference.is_earth else f"degrees on {reference.crs.ellipsoid}"
    return f"longitude and latitude, {body}"


def _line(parts: list[Part], path: PlannedPath) -> tuple[dict[str, Any], list[Any]]:
    """The geometry, and heights in the same order and nesting.

    Heights are not third coordinates. Those would be metres above the ellipsoid, but the heights
    of a map are above sea level, or above what the map defines.
    """
    lines = [part.lonlat.tolist() for part in parts]
    found = [heights(path, part.points).tolist() for part in parts]
    if len(parts) == 1:
        return {"type": "LineString", "coordinates": lines[0]}, found[0]
    return {"type": "MultiLineString", "coordinates": lines}, found


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


def write(route: Route, file: Path) -> None:
    """A collection: the route, and its via points where there are any."""
    path, points, via = route.path, route.points, route.solution.via
    reference = path.surface.georeference
    if reference is None:
        parts, via_places = [Part(points, points)], via
    else:
        parts = parts_in_degrees(reference, points)
        via_places = np.round(in_degrees(reference, via), DECIMALS)
    geometry, along = _line(parts, path)
    has_height = height_layer(path.surface) is not None
    properties = {
        **summary(route),
        "coordinates": _frame(path.surface),
        "heights": along if has_height else None,
        "height_unit": path.ground_unit if has_height else None,
    }
    line = {"type": "Feature", "geometry": geometry, "properties": properties}
    collection = {"type": "FeatureCollection", "features": [line, *_vias(via, via_places)]}
    file.write_text(dump(collection), encoding="utf-8")
