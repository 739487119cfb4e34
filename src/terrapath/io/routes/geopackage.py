"""GeoPackage, in the CRS that was planned in."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...problem import Solution
from .profile import clean, distinct, profile_columns
from .record import dump, summary, via_points

# GDAL stamps a file with the day it is written; the same route should give the same bytes.
EPOCH = "1970-01-01T00:00:00.000Z"
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
    via = via_points(solution)
    ends = shapely.points(np.concatenate([[problem.start], via, [problem.goal]]))
    roles = ["start", *["via"] * len(via), "goal"]
    return {
        "route": gpd.GeoDataFrame(_attributes(solution), geometry=[path.line], crs=crs),
        "points": gpd.GeoDataFrame(data, geometry=shapely.points(path.profile.points), crs=crs),
        "waypoints": gpd.GeoDataFrame({"role": roles}, geometry=ends, crs=crs),
    }


def write(solution: Solution, file: Path) -> None:
    """Layers ``route``, ``points`` (the profile) and ``waypoints`` (start, via, goal).

    Written elsewhere first: SQLite keeps journals beside its files.
    """
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

    with tempfile.TemporaryDirectory(prefix="terrapath-") as folder, _quietly_without_dates():
        draft = Path(folder) / "route.gpkg"
        try:
            for name, frame in _layers(solution).items():
                frame.to_file(draft, layer=name, driver="GPKG", engine="pyogrio")
        except (DataLayerError, DataSourceError, FeatureError) as error:
            raise OSError(str(error).split("\n")[0]) from error
        file.write_bytes(draft.read_bytes())
