"""Maps of every form give the surface that their numbers describe."""

import inspect
import json
import os
import subprocess
import sys

import numpy as np
import pytest
import rasterio
import xarray
from pyproj import CRS, Transformer
from rasterio import Affine
from scipy.ndimage import binary_dilation, binary_erosion

import terrapath as tp
from helpers import one_line
from terrapath.cli.main import run
from terrapath.surface.grid import Grid
from terrapath.surface.holes import continue_into_holes, fill_small_holes
from terrapath.surface.resampling import resample
from test_rasters import DATA, HEIGHTS, NORTH_UP, UTM, centres, write

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

CENTRE = (15.3, 46.4)  # longitude, latitude
TRUTH = CRS.from_proj4(f"+proj=laea +lon_0={CENTRE[0]} +lat_0={CENTRE[1]} +datum=WGS84")
WGS84 = CRS.from_epsg(4326)


def height_at(x, y):
    """A smooth terrain in metres of the true projection."""
    hills = 300.0 * np.exp(-(((x - 800.0) / 1500.0) ** 2 + ((y + 300.0) / 1200.0) ** 2))
    return 500.0 + hills + 120.0 * np.sin(x / 900.0) * np.cos(y / 1100.0) + 0.02 * x


def terrain(crs, cell, *, half=5000.0, turned=0.0):
    """(heights, transform): the terrain sampled exactly at the cell centres in a CRS."""
    to_map = Transformer.from_crs(TRUTH, crs, always_xy=True)
    edge = np.linspace(-half, half, 21)
    corners = np.stack(np.meshgrid(edge, edge), axis=-1).reshape(-1, 2)
    x, y = to_map.transform(*corners.T)
    middle = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
    columns, rows = (int(np.ceil(1.1 * np.ptp(c) / s)) for c, s in zip((x, y), cell, strict=True))
    transform = (
        Affine.translation(*middle)
        @ Affine.rotation(turned)
        @ Affine.scale(cell[0], -cell[1])
        @ Affine.translation(-0.5 * columns, -0.5 * rows)
    )
    places = centres(transform, (rows, columns))
    true_x, true_y = to_map.transform(places[..., 0], places[..., 1], direction="INVERSE")
    return height_at(true_x, true_y), transform


def length_on(surface):
    """Length of the shortest path between two fixed places on Earth."""
    ends = np.array([[-3500.0, -3000.0], [3600.0, 3100.0]])
    to_plane = Transformer.from_crs(TRUTH, surface.georeference.crs, always_xy=True)
    start, goal = np.stack(to_plane.transform(*ends.T), axis=-1)
    problem = tp.Problem(surface, start, goal)
    found = tp.plan(problem, "fast-marching")
    return tp.refine(problem, found.path).length


def as_dataarray(heights, transform, crs, **attributes):
    places = centres(transform, heights.shape)
    array = xarray.DataArray(
        heights,
        dims=("y", "x"),
        coords={"y": places[:, 0, 1], "x": places[0, :, 0]},
        name="elevation",
        attrs=attributes,
    )
    return array.assign_coords(spatial_ref=((), 0, {"crs_wkt": CRS(crs).to_wkt()}))


def test_the_same_terrain_has_the_same_length_whatever_it_is_given_as(tmp_path):
    cells = {
        "EPSG:4326": (100.0 / 76_700.0, 100.0 / 111_200.0),
        "EPSG:32633": (100.0, 100.0),
        "EPSG:3035": (100.0, 100.0),
    }
    # Web Mercator stretches lengths by 44 % there, EPSG:3035 by 0.15 %.
    cells["EPSG:3857"] = (140.0, 140.0)
    lengths = {}
    for crs, cell in cells.items():
        heights, transform = terrain(crs, cell)
        path = write(tmp_path / f"{crs[5:]}.tif", heights, transform, crs)
        lengths[crs] = length_on(tp.read_surface(path))
    heights, transform = terrain(UTM, (100.0, 100.0), turned=25.0)
    turned = write(tmp_path / "turned.tif", heights, transform, UTM)
    lengths["turned"] = length_on(tp.read_surface(turned))
    heights, transform = terrain(UTM, (100.0, 100.0))
    array = as_dataarray(heights, transform, UTM)
    lengths["xarray"] = length_on(tp.read_surface(array))
    lengths["netcdf"] = length_on(tp.read_surface(_netcdf(tmp_path / "dem.nc", array)))
    x, y = array.x.values, array.y.values
    lengths["numpy"] = length_on(tp.read_surface((heights, x, y), crs=UTM))
    lengths["grid"] = length_on(
        tp.Surface.from_grid(heights[::-1], x, y[::-1], georeference=_georeference(UTM))
    )
    assert lengths["xarray"] == pytest.approx(lengths[UTM], rel=1e-9)
    assert lengths["grid"] == pytest.approx(lengths["numpy"], rel=1e-12)
    spread = (max(lengths.values()) - min(lengths.values())) / min(lengths.values())
    assert spread < 1e-3, lengths
    straight = np.hypot(7100.0, 6100.0)
    assert all(1.001 * straight < length < 1.2 * straight for length in lengths.values())


