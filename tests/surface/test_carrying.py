"""Maps in degrees, turned or distorted are carried onto the plane without loss."""

import numpy as np
import pytest
import rasterio
from rasterio import Affine

import terrapath as tp
from common import REAL_MAPS, one_line
from rasters import blocked_at, centres_on_plane, write
from rough_maps import fractal
from terrapath.space.lattice import Spacing, default_spacing
from terrapath.surface.bounds import Bounds

SRTM = REAL_MAPS / "srtm_oetztal.tif"


def rough(seed, shape):
    """Rough ground, metres."""
    return 1500.0 + 500.0 * fractal(np.random.default_rng(seed), *shape, 1.9)


def check_heights(surface, heights, transform, rms, most):
    places = centres_on_plane(surface, transform, heights.shape)
    known = np.isfinite(heights)
    assert surface.bounds.contains(places[known]).all()
    off = surface.values(places[known])[:, 0] - heights[known]
    assert np.sqrt(np.mean(off**2)) < rms
    assert np.abs(off).max() < most
    # What is printed is the error against the file.
    assert surface.fit.value_error == pytest.approx(np.abs(off).max(), abs=1e-4)


@pytest.mark.skipif(not SRTM.exists(), reason="the map is not here")
def test_a_real_map_in_degrees_has_the_heights_of_its_file():
    with rasterio.open(SRTM) as file:
        heights, transform = file.read(1).astype(float), file.transform
    surface = tp.read_surface(SRTM)
    check_heights(surface, heights, transform, 0.05, 1.0)
    assert surface.resolution == pytest.approx(64.0, rel=0.02)  # the map's own cells


SECOND = 1.0 / 3600.0


@pytest.mark.parametrize(
    ("crs", "transform"),
    [
        ("EPSG:4326", Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, 47.0)),
        ("EPSG:4326", Affine(2 * SECOND, 0.0, 25.0, 0.0, -SECOND, 71.0)),
        ("EPSG:4326", Affine(SECOND, 0.0, 179.99, 0.0, -SECOND, -16.5)),
        ("EPSG:3857", Affine(40.0, 0.0, 1.2e6, 0.0, -40.0, 5.9e6)),
        (
            "EPSG:32632",
            Affine.translation(5e5, 5e6) * Affine.rotation(28.0) * Affine.scale(30, -30),
        ),
    ],
)
def test_rough_ground_has_the_heights_of_its_file(tmp_path, crs, transform):
    heights = rough(3, (120, 140))
    heights[40:47, 50:58] = np.nan
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, crs))
    check_heights(surface, heights, transform, 0.05, 1.0)


def test_the_climb_of_a_line_is_that_of_the_file(tmp_path):
    heights = rough(4, (200, 200))
    transform = Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, 47.0)
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, "EPSG:4326"))
    row = centres_on_plane(surface, transform, heights.shape)[77]
    climb = np.maximum(np.diff(surface.values(row)[:, 0]), 0.0).sum()
    assert climb == pytest.approx(np.maximum(np.diff(heights[77]), 0.0).sum(), rel=0.001)


@pytest.mark.parametrize("latitude", [3.0, 47.0, -70.0])
def test_every_cell_without_data_is_blocked_and_no_other(tmp_path, latitude):
    random = np.random.default_rng(8)
    heights = rough(5, (90, 110))
    heights[random.random(heights.shape) < 0.05] = np.nan
    heights[30], heights[:, 40] = np.nan, np.nan  # walls of one cell
    transform = Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, latitude)
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, "EPSG:4326"))
    places = centres_on_plane(surface, transform, heights.shape)
    np.testing.assert_array_equal(blocked_at(surface.nodata, places), np.isnan(heights))
    # No path leads through the walls.
    free = np.argwhere(np.isfinite(heights))
    before, beyond = (free[(free[:, 0] < 30) & (free[:, 1] < 40)][0], free[(free > 50).all(1)][0])
    problem = tp.Problem(surface, places[tuple(before)], places[tuple(beyond)])
    assert problem.is_unreachable


def test_small_holes_are_filled_by_their_size_in_metres(tmp_path):
    heights = rough(6, (60, 60))
    heights[20:22, 20:22] = np.nan
    heights[40:44, 40:42] = np.nan
    transform = Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, 47.0)
    path = write(tmp_path / "dem.tif", heights, transform, "EPSG:4326")
    surface = tp.read_surface(path, fill_holes=70.0)  # cells are 21 x 31 metres
    found = blocked_at(surface.nodata, centres_on_plane(surface, transform, heights.shape))
    assert not found[20:22, 20:22].any()
    assert found[40:44, 40:42].all()


