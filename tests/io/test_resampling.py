"""Maps on other cells: warped, coarser, of a window."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import rasterio
from pyproj import CRS, Transformer
from rasterio import Affine
from scipy.ndimage import binary_dilation

import terrapath as tp
from common import one_line
from rasters import HEIGHTS, NORTH_UP, UTM, centres, write
from terrains import TRUTH, WGS84, height_at, terrain
from terrapath.cli.main import run
from terrapath.surface.bounds import Bounds
from terrapath.surface.raster import Grid
from terrapath.surface.resampling import resample

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")


@pytest.mark.parametrize("turned", [0.0, 33.0])
def test_a_warped_map_is_exact_at_every_cell(tmp_path, turned):
    heights, transform = terrain(WGS84, (1 / 767.0, 1 / 1112.0), turned=turned)
    heights[0, 0] = np.nan
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, "EPSG:4326"))
    mask = surface.nodata  # the corners that are not covered
    x, y = np.meshgrid(mask.x, mask.y)
    # The outermost half cell has no neighbours, and is up to two cells of the plane.
    free = ~binary_dilation(mask.blocked, iterations=2)
    plane = np.stack([x[free], y[free]], axis=-1)
    to_truth = Transformer.from_crs(surface.georeference.crs, TRUTH, always_xy=True)
    expected = height_at(*to_truth.transform(*plane.T))
    off = np.abs(surface.values(plane)[:, 0] - expected)
    inner = (np.abs(np.stack(to_truth.transform(*plane.T))) < 4500.0).all(axis=0)
    assert inner.sum() > 3000
    assert off[inner].max() < 2e-3  # metres; GDAL's approximate warp was 0.2 m off
    assert off.max() < 0.1


def test_resampling_onto_its_own_cells_changes_nothing():
    values = np.random.default_rng(0).normal(size=(9, 7))
    grid = Grid(9, 7, NORTH_UP, CRS(UTM))
    for target in (grid, grid.flipped()):
        for linear in (True, False):
            out = np.empty((9, 7))
            resample(values.copy(), grid, target, out, linear=linear)
            expected = values if target is grid else values[::-1]
            np.testing.assert_allclose(out, expected, atol=1e-12)


def test_a_map_across_the_date_line_is_one_map(tmp_path):
    transform = Affine(0.002, 0.0, 179.9, 0.0, -0.002, -16.5)
    places = centres(transform, (80, 100))
    heights = 1e3 * (places[..., 0] - 180.0)
    surface = tp.read_surface(write(tmp_path / "fiji.tif", heights, transform, "EPSG:4326"))
    middle = surface.georeference.from_map(np.array([[179.95, -16.58], [-179.95, -16.58]]))
    np.testing.assert_allclose(surface.values(middle)[:, 0], [-50.0, 50.0], atol=1e-3)


def test_a_map_of_half_the_world_is_refused_with_the_remedy(tmp_path):
    transform = Affine(2.0, 0.0, -80.0, 0.0, -2.0, 60.0)
    path = write(tmp_path / "world.tif", np.zeros((60, 80)), transform, "EPSG:4326")
    with pytest.raises(tp.MapError, match="too far") as caught:
        tp.read_surface(path)
    assert "within" in one_line(caught)


def test_a_finer_layer_is_averaged_over_the_maps_cells(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    fine = NORTH_UP @ Affine.scale(0.1)
    noise = np.random.default_rng(3).uniform(1.0, 3.0, (120, 100))
    surface = tp.read_surface(dem, layers={"rocks": write(tmp_path / "rocks.tif", noise, fine)})
    means = noise.reshape(12, 10, 10, 10).mean(axis=(1, 3))
    np.testing.assert_allclose(surface.values(centres())[..., 1], means, atol=1e-9)


def test_layers_that_do_not_overlap_are_refused(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    away = write(tmp_path / "away.tif", HEIGHTS, Affine.translation(5000, 0) @ NORTH_UP)
    swapped = Affine(0.001, 0.0, 46.0, 0.0, -0.001, 15.0)
    degrees = write(tmp_path / "swapped.tif", HEIGHTS, swapped, "EPSG:4326")
    for path in (away, degrees):
        with pytest.raises(tp.MapError, match="does not overlap") as caught:
            tp.read_surface(dem, layers={"rocks": path})
        assert "rocks" in one_line(caught)


def test_a_layer_of_another_body_is_refused(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    moon = "+proj=longlat +R=1737400 +no_defs"
    far = Affine(0.01, 0.0, 15.0, 0.0, -0.01, 36.2)
    lunar = write(tmp_path / "moon.tif", np.zeros((100, 100)), far, CRS(moon).to_wkt())
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(dem, layers={"rocks": lunar})
    one_line(caught)


# Windows and coarser maps


@pytest.mark.parametrize(
    ("crs", "corner", "cell"),
    [("EPSG:32633", (500_000.0, 4_000_000.0), 10.0), ("EPSG:4326", (15.0, 60.0), 1e-4)],
)
def test_a_margin_around_a_window_is_read_too(tmp_path, crs, corner, cell):
    values = np.random.default_rng(5).normal(size=(300, 300))
    transform = Affine(cell, 0.0, corner[0], 0.0, -cell, corner[1])
    path = write(tmp_path / "dem.tif", values, transform, crs=crs)
    west, north = corner[0] + 140 * cell, corner[1] - 140 * cell
    window = (west, north - 20 * cell, west + 20 * cell, north)
    cells = tp.read_surface(path, within=window).cells
    margin = 6.0 * max(cells.dx, cells.dy)
    part = tp.read_surface(path, within=window, margin=margin)
    ends = np.array([window[:2], window[2:]])
    inside = part.georeference.from_map(ends)
    (west, south), (east, north) = inside.min(axis=0) - margin, inside.max(axis=0) + margin
    assert part.bounds.encloses(Bounds(west, south, east, north))
    side = np.ptp(inside, axis=0).max()
    assert max(part.bounds.width, part.bounds.height) < 2.0 * (side + margin)


def test_what_is_blocked_beyond_the_bounds_keeps_the_vehicle_off(tmp_path, capsys):
    heights = np.zeros((100, 100))
    heights[:, 60:] = np.nan
    path = write(tmp_path / "dem.tif", heights, Affine(0.1, 0.0, 0.0, 0.0, -0.1, 10.0))
    asked = ["plan", str(path), "--start", "1,5", "--goal", "4,5", "--bounds", "0,0,4.5,10"]
    assert run([*asked, "--radius", "1.9", "--quiet"]) == 0
    assert run([*asked, "--radius", "2.1", "--quiet"]) == 2
    assert "goal=(4, 5) is nearer than radius=2.1" in capsys.readouterr().err


def test_within_reads_a_window_with_a_margin(tmp_path):
    values = np.random.default_rng(5).normal(size=(100, 80))
    path = write(tmp_path / "dem.tif", values, NORTH_UP)
    whole = tp.read_surface(path)
    window = (500_200.0, 3_999_500.0, 500_400.0, 3_999_700.0)
    part = tp.read_surface(path, within=window, layers={"same": path})
    assert part.bounds.encloses(Bounds(*window))
    assert part.bounds.width < 400.0
    points = np.random.default_rng(6).uniform(window[:2], window[2:], (100, 2))
    np.testing.assert_allclose(part.values(points)[:, 0], whole.values(points)[:, 0], atol=1e-4)
    np.testing.assert_array_equal(part.values(points)[:, 1], part.values(points)[:, 0])
    with pytest.raises(tp.MapError, match="does not touch") as caught:
        tp.read_surface(path, within=(0.0, 0.0, 1.0, 1.0))
    assert "500000" in one_line(caught)
    with pytest.raises(tp.InputError, match="within"):
        tp.read_surface(path, within=(1.0, 1.0, 0.0, 0.0))


@pytest.mark.parametrize("tiled", [False, True])
def test_a_coarser_map_holds_means_of_cells_with_data(tmp_path, tiled):
    values = np.random.default_rng(5).normal(size=(103, 83))
    values[:3, :2] = np.nan
    values[30:33, 30:33] = np.nan
    options = {"tiled": True, "blockxsize": 16, "blockysize": 16} if tiled else {}
    path = write(tmp_path / "dem.tif", values, NORTH_UP, **options)
    surface = tp.read_surface(path, decimate=3)
    cells = values[:102, :81].reshape(34, 3, 27, 3)
    known = np.isfinite(cells).sum(axis=(1, 3))
    assert (known[0, 0], known[10, 10]) == (3, 0)
    np.testing.assert_array_equal(surface.nodata.blocked[::-1], known < 4.5)
    places = centres(NORTH_UP @ Affine.scale(3), (34, 27))
    found = surface.values(places)[..., 0]
    means = np.nansum(cells, axis=(1, 3)) / np.maximum(known, 1)
    np.testing.assert_allclose(found[known >= 5], means[known >= 5], atol=1e-9)


def test_absurd_sizes_are_refused_before_memory_is_taken(tmp_path):
    # A file of a kilobyte that claims a terabyte, in five disguises.
    vrt = tmp_path / "bomb.vrt"
    vrt.write_text(
        '<VRTDataset rasterXSize="1000000" rasterYSize="1000000"><VRTRasterBand '
        'dataType="Float32" band="1"/></VRTDataset>'
    )
    header = "ncols 900000\nnrows 900000\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n"
    grid = tmp_path / "bomb.asc"
    grid.write_text(header)
    sparse = tmp_path / "bomb.tif"
    with rasterio.open(
        sparse, "w", driver="GTiff", width=200_000, height=200_000, count=1, dtype="float64",
        sparse_ok=True, tiled=True, blockxsize=1024, blockysize=1024, bigtiff="YES", crs=UTM,
        transform=NORTH_UP,
    ):  # fmt: skip
        pass
    import zipfile

    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(sparse, "bomb.tif")
    sources = [vrt, grid, sparse, f"/vsizip/{tmp_path}/bomb.zip/bomb.tif"]
    code = (
        "import json, resource, sys, terrapath as tp\n"
        "before, said = None, []\n"
        "for source in json.loads(sys.argv[1]):\n"
        "    try: tp.read_surface(source)\n"
        "    except tp.MapError as error: said.append(str(error))\n"
        "    before = before or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "print(json.dumps([said, (after - before) / 1024]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps([str(source) for source in sources])],
        capture_output=True, text=True, check=True, env=os.environ,
    )  # fmt: skip
    said, megabytes = json.loads(done.stdout)
    assert len(said) == len(sources)
    assert all("more than 150,000,000" in line and "within" in line for line in said)
    assert megabytes < 100.0
    assert done.stderr == ""
    small = write(tmp_path / "small.tif", HEIGHTS)
    with pytest.raises(tp.MapError, match="10 x 12 cells, more than 50") as caught:
        tp.read_surface(small, most_cells=50)
    assert "decimate=2" in one_line(caught)