def _georeference(crs):
    from terrapath.surface.georeference import Georeference

    return Georeference.from_projected(crs)


def _netcdf(path, array):
    """As CF asks: the CRS by its name, the axes by theirs."""
    for axis in ("x", "y"):
        array[axis].attrs.update(standard_name=f"projection_{axis}_coordinate", units="m")
    dataset = array if isinstance(array, xarray.Dataset) else array.to_dataset(name="elevation")
    for name in dataset.data_vars:
        dataset[name].attrs["grid_mapping"] = "spatial_ref"
    dataset.to_netcdf(path)
    return path


def test_a_netcdf_file_that_does_not_say_where_its_cells_lie_is_refused(tmp_path):
    as_dataarray(HEIGHTS, NORTH_UP, UTM).to_netcdf(tmp_path / "dem.nc")
    with pytest.raises(tp.MapError, match="xarray") as caught:
        tp.read_surface(tmp_path / "dem.nc")
    one_line(caught)
    surface = tp.read_surface(xarray.open_dataset(tmp_path / "dem.nc"))
    np.testing.assert_allclose(surface.values(centres())[..., 0], HEIGHTS, atol=1e-9)


# Resampling


@pytest.mark.parametrize("turned", [0.0, 33.0])
def test_a_warped_map_is_exact_at_every_cell(tmp_path, turned):
    heights, transform = terrain(WGS84, (1 / 767.0, 1 / 1112.0), turned=turned)
    heights[0, 0] = np.nan
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, "EPSG:4326"))
    mask = surface.nodata  # the corners that are not covered
    x, y = np.meshgrid(mask.x, mask.y)
    free = ~binary_dilation(mask.blocked)  # the outermost half cell has no neighbours
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


# CRS


def test_a_crs_is_assigned_where_there_is_none_and_must_not_contradict(tmp_path):
    bare = write(tmp_path / "bare.tif", HEIGHTS, crs=None)
    surface = tp.read_surface(bare, crs=UTM)
    assert surface.georeference.crs == CRS(UTM)
    assert str(surface.layers[0]) == "height [m]"
    named = write(tmp_path / "named.tif", HEIGHTS)
    assert tp.read_surface(named, crs=UTM).georeference.crs == CRS(UTM)
    with pytest.raises(tp.MapError, match="contradicts"):
        tp.read_surface(named, crs="EPSG:32632")
    for wrong in ("EPSG:999999", "not a crs", "EPSG:4978", "EPSG:5773"):
        with pytest.raises(tp.MapError) as caught:
            tp.read_surface(bare, crs=wrong)
        assert "crs=" in one_line(caught)


def test_degrees_without_a_crs_are_refused_and_planned_in_metres_with_one(tmp_path):
    transform = Affine(0.001, 0.0, 15.0, 0.0, -0.001, 46.0)
    path = write(tmp_path / "dem.tif", np.round(100.0 * HEIGHTS), transform, None)
    with pytest.raises(tp.MapError, match="look like degrees") as caught:
        tp.read_surface(path)
    assert "EPSG:4326" in one_line(caught)
    assert tp.read_surface(path, crs="EPSG:4326").unit == "m"


def test_of_a_compound_crs_the_vertical_part_gives_the_heights_unit(tmp_path):
    # UTM 17N with NAVD 88 heights in US survey feet.
    path = write(tmp_path / "dem.tif", HEIGHTS, crs="EPSG:26917+6360")
    surface = tp.read_surface(path)
    assert surface.georeference.crs == CRS("EPSG:26917")
    expected = HEIGHTS * 1200.0 / 3937.0
    np.testing.assert_allclose(surface.values(centres())[..., 0], expected, atol=1e-9)
    assert surface.layers[0].unit == "m"


