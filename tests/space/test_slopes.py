"""How steep cells are: beside Horn's formula written out, gdaldem, and the same ground in UTM."""

import shutil
import subprocess

import numpy as np
import pytest
import rasterio
from pyproj import Transformer
from rasterio import Affine

import terrapath as tp
from common import REAL_MAPS
from horn import horn_degrees
from rasters import UTM, blocked_at, centres_on_plane, write
from terrapath.errors import BlockedError
from terrapath.space.slope_limit import SlopeLimit
from terrapath.surface.bounds import Bounds

SRTM = REAL_MAPS / "srtm_oetztal.tif"


def rough(seed, shape=(40, 50), holes=0.03):
    """Rough heights with holes, single cells and blocks, some at the edge."""
    random = np.random.default_rng(seed)
    heights = random.normal(size=shape).cumsum(axis=0).cumsum(axis=1)
    heights[random.random(shape) < holes] = np.nan
    heights[:3, 10:14] = np.nan
    heights[20:25, 20:24] = np.nan
    return heights


def limit_of(surface, degrees, *measure):
    return SlopeLimit(surface, degrees, surface.bounds, *measure)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sides", [(10.0, 10.0), (7.0, 12.0)])
def test_cells_are_as_steep_as_horn_says(tmp_path, seed, sides):
    heights = rough(seed)
    transform = Affine(sides[0], 0.0, 500_000.0, 0.0, -sides[1], 4_000_000.0)
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform), smoothing=None)
    slopes = horn_degrees(heights, *sides)
    for limit in np.nanquantile(slopes, [0.3, 0.7, 0.95]):
        steep = limit_of(surface, float(limit)).mask.blocked[::-1]
        np.testing.assert_array_equal(steep, np.nan_to_num(slopes) > limit * (1 + 1e-9))


def in_degrees(latitude, shape, cell=1 / 1200):
    """A grid of cells in degrees, and the sides of its cells in metres (each row's, and all's)."""
    transform = Affine(cell, 0.0, 10.0, 0.0, -cell, latitude)
    rows = np.radians(latitude - cell * (np.arange(shape[0]) + 0.5))
    a, e2 = 6378137.0, 0.00669437999014
    across = a * np.cos(rows) / np.sqrt(1 - e2 * np.sin(rows) ** 2)
    along = a * (1 - e2) / (1 - e2 * np.sin(rows.mean()) ** 2) ** 1.5
    return transform, np.radians(cell) * across, np.radians(cell) * along


@pytest.mark.parametrize("latitude", [0.05, 47.0, -68.0])
def test_in_degrees_cells_are_as_steep_as_with_their_true_sides(tmp_path, latitude):
    heights = 15.0 * rough(5, (60, 50))
    transform, across, along = in_degrees(latitude, heights.shape)
    path = write(tmp_path / "dem.tif", heights, transform, "EPSG:4326")
    surface = tp.read_surface(path, smoothing=None)
    slopes = horn_degrees(heights, across, along)
    known = np.isfinite(slopes)
    centres = centres_on_plane(surface, transform, heights.shape)[known]
    for limit in np.nanquantile(slopes, [0.3, 0.6, 0.9]):
        found = blocked_at(limit_of(surface, float(limit)).mask, centres)
        # Neighbouring cells have slopes that nothing relates; on real ground it is 97 %.
        assert (found == (slopes[known] > limit)).mean() > 0.95
        assert found.mean() == pytest.approx((slopes[known] > limit).mean(), abs=0.02)


def test_a_plane_in_degrees_has_its_slope_everywhere(tmp_path):
    shape = (50, 60)
    transform, _, along = in_degrees(61.0, shape)
    heights = np.tan(np.radians(30.0)) * along * np.mgrid[: shape[0], : shape[1]][0]
    path = write(tmp_path / "dem.tif", heights, transform, "EPSG:4326")
    surface = tp.read_surface(path)
    assert limit_of(surface, 30.1).mask is None
    steep = limit_of(surface, 29.9).mask
    assert blocked_at(steep, centres_on_plane(surface, transform, shape)).all()


def test_the_strict_measure_blocks_what_horn_does_and_more(tmp_path):
    heights = 15.0 * rough(6)
    transform, _, _ = in_degrees(47.0, heights.shape)
    for crs, place in (
        (UTM, Affine(60.0, 0.0, 500_000.0, 0.0, -90.0, 4e6)),
        ("EPSG:4326", transform),
    ):
        surface = tp.read_surface(write(tmp_path / "dem.tif", heights, place, crs), smoothing=None)
        strict = limit_of(surface, 30.0, "steepest").mask
        centres = np.stack(np.meshgrid(strict.x, strict.y), axis=-1)
        horn = blocked_at(limit_of(surface, 30.0).mask, centres)
        assert (strict.blocked | ~horn)[~surface.nodata.blocked].mean() > 0.98
        assert strict.blocked.mean() > horn.mean() + 0.05