def test_layers_and_costs_come_along(tmp_path):
    heights, rocks = rough(7, (70, 80)), rough(8, (70, 80))
    costs = np.ones((70, 80))
    costs[:, 40:] = 7.0
    transform = Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, 47.0)
    paths = [
        str(write(tmp_path / f"{name}.tif", values, transform, "EPSG:4326"))
        for name, values in (("dem", heights), ("rocks", rocks), ("mud", costs))
    ]
    surface = tp.read_surface(paths[0], layers={"rocks": paths[1]}, costs={"mud": paths[2]})
    places = centres_on_plane(surface, transform, heights.shape)
    np.testing.assert_allclose(surface.values(places)[..., 1], rocks, atol=0.5)
    found = surface.cost(places)
    np.testing.assert_allclose(found[:, :38], 1.0, rtol=1e-6)
    np.testing.assert_allclose(found[:, 42:], 7.0, rtol=1e-6)


def test_nodes_are_as_many_as_the_maps_cells(tmp_path):
    heights = rough(9, (300, 320))
    transform = Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, 47.0)
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, "EPSG:4326"))
    (west, south), (east, north) = surface.bounds[:2], surface.bounds[2:]
    ends = (0.7 * west + 0.3 * east, 0.5 * (south + north)), (0.3 * west + 0.7 * east, 0.5 * north)
    for max_slope in (None, 80):
        problem = tp.Problem(surface, *ends, max_slope=max_slope)
        spacing = problem.default_spacing
        nodes = surface.bounds.width / spacing.x * surface.bounds.height / spacing.y
        assert nodes == pytest.approx(heights.size, rel=0.05)


def test_more_than_a_thousand_cells_in_degrees_get_no_more_nodes_than_squares(tmp_path):
    heights = np.zeros((1100, 1100))
    transform = Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, 47.0)
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, "EPSG:4326"))
    bounds = surface.bounds
    spacing = default_spacing(bounds, Spacing(surface.cells.dx, surface.cells.dy))
    assert spacing.y / spacing.x == pytest.approx(surface.cells.dy / surface.cells.dx)
    nodes = bounds.width / spacing.x * bounds.height / spacing.y
    assert nodes == pytest.approx(1000 * 1000 * bounds.width / bounds.height, rel=1e-9)


def test_a_map_with_long_cells_keeps_its_nodes():
    # 200 x 200 cells of 100 : 1; by the longer side alone it would have 100 nodes a side.
    spacing = default_spacing(Bounds(0.0, 0.0, 20_000.0, 200.0), Spacing(100.0, 1.0))
    assert spacing == pytest.approx((80.0, 0.8))


def test_a_small_map_in_degrees_is_read_and_a_smaller_one_refused_with_its_own_numbers(tmp_path):
    transform = Affine(SECOND, 0.0, 11.0, 0.0, -SECOND, 70.0)
    small = rough(10, (4, 4))
    surface = tp.read_surface(write(tmp_path / "small.tif", small, transform, "EPSG:4326"))
    check_heights(surface, small, transform, 0.5, 2.0)
    path = write(tmp_path / "smaller.tif", small[:3], transform, "EPSG:4326")
    with pytest.raises(tp.MapError, match="has 4 x 3 cells"):
        tp.read_surface(path)


def test_beside_a_pole_places_are_still_right(tmp_path):
    transform = Affine(0.01, 0.0, 20.0, 0.0, -0.001, 89.9)
    heights = rough(11, (100, 120))
    surface = tp.read_surface(write(tmp_path / "pole.tif", heights, transform, "EPSG:4326"))
    check_heights(surface, heights, transform, 0.5, 5.0)


def test_cells_without_a_size_on_the_plane_are_refused_in_one_line(tmp_path):
    transform = Affine(-1e-310, 0.0, 500_000.0, 0.0, -10.0, 4_000_120.0)
    path = write(tmp_path / "thin.tif", rough(12, (14, 12)), transform, "EPSG:32633")
    with pytest.raises(tp.MapError, match="its cells have no size; check its CRS") as caught:
        tp.read_surface(path)
    one_line(caught)


def test_cells_that_are_slanted_out_of_all_proportion_are_refused_in_one_line(tmp_path):
    transform = Affine(10.0, 0.0, 500_000.0, 1e11, -10.0, 4_000_120.0)
    path = write(tmp_path / "slanted.tif", rough(12, (14, 12)), transform, None)
    with pytest.raises(tp.MapError, match=r"so slanted or distorted .*gdalwarp") as caught:
        tp.read_surface(path)
    one_line(caught)