@pytest.mark.parametrize(
    ("crs", "unit", "factor", "shown"),
    [
        (UTM, "ft", 0.3048, "m"),
        (UTM, "km", 1000.0, "m"),
        (UTM, "metres", 1.0, "m"),
        ("EPSG:2225", "m", 3937.0 / 1200.0, "ft"),
        ("EPSG:2225", "US survey foot", 1.0, "ft"),
        ("+proj=utm +zone=33 +datum=WGS84 +units=km", "m", 0.001, "km"),
        (UTM, "DN", 1.0, "DN"),
    ],
)
def test_heights_are_brought_into_the_planes_unit(tmp_path, crs, unit, factor, shown):
    size = {"ft": 1.0, "km": 1e-3}.get(shown, 1.0)
    place = (6.5e6, 2e6) if shown == "ft" else (5e5 * size, 4e6 * size)
    transform = Affine(10.0 * size, 0.0, place[0], 0.0, -10.0 * size, place[1])
    path = write(tmp_path / "dem.tif", HEIGHTS, transform, CRS(crs).to_wkt(), units=(unit,))
    surface = tp.read_surface(path)
    found = surface.values(centres(transform))[..., 0]
    np.testing.assert_allclose(found, factor * HEIGHTS, rtol=3e-6, atol=1e-9)
    assert surface.layers[0].unit == shown


def test_a_map_that_is_not_where_its_crs_reaches_is_refused(tmp_path):
    far = Affine(10.0, 0.0, 5e8, 0.0, -10.0, 4e9)
    with pytest.raises(tp.MapError, match="does not reach") as caught:
        tp.read_surface(write(tmp_path / "dem.tif", HEIGHTS, far))
    assert "UTM zone 33N" in one_line(caught)


def test_a_projection_that_is_not_true_to_scale_is_planned_on_a_local_one(tmp_path):
    heights, transform = terrain("EPSG:3857", (140.0, 140.0))
    surface = tp.read_surface(write(tmp_path / "web.tif", heights, transform, "EPSG:3857"))
    assert "local transverse Mercator" in surface.georeference.name
    assert "Mercator" in surface.georeference.map_crs.name
    middle = surface.georeference.from_map(np.array([1_703_000.0, 5_850_000.0]))
    back = surface.georeference.to_map(middle)
    np.testing.assert_allclose(back, [1_703_000.0, 5_850_000.0], atol=1e-5)


# xarray


@pytest.mark.parametrize("axes", [("y", "x"), ("x", "y")])
@pytest.mark.parametrize("north_up", [True, False])
@pytest.mark.parametrize("x_falls", [True, False])
def test_an_array_lies_where_its_coordinates_say(axes, north_up, x_falls):
    array = as_dataarray(HEIGHTS, NORTH_UP, UTM).transpose(*axes)
    array = array if north_up else array.isel(y=slice(None, None, -1))
    array = array.isel(x=slice(None, None, -1)) if x_falls else array
    surface = tp.read_surface(array)
    np.testing.assert_allclose(surface.values(centres())[..., 0], HEIGHTS, atol=1e-9)
    assert surface.georeference.crs == CRS(UTM)


@pytest.mark.parametrize(
    ("names", "attributes"),
    [
        (("easting", "northing"), ({}, {})),
        (("Lon", "Lat"), ({}, {})),
        (("a", "b"), ({"axis": "X"}, {"axis": "Y"})),
        (
            ("a", "b"),
            (
                {"standard_name": "projection_x_coordinate"},
                {"standard_name": "projection_y_coordinate"},
            ),
        ),
        (("rlon", "rlat"), ({"units": "degrees_east"}, {"units": "degrees_north"})),
    ],
)
def test_dimensions_are_known_by_attributes_and_names(names, attributes):
    degrees = "on" in names[0]
    values = HEIGHTS / 1000.0 if degrees else HEIGHTS
    step = 0.01 if degrees else 10.0
    axes = [np.arange(10) * step + 5.0, np.arange(12) * step + 7.0]
    array = xarray.DataArray(
        values[None],
        dims=("time", names[1], names[0]),
        coords={
            name: (name, axis, described)
            for name, axis, described in zip(names, axes, attributes, strict=True)
        },
    )
    surface = tp.read_surface(array)
    assert (surface.unit == "m") == degrees
    assert (surface.georeference is not None) == degrees
    if degrees:
        assert surface.georeference.map_crs == WGS84
    else:
        places = np.stack(np.meshgrid(*axes), axis=-1)
        np.testing.assert_allclose(surface.values(places)[..., 0], HEIGHTS, atol=1e-9)


