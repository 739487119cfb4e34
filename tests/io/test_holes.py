"""Ground without data, rounded heights, and costs beside them."""

import numpy as np
import pytest
import rasterio
from rasterio import Affine
from scipy.ndimage import binary_erosion

import terrapath as tp
from common import one_line
from rasters import HEIGHTS, NORTH_UP, centres, write
from terrapath.surface.holes import continue_into_holes, fill_small_holes

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")


# Holes


def plane_with_hole(slope=(0.8, -0.5), shape=(40, 50), hole=np.s_[10:25, 15:32]):
    rows, columns = np.indices(shape).astype(float)
    plane = 100.0 + slope[0] * columns + slope[1] * rows
    missing = np.zeros(shape, dtype=bool)
    missing[hole] = True
    return plane, missing


def test_the_ground_goes_on_into_holes_without_a_crease_at_their_edge():
    plane, missing = plane_with_hole()
    values = np.where(missing, np.nan, plane)
    continue_into_holes(values, missing)
    assert np.isfinite(values).all()
    np.testing.assert_array_equal(values[~missing], plane[~missing])
    edge = missing & ~binary_erosion(missing)
    # The nearest cells' values are 0.5 to 0.8 off.
    np.testing.assert_allclose(values[edge], plane[edge], rtol=0.0, atol=1e-9)
    # Further in the ground levels off: nowhere above or below what the plane has in the hole.
    assert values[missing].min() >= plane[missing].min() - 1e-9
    assert values[missing].max() <= plane[missing].max() + 1e-9


# Of 200 seeds 105 is the worst in slope (0.0534 of it) and 130 in height (0.023 cells' rise).
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 105, 130])
def test_a_spline_does_not_ring_at_the_edge_of_a_hole(tmp_path, seed):
    """On ground of one slope the surface between cells with data is that ground."""
    random = np.random.default_rng(seed)
    slope = random.uniform(-2.0, 2.0, 2)
    plane, _ = plane_with_hole(slope)
    rows, columns = np.indices(plane.shape)
    centre = random.uniform((12, 15), (28, 35))
    missing = np.hypot(rows - centre[0], columns - centre[1]) < random.uniform(2.0, 9.0)
    grid = Affine(10.0, 0.0, 0.0, 0.0, -10.0, 400.0)
    path = write(tmp_path / "dem.tif", np.where(missing, np.nan, 10.0 * plane), grid)
    surface = tp.read_surface(path)
    whole = tp.read_surface(write(tmp_path / "whole.tif", 10.0 * plane, grid))
    points = random.uniform((5.0, 5.0), (495.0, 395.0), (20_000, 2))
    cells = np.floor([(400.0 - points[:, 1]) / 10.0, points[:, 0] / 10.0]).astype(int)
    free = ~missing[tuple(cells)]
    assert 500 < free.sum() < len(free)
    off = (surface.gradients(points) - whole.gradients(points))[free, 0]
    # With the nearest cells' values 1.4 to 1.7 times the slope, and 0.5 to 0.9 cells' rise.
    steepness = np.hypot(*slope)
    assert np.hypot(*off.T).max() < 0.06 * steepness
    risen = np.abs((surface.values(points) - whole.values(points))[free])
    assert risen.max() < 0.03 * 10.0 * steepness


@pytest.mark.parametrize("dy", [1.0, 2.5])
def test_small_holes_are_filled_by_a_plate_that_keeps_planes_and_hills(dy):
    plane, missing = plane_with_hole()
    values = np.where(missing, np.nan, plane)
    fill_small_holes(values, missing, 1.0, dy, 40.0)
    assert not missing.any()
    np.testing.assert_allclose(values, plane, atol=1e-6)
    rows, columns = np.indices(plane.shape)
    hill = 50.0 * np.exp(-((columns - 24.0) ** 2 + (rows - 18.0) ** 2 * dy**2) / 300.0)
    missing = np.hypot(rows - 18, columns - 22) < 4.0
    values = np.where(missing, np.nan, hill)
    gone = missing.copy()
    fill_small_holes(values, gone, 1.0, dy, 40.0)
    assert np.abs(values - hill)[missing].max() < 0.02 * 50.0


