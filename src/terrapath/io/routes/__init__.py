"""Routes out: one format, one file, and the registry of their writers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ..._support.extras import require_packages
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


class Writer(NamedTuple):
    """How a format is written, and by which packages of the extras."""

    # Takes a solution that has a path, and a file that exists already, empty.
    write: Callable[[Solution, Path], None]
    packages: tuple[str, ...] = ()


WRITERS = {
    ".geojson": Writer(geojson.write),
    ".gpkg": Writer(geopackage.write, ("geopandas", "pyogrio")),
    ".gpx": Writer(gpx.write, ("gpxpy",)),
    ".csv": Writer(table.write),
    ".json": Writer(write_json),
    BAG_ENDING: Writer(ros.write, ("rosbags",)),
}


def require_known_format(path: Path) -> None:
    """Raise MapError for an ending that no writer has, MissingExtraError without its packages."""
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise MapError(f"output={str(path)!r} has no known format; end it in {', '.join(WRITERS)}")
    require_packages(f"output={str(path)!r}", *WRITERS[ending].packages)


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
        WRITERS[ending].write(solution, temporary)
