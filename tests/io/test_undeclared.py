"""Fills that no tag declares are found and blocked; ground that looks like one is not."""

import re
import warnings
from contextlib import ExitStack

import numpy as np
import pytest
import rasterio

import fills
import terrapath as tp
from common import REAL_MAPS
from fills import GROUNDS, SHAPES, resampled, shape, stands_out
from rasters import HEIGHTS, write
from terrapath.cli.main import run
from terrapath.errors import collecting
from terrapath.io.bands import View
from terrapath.io.sources import LayerSource, Unsaid
from terrapath.io.undeclared import Fills, findings
from terrapath.surface.georeference import parse_crs

SIDE = 64
AXIS = 500_000.0 + 30.0 * np.arange(SIDE)


def view_of(values):
    with ExitStack() as files:
        unsaid = Unsaid(crs=parse_crs("EPSG:32633"))
        return View.whole(LayerSource((values, AXIS, AXIS)).open(files, unsaid))


def blocked(values):
    """(ny, nx): what counts as no data."""
    with collecting():
        read = Fills("auto").blocked(view_of(values), "heights")
    return ~np.isfinite(read.band.read(slice(0, SIDE), slice(0, SIDE)))


@pytest.mark.parametrize("name", GROUNDS)
def test_real_ground_is_not_taken_for_a_fill(name):
    for seed in range(4):
        ground = GROUNDS[name](np.random.default_rng([seed, 1]), SIDE)
        assert findings(view_of(ground), "heights") == [], seed


@pytest.mark.parametrize("name", GROUNDS)
def test_fills_are_blocked_and_nothing_else_is(name):
    tried = 0
    for seed, kind in enumerate(SHAPES):
        random = np.random.default_rng([seed, 2])
        ground = GROUNDS[name](random, SIDE)
        for value in fills.FILLS:
            cells = shape(random, SIDE, kind)
            if stands_out(ground, value):
                np.testing.assert_array_equal(blocked(np.where(cells, value, ground)), cells)
                tried += 1
    assert tried >= 20


@pytest.mark.parametrize("value", fills.PLAINS)
def test_a_plain_of_any_value_far_below_the_ground_is_a_fill(value):
    for name in ("hills", "lake", "flat", "pit", "city", "rough", "steps", "dead sea"):
        random = np.random.default_rng([len(name), 3])
        ground, cells = GROUNDS[name](random, SIDE), shape(random, SIDE, "blob")
        np.testing.assert_array_equal(blocked(np.where(cells, value, ground)), cells)


def test_two_fills_are_both_found():
    random = np.random.default_rng(4)
    ground = GROUNDS["mountains"](random, SIDE)
    one, other = shape(random, SIDE, "blob"), shape(random, SIDE, "wedge")
    values = np.where(one, -32768.0, np.where(other, -9999.0, ground))
    np.testing.assert_array_equal(blocked(values), one | other)


@pytest.mark.parametrize("value", [-9999.0, -32768.0, 32767.0])
def test_what_a_warp_mixed_with_a_fill_is_blocked_with_it(value):
    for name in ("hills", "lake", "pit"):
        random = np.random.default_rng([len(name), 5])
        ground = GROUNDS[name](random, SIDE)
        values, cells = resampled(ground, shape(random, SIDE, "blob"), value)
        found = blocked(values)
        assert not (found & ~cells).any()
        left = cells & ~found
        assert left.sum() <= 0.05 * cells.sum()


# As people meet it


def holed(value=-9999.0, dtype="float32"):
    heights = (100.0 + HEIGHTS).astype(dtype)
    heights[4:7, 3:6] = value
    return heights


def test_one_line_says_what_is_blocked_where_and_how_to_say_otherwise(tmp_path):
    path = write(tmp_path / "dem.tif", holed())
    with pytest.warns(tp.MapWarning) as told:
        surface = tp.read_surface(path)
    assert surface.nodata.blocked.sum() == 9
    (text,) = [str(entry.message) for entry in told]
    assert str(path) in text
    assert "9 cells hold -9999" in text
    assert "x=500035, y=4000075" in text  # the first, in the map's own coordinates
    assert "--nodata -9999" in text
    assert "--nodata none" in text
    assert "\n" not in text


@pytest.mark.parametrize("value", [-9999.0, -3.4028234663852886e38, 0.1])
def test_a_value_that_is_given_is_no_data_without_a_word(tmp_path, value):
    surface = tp.read_surface(write(tmp_path / "dem.tif", holed(value)), nodata=value)
    assert surface.nodata.blocked.sum() == 9


def test_nothing_is_looked_for_where_the_map_is_said_to_be_right(tmp_path):
    surface = tp.read_surface(write(tmp_path / "dem.tif", holed()), nodata="none")
    assert surface.nodata is None


