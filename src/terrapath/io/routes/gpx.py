"""GPX: a track with elevations, for GPS receivers and outdoor maps. Earth only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...problem import Path as PlannedPath
from ...surface.ground import height_metres
from ...validation import Array
from .places import DECIMALS, in_degrees
from .profile import clean, heights
from .route import Route


def _places(path: PlannedPath, points: Array) -> list[dict[str, Any]]:
    """Degrees, and elevations in metres as GPX requires; none where the heights have no unit."""
    reference, metres = path.surface.georeference, height_metres(path.surface)
    assert reference is not None
    degrees = np.round(in_degrees(reference, points), DECIMALS).tolist()
    elevations = heights(path, points).tolist()
    return [
        {
            "longitude": longitude,
            "latitude": latitude,
            "elevation": None if metres is None else round(height, 4),
        }
        for (longitude, latitude), height in zip(degrees, elevations, strict=True)
    ]


def write(route: Route, file: Path) -> None:
    """Write the profile as one track; start, via points and goal as waypoints."""
    from gpxpy import gpx

    solution, path = route.solution, route.path
    document = gpx.GPX()
    document.creator = f"terrapath {__version__}"
    stops = _places(path, solution.stops)
    document.waypoints = [
        gpx.GPXWaypoint(name=name, **place)
        for name, place in zip(route.stop_names, stops, strict=True)
    ]
    description = route.description
    if height_metres(path.surface) is None:
        description += "; without elevations: the unit of the heights is not known"
    track = gpx.GPXTrack(name=clean(solution.problem.name) or "route", description=description)
    points = _places(path, route.points)
    track.segments.append(gpx.GPXTrackSegment([gpx.GPXTrackPoint(**place) for place in points]))
    document.tracks.append(track)
    file.write_text(document.to_xml(), encoding="utf-8")