def test_only_holes_up_to_the_size_inside_the_map_are_filled(tmp_path):
    ground = np.fromfunction(lambda r, c: 3.0 * r - c, (40, 50))
    heights = ground.copy()
    heights[5:8, 5:9] = np.nan  # 3 x 4 cells of 10: 40 long
    heights[20:25, 20:22] = np.nan  # 50 long
    heights[0:2, 30:32] = np.nan  # at the edge: no hole
    heights[30, 40] = heights[31, 41] = np.nan  # corner to corner: one hole of 20
    path = write(tmp_path / "dem.tif", heights)
    counts = {0.0: 12 + 10 + 4 + 2, 19.9: 28, 20.0: 26, 40.0: 14, 49.0: 14, 50.0: 4, 1e6: 4}
    for size, blocked in counts.items():
        surface = tp.read_surface(path, fill_holes=size)
        assert surface.nodata.blocked.sum() == blocked, size
    np.testing.assert_allclose(
        surface.values(centres(shape=ground.shape))[8:30, :30, 0], ground[8:30, :30], atol=1e-5
    )
    with pytest.raises(tp.InputError, match="fill_holes"):
        tp.read_surface(path, fill_holes=-1.0)


# Rounded heights


@pytest.mark.parametrize("stored", ["int16", "float32", "scaled"])
def test_rounded_heights_are_smoothed_by_default_and_the_residual_is_reported(tmp_path, stored):
    grid = Affine(1.0, 0.0, 500_000.0, 0.0, -1.0, 4_000_000.0)
    rows, columns = np.indices((80, 90))
    metres = np.round(30.0 * np.sin(columns / 20.0) * np.cos(rows / 25.0))
    values = {"int16": metres, "float32": metres, "scaled": 10 * metres}[stored]
    path = write(
        tmp_path / "dem.tif", values.astype("int16" if stored == "scaled" else stored), grid
    )
    if stored == "scaled":
        with rasterio.open(path, "r+") as dataset:
            dataset.scales = (0.1,)
    surface = tp.read_surface(path)
    scale = 2.4 * (np.sqrt(0.1) if stored == "scaled" else 1.0)
    assert surface.fit.smoothing.scale == pytest.approx(scale, rel=1e-3)
    assert 0.05 < surface.fit.smoothing.rms_change[0] < 1.0
    assert "smoothed over" in str(surface)
    for smoothing in (None, 0, 0.0):
        assert tp.read_surface(path, smoothing=smoothing).fit.smoothing is None
    assert tp.read_surface(path, smoothing=5).fit.smoothing.scale == 5.0
    coarse = tp.read_surface(path, decimate=2)  # half the noise, cells twice as large
    if stored == "scaled":
        assert coarse.fit.smoothing is None  # below half a cell
    else:
        assert coarse.fit.smoothing.scale == pytest.approx(scale, rel=1e-3)
    for wrong in ("much", -1.0, np.nan, 1e9):
        with pytest.raises(tp.InputError) as caught:
            tp.read_surface(path, smoothing=wrong)
        assert "smoothing=" in one_line(caught)


def test_smoothing_carries_nothing_out_of_holes(tmp_path):
    plane, missing = plane_with_hole()
    path = write(tmp_path / "dem.tif", np.where(missing, np.nan, 10.0 * plane))
    surface = tp.read_surface(path, smoothing=20.0)
    places = centres(shape=plane.shape)
    off = surface.values(places)[..., 0] - 10.0 * plane
    assert np.abs(off[~missing]).max() < 0.1 * 10.0  # a tenth of what the ground rises in a cell


# Costs


@pytest.mark.parametrize("wrong", [0.0, -2.5])
def test_a_cost_that_is_not_above_0_is_named_with_its_place(tmp_path, wrong):
    costs = np.full((12, 10), 2.0)
    costs[4, 6] = wrong
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    with pytest.raises(tp.MapError, match="above 0") as caught:
        tp.read_surface(dem, costs={"mud": write(tmp_path / "mud.tif", costs)})
    text = one_line(caught)
    assert f"cost 'mud' is {wrong:g} at x=500065, y=4000075" in text


def test_costs_stay_within_their_range_on_any_grid_and_beside_holes(tmp_path):
    random = np.random.default_rng(4)
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    for name, transform, size in (
        ("same", NORTH_UP, (12, 10)),
        ("coarse", NORTH_UP @ Affine.scale(2.3), (6, 5)),
        ("fine", NORTH_UP @ Affine.scale(0.21), (60, 50)),
    ):
        costs = np.where(random.random(size) < 0.5, 2.0, 80.0)
        costs[size[0] // 2, size[1] // 2] = np.nan
        mud = write(tmp_path / f"{name}.tif", costs, transform)
        surface = tp.read_surface(dem, costs={"mud": f"{mud}*1"})
        assert [layer.name for layer in surface.costs] == ["mud"]
        x, y = surface.bounds[0::2], surface.bounds[1::2]
        points = random.uniform((x[0], y[0]), (x[1], y[1]), (2000, 2))
        found = surface.cost(points)
        assert found.min() > 2.0 * (1.0 - 1e-9)
        assert found.max() < 80.0 * (1.0 + 1e-9)
