"""Solutions as records and files."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..errors import MapError
from ..files import written_whole
from ..problem import Solution
from ..validation import Array


def _finite(value: float | None) -> float | None:
    """JSON has no infinity."""
    return None if value is None or not math.isfinite(value) else float(value)


def route_record(solution: Solution) -> dict[str, Any]:
    """All that is known of a solution, ready for JSON.

    ``start``, ``goal`` and ``path`` are on the plane that was planned in, map units; with a
    georeference ``crs`` names that plane, and ``start_lonlat``, ``goal_lonlat`` and
    ``path_lonlat`` are longitude and latitude in degrees. ``unrefined_length`` is of the
    planner's own path where that was refined.
    """
    problem, path = solution.problem, solution.path
    points = None if path is None else path.points
    record: dict[str, Any] = {
        "status": solution.status.value,
        "planner": solution.planner,
        "length": _finite(solution.length),
        "unrefined_length": None if solution.unrefined is None else solution.unrefined.length,
        "cost": _finite(solution.cost),
        "lower_bound": _finite(solution.lower_bound),
        "gap": _finite(solution.gap),
        "seconds": solution.seconds,
        "samples": solution.samples,
        "seed": solution.seed,
        "start": list(problem.start),
        "goal": list(problem.goal),
        "path": None if points is None else points.tolist(),
        "straight_length": problem.straight_length,
        "climb": None if path is None else path.climb,
        "unit": problem.surface.unit,
        "layers": {layer.name: layer.weight for layer in problem.surface.layers},
        "stopped_by": solution.stopped_by,
        "counters": solution.counters,
        "alternatives": [path.length for path in solution.alternatives],
    }
    reference = problem.surface.georeference
    if reference is not None:
        ends = reference.to_lonlat(np.array([problem.start, problem.goal]))
        record["crs"] = reference.crs.to_string()
        record["start_lonlat"], record["goal_lonlat"] = ends.tolist()
        record["path_lonlat"] = None if points is None else reference.to_lonlat(points).tolist()
    return record


_PROPERTIES = (
    "status",
    "planner",
    "length",
    "unrefined_length",
    "cost",
    "lower_bound",
    "gap",
    "climb",
    "straight_length",
    "unit",
    "samples",
    "seed",
    "layers",
)


def _write_geojson(solution: Solution, file: Path) -> None:
    """One feature; WGS 84 longitude and latitude on Earth (RFC 7946), else the plane's own."""
    record = route_record(solution)
    properties = {key: record[key] for key in _PROPERTIES}
    properties["software"] = f"terrapath {__version__}"
    reference = solution.problem.surface.georeference
    coordinates = record["path"]
    if reference is None:
        properties["coordinates"] = "plane, without CRS"
    else:
        coordinates = record["path_lonlat"]
        body = "WGS 84" if reference.is_earth else f"degrees on {reference.crs.ellipsoid}"
        properties["coordinates"] = f"longitude and latitude, {body}"
        properties["planned_in"] = record["crs"]
    feature = {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": coordinates},
        "properties": properties,
    }
    collection = {"type": "FeatureCollection", "features": [feature]}
    file.write_text(json.dumps(collection, indent=1) + "\n", encoding="utf-8")


def _write_csv(solution: Solution, file: Path) -> None:
    """The profile: distance, position and every layer along the path."""
    assert solution.path is not None
    profile = solution.path.profile
    columns: dict[str, Array] = {
        "distance": profile.distance,
        "x1": profile.points[:, 0],
        "x2": profile.points[:, 1],
    }
    reference = solution.problem.surface.georeference
    if reference is not None:
        columns["longitude"], columns["latitude"] = reference.to_lonlat(profile.points).T
    for layer, values in zip(solution.problem.surface.layers, profile.values.T, strict=True):
        columns[f"{layer.name} [{layer.unit}]" if layer.unit else layer.name] = values
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))


def _write_json(solution: Solution, file: Path) -> None:
    file.write_text(json.dumps(route_record(solution)) + "\n", encoding="utf-8")


WRITERS: dict[str, Callable[[Solution, Path], None]] = {
    ".geojson": _write_geojson,
    ".csv": _write_csv,
    ".json": _write_json,
}


def require_known_format(path: Path) -> None:
    """Raise MapError for an ending that no writer has."""
    if path.suffix.lower() not in WRITERS:
        raise MapError(f"output={str(path)!r} has no known format; end it in {', '.join(WRITERS)}")


def write_route(solution: Solution, path: str | Path) -> None:
    """Write a solved route as .geojson, .csv or .json, whole or not at all."""
    target = Path(path)
    require_known_format(target)
    if solution.path is None:
        raise MapError(f"output={str(target)!r} was not written: there is no path to write")
    with written_whole(target) as temporary:
        WRITERS[target.suffix.lower()](solution, temporary)
