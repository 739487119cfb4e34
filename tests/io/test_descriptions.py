"""What maps say of themselves in ways that are easily missed: alpha, units, order, pictures."""

from pathlib import Path

import h5netcdf
import numpy as np
import pytest
import rasterio
import xarray
from rasterio.enums import ColorInterp

import terrapath as tp
from rasters import HEIGHTS, UTM, centres, write

CASES = Path(__file__).parents[3] / "shared" / "cases"

# Alpha


@pytest.mark.parametrize("bands", [2, 3, 4, 5])
@pytest.mark.parametrize("alpha", [1, 2, 3, 4, 5])
def test_where_alpha_is_0_there_is_no_data_in_whatever_band_it_is(tmp_path, bands, alpha):
    if alpha > bands:
        pytest.skip("there is no such band")
    values = np.full((bands, 12, 10), 7, np.uint16)
    heights = 2 if alpha == 1 else 1
    values[heights - 1] = 500 + np.round(HEIGHTS)
    values[alpha - 1] = 65535
    values[alpha - 1, 3:5, 6] = 0
    values[alpha - 1, 8, 2] = 1  # nearly transparent, and yet there
    path = write(tmp_path / "dem.tif", values, photometric="minisblack")
    with rasterio.open(path, "r+") as dataset:
        kinds = [ColorInterp.gray] + [ColorInterp.undefined] * (bands - 1)
        kinds[alpha - 1] = ColorInterp.alpha
        dataset.colorinterp = kinds
    surface = tp.read_surface(path, height_band=heights)
    assert surface.nodata.blocked.sum() == 2
    with pytest.raises(tp.MapError, match="is its alpha"):
        tp.read_surface(path, height_band=alpha)


@pytest.mark.parametrize("name", ["a3.tif", "a5.tif"])
def test_maps_with_alpha_that_were_seen(name):
    if not (CASES / name).exists():
        pytest.skip("the map is not here")
    surface = tp.read_surface(CASES / name)
    with pytest.raises(tp.BlockedError):
        tp.Problem(surface, (500_330.0, 4_000_370.0), (500_030.0, 4_000_030.0))


# Units of coordinates


def array_in(unit, metres, crs=None):
    """A ramp of 0.3 along x on cells of 10 m, with coordinates in another unit."""
    x, y = 500_005 + 10.0 * np.arange(30), 4_000_005 + 10.0 * np.arange(20)
    attributes = {
        axis: {"units": unit, "standard_name": f"projection_{axis}_coordinate"} for axis in "xy"
    }
    array = xarray.DataArray(
        np.tile(0.3 * (x - 500_005), (20, 1)),
        {a: (a, v / metres, attributes[a]) for a, v in (("y", y), ("x", x))},
        ("y", "x"),
        name="height",
        attrs={"units": "m"},
    )
    if crs is None:
        return array
    array.attrs["grid_mapping"] = "place"
    wkt = rasterio.crs.CRS.from_user_input(crs).to_wkt()
    return array.assign_coords(place=((), 0, {"crs_wkt": wkt}))


UNITS = [("km", 1000.0), ("m", 1.0), ("metres", 1.0), ("cm", 0.01), ("ft", 0.3048), ("", 1.0)]


@pytest.mark.parametrize(("unit", "metres"), UNITS)
@pytest.mark.parametrize("kind", ["own CRS", "given CRS", "NETCDF4", "NETCDF3_CLASSIC"])
def test_coordinates_count_in_their_own_unit(tmp_path, unit, metres, kind):
    own = kind in {"own CRS", "NETCDF4"} or None
    source = array_in(unit, metres, own and UTM)
    if kind.startswith("NETCDF"):
        source.to_netcdf(tmp_path / "dem.nc", format=kind)
        source = tmp_path / "dem.nc"
    surface = tp.read_surface(source, crs=None if own else UTM, smoothing=None)
    ends = np.array([[500_015.0, 4_000_105.0], [500_265.0, 4_000_105.0]]) / metres
    problem = tp.Problem(surface, *ends)
    length = tp.plan(problem, "dijkstra").length * metres
    assert length == pytest.approx(250.0 * np.hypot(1.0, 0.3), rel=1e-4)
    place = surface.georeference.to_lonlat(np.array([500_000.0, 4_000_000.0]) / metres)
    assert place == pytest.approx([15.0, 36.14471809881776], abs=1e-9)  # on the central meridian


@pytest.mark.parametrize("unit", ["rad", "furlongs", "degrees_east", "K"])
def test_coordinates_that_the_crs_cannot_have_are_refused(unit):
    with pytest.raises(tp.MapError, match="coordinates in") as caught:
        tp.read_surface(array_in(unit, 1.0), crs=UTM)
    assert repr(unit) in str(caught.value)


def test_coordinates_in_two_units_are_refused():
    array = array_in("km", 1000.0)
    array["y"].attrs["units"] = "m"
    with pytest.raises(tp.MapError, match="'km' and 'm'"):
        tp.read_surface(array, crs=UTM)


