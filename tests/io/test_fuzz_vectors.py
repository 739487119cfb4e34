"""Vector files that were altered anywhere: an answer or one clear line, and soon."""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import geopandas
import numpy as np
import pytest
import shapely

import terrapath as tp
from terrapath.surface.georeference import Georeference

PLACE = Georeference.from_projected("EPSG:32633")
AXES = 490_000.0 + np.linspace(0, 20_000, 9), 5_500_000.0 + np.linspace(0, 20_000, 9)
SURFACE = tp.Surface.from_grid(np.zeros((9, 9)), *AXES, georeference=PLACE)
SHAPES = [
    shapely.box(495_000, 5_505_000, 496_000, 5_506_000),
    shapely.LineString([(491_000, 5_501_000), (498_000, 5_519_000)]),
    shapely.Polygon([(5e5, 5.51e6), (5.01e5, 5.51e6), (5.005e5, 5.512e6)]),
]
MUTATIONS = {"geojson": 900, "shp": 500, "gpkg": 400, "kml": 300, "gml": 300}
LONGEST = 10.0  # seconds for one file, on a machine that has other things to do


def make(folder, ending):
    """A valid file; of a shapefile, the part that holds the geometries."""
    path = folder / f"valid.{ending}"
    shapes = SHAPES[::2] if ending == "shp" else SHAPES
    crs = "EPSG:4326" if ending in {"geojson", "kml"} else "EPSG:3857"
    data = geopandas.GeoDataFrame({"a": range(len(shapes))}, geometry=shapes, crs="EPSG:32633")
    data.to_crs(crs).to_file(path, driver={"kml": "KML", "gml": "GML"}.get(ending))
    return path


def mutated(content, random):
    """Bytes flipped, overwritten, cut out, repeated, moved, or the end cut off."""
    data = bytearray(content)
    for _ in range(int(random.integers(1, 4))):
        at, size = int(random.integers(len(data))), int(random.integers(1, 40))
        match int(random.integers(7)):
            case 0:
                data[at] ^= 1 << int(random.integers(8))
            case 1:
                data[at : at + size] = random.bytes(size)
            case 2:
                del data[at : at + size]
            case 3:
                data[at:at] = data[at : at + size]
            case 4:
                data[at : at + size] = bytes(len(data[at : at + size]))
            case 5:
                data[at:] = data[at : at + (len(data) - at) // 2]
            case 6:
                digits = [k for k, byte in enumerate(data) if 48 <= byte <= 57]
                place = digits[int(random.integers(len(digits)))] if digits else at
                data[place : place + 1] = random.choice([b"-", b"9e300", b"nan", b"[", b'"', b""])
        if not data:
            return b""
    return bytes(data)


@pytest.mark.parametrize("ending", list(MUTATIONS))
def test_altered_files_give_geometries_or_one_line(tmp_path, ending):
    valid = make(tmp_path, ending)
    assert len(tp.read_obstacles(valid, SURFACE)) == (2 if ending == "shp" else 3)
    content, refused, read = valid.read_bytes(), 0, 0
    for seed in range(MUTATIONS[ending]):
        random = np.random.default_rng([seed, len(ending)])
        valid.write_bytes(mutated(content, random))
        began = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", tp.VectorWarning)
                found = tp.read_obstacles(valid, SURFACE)
        except tp.TerrapathError as error:
            assert "\n" not in str(error), seed  # noqa: PT017 -- both outcomes are fine
            assert str(valid) in str(error), seed  # noqa: PT017
            refused += 1
        else:
            assert all(shape.is_valid and not shape.is_empty for shape in found), seed
            assert all(np.isfinite(shapely.get_coordinates(shape)).all() for shape in found), seed
            read += 1
        assert time.process_time() - began < LONGEST, seed
    assert refused > 0.03 * MUTATIONS[ending]
    assert read > 0.03 * MUTATIONS[ending]
    left = {path.suffix for path in Path(tmp_path).iterdir()}
    assert left <= {
        f".{ending}",
        ".shx",
        ".dbf",
        ".prj",
        ".cpg",
        *([".xsd"] if ending == "gml" else []),
    }
