"""Shapefile: the route as a line with its numbers, in the CRS of the planning plane."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import shapely

from .features import Features, Values, crs_text, write_features
from .record import summary
from .route import Route

# Names of attributes have ten letters at most.
COLUMNS = {
    "planner": "planner",
    "status": "status",
    "value": "value",
    "unit": "unit",
    "ground_length": "ground_len",
    "ground_unit": "ground_unt",
    "climb": "climb",
    "descent": "descent",
    "steepest": "steepest",
    "steepest_side": "steep_side",
    "lower_bound": "low_bound",
    "gap": "gap",
    "simplified_to": "tolerance",
    "software": "software",
}
# The file holds a date, but the same route should give the same bytes.
EPOCH = "1970-01-01"


def _attributes(route: Route) -> dict[str, Values]:
    facts = summary(route)
    columns: dict[str, Values] = {}
    for key, name in COLUMNS.items():
        value = facts[key]
        is_text = isinstance(value, str)
        columns[name] = np.array([value], object) if is_text else np.array([value], np.float64)
    return columns


def write(route: Route, file: Path) -> None:
    """Write the file and those beside it, which have its name and other endings."""
    features = Features(
        "LineString", np.array([shapely.LineString(route.points)]), _attributes(route)
    )
    write_features(
        file,
        features,
        layer=file.stem,
        driver="ESRI Shapefile",
        crs=crs_text(route.path.surface.georeference),
        ENCODING="UTF-8",
        DBF_DATE_LAST_UPDATE=EPOCH,
    )
    _require_whole(file)


def _require_whole(file: Path) -> None:
    """Raise OSError where the end of a file is missing: GDAL does not report it."""
    whole = True
    for ending in (".shp", ".shx"):
        content = file.with_suffix(ending).read_bytes()
        # Its length in words of two bytes, in the header.
        whole &= len(content) >= 100 and len(content) == 2 * struct.unpack(">i", content[24:28])[0]
    table = file.with_suffix(".dbf").read_bytes()
    rows, head, row = struct.unpack("<IHH", table[4:12]) if len(table) > 32 else (0, 0, 0)
    whole &= rows == 1 and head > 32 and len(table) == head + row + 1  # a mark ends it
    if not whole:
        raise OSError("its last part could not be stored; is the disk full?")
