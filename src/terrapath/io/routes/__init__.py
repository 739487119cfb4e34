"""Writes routes: one module for each format, and the registry of their writers."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from ..._support.extras import require_packages
from ..._support.files import (
    BAG_ENDING,
    SHAPEFILE_ENDING,
    folder_written_whole,
    shapefile_written_whole,
    written_whole,
)
from ...errors import MapError
from ...problem import Solution
from ...surface.georeference import Georeference
from .places import require_earth
from .route import Route

__all__ = [
    "WRITERS",
    "require_fitting_format",
    "require_known_format",
    "write_route",
]


class Writer(NamedTuple):
    """The module that writes a format, and the optional packages that it needs."""

    # The module's ``write`` takes a route and an empty file that exists.
    module: str
    packages: tuple[str, ...] = ()
    dense: bool = False  # points are at most a cell apart


WRITERS = {
    ".geojson": Writer("geojson"),
    ".gpkg": Writer("geopackage", ("pyogrio",)),
    ".gpx": Writer("gpx", ("gpxpy",)),
    ".kml": Writer("kml", ("pyogrio",)),
    ".shp": Writer("shapefile", ("pyogrio",)),
    ".csv": Writer("table"),
    ".json": Writer("record"),
    BAG_ENDING: Writer("ros", ("rosbags",), dense=True),
}


EARTH_ONLY = (".gpx", ".kml")


def _writer(ending: str) -> ModuleType:
    return import_module(f".{WRITERS[ending].module}", __name__)


def require_known_format(path: Path) -> None:
    """Raise MapError for an unknown file ending, MissingExtraError if its packages are missing."""
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise MapError(f"output={str(path)!r} has no known format; end it in {', '.join(WRITERS)}")
    require_packages(f"output={str(path)!r}", *WRITERS[ending].packages)


def require_fitting_format(path: Path, georeference: Georeference | None) -> None:
    """Raise MapError where the format cannot hold a route on this plane (GPX, KML off Earth)."""
    require_known_format(path)
    if path.suffix.lower() in EARTH_ONLY:
        require_earth(path, georeference)


def write_route(solution: Solution, path: str | Path, *, simplify: float | None = None) -> None:
    """Write the route of a solution, completely or not at all; the file ending sets the format.

    .geojson, .gpkg, .gpx and .kml (Earth only), .shp, .csv (the profile), .json (all that is
    known), and .bag2 (a ROS 2 bag, which is a folder).
    simplify : how far the route may be from the lines between the points that are written, map
    units; by default a tenth of a cell, and 0 writes all points. They keep clear of obstacles
    and keep the length. .json has all points that were planned.
    Raises MapError with the file and the remedy.
    """
    target = Path(path)
    require_fitting_format(target, solution.problem.surface.georeference)
    if solution.path is None:
        raise MapError(f"output={str(target)!r} was not written: there is no path to write")
    ending = target.suffix.lower()
    route = Route.of(solution, simplify, dense=WRITERS[ending].dense)
    whole = {BAG_ENDING: folder_written_whole, SHAPEFILE_ENDING: shapefile_written_whole}.get(
        ending, written_whole
    )
    with whole(target) as temporary:
        _writer(ending).write(route, temporary)
