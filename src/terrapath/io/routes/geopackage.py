"""GeoPackage, in the CRS that was planned in."""

from __future__ import annotations

import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ...errors import silence
from ...problem import Solution
from ...surface.georeference import Georeference
from .profile import clean, distinct, profile_columns
from .record import dump, summary

# GDAL stamps a file with the day it is written; the same route should give the same bytes.
EPOCH = "1970-01-01T00:00:00.000Z"
# No index of places: routes are small, and an index is one more thing that a full disk cuts off.
PLAIN = {"SPATIAL_INDEX": "NO"}
# Names of columns that are GDAL's own.
RESERVED = ("fid", "geom")

Values = npt.NDArray[Any]


class Layer(NamedTuple):
    """Geometries of one kind, and columns of values, one for each geometry."""

    kind: str
    geometries: Values
    columns: dict[str, Values]


def _attributes(solution: Solution) -> dict[str, Values]:
    """One row; what has parts becomes JSON text."""
    columns = {}
    for key, value in summary(solution).items():
        if isinstance(value, dict | list):
            columns[key] = np.array([dump(value).strip()], object)
        elif isinstance(value, str):
            columns[key] = np.array([clean(value)], object)
        elif key in {"seed", "samples"}:
            columns[key] = np.ma.array([value or 0], np.int64, mask=[value is None])
        else:
            columns[key] = np.array([np.nan if value is None else value])
    return columns


def _layers(solution: Solution) -> dict[str, Layer]:
    """By their names."""
    import shapely

    path = solution.path
    assert path is not None
    columns = profile_columns(solution)
    names = distinct([column.heading for column in columns], RESERVED)
    data = {name: column.values for name, column in zip(names, columns, strict=True)}
    roles = np.array(["start", *["via"] * len(solution.via), "goal"], object)
    places = shapely.points(path.profile.points)
    return {
        "route": Layer("LineString", np.array([path.line]), _attributes(solution)),
        "points": Layer("Point", places, data),
        "waypoints": Layer("Point", shapely.points(solution.stops), {"role": roles}),
    }


def _crs(reference: Georeference | None) -> str | None:
    """As GDAL writes it: by its code where it has one."""
    if reference is None:
        return None
    code = reference.crs.to_epsg()
    return f"EPSG:{code}" if code else reference.crs.to_wkt("WKT1_GDAL")


def _write_layer(file: Path, name: str, layer: Layer, crs: str | None) -> None:
    import pyogrio.raw
    import shapely

    columns = layer.columns.values()
    silence(UserWarning, __name__)  # of a plane that has no CRS: it is so
    pyogrio.raw.write(
        file,
        shapely.to_wkb(layer.geometries),
        [np.ma.getdata(values) for values in columns],
        list(layer.columns),
        [np.ma.getmaskarray(v) if np.ma.isMaskedArray(v) else None for v in columns],
        layer=name,
        driver="GPKG",
        geometry_type=layer.kind,
        crs=crs,
        layer_options=PLAIN,
    )


def write(solution: Solution, file: Path) -> None:
    """Layers ``route``, ``points`` (the profile) and ``waypoints`` (start, via, goal).

    Written elsewhere first: SQLite keeps journals beside its files.
    """
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

    layers, crs = _layers(solution), _crs(solution.problem.surface.georeference)
    with tempfile.TemporaryDirectory(prefix="terrapath-") as folder:
        draft, whole = Path(folder) / "route.gpkg", Path(folder) / "whole.gpkg"
        try:
            for name, layer in layers.items():
                _write_layer(draft, name, layer, crs)
        except (DataLayerError, DataSourceError, FeatureError) as error:
            raise OSError(str(error).split("\n")[0]) from error
        try:
            with closing(sqlite3.connect(draft)) as database:
                _require_whole(database, {n: len(layer.geometries) for n, layer in layers.items()})
                _copy_without_dates(database, whole)
        except sqlite3.Error as error:
            raise OSError(str(error)) from error
        file.write_bytes(whole.read_bytes())


def _copy_without_dates(database: sqlite3.Connection, file: Path) -> None:
    """A copy with the same bytes each time: GDAL's option for the date is the whole process's.

    The file itself counts its changes, and those of the date are some more or fewer.
    """
    with database:
        database.execute("UPDATE gpkg_contents SET last_change = ?", [EPOCH])
    database.execute("VACUUM INTO ?", [str(file)])


def _require_whole(database: sqlite3.Connection, counts: dict[str, int]) -> None:
    """Raise OSError where the last of a file is missing: GDAL does not tell what fails at closing.

    Then SQLite finds a fault, or what is written last is missing: extents and counts, and the
    triggers that keep counts, of which each layer has as many as any other.
    """
    found = "SELECT table_name, feature_count FROM gpkg_contents NATURAL JOIN gpkg_ogr_contents"
    triggers = "SELECT count(*) FROM sqlite_master WHERE type = 'trigger' AND tbl_name = ?"
    (verdict,) = database.execute("PRAGMA integrity_check").fetchone()
    whole = dict(database.execute(f"{found} WHERE min_x IS NOT NULL")) == counts
    whole &= len({database.execute(triggers, [name]).fetchone() for name in counts}) == 1
    if verdict != "ok" or not whole:
        raise OSError("its last part could not be stored; is the disk full?")
