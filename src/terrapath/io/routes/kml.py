"""KML: a line and its stops, for Google Earth and maps on the web. Earth only."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ...surface.ground import height_metres
from ...validation import Array
from .features import Features, write_features
from .places import DECIMALS, in_degrees, parts_in_degrees
from .profile import clean, heights
from .record import GROUND_NUMBERS, summary
from .route import Route

# The numbers of the route that its feature has, besides those on the ground.
NUMBERS = ("value", "unit", *GROUND_NUMBERS, "lower_bound", "gap")


def _lifted(route: Route, lonlat: Array, points: Array) -> Array:
    """(m, 3): longitude, latitude and height in metres; (m, 2) where the unit is not known.

    Earth draws the line on its own ground; the heights are for programs.
    """
    if height_metres(route.path.surface) is None:
        return lonlat
    return np.column_stack([lonlat, np.round(heights(route.path, points), 4)])


def _geometries(route: Route) -> list[Any]:
    """The line, cut at the antimeridian, and the stops."""
    reference, stops = route.path.surface.georeference, route.solution.stops
    assert reference is not None
    parts = parts_in_degrees(reference, route.points)
    lines = [shapely.LineString(_lifted(route, part.lonlat, part.points)) for part in parts]
    places = np.round(in_degrees(reference, stops), DECIMALS)
    points = shapely.points(_lifted(route, places, stops))
    return [lines[0] if len(lines) == 1 else shapely.MultiLineString(lines), *points]


def write(route: Route, file: Path) -> None:
    """Write the route with its numbers, and start, via points and goal."""
    numbers = summary(route)
    names = [clean(route.solution.problem.name) or "route", *route.stop_names]
    texts = [route.description, *[""] * len(route.stop_names)]
    columns = {"Name": np.array(names, object), "Description": np.array(texts, object)}
    only_route = np.arange(len(names)) > 0
    for key in NUMBERS:
        value = numbers[key]
        if value is not None:
            column = np.array([value] * len(names), object if isinstance(value, str) else float)
            columns[key] = np.ma.array(column, mask=only_route)
    features = Features("Unknown", np.array(_geometries(route), object), columns)
    # In memory first: GDAL does not report every failure to write.
    memory = BytesIO()
    write_features(memory, features, layer="route", driver="KML", crs="EPSG:4326")
    file.write_bytes(memory.getvalue())
