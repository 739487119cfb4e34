"""Writes routes: one module for each format, and the registry of their writers."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from ..._support.extras import require_packages
from ..._support.files import BAG_ENDING, folder_written_whole, written_whole
from ...errors import MapError
from ...problem import Solution
from ...surface.georeference import Georeference

__all__ = [
    "WRITERS",
    "require_fitting_format",
    "require_known_format",
    "write_route",
]


class Writer(NamedTuple):
    """The module that writes a format, and the optional packages that it needs."""

    # The module's ``write`` takes a solution that has a path, and an empty file that exists.
    module: str
    packages: tuple[str, ...] = ()


WRITERS = {
    ".geojson": Writer("geojson"),
    ".gpkg": Writer("geopackage", ("pyogrio",)),
    ".gpx": Writer("gpx", ("gpxpy",)),
    ".csv": Writer("table"),
    ".json": Writer("record"),
    BAG_ENDING: Writer("ros", ("rosbags",)),
}


def _writer(ending: str) -> ModuleType:
    return import_module(f".{WRITERS[ending].module}", __name__)


def require_known_format(path: Path) -> None:
    """Raise MapError for an unknown file ending, MissingExtraError if its packages are missing."""
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise MapError(f"output={str(path)!r} has no known format; end it in {', '.join(WRITERS)}")
    require_packages(f"output={str(path)!r}", *WRITERS[ending].packages)


def require_fitting_format(path: Path, georeference: Georeference | None) -> None:
    """Raise MapError where the format cannot hold a route on this plane (GPX off Earth)."""
    require_known_format(path)
    if path.suffix.lower() == ".gpx":
        _writer(".gpx").require_earth(path, georeference)


def write_route(solution: Solution, path: str | Path) -> None:
    """Write the route of a solution, completely or not at all; the file ending sets the format.

    .geojson, .gpkg, .gpx (Earth only), .csv (the profile), .json (all that is known), and
    .bag2 (a ROS 2 bag, which is a folder). Raises MapError with the file and the remedy.
    """
    target = Path(path)
    require_fitting_format(target, solution.problem.surface.georeference)
    if solution.path is None:
        raise MapError(f"output={str(target)!r} was not written: there is no path to write")
    ending = target.suffix.lower()
    whole = folder_written_whole if ending == BAG_ENDING else written_whole
    with whole(target) as temporary:
        _writer(ending).write(solution, temporary)
