"""Check the files that the README's main command writes: check_route.py GEOJSON PNG."""

import json
import sys
from pathlib import Path


def check(geojson: Path, picture: Path) -> None:
    (feature,) = json.loads(geojson.read_text())["features"]
    coordinates = feature["geometry"]["coordinates"]
    properties = feature["properties"]
    assert properties["status"] == "solved"
    assert len(coordinates) >= 2
    # The map's corner of Tennessee, in longitude and latitude.
    assert all(-84.42 < x < -84.07 and 36.44 < y < 36.74 for x, y in coordinates)
    assert 29_000.0 < properties["length"] <= properties["straight_length"]
    bound = properties.get("lower_bound")
    if bound is not None:
        assert 0.9 * properties["length"] < bound <= properties["length"]
        gap = properties["length"] / bound - 1.0
        assert abs(properties["gap"] - gap) <= 1e-12
    own = properties.get("unrefined_length")
    assert own is None or own >= properties["length"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size > 100_000


if __name__ == "__main__":
    check(Path(sys.argv[1]), Path(sys.argv[2]))
    print("route and picture are as they should be")