def test_packed_arrays_are_unpacked():
    stored = np.round(10.0 * HEIGHTS).astype(np.int16)
    stored[3, 4] = -999
    array = as_dataarray(
        stored, NORTH_UP, UTM, scale_factor=0.1, add_offset=100.0, _FillValue=-999, units="km"
    )
    surface = tp.read_surface(array, smoothing=None)
    expected = 1000.0 * (0.1 * stored + 100.0)
    kept = stored != -999
    found = surface.values(centres())[..., 0]
    np.testing.assert_allclose(found[kept], expected[kept], rtol=1e-12)
    assert surface.layers[0].unit == "m"
    assert np.argwhere(surface.nodata.blocked[::-1]).tolist() == [[3, 4]]


def test_a_dataset_gives_heights_and_layers(tmp_path):
    array = as_dataarray(HEIGHTS, NORTH_UP, UTM)
    dataset = xarray.Dataset({"rocks": array * 2.0, "elevation": array, "count": ((), 3.0)})
    path = _netcdf(tmp_path / "maps.nc", dataset)
    for source, layer in (
        (dataset, dataset["rocks"]),
        (path, f"netcdf:{path}:rocks"),
        (f"netcdf:{path}:elevation", tp.LayerSource(path, "rocks")),
        (dataset, tp.LayerSource(dataset, "rocks", 1.0)),
    ):
        surface = tp.read_surface(source, layers={"rocks": layer})
        expected = HEIGHTS[..., None] * [1.0, 2.0]
        np.testing.assert_allclose(surface.values(centres()), expected, atol=1e-9)
    by_name = tp.read_surface(path, height_band="rocks")
    np.testing.assert_allclose(by_name.values(centres())[..., 0], 2.0 * HEIGHTS, atol=1e-9)
    with pytest.raises(tp.MapError, match="rocks"):
        tp.read_surface(path, height_band="none")
    with pytest.raises(tp.MapError, match="rocks"):
        tp.read_surface(dataset, height_band="none")


def test_bands_of_an_array_are_counted_from_1():
    array = as_dataarray(HEIGHTS, NORTH_UP, UTM)
    bands = xarray.concat([array, 3.0 * array], dim="band")
    for band, factor in ((1, 1.0), (2, 3.0)):
        found = tp.read_surface(bands, height_band=band).values(centres())[..., 0]
        np.testing.assert_allclose(found, factor * HEIGHTS, atol=1e-9)
    for band in (0, 3):
        with pytest.raises(tp.MapError, match="band"):
            tp.read_surface(bands, height_band=band)


@pytest.mark.parametrize("band", [0, 2, "height"])
def test_of_values_and_coordinates_there_is_one_band(band):
    map_of_one = (HEIGHTS, np.arange(10.0), np.arange(12.0))
    with pytest.raises(tp.MapError, match=f"band={band!r} is not in the array; it has 1"):
        tp.read_surface(map_of_one, height_band=band)
    with pytest.raises(tp.MapError, match=f"band={band!r} is not in the array; it has 1"):
        tp.read_surface(map_of_one, layers={"rocks": tp.LayerSource(map_of_one, band)})
    layered = tp.read_surface(map_of_one, layers={"rocks": tp.LayerSource(map_of_one)})
    assert [layer.name for layer in layered.layers] == ["height", "rocks"]


def array_with(**changes):
    given = {
        "data": HEIGHTS,
        "dims": ("y", "x"),
        "coords": {"x": np.arange(10.0), "y": np.arange(12.0)},
    }
    return xarray.DataArray(**{**given, **changes})


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (array_with(coords={}), "no coordinates"),
        (array_with(dims=("a", "b"), coords={}), "known as x"),
        (array_with(data=HEIGHTS.astype(complex)), "complex"),
        (array_with(data=HEIGHTS.astype("datetime64[s]")), "datetime"),
        (array_with(data=HEIGHTS.astype(str)), "real numbers"),
        (array_with(coords={"x": np.arange(10.0) ** 2, "y": np.arange(12.0)}), "equal steps"),
        (array_with(data=np.full((12, 10), np.nan)), "no data"),
        (xarray.Dataset({"a": array_with(), "b": array_with()}), "a, b"),
        (xarray.Dataset(), "none"),
    ],
)
def test_arrays_that_are_no_maps_are_refused_in_one_line(array, said):
    with pytest.raises(tp.TerrapathError) as caught:
        tp.read_surface(array)
    assert said in one_line(caught)


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
    margin = 6.0 * tp.read_surface(path, within=window).resolution
    part = tp.read_surface(path, within=window, margin=margin)
    ends = np.array([window[:2], window[2:]])
    inside = part.georeference.from_map(ends)
    (west, south), (east, north) = inside.min(axis=0) - margin, inside.max(axis=0) + margin
    assert part.bounds.encloses(tp.validation.Bounds(west, south, east, north))
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
    assert part.bounds.encloses(tp.validation.Bounds(*window))
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
    if "kinds" not in inspect.signature(tp.Surface.from_grid).parameters:
        pytest.skip("the core has no cost layers yet")
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


