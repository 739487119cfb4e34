"""GeoPackage, in the CRS of the planning plane."""

from __future__ import annotations

import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from .features import Features, Values, crs_text, write_features
from .profile import clean, distinct, profile_columns
from .record import dump, summary
from .route import Route

# GDAL writes the current date into a file, but the same route should give the same bytes.
EPOCH = "1970-01-01T00:00:00.000Z"
# No spatial index: routes are small, and an index is one more part that a full disk can cut off.
PLAIN = {"SPATIAL_INDEX": "NO"}
# Column names that GDAL uses itself.
RESERVED = ("fid", "geom")


def _attributes(route: Route) -> dict[str, Values]:
    """One row of attributes; a list or a dict becomes JSON text."""
    columns = {}
    for key, value in summary(route).items():
        if isinstance(value, dict | list):
            columns[key] = np.array([dump(value).strip()], object)
        elif isinstance(value, str):
            columns[key] = np.array([clean(value)], object)
        elif key in {"seed", "samples", "points", "points_planned"}:
            columns[key] = np.ma.array([value or 0], np.int64, mask=[value is None])
        else:
            columns[key] = np.array([np.nan if value is None else value])
    return columns


def _layers(route: Route) -> dict[str, Features]:
    """The layers of the file, by their names."""
    import shapely

    solution, columns = route.solution, profile_columns(route)
    names = distinct([column.heading for column in columns], RESERVED)
    data = {name: column.values for name, column in zip(names, columns, strict=True)}
    roles = np.array(["start", *["via"] * len(solution.via), "goal"], object)
    line = np.array([shapely.LineString(route.points)])
    return {
        "route": Features("LineString", line, _attributes(route)),
        "points": Features("Point", shapely.points(route.points), data),
        "waypoints": Features("Point", shapely.points(solution.stops), {"role": roles}),
    }


def write(route: Route, file: Path) -> None:
    """Write the layers ``route``, ``points`` (the profile) and ``waypoints`` (start, via, goal).

    The file is first made in a temporary folder, because SQLite keeps journals beside its files.
    """
    layers, crs = _layers(route), crs_text(route.path.surface.georeference)
    with tempfile.TemporaryDirectory(prefix="terrapath-") as folder:
        draft, whole = Path(folder) / "route.gpkg", Path(folder) / "whole.gpkg"
        for name, layer in layers.items():
            write_features(draft, layer, layer=name, driver="GPKG", crs=crs, **PLAIN)
        try:
            with closing(sqlite3.connect(draft)) as database:
                _require_whole(database, {n: len(layer.geometries) for n, layer in layers.items()})
                _copy_without_dates(database, whole)
        except sqlite3.Error as error:
            raise OSError(str(error)) from error
        file.write_bytes(whole.read_bytes())


def _copy_without_dates(database: sqlite3.Connection, file: Path) -> None:
    """Write a copy without the current date, so that its bytes are the same each time.

    GDAL has an option for the date, but it applies to the whole process. A fresh copy is needed
    because an SQLite file counts its changes, and the number of updates of the date varies.
    """
    with database:
        database.execute("UPDATE gpkg_contents SET last_change = ?", [EPOCH])
    database.execute("VACUUM INTO ?", [str(file)])


def _require_whole(database: sqlite3.Connection, counts: dict[str, int]) -> None:
    """Raise OSError where the end of a file is missing: GDAL reports no errors when it closes one.

    Then SQLite finds a fault, or the parts that are written last are missing: extents, counts,
    and the triggers that keep the counts. All layers have the same number of triggers.
    """
    counted = "SELECT table_name, feature_count FROM gpkg_contents NATURAL JOIN gpkg_ogr_contents"
    triggers = "SELECT count(*) FROM sqlite_master WHERE type = 'trigger' AND tbl_name = ?"
    (verdict,) = database.execute("PRAGMA integrity_check").fetchone()
    whole = dict(database.execute(f"{counted} WHERE min_x IS NOT NULL")) == counts
    whole &= len({database.execute(triggers, [name]).fetchone() for name in counts}) == 1
    if verdict != "ok" or not whole:
        raise OSError("its last part could not be stored; is the disk full?")
