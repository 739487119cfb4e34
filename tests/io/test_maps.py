"""Maps of every form give the surface that their numbers describe."""

import numpy as np
import pytest
import rasterio
import xarray
from pyproj import CRS, Transformer
from rasterio import Affine

import terrapath as tp
from common import REAL_MAPS, one_line
from rasters import HEIGHTS, NORTH_UP, UTM, centres, write
from terrains import TRUTH, WGS84, as_dataarray, netcdf, terrain

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

# What is told of such maps has tests of its own.
TOLD = pytest.mark.filterwarnings("ignore::terrapath.MapWarning")


def length_on(surface):
    """Length of the shortest path between two fixed places on Earth."""
    ends = np.array([[-3500.0, -3000.0], [3600.0, 3100.0]])
    to_plane = Transformer.from_crs(TRUTH, surface.georeference.crs, always_xy=True)
    start, goal = np.stack(to_plane.transform(*ends.T), axis=-1)
    problem = tp.Problem(surface, start, goal)
    found = tp.plan(problem, "fast-marching")
    return tp.refine(problem, found.path).length


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
    lengths["netcdf"] = length_on(tp.read_surface(netcdf(tmp_path / "dem.nc", array)))
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


def test_a_netcdf_file_that_gdal_cannot_place_is_read_by_the_names_of_its_dimensions(tmp_path):
    array = as_dataarray(HEIGHTS, NORTH_UP, UTM)
    array.to_netcdf(tmp_path / "dem.nc", engine="h5netcdf")
    for source in (tmp_path / "dem.nc", xarray.open_dataset(tmp_path / "dem.nc")):
        surface = tp.read_surface(source)
        np.testing.assert_allclose(surface.values(centres())[..., 0], HEIGHTS, atol=1e-9)
    array.rename(x="a", y="b").to_netcdf(tmp_path / "names.nc", engine="h5netcdf")
    with pytest.raises(tp.MapError, match="none is known as x") as caught:
        tp.read_surface(tmp_path / "names.nc")
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
        pytest.param(UTM, "DN", 1.0, "DN", marks=TOLD),
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
    path = netcdf(tmp_path / "maps.nc", dataset)
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
    path = REAL_MAPS / name
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
