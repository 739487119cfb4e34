"""GeoTIFFs on their way to a surface."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.crs
from hypothesis import given, settings, strategies as st
from pyproj import CRS, Geod, Transformer
from rasterio import Affine

import terrapath as tp
from common import REAL_MAPS, one_line
from oracles import is_blocked
from rasters import HEIGHTS, NORTH_UP, UTM, centres, write
from terrapath.io.sources import LayerSource
from terrapath.surface.georeference import Georeference
from terrapath.surface.raster import Raster

# rasterio 1.4 multiplies Affine by "*" in its own modules, which affine 3 is about to retire.
pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

# What is told of such maps has tests of its own.
TOLD = pytest.mark.filterwarnings("ignore::terrapath.MapWarning")

# Values


def test_the_surface_passes_through_the_raster_at_the_cell_centres(tmp_path):
    surface = tp.read_surface(write(tmp_path / "dem.tif", HEIGHTS))
    np.testing.assert_allclose(surface.values(centres())[..., 0], HEIGHTS, atol=1e-10)
    assert surface.bounds == (500_005.0, 4_000_005.0, 500_095.0, 4_000_115.0)
    assert surface.resolution == 10.0
    assert surface.nodata is None
    assert [str(layer) for layer in surface.layers] == ["height [m]"]
    assert surface.unit == "m"


def test_north_up_and_south_up_rasters_give_the_same_surface(tmp_path):
    south_up = Affine(10.0, 0.0, 500_000.0, 0.0, 10.0, 4_000_000.0)
    first = tp.read_surface(write(tmp_path / "north.tif", HEIGHTS))
    second = tp.read_surface(write(tmp_path / "south.tif", HEIGHTS[::-1], south_up))
    assert first.bounds == second.bounds
    random = np.random.default_rng(1)
    points = random.uniform(first.bounds[:2], first.bounds[2:], (200, 2))
    np.testing.assert_allclose(first.values(points), second.values(points), atol=1e-12)
    np.testing.assert_allclose(first.gradients(points), second.gradients(points), atol=1e-12)


def test_the_height_band_is_chosen(tmp_path):
    path = write(tmp_path / "dem.tif", np.stack([HEIGHTS, 2 * HEIGHTS, HEIGHTS + 1]))
    for band, expected in ((1, HEIGHTS), (2, 2 * HEIGHTS), (3, HEIGHTS + 1)):
        surface = tp.read_surface(str(path), height_band=band)
        np.testing.assert_allclose(surface.values(centres())[..., 0], expected, atol=1e-10)


def test_scale_and_offset_of_a_band_are_applied(tmp_path):
    stored = np.round(10 * HEIGHTS).astype(np.int16)
    path = write(tmp_path / "dem.tif", stored)
    with rasterio.open(path, "r+") as dataset:
        dataset.scales, dataset.offsets = (0.1,), (250.0,)
    surface = tp.read_surface(path)
    np.testing.assert_allclose(surface.values(centres())[..., 0], 0.1 * stored + 250.0, atol=1e-9)


# No-data


@pytest.mark.parametrize(
    ("dtype", "declared", "stored"),
    [
        ("float32", -np.inf, -np.inf),
        ("float64", np.nan, np.nan),
        ("float64", None, np.nan),
        ("float64", None, np.inf),
        ("float32", -9999.0, -9999.0),
        ("int16", -32768, -32768),
        pytest.param("uint8", 255, 255, marks=TOLD),
    ],
)
def test_no_data_becomes_blocked_cells_and_nothing_else_does(tmp_path, dtype, declared, stored):
    bands = np.abs(np.round(HEIGHTS)).astype(dtype)
    holes = [(0, 0), (5, 3), (5, 4), (11, 9)]
    for hole in holes:
        bands[hole] = stored
    path = write(tmp_path / "dem.tif", bands, nodata=declared)
    surface = tp.read_surface(path, smoothing=None)
    assert surface.nodata is not None
    assert surface.nodata.blocked.sum() == len(holes)
    places = centres()
    for row, column in np.ndindex(*bands.shape):
        assert is_blocked(surface.nodata, places[row, column]) == ((row, column) in holes)
    kept = np.isfinite(bands.astype(float)) & (bands != stored)
    found = surface.values(places)[..., 0]
    np.testing.assert_allclose(found[kept], bands[kept].astype(float), atol=1e-4)
    assert np.abs(found).max() < 100.0  # no cliff where data are missing
    with pytest.raises(tp.InputError, match="no-data"):
        tp.Problem(surface, places[5, 3], places[2, 2])


def test_a_cell_without_data_in_any_layer_is_blocked(tmp_path):
    rocks = np.ones((12, 10))
    rocks[4, 6] = np.nan
    heights = HEIGHTS.copy()
    heights[1, 1] = np.nan
    path = write(tmp_path / "dem.tif", np.stack([heights, rocks]))
    surface = tp.read_surface(path, layers={"rocks": f"{path}:2"})
    assert np.argwhere(surface.nodata.blocked[::-1]).tolist() == [[1, 1], [4, 6]]


def test_a_map_without_any_data_is_refused(tmp_path):
    for crs, transform in ((UTM, NORTH_UP), ("EPSG:4326", Affine(0.01, 0, 15, 0, -0.01, 46))):
        path = write(tmp_path / "dem.tif", np.full((12, 10), np.nan), transform, crs)
        with pytest.raises(tp.MapError) as caught:
            tp.read_surface(path)
        assert "no data" in one_line(caught)


# Files that are none


@pytest.mark.parametrize(
    ("shape", "shown"), [((3, 10), "10 x 3"), ((12, 3), "3 x 12"), ((1, 1), "1 x 1")]
)
def test_a_map_with_less_than_4_by_4_cells_is_refused(tmp_path, shape, shown):
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(write(tmp_path / "dem.tif", np.zeros(shape)))
    assert shown in one_line(caught)
    assert "4 x 4" in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    for name in ("none.tif", "none/dem.tif", "dem.tif:1"):
        with pytest.raises(tp.MapError) as caught:
            tp.read_surface(tmp_path / name)
        assert str(tmp_path / name) in one_line(caught)
        assert "does not exist" in str(caught.value)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
@pytest.mark.parametrize("compress", [None, "deflate"])
def test_a_truncated_file_is_an_error_that_names_it(tmp_path, share, compress):
    bands = np.random.default_rng(0).normal(size=(200, 200))
    whole = write(tmp_path / "whole.tif", bands, compress=compress)
    content = whole.read_bytes()
    cut = tmp_path / "cut.tif"
    cut.write_bytes(content[: int(share * len(content))])
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(cut)
    assert str(cut) in one_line(caught)


@pytest.mark.parametrize("content", ["not a map", "", "x1,x2\n1,2\n"])
def test_a_file_of_text_is_an_error_that_names_it(tmp_path, content):
    path = tmp_path / "notes.txt"
    path.write_text(content)
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(path)
    assert str(path) in one_line(caught)


def test_a_directory_is_an_error_that_names_it(tmp_path):
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(tmp_path)
    assert str(tmp_path) in one_line(caught)


@pytest.mark.parametrize("band", [0, 4, -1, 10**12])
def test_a_band_that_is_not_there_is_refused_with_those_that_are(tmp_path, band):
    path = write(tmp_path / "dem.tif", np.stack([HEIGHTS] * 3))
    with rasterio.open(path, "r+") as dataset:
        dataset.set_band_description(2, "rock abundance")
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(path, height_band=band)
    text = one_line(caught)
    assert f"band={band}" in text
    assert "1, 2 rock abundance, 3" in text


# Layers


@pytest.mark.parametrize(
    ("text", "path", "band", "weight"),
    [
        ("rocks.tif", "rocks.tif", 1, 1.0),
        ("rocks.tif:3", "rocks.tif", 3, 1.0),
        ("rocks.tif*20", "rocks.tif", 1, 20.0),
        ("rocks.tif:3*2.5e-1", "rocks.tif", 3, 0.25),
        ("rocks.tif:3*0", "rocks.tif", 3, 0.0),
        ("C:/maps/rocks.tif", "C:/maps/rocks.tif", 1, 1.0),
        ("C:/maps/rocks.tif:2*3", "C:/maps/rocks.tif", 2, 3.0),
        ("a:b.tif", "a:b.tif", 1, 1.0),
        ("12:30.tif:2", "12:30.tif", 2, 1.0),
        ("a:1:2", "a:1", 2, 1.0),
        ("a*b.tif*2", "a*b.tif", 1, 2.0),
        ("a*2:1*3", "a*2", 1, 3.0),
        (":2", ":2", 1, 1.0),
    ],
)
def test_a_layer_source_is_read_from_text(text, path, band, weight):
    assert LayerSource.parse(text) == LayerSource(Path(path), band, weight)
    assert LayerSource.of(text) == LayerSource.parse(text)


@pytest.mark.parametrize(
    "text",
    ["", "a.tif*", "a.tif*heavy", "a.tif*-1", "a.tif*nan", "a.tif*inf", "a.tif:2*3*x", "a\nb*"],
)
def test_a_text_that_is_no_layer_source_is_refused_in_one_line(text):
    with pytest.raises(tp.InputError) as caught:
        LayerSource.parse(text)
    one_line(caught)


@given(st.text(max_size=12) | st.text("ab.:*1\n", max_size=8))
@settings(deadline=None, max_examples=300)
def test_any_text_is_a_layer_source_or_an_input_error(text):
    try:
        source = LayerSource.parse(text)
    except tp.InputError:
        return
    assert text.startswith(str(source.path)) or source.path == Path(text)
    assert source.weight >= 0.0


def test_a_layer_source_that_is_neither_text_nor_path_is_refused():
    with pytest.raises(tp.InputError, match="12"):
        LayerSource.of(12)


def test_layers_take_bands_weights_and_odd_file_names(tmp_path):
    odd = write(
        tmp_path / "a:1*b:2.tif",
        np.stack([HEIGHTS, 3 * HEIGHTS, 5 * HEIGHTS]),
        units=("m", "kPa", ""),
    )
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    layers = {
        "rocks": f"{odd}:2*20",
        "shade": f"{odd}:3*0.5",
        "plain": odd,
        "given": LayerSource(odd, 3, 7.0),
    }
    surface = tp.read_surface(dem, layers=layers)
    names = ["height [m]", "rocks [kPa] x 20", "shade x 0.5", "plain [m]", "given x 7"]
    assert [str(layer) for layer in surface.layers] == names
    expected = HEIGHTS[..., None] * [1, 3, 5, 1, 5]
    np.testing.assert_allclose(surface.values(centres()), expected, atol=1e-9)
    np.testing.assert_allclose(
        surface.lift(centres())[..., 2:], expected * [1, 20, 0.5, 1, 7], atol=1e-8
    )


def test_a_layer_cannot_be_called_height_again(tmp_path):
    path = write(tmp_path / "dem.tif", HEIGHTS)
    with pytest.raises(tp.InputError, match="height"):
        tp.read_surface(path, layers={"height": path})


def test_a_damaged_layer_is_named(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    with pytest.raises(tp.MapError, match=r"gone\.tif"):
        tp.read_surface(dem, layers={"rocks": tmp_path / "gone.tif"})
    with pytest.raises(tp.MapError, match="band=9"):
        tp.read_surface(dem, layers={"rocks": f"{dem}:9"})


def test_a_layer_on_another_grid_is_brought_onto_the_heights_grid(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    coarse = Affine(25.0, 0.0, 499_900.0, 0.0, -25.0, 4_000_300.0)
    places = centres(coarse, (16, 14))
    plane = 0.1 * (places[..., 0] - 5e5) - 0.2 * (places[..., 1] - 4e6)
    rocks = write(tmp_path / "rocks.tif", plane, coarse)
    surface = tp.read_surface(dem, layers={"rocks": rocks})
    wanted = centres()
    expected = 0.1 * (wanted[..., 0] - 5e5) - 0.2 * (wanted[..., 1] - 4e6)
    np.testing.assert_allclose(surface.values(wanted)[..., 1], expected, atol=1e-6)
    np.testing.assert_allclose(surface.values(wanted)[..., 0], HEIGHTS, atol=1e-10)
    assert surface.nodata is None


def test_a_layer_in_another_crs_is_brought_onto_the_heights_grid(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    lon, lat = Transformer.from_crs(UTM, 4326, always_xy=True).transform(500_050.0, 4_000_060.0)
    step = 5e-5
    degrees = Affine(step, 0, lon - 20 * step, 0, -step, lat + 20 * step)
    places = centres(degrees, (40, 40))
    rocks = write(tmp_path / "rocks.tif", 1e5 * (places[..., 0] - lon), degrees, "EPSG:4326")
    surface = tp.read_surface(dem, layers={"rocks": rocks})
    back = Transformer.from_crs(UTM, 4326, always_xy=True)
    wanted = centres()
    expected = 1e5 * (np.asarray(back.transform(wanted[..., 0], wanted[..., 1])[0]) - lon)
    assert np.ptp(expected) > 50.0
    np.testing.assert_allclose(surface.values(wanted)[..., 1], expected, atol=0.2)


def test_what_a_smaller_layer_does_not_cover_is_blocked(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    half = write(tmp_path / "half.tif", np.ones((12, 5)))
    surface = tp.read_surface(dem, layers={"rocks": half})
    assert surface.nodata.blocked[:, 6:].all()
    assert not surface.nodata.blocked[:, :5].any()


def test_layers_on_different_grids_without_a_crs_are_refused(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS, crs=None)
    same = write(tmp_path / "same.tif", 2 * HEIGHTS, crs=None)
    surface = tp.read_surface(dem, layers={"twice": same})
    np.testing.assert_allclose(surface.values(centres())[..., 1], 2 * HEIGHTS, atol=1e-10)
    other = write(tmp_path / "other.tif", HEIGHTS, NORTH_UP @ Affine.translation(1, 0), crs=None)
    with pytest.raises(tp.MapError, match="no CRS"):
        tp.read_surface(dem, layers={"shifted": other})


# Coordinate reference systems


def geographic(tmp_path, crs="EPSG:4326", at=(15.0, 46.0), step=0.002, shape=(100, 120)):
    transform = Affine(step, 0.0, at[0], 0.0, -step, at[1])
    places = centres(transform, shape)
    heights = 300 + 100 * np.sin(40 * places[..., 0]) * np.cos(30 * places[..., 1])
    return write(tmp_path / "dem.tif", heights, transform, crs), places, heights


@pytest.mark.parametrize("at", [(15.0, 46.0), (-84.3, 36.7), (170.0, -43.0), (20.0, 0.1)])
def test_a_map_in_degrees_is_planned_in_metres_that_agree_with_the_ellipsoid(tmp_path, at):
    path, _, _ = geographic(tmp_path, at=at)
    surface = tp.read_surface(path)
    assert surface.unit == "m"
    assert surface.layers[0].unit == "m"
    random = np.random.default_rng(2)
    a, b = random.uniform(surface.bounds[:2], surface.bounds[2:], (2, 100, 2))
    degrees_a, degrees_b = map(surface.georeference.to_lonlat, (a, b))
    _, _, exact = Geod(ellps="WGS84").inv(*degrees_a.T, *degrees_b.T)
    np.testing.assert_allclose(np.hypot(*(b - a).T), exact, rtol=1e-4)
    assert np.hypot(*(b - a).T).max() > 10_000.0
    assert (np.abs(degrees_a - at) < 0.25).all()


def test_lonlat_and_back_is_where_one_was(tmp_path):
    path, _, _ = geographic(tmp_path)
    georeference = tp.read_surface(path).georeference
    lonlat = np.random.default_rng(0).uniform((15.0, 45.8), (15.24, 46.0), (50, 2))
    plane = georeference.from_map(lonlat)
    assert np.abs(plane).max() > 1000.0
    np.testing.assert_allclose(georeference.to_lonlat(plane), lonlat, rtol=0, atol=1e-9)
    np.testing.assert_allclose(georeference.to_map(plane), lonlat, rtol=0, atol=1e-9)


def test_a_map_in_degrees_keeps_its_heights(tmp_path):
    path, places, heights = geographic(tmp_path)
    surface = tp.read_surface(path)
    inner = np.s_[10:-10, 10:-10]
    plane = surface.georeference.from_map(places[inner])
    np.testing.assert_allclose(surface.values(plane)[..., 0], heights[inner], atol=0.25)
    assert np.ptp(heights[inner]) > 150.0


def test_longitudes_and_latitudes_are_of_wgs_84_whatever_the_maps_datum(tmp_path):
    path, _, _ = geographic(tmp_path, crs="EPSG:4267", at=(-84.3, 36.7))  # NAD 27
    georeference = tp.read_surface(path).georeference
    places = np.random.default_rng(0).uniform((-84.2, 36.55), (-84.1, 36.65), (20, 2))
    expected = Transformer.from_crs(4267, 4326, always_xy=True).transform(*places.T)
    found = georeference.to_lonlat(georeference.from_map(places))
    np.testing.assert_allclose(found, np.stack(expected, axis=-1), rtol=0, atol=1e-7)


def test_a_projected_map_is_planned_in_its_own_crs(tmp_path):
    georeference = tp.read_surface(write(tmp_path / "dem.tif", HEIGHTS)).georeference
    assert georeference.crs == CRS(UTM)
    place = np.array([500_050.0, 4_000_060.0])
    np.testing.assert_array_equal(georeference.to_map(place), place)
    expected = Transformer.from_crs(UTM, 4326, always_xy=True).transform(*place)
    np.testing.assert_allclose(georeference.to_lonlat(place), expected, rtol=0, atol=1e-12)


def test_heights_without_a_unit_are_metres_only_on_a_plane_in_metres(tmp_path):
    transform = Affine(10.0, 0.0, 6.5e6, 0.0, -10.0, 2e6)
    feet = write(tmp_path / "feet.tif", HEIGHTS, transform, "EPSG:2225")
    with pytest.warns(tp.MapWarning, match="without a unit, and are taken to be in ft"):
        surface = tp.read_surface(feet)
    assert surface.unit == "ft"
    assert surface.layers[0].unit == "ft"


@pytest.mark.parametrize("crs", [UTM, None], ids=["projected", "no CRS"])
@pytest.mark.parametrize("degrees", [90.0, 30.0, 180.0, -75.0])
def test_a_turned_map_is_brought_upright(tmp_path, crs, degrees):
    turned = (
        Affine.translation(500_300, 4_000_300) @ Affine.rotation(degrees) @ Affine.scale(10, -10)
    )
    places = centres(turned, (40, 30))
    plane = 0.1 * (places[..., 0] - 500_300) - 0.05 * (places[..., 1] - 4_000_300)
    surface = tp.read_surface(write(tmp_path / "dem.tif", plane, turned, crs))
    assert surface.layers[0].unit == ("m" if crs else "")
    inner = places[9:-9, 9:-9]  # away from the corners that it does not cover
    expected = 0.1 * (inner[..., 0] - 500_300) - 0.05 * (inner[..., 1] - 4_000_300)
    np.testing.assert_allclose(surface.values(inner)[..., 0], expected, atol=1e-3)
    if surface.nodata is not None:
        assert not any(is_blocked(surface.nodata, place) for place in inner.reshape(-1, 2))


def test_a_map_without_a_crs_is_planned_on_without_units(tmp_path):
    surface = tp.read_surface(write(tmp_path / "dem.tif", HEIGHTS, crs=None))
    assert surface.georeference is None
    assert surface.unit == ""
    assert surface.layers[0].unit == ""
    np.testing.assert_allclose(surface.values(centres())[..., 0], HEIGHTS, atol=1e-10)


def test_an_extent_is_that_of_the_outer_edges_of_the_cells():
    raster = Raster.from_extent(HEIGHTS[None], (0.0, 0.0, 100.0, 120.0), UTM)
    surface = raster.to_surface(names=["height"])
    assert surface.bounds == (5.0, 5.0, 95.0, 115.0)
    assert surface.values((5.0, 115.0))[0] == pytest.approx(HEIGHTS[0, 0])
    assert not raster.needs_warp()


def test_a_crs_that_is_none_is_refused():
    with pytest.raises(tp.MapError) as caught:
        Georeference.from_projected("EPSG:999999")
    assert "EPSG:999999" in one_line(caught)


# Real maps


@pytest.mark.parametrize(
    ("name", "band", "columns", "rows", "cell"),
    [("herodotus_mons", 2, 256, 191, 53.634071), ("aristarchus_plateau", 3, 256, 244, 214.023094)],
)
def test_a_real_map_of_the_moon_is_read(name, band, columns, rows, cell):
    path = REAL_MAPS / f"{name}.tif"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    surface = tp.read_surface(path, height_band=band, layers={"rocks": f"{path}:{band + 1}*1000"})
    assert surface.georeference.name == "the map's own Orthographic projection"
    assert surface.unit == "m"
    assert [str(layer) for layer in surface.layers] == ["height [m]", "rocks x 1000"]
    assert surface.bounds.width == pytest.approx((columns - 1) * cell)
    assert surface.bounds.height == pytest.approx((rows - 1) * cell)
    assert surface.resolution == pytest.approx(cell)
    assert not surface.georeference.is_earth
    with rasterio.open(path) as dataset:
        assert rasterio.crs.CRS.from_wkt(surface.georeference.crs.to_wkt()) == dataset.crs
        stored = dataset.read([band, band + 1]).astype(float)
        places = centres(dataset.transform, dataset.shape)
    missing = ~np.isfinite(stored).all(axis=0)
    if missing.any():
        np.testing.assert_array_equal(surface.nodata.blocked[::-1], missing)
    else:
        assert surface.nodata is None
    found = surface.values(np.clip(places, surface.bounds[:2], surface.bounds[2:]))
    np.testing.assert_allclose(found[~missing], stored[:, ~missing].T, atol=1e-6)
    assert 200.0 < np.ptp(stored[0][~missing]) < 5000.0
    lonlat = surface.georeference.to_lonlat(np.array([0.0, 0.0]))
    assert lonlat == pytest.approx(
        np.array({2: (-52.957024, 27.489461), 3: (-47.230128, 23.824139)}[band])
    )