# Files that are none


def test_pictures_and_complex_numbers_are_refused(tmp_path):
    picture = np.zeros((3, 20, 20), dtype=np.uint8)
    path = write(tmp_path / "photo.tif", picture, photometric="RGB")
    with pytest.raises(tp.MapError, match="colour") as caught:
        tp.read_surface(path)
    one_line(caught)
    waves = write(tmp_path / "waves.tif", HEIGHTS.astype(np.complex64))
    with pytest.raises(tp.MapError, match="complex64"):
        tp.read_surface(waves)


def test_a_grid_of_text_is_read_and_a_broken_one_refused(tmp_path):
    header = (
        "ncols 10\nnrows 12\nxllcorner 500000\nyllcorner 4000000\ncellsize 10\nNODATA_value -9\n"
    )
    rows = [" ".join(f"{value:.6f}" for value in row) for row in HEIGHTS]
    path = tmp_path / "dem.asc"
    path.write_text(header + "\n".join(rows) + "\n")
    surface = tp.read_surface(path, crs=UTM)
    np.testing.assert_allclose(surface.values(centres())[..., 0], HEIGHTS, atol=1e-5)
    path.write_text(header + "\n".join(rows[:7]))
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(path, crs=UTM)
    assert str(path) in one_line(caught)


def test_a_cloud_optimised_geotiff_is_read(tmp_path):
    values = np.random.default_rng(0).normal(size=(600, 600)).astype(np.float32)
    path = write(tmp_path / "cog.tif", values, driver="COG", blocksize=128)
    found = tp.read_surface(path).values(centres(shape=(600, 600))[::7, ::7])[..., 0]
    np.testing.assert_allclose(found, values[::7, ::7], atol=1e-6)


# Real maps


def lunar(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not here")
    return path


def test_aristarchus_is_read_with_three_layers_in_one_call():
    path = lunar("aristarchus_plateau.tif")
    layers = {"albedo": f"{path}:1*1000", "rocks": f"{path}:4", "olivine": f"{path}:5*500"}
    surface = tp.read_surface(path, height_band=3, layers=layers)
    assert [layer.name for layer in surface.layers] == ["height", "albedo", "rocks", "olivine"]
    with rasterio.open(path) as dataset:
        stored = dataset.read([3, 1, 4, 5]).astype(float)
        places = centres(dataset.transform, dataset.shape)
    known = np.isfinite(stored).all(axis=0)
    places = np.clip(places, surface.bounds[:2], surface.bounds[2:])
    np.testing.assert_allclose(surface.values(places)[known], stored[:, known].T, atol=1e-6)


def test_jacksboro_as_a_geotiff_is_the_built_in_scene(tmp_path):
    from matplotlib.cbook import get_sample_data
    from rasterio.transform import from_bounds

    with get_sample_data("jacksboro_fault_dem.npz") as archive:
        heights = archive["elevation"]
        west, east, north, south = (float(archive[k]) for k in ("xmin", "xmax", "ymin", "ymax"))
    transform = from_bounds(west, south, east, north, *heights.shape[::-1])
    surface = tp.read_surface(write(tmp_path / "dem.tif", heights, transform, "EPSG:4326"))
    scene = tp.scenes.load("jacksboro").surface
    assert surface.bounds == scene.bounds
    assert surface.fit.smoothing is None  # whole metres on cells of 80 m need none
    np.testing.assert_array_equal(surface.data.coefficients, scene.data.coefficients)


def test_the_plane_is_named_by_its_code_or_as_it_was_made(tmp_path):
    degrees = Affine(0.001, 0.0, 15.0, 0.0, -0.001, 46.0), WGS84.to_wkt()
    local = tp.read_surface(write(tmp_path / "degrees.tif", HEIGHTS, *degrees)).georeference
    assert not local.is_map_crs
    assert local.text == local.crs.to_string()
    assert CRS(local.text) == local.crs
    projected = tp.read_surface(write(tmp_path / "metres.tif", HEIGHTS)).georeference
    assert projected.text == UTM