def test_heights_are_brought_into_the_unit_of_coordinates_without_a_crs():
    surface = tp.read_surface(array_in("km", 1000.0), smoothing=None)
    assert surface.layers[0].unit == "km"
    assert surface.gradients(np.array([[500.1, 4000.1]])).ravel()[0] == pytest.approx(0.3, rel=1e-6)


# The order of dimensions


def lon_lat(path, dimensions, height):
    """A netCDF-4 file whose variable has its dimensions in this order."""
    lon, lat = np.linspace(44.0, 44.6, 31), np.linspace(45.0, 45.4, 25)
    axes = {"lon": lon, "lat": lat, "time": np.zeros(1)}
    grids = dict(zip(("lon", "lat"), np.meshgrid(lon, lat, indexing="ij"), strict=True))
    values = height(grids["lon"], grids["lat"])
    values = np.transpose(values[..., None], [["lon", "lat", "time"].index(d) for d in dimensions])
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {name: len(axes[name]) for name in dimensions}
        for name, standard, unit in (
            ("lon", "longitude", "degrees_east"),
            ("lat", "latitude", "degrees_north"),
        ):
            axis = file.create_variable(name, (name,), "f8", data=axes[name])
            axis.attrs["standard_name"], axis.attrs["units"] = standard, unit
        file.create_variable("elevation", dimensions, "f8", data=values).attrs["units"] = "m"
    return path


@pytest.mark.parametrize(
    "dimensions",
    [
        ("time", "lat", "lon"),
        ("time", "lon", "lat"),
        ("lon", "lat", "time"),
        ("lat", "lon", "time"),
    ],
)
@pytest.mark.parametrize("prefix", ["", "netcdf:"])
def test_dimensions_are_known_by_name_and_not_by_order(tmp_path, dimensions, prefix):
    path = lon_lat(
        tmp_path / "dem.nc", dimensions, lambda lon, lat: 900.0 * (lon - 44.0) + 10.0 * (lat - 45.0)
    )
    source = f'netcdf:"{path}":elevation' if prefix else path
    surface = tp.read_surface(source, crs="EPSG:4326", smoothing=None)
    places = np.array([[44.1, 45.3], [44.5, 45.1]])
    found = surface.values(surface.georeference.from_lonlat(places))[..., 0]
    np.testing.assert_allclose(found, [93.0, 451.0], atol=0.5)


# Units of heights, and pictures


@pytest.mark.parametrize("unit", ["hPa", "degrees", "DN", "percent"])
def test_heights_in_an_unknown_unit_are_told(tmp_path, unit):
    path = write(tmp_path / "dem.tif", HEIGHTS, units=(unit,))
    with pytest.warns(tp.MapWarning, match=f"'{unit}', which is not a known unit"):
        tp.read_surface(path)
    tp.read_surface(path, height_unit="m")


def test_a_unit_that_is_given_counts(tmp_path):
    surface = tp.read_surface(write(tmp_path / "dem.tif", HEIGHTS), height_unit="ft")
    found = surface.values(centres())[..., 0]
    np.testing.assert_allclose(found, 0.3048 * HEIGHTS, atol=1e-9)
    metres = write(tmp_path / "metres.tif", HEIGHTS, units=("m",))
    with pytest.raises(tp.InputError, match="contradicts"):
        tp.read_surface(metres, height_unit="ft")
    with pytest.raises(tp.InputError, match="not a known unit"):
        tp.read_surface(metres, height_unit="furlong")


def test_eight_bits_are_told_of_unless_they_are_said_to_be_heights(tmp_path):
    shade = np.random.default_rng(1).integers(0, 255, (12, 10)).astype(np.uint8)
    path = write(tmp_path / "shade.tif", shade)
    with pytest.warns(tp.MapWarning, match="8-bit"):
        tp.read_surface(path, smoothing=None)
    tp.read_surface(path, smoothing=None, height_unit="m")
    tp.read_surface(write(tmp_path / "dem.tif", shade, units=("m",)), smoothing=None)
    tp.read_surface(path, smoothing=None, height_range=(0, 10))


# Large coordinates


@pytest.mark.parametrize("far", [0.0, 1e6, 1e9, -1e9])
def test_routes_do_not_depend_on_how_large_coordinates_are(far):
    x, y = np.arange(40.0), np.arange(30.0)
    heights = 3.0 * np.sin(x / 5) * np.cos(y[:, None] / 4)
    near = tp.plan(tp.Problem(tp.read_surface((heights, x, y)), (3, 4), (35, 22)), "dijkstra")
    surface = tp.read_surface((heights, x + far, y + far), smoothing=None)
    moved = tp.plan(tp.Problem(surface, (3 + far, 4 + far), (35 + far, 22 + far)), "dijkstra")
    assert moved.length == pytest.approx(near.length, rel=1e-5)


def test_coordinates_that_were_rounded_away_are_refused_with_the_reason():
    x = (1e9 + np.arange(40.0)).astype(np.float32)  # all in one or two numbers
    with pytest.raises(tp.MapError, match="32-bit"):
        tp.read_surface((np.zeros((30, 40)), x, np.arange(30.0)))
