"""GPX: a track with elevations, for GPS receivers and outdoor maps. Earth only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...errors import MapError
from ...problem import Solution
from ...surface import Surface
from ...surface.georeference import Georeference
from ...validation import Array
from .places import DECIMALS, in_degrees
from .profile import clean
from .units import height_metres


def require_earth(path: Path, georeference: Georeference | None) -> None:
    """Raise MapError where the plane has no WGS 84 coordinates: GPX allows no others."""
    if georeference is not None and georeference.is_earth:
        return
    where = "the map has no CRS" if georeference is None else f"{georeference.name} is not on Earth"
    raise MapError(
        f"output={str(path)!r} cannot be written: GPX holds places on Earth, and {where}; "
        "write .geojson, .gpkg or .csv instead"
    )


def _places(surface: Surface, points: Array) -> list[dict[str, Any]]:
    """Degrees, and elevations in metres as GPX requires; none where the heights have no unit."""
    reference, metres = surface.georeference, height_metres(surface)
    assert reference is not None
    degrees = np.round(in_degrees(reference, points), DECIMALS).tolist()
    heights = surface.values(points)[:, 0].tolist()
    return [
        {
            "longitude": longitude,
            "latitude": latitude,
            "elevation": None if metres is None else round(metres * height, 4),
        }
        for (longitude, latitude), height in zip(degrees, heights, strict=True)
    ]


def _description(solution: Solution) -> str:
    surface = solution.problem.surface
    text = f"length {solution.length:.6g} {surface.unit}".rstrip()
    if solution.lower_bound is not None and solution.gap is not None:
        text += (
            f", {solution.bound_in_words} than {solution.lower_bound:.6g}, gap {solution.gap:.3%}"
        )
    if height_metres(surface) is None:
        text += "; without elevations: the unit of the heights is not known"
    return f"{text}; {solution.planner}, seed {solution.seed}"


def write(solution: Solution, file: Path) -> None:
    """Write the profile as one track; start, via points and goal as waypoints."""
    from gpxpy import gpx

    assert solution.path is not None
    problem, surface = solution.problem, solution.problem.surface
    document = gpx.GPX()
    document.creator = f"terrapath {__version__}"
    names = ["start", *(f"via {k}" for k in range(1, len(solution.via) + 1)), "goal"]
    stops = _places(surface, solution.stops)
    document.waypoints = [
        gpx.GPXWaypoint(name=name, **place) for name, place in zip(names, stops, strict=True)
    ]
    track = gpx.GPXTrack(name=clean(problem.name) or "route", description=_description(solution))
    points = _places(surface, solution.path.profile.points)
    track.segments.append(gpx.GPXTrackSegment([gpx.GPXTrackPoint(**place) for place in points]))
    document.tracks.append(track)
    file.write_text(document.to_xml(), encoding="utf-8")
