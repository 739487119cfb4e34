"""GeoPackage, in the CRS that was planned in."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...problem import Solution
from .profile import clean, distinct, profile_columns
from .record import dump, summary

# GDAL stamps a file with the day it is written; the same route should give the same bytes.
EPOCH = "1970-01-01T00:00:00.000Z"
# No index of places: routes are small, and an index is one more thing that a full disk cuts off.
PLAIN = {"SPATIAL_INDEX": "NO"}
# Names of columns that are GDAL's own.
RESERVED = ("fid", "geom")


@contextmanager
def _quietly_without_dates() -> Iterator[None]:
    """No stamp of today, and no warning of a plane that has no CRS: it is so."""
    import pyogrio

    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": EPOCH})
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "'crs' was not provided", UserWarning)
            yield
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def _attributes(solution: Solution) -> dict[str, Any]:
    """One row; what has parts becomes JSON text."""
    import pandas as pd

    columns: dict[str, Any] = {}
    for key, value in summary(solution).items():
        if key in {"seed", "samples"}:
            columns[key] = pd.array([value], dtype="Int64")
        elif isinstance(value, dict | list):
            columns[key] = [dump(value).strip()]
        elif isinstance(value, str):
            columns[key] = [clean(value)]
        else:
            columns[key] = [np.nan if value is None else value]
    return columns


def _layers(solution: Solution) -> dict[str, Any]:
    """GeoDataFrames by the names of their layers."""
    import geopandas as gpd
    import shapely

    assert solution.path is not None
    problem, path = solution.problem, solution.path
    reference = problem.surface.georeference
    crs = None if reference is None else reference.crs
    columns = profile_columns(solution)
    names = distinct([column.heading for column in columns], RESERVED)
    data = {name: column.values for name, column in zip(names, columns, strict=True)}
    stops = shapely.points(solution.stops)
    roles = ["start", *["via"] * len(solution.via), "goal"]
    return {
        "route": gpd.GeoDataFrame(_attributes(solution), geometry=[path.line], crs=crs),
        "points": gpd.GeoDataFrame(data, geometry=shapely.points(path.profile.points), crs=crs),
        "waypoints": gpd.GeoDataFrame({"role": roles}, geometry=stops, crs=crs),
    }


def write(solution: Solution, file: Path) -> None:
    """Layers ``route``, ``points`` (the profile) and ``waypoints`` (start, via, goal).

    Written elsewhere first: SQLite keeps journals beside its files.
    """
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

    with tempfile.TemporaryDirectory(prefix="terrapath-") as folder, _quietly_without_dates():
        draft = Path(folder) / "route.gpkg"
        try:
            layers = _layers(solution)
            for name, frame in layers.items():
                frame.to_file(draft, layer=name, driver="GPKG", engine="pyogrio", **PLAIN)
        except (DataLayerError, DataSourceError, FeatureError) as error:
            raise OSError(str(error).split("\n")[0]) from error
        _require_whole(draft, {name: len(frame) for name, frame in layers.items()})
        file.write_bytes(draft.read_bytes())


def _require_whole(draft: Path, counts: Mapping[str, int]) -> None:
    """Raise OSError where the last of a file is missing: GDAL does not tell what fails at closing.

    Then SQLite finds a fault, or what is written last is missing: extents and counts, and the
    triggers that keep counts, of which each layer has as many as any other.
    """
    import sqlite3

    found = "SELECT table_name, feature_count FROM gpkg_contents NATURAL JOIN gpkg_ogr_contents"
    triggers = "SELECT count(*) FROM sqlite_master WHERE type = 'trigger' AND tbl_name = ?"
    try:
        with closing(sqlite3.connect(draft)) as database:
            (verdict,) = database.execute("PRAGMA integrity_check").fetchone()
            whole = dict(database.execute(f"{found} WHERE min_x IS NOT NULL")) == counts
            whole &= len({database.execute(triggers, [name]).fetchone() for name in counts}) == 1
    except sqlite3.Error as error:
        raise OSError(str(error)) from error
    if verdict != "ok" or not whole:
        raise OSError("its last part could not be stored; is the disk full?")