@pytest.mark.parametrize("wrong", ["some", None, True, [1.0]])
def test_other_words_are_refused(tmp_path, wrong):
    with pytest.raises(tp.InputError, match="neither a number"):
        tp.read_surface(write(tmp_path / "dem.tif", holed()), nodata=wrong)


def test_a_map_that_is_read_coarser_does_not_mix_fills_with_ground():
    heights = 100.0 + np.tile(HEIGHTS, (4, 4))
    heights[10:14, 21] = -9999.0
    axes = np.arange(40.0), np.arange(48.0)
    with pytest.warns(tp.MapWarning, match="4 cells hold"):
        surface = tp.read_surface((heights, *axes), decimate=4, smoothing=None)
    assert surface.values([(20.5, 12.5)])[0, 0] > 50.0


def test_fills_are_stored_unscaled(tmp_path):
    heights = np.round(10.0 * (100.0 + HEIGHTS)).astype(np.int16)
    heights[5, 5] = -9999
    path = tmp_path / "dem.tif"
    write(path, heights)
    with rasterio.open(path, "r+") as dataset:
        dataset.scales, dataset.offsets = (0.1,), (3.0,)
    with pytest.warns(tp.MapWarning, match="-996.9"):
        assert tp.read_surface(path).nodata.blocked.sum() == 1


def test_layers_are_searched_too(tmp_path):
    rocks = np.abs(HEIGHTS)
    rocks[2, 2] = -9999.0
    layer = write(tmp_path / "rocks.tif", rocks)
    with pytest.warns(tp.MapWarning, match=r"rocks\.tif: 1 cell holds -9999"):
        surface = tp.read_surface(write(tmp_path / "dem.tif", HEIGHTS), layers={"rocks": layer})
    assert surface.nodata.blocked.sum() == 1


DEAR = [999.0, 9999.0, 32767.0, 65535.0, 99999.0, 2147483647.0, 4294967295.0, 1e11]


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("value", DEAR)
def test_a_dear_cost_is_a_cost(tmp_path, value, smooth):
    costs = np.ones((12, 10))
    costs[3:6, 4:7] = value
    layer = write(tmp_path / "going.tif", costs)
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        surface = tp.read_surface(dem, costs={"going": layer}, smooth_costs=smooth)
    assert surface.nodata is None
    start, goal = (500015.0, 4000015.0), (500055.0, 4000075.0)  # in the dear cells
    assert tp.plan(tp.Problem(surface, start, goal), "dijkstra").path is not None


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("value", [-9999.0, -32768.0, -99999.0, -3.4e38, 3.4e38, 1e30])
@pytest.mark.parametrize("dear", [3.0, 65535.0])
def test_what_no_cost_can_be_is_no_data(tmp_path, value, smooth, dear):
    costs = np.random.default_rng(0).choice([1.0, dear], (12, 10))
    costs[3:6, 4:7] = value
    layer = write(tmp_path / "going.tif", costs)
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    with pytest.warns(tp.MapWarning, match=r"going\.tif: 9 cells hold .* as no cost can be"):
        surface = tp.read_surface(dem, costs={"going": layer}, smooth_costs=smooth)
    assert surface.nodata.blocked.sum() == 9


def test_a_map_of_nothing_but_fills_holds_no_data(tmp_path):
    path = write(tmp_path / "dem.tif", np.full((12, 10), -9999.0))
    with (
        pytest.warns(tp.MapWarning, match="120 cells"),
        pytest.raises(tp.MapError, match="no data at all"),
    ):
        tp.read_surface(path)


def test_the_command_says_it_once_and_takes_the_option(tmp_path, capsys):
    path = write(tmp_path / "dem.tif", holed())
    route = ["--start", "500015,4000015", "--goal", "500085,4000105", "--planner", "dijkstra"]
    plan = ["plan", str(path), *route, "--no-bound", "--json"]
    assert run(plan) == 0
    assert len(re.findall("-9999 as no ground does", capsys.readouterr().err)) == 1
    assert run([*plan, "--nodata", "-9999"]) == 0
    assert capsys.readouterr().err == ""
    assert run([*plan, "--nodata", "some"]) == 2
    assert "'some' is not a number" in capsys.readouterr().err


def test_a_map_that_people_have():
    path = REAL_MAPS / "hugo.asc"
    if not path.exists():
        pytest.skip("the map is not here")
    with pytest.warns(tp.MapWarning, match="-9999"):
        surface = tp.read_surface(path)
    assert surface.nodata is not None
    assert surface.values(np.array([surface.bounds[:2]])).min() > -1000.0
