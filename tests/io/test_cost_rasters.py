"""Cost rasters as files: their cells, other grids, no-data and the smooth option."""

import json

import numpy as np
import pytest
from rasterio.transform import from_origin

import rasters
import terrapath as tp
from terrapath.cli.main import run


def written(path, values, cell=10.0, crs="EPSG:32632", corner=(500_000.0, 5_200_000.0), **more):
    """A GeoTIFF of rows from south to north, with its lower left corner at ``corner``."""
    transform = from_origin(corner[0], corner[1] + len(values) * cell, cell, cell)
    return str(rasters.write(path, values[::-1], transform, crs, **more))


@pytest.fixture
def dem(tmp_path):
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    return written(tmp_path / "dem.tif", np.sin(0.2 * x) + 0.1 * y)


def places(count, cell, offset=0.0):
    """Points of the map, random inside cells of a size."""
    random = np.random.default_rng(2)
    i, j = random.integers(0, count, (2, 200))
    x, y = ((k + random.uniform(0.01, 0.99, 200)) * cell + offset for k in (i, j))
    inside = (x > 5.0) & (x < 295.0) & (y > 5.0) & (y < 295.0)
    points = np.column_stack([500_000.0 + x, 5_200_000.0 + y])
    return points[inside], i[inside], j[inside]


@pytest.mark.parametrize(("count", "cell"), [(30, 10.0), (150, 2.0), (12, 25.0), (43, 7.0)])
def test_a_cost_is_what_the_raster_says_in_its_own_cells(dem, tmp_path, count, cell):
    costs = 10.0 ** np.random.default_rng(1).uniform(-1.0, 2.0, (count, count))
    surface = tp.read_surface(dem, costs={"mud": written(tmp_path / "mud.tif", costs, cell)})
    points, i, j = places(count, cell)
    np.testing.assert_array_equal(surface.cost(points), costs[j, i])
    np.testing.assert_array_equal(surface.cost_values(points)[:, 0], costs[j, i])


def test_rasters_with_different_cells_take_the_nearest(dem, tmp_path):
    random = np.random.default_rng(1)
    fine, wide = random.uniform(1.0, 9.0, (150, 150)), random.uniform(1.0, 9.0, (12, 12))
    surface = tp.read_surface(
        dem,
        costs={
            "fine": written(tmp_path / "fine.tif", fine, 2.0),
            "wide": written(tmp_path / "wide.tif", wide, 25.0),
        },
    )
    assert surface.cost_cells.values.shape == (2, 30, 30)
    centre = (500_000.0 + 105.0, 5_200_000.0 + 215.0)
    assert surface.cost_values(centre)[1] == wide[8, 4]


def test_costs_can_be_smooth(dem, tmp_path):
    costs = np.ones((30, 30))
    costs[:, 15] = 255.0
    mud = written(tmp_path / "mud.tif", costs)
    cells, smooth = (
        tp.read_surface(dem, costs={"mud": mud}, smooth_costs=s) for s in (False, True)
    )
    at = [(500_155.0, 5_200_105.0), (500_145.0, 5_200_105.0)]
    np.testing.assert_array_equal(cells.cost(at), [255.0, 1.0])
    assert cells.costs[0].kind == "cells"
    assert smooth.costs[0].kind == "cost"
    assert smooth.cost(at)[0] < 100.0


def test_a_cell_without_a_cost_is_blocked_and_others_keep_theirs(dem, tmp_path):
    costs = np.random.default_rng(1).uniform(1.0, 9.0, (30, 30))
    marked = costs.copy()
    marked[10:13, 5] = -1.0
    mud = written(tmp_path / "mud.tif", marked, nodata=-1.0)
    surface = tp.read_surface(dem, costs={"mud": mud})
    assert surface.nodata.blocked.sum() == 3
    points, i, j = places(30, 10.0)
    known = marked[j, i] > 0.0
    np.testing.assert_array_equal(surface.cost(points[known]), costs[j, i][known])


def test_a_map_in_degrees_takes_the_cost_where_the_centres_lie(tmp_path):
    x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    place = {"cell": 1e-3, "crs": "EPSG:4326", "corner": (11.0, 47.0)}
    dem = written(tmp_path / "dem.tif", 20.0 * np.sin(0.2 * x) + y, **place)
    costs = np.where((x + y) % 7 < 2, 50.0, 1.0)
    surface = tp.read_surface(dem, costs={"mud": written(tmp_path / "mud.tif", costs, **place)})
    assert set(np.unique(surface.cost_cells.values)) == {1.0, 50.0}


def test_the_scenario_key_and_the_flag_say_the_same(dem, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    costs = np.ones((30, 30))
    costs[:, 15] = 255.0
    written(tmp_path / "mud.tif", costs)
    (tmp_path / "a.toml").write_text(
        '[map]\npath = "dem.tif"\nsmooth_costs = true\n[map.costs.mud]\nfile = "mud.tif"\n'
        "[route]\nstart = [500050.0, 5200150.0]\ngoal = [500250.0, 5200150.0]\n"
    )

    def value(*given):
        assert run(["plan", *given, "--planner", "dijkstra", "--json"]) == 0
        return json.loads(capsys.readouterr().out)["value"]

    ends = ["--start", "500050,5200150", "--goal", "500250,5200150"]
    flags = ["dem.tif", "--cost", "mud=mud.tif", *ends]
    assert value("a.toml") == value(*flags, "--smooth-costs") != value(*flags)