def test_slopes_are_of_the_true_ground_whatever_its_weight():
    axis = np.arange(20.0)
    surface = tp.Surface.from_grid(
        np.tan(0.3) * np.meshgrid(axis, axis)[0], axis, axis, weights=[9]
    )
    assert limit_of(surface, np.degrees(0.31)).mask is None
    assert limit_of(surface, np.degrees(0.29)).mask.blocked.all()


def test_surfaces_without_cells_of_their_own_have_their_steepest_place_in_each():
    bounds = (0, 0, 10, 10)
    hill = tp.Surface.from_function(lambda x, y: np.exp(-((x - 5) ** 2) - (y - 5) ** 2), bounds)
    peaks = tp.Surface.from_peaks([[(1.0, 1.0, 5.0, 5.0)]])
    steepest = np.degrees(np.arctan(np.sqrt(2 / np.e)))
    for surface in (hill, peaks):
        for measure in ("horn", "steepest"):
            limits = (
                SlopeLimit(surface, steepest + d, Bounds(*bounds), measure) for d in (0.1, -0.1)
            )
            above, below = limits
            assert above.mask is None
            assert below.mask is not None


needs_gdal = pytest.mark.skipif(shutil.which("gdaldem") is None, reason="gdaldem is not installed")
needs_srtm = pytest.mark.skipif(not SRTM.exists(), reason="the map is not here")


def gdal(*arguments):
    subprocess.run([str(a) for a in arguments], check=True, capture_output=True)


@needs_gdal
def test_gdaldem_says_the_same_cell_by_cell(tmp_path):
    heights = rough(7)
    place = Affine(7.0, 0.0, 5e5, 0.0, -12.0, 4e6)
    write(tmp_path / "dem.tif", heights, place, nodata=np.nan)
    gdal("gdaldem", "slope", "-compute_edges", tmp_path / "dem.tif", tmp_path / "slope.tif")
    with rasterio.open(tmp_path / "slope.tif") as file:
        theirs = file.read(1, masked=True).astype(float).filled(np.nan)
    ours = horn_degrees(heights, 7.0, 12.0)
    inner = np.ones(ours.shape, bool)
    inner[[0, 0, -1, -1], [0, -1, 0, -1]] = False  # it has half the slope of a plane at corners
    np.testing.assert_allclose(ours[inner], theirs[inner], atol=1e-4)


@needs_gdal
@needs_srtm
def test_a_real_map_in_degrees_is_blocked_where_gdaldem_says_in_utm(tmp_path):
    utm, slope = tmp_path / "utm.tif", tmp_path / "slope.tif"
    warp = ("-q", "-t_srs", "EPSG:32632", "-r", "cubic", "-ot", "Float32", "-dstnodata", "-9999")
    gdal("gdalwarp", *warp, SRTM, utm)
    gdal("gdaldem", "slope", "-q", "-compute_edges", utm, slope)
    with rasterio.open(slope) as file:
        theirs = file.read(1, masked=True).astype(float).filled(np.nan)
        rows, columns = np.nonzero(np.isfinite(theirs))
        places, crs = np.stack(file.transform * (columns + 0.5, rows + 0.5), axis=-1), file.crs
    surface, in_utm = tp.read_surface(SRTM), tp.read_surface(utm)
    there = Transformer.from_crs(crs.to_wkt(), surface.georeference.crs, always_xy=True)
    points = np.stack(there.transform(*places.T), axis=-1)
    for limit in (30, 35, 40, 42):
        expected = theirs[rows, columns] > limit
        found = blocked_at(limit_of(surface, limit).mask, points)
        assert found.mean() == pytest.approx(expected.mean(), abs=0.02)
        assert (found == expected).mean() > 0.97
        assert (blocked_at(limit_of(in_utm, limit).mask, places) == expected).mean() > 0.9999


@needs_srtm
def test_a_route_under_a_limit_on_a_map_in_degrees(tmp_path):
    surface = tp.read_surface(SRTM)
    ends = surface.georeference.from_lonlat(np.array([[11.0270, 46.8690], [10.9115, 46.8585]]))
    solution = tp.plan(tp.Problem(surface, *ends, max_slope=40), "fast-marching", refine=True)
    assert solution.length == pytest.approx(9508.0, rel=0.01)  # on the map warped to UTM


@pytest.mark.parametrize("which", ["costs", "layers"])
def test_ground_beside_gaps_of_another_layer_is_as_steep_as_it_is(which):
    axis = 10.0 * np.arange(30)
    plane = np.tile(axis * np.tan(np.radians(40.0)), (30, 1))
    other = np.ones((30, 30))
    other[:, 5:25:4] = np.nan
    surface = tp.read_surface((plane, axis, axis), **{which: {"going": (other, axis, axis)}})
    for x in (20.0, 60.0):
        with pytest.raises(BlockedError, match="steep"):
            tp.Problem(surface, (x, 100.0), (x, 120.0), max_slope=30.0)
        tp.Problem(surface, (x, 100.0), (x, 120.0), max_slope=41.0)
