"""Routes out: one format, one file, and the registry of their writers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..._support.files import BAG_ENDING, folder_written_whole, written_whole
from ...errors import MapError
from ...problem import Solution
from ...surface.georeference import Georeference
from . import geojson, geopackage, gpx, ros, table
from .record import provenance, route_record, write_json

__all__ = [
    "WRITERS",
    "provenance",
    "require_fitting_format",
    "require_known_format",
    "route_record",
    "write_route",
]

# Each takes a solution that has a path, and a file that exists already, empty.
WRITERS: dict[str, Callable[[Solution, Path], None]] = {
    ".geojson": geojson.write,
    ".gpkg": geopackage.write,
    ".gpx": gpx.write,
    ".csv": table.write,
    ".json": write_json,
    BAG_ENDING: ros.write,
}


def require_known_format(path: Path) -> None:
    """Raise MapError for an ending that no writer has, or whose library is not installed."""
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise MapError(f"output={str(path)!r} has no known format; end it in {', '.join(WRITERS)}")
    if ending == BAG_ENDING:
        ros.require_library(path)


def require_fitting_format(path: Path, georeference: Georeference | None) -> None:
    """Raise MapError where a route on this plane has no place in the format (GPX off Earth)."""
    require_known_format(path)
    if path.suffix.lower() == ".gpx":
        gpx.require_earth(path, georeference)


def write_route(solution: Solution, path: str | Path) -> None:
    """Write a solved route, whole or not at all; the ending names the format.

    .geojson, .gpkg, .gpx (Earth only), .csv (the profile), .json (all that is known), and
    .bag2, the folder of a ROS 2 bag. Raises MapError, naming the file and the remedy.
    """
    target = Path(path)
    require_fitting_format(target, solution.problem.surface.georeference)
    if solution.path is None:
        raise MapError(f"output={str(target)!r} was not written: there is no path to write")
    ending = target.suffix.lower()
    whole = folder_written_whole if ending == BAG_ENDING else written_whole
    with whole(target) as temporary:
        WRITERS[ending](solution, temporary)
