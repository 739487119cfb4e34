"""Routes as files: right in content, whole or not there at all."""

import csv
import json
import shutil

import numpy as np
import pytest
import rasterio
import shapely
from pyproj import CRS, Transformer

import terrapath as tp
from common import REAL_MAPS
from terrapath._support.files import require_writable, written_whole


@pytest.fixture(scope="module")
def solution():
    return tp.RRTStar(samples=1000).solve(tp.scenes.load("jacksboro"))


def test_geojson_is_read_by_shapely_as_the_same_line(solution, tmp_path):
    tp.write_route(solution, tmp_path / "route.geojson")
    line = shapely.get_parts(shapely.from_geojson((tmp_path / "route.geojson").read_text()))[0]
    reference = solution.problem.surface.georeference
    back = reference.from_map(shapely.get_coordinates(line))
    assert np.abs(back[[0, -1]] - solution.path.points[[0, -1]]).max() < 1e-3  # a millimetre
    off = shapely.hausdorff_distance(shapely.LineString(back), solution.path.line, densify=0.01)
    assert off < 0.1 * solution.problem.surface.resolution


def test_geojson_without_crs_keeps_the_plane(tmp_path):
    solution = tp.RRTStar(samples=300).solve(tp.scenes.load("one-peak"))
    tp.write_route(solution, tmp_path / "route.geojson")
    feature = json.loads((tmp_path / "route.geojson").read_text())["features"][0]
    line = shapely.LineString(feature["geometry"]["coordinates"])
    assert shapely.hausdorff_distance(line, solution.path.line, densify=0.01) < 0.12
    assert "without CRS" in feature["properties"]["coordinates"]


@pytest.fixture(scope="module")
def finished():
    problem = tp.scenes.load("one-peak")
    return tp.plan(problem, samples=300, refine=True, bound=True)


def test_records_tell_the_bound_and_the_planners_own_length(finished, tmp_path):
    for suffix in (".json", ".geojson"):
        tp.write_route(finished, tmp_path / f"route{suffix}")
    record = json.loads((tmp_path / "route.json").read_text())
    (feature,) = json.loads((tmp_path / "route.geojson").read_text())["features"]
    for found in (record, feature["properties"]):
        assert found["length"] == finished.length
        assert found["unrefined_length"] == finished.unrefined.length > finished.length
        assert found["lower_bound"] == finished.lower_bound
        assert found["gap"] == finished.gap
    assert record["path"] == finished.path.points.tolist()
    assert len(feature["geometry"]["coordinates"]) == feature["properties"]["points"]


def test_what_was_not_asked_for_is_null_in_records(solution, tmp_path):
    tp.write_route(solution, tmp_path / "route.geojson")
    (feature,) = json.loads((tmp_path / "route.geojson").read_text())["features"]
    for key in ("unrefined_length", "lower_bound", "gap"):
        assert feature["properties"][key] is None


# Distance fields


@pytest.fixture(scope="module")
def walled():
    """A field whose goal's side is walled off, on nodes 0.25 apart."""
    surface = tp.scenes.load("one-peak").surface
    wall = shapely.LineString([(7, -1), (7, 11)])
    return tp.distance_field(
        surface, (1, 2), bounds=(-1, -1, 11, 9), obstacles=[wall], spacing=0.25
    )


def test_a_field_comes_back_from_a_geotiff_as_it_was(walled, tmp_path):
    tp.write_field(walled, tmp_path / "field.tif")
    with rasterio.open(tmp_path / "field.tif") as dataset:
        values = dataset.read(1)
        rows, columns = np.indices(values.shape)
        x, y = dataset.transform * (columns + 0.5, rows + 0.5)
        assert dataset.crs is None
        assert dataset.descriptions == ("distance",)
        assert np.isnan(dataset.nodata)
        assert dataset.profile["compress"] == "deflate"
        assert dataset.tags()["source_x1"] == "1.0"
    lattice = walled.lattice
    expected = np.broadcast_to(lattice.x, values.shape)
    np.testing.assert_allclose(x, expected, atol=1e-12)
    np.testing.assert_allclose(y, np.broadcast_to(lattice.y[::-1, None], values.shape), atol=1e-12)
    np.testing.assert_array_equal(np.isnan(values), np.isinf(walled.values[::-1]))
    np.testing.assert_array_equal(np.nan_to_num(values, nan=np.inf), walled.values[::-1])
    assert np.isnan(values[x > 7]).all()
    assert np.isfinite(values[x < 6.9]).all()
    assert [path.name for path in tmp_path.iterdir()] == ["field.tif"]


def test_a_field_comes_back_from_an_archive_as_it_was(walled, tmp_path):
    tp.write_field(walled, tmp_path / "field.npz")
    with np.load(tmp_path / "field.npz") as archive:
        np.testing.assert_array_equal(archive["distance"], walled.values)
        np.testing.assert_array_equal(archive["x"], walled.lattice.x)
        np.testing.assert_array_equal(archive["y"], walled.lattice.y)
        assert archive["source"].tolist() == [1.0, 2.0]
        assert str(archive["crs"]) == ""


def test_a_field_on_a_map_is_read_back_in_its_place(tmp_path):
    problem = tp.scenes.load("jacksboro")
    surface = problem.surface
    field = tp.distance_field(surface, problem.start, spacing=500.0)
    j, i = 10, 40  # far from the middle: a file turned or mirrored would show
    tp.write_field(field, tmp_path / "field.tif")
    with rasterio.open(tmp_path / "field.tif") as dataset:
        assert dataset.units == ("m",)
        assert dataset.descriptions == ("distance (m)",)
        found = next(dataset.sample([field.lattice.points[j, i]])).item()
        crs = CRS.from_wkt(dataset.crs.to_wkt())
    assert np.isfinite(found)
    assert found == field.values[j, i]
    there = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(*problem.goal)
    assert there == pytest.approx(tp.scenes.JACKSBORO_GOAL, abs=1e-7)
    # Its heights are distances: the file is a map again.
    again = tp.read_surface(tmp_path / "field.tif")
    assert again.georeference.is_map_crs


def test_a_failure_while_a_field_is_written_leaves_nothing(walled, tmp_path, monkeypatch):
    with pytest.raises(tp.MapError, match=r"field.csv.*\.tif"):
        tp.write_field(walled, tmp_path / "field.csv")

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", fail)
    with pytest.raises(tp.MapError, match="No space left"):
        tp.write_field(walled, tmp_path / "field.tif")
    assert list(tmp_path.iterdir()) == []


# Routes again


def test_csv_is_the_profile(solution, tmp_path):
    tp.write_route(solution, tmp_path / "route.csv", simplify=0.0)
    with (tmp_path / "route.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    profile = solution.path.profile
    assert [float(row["distance [m]"]) for row in rows] == profile.distance.tolist()
    assert [float(row["height [m]"]) for row in rows] == profile.values[:, 0].tolist()


def test_the_profile_adds_up(solution):
    profile = solution.path.profile
    assert profile.distance[-1] == pytest.approx(solution.length, rel=1e-9)
    rises = np.diff(profile.values[:, 0])
    assert solution.path.climb == pytest.approx(rises[rises > 0].sum(), rel=1e-2)
    assert solution.path.climb >= rises[rises > 0].sum()
    net = profile.values[-1, 0] - profile.values[0, 0]
    assert solution.path.climb >= max(net, 0.0)


def test_a_tilted_plane_is_climbed_by_its_slope():
    surface = tp.Surface.from_function(lambda x, y: 0.3 * x, (0, 0, 10, 10))
    path = tp.Problem(surface, (1, 1), (9, 5)).path([(1, 1), (9, 5)])
    assert path.climb == pytest.approx(0.3 * 8, abs=1e-9)
    assert path.length == pytest.approx(np.hypot(np.hypot(8, 4), 2.4), rel=1e-12)


def test_lunar_routes_are_written_in_degrees_of_the_moon(tmp_path):
    lunar = REAL_MAPS / "herodotus_mons.tif"
    if not lunar.exists():
        pytest.skip("the lunar map is not here")
    surface = tp.read_surface(lunar, height_band=2)
    solution = tp.RRTStar(samples=500).solve(tp.Problem(surface, (-5000, -3500), (5000, 3500)))
    tp.write_route(solution, tmp_path / "route.geojson")
    feature = json.loads((tmp_path / "route.geojson").read_text())["features"][0]
    longitude, latitude = np.array(feature["geometry"]["coordinates"]).T
    assert ((longitude > -53.3) & (longitude < -52.6)).all()
    assert ((latitude > 27.2) & (latitude < 27.8)).all()
    assert "WGS" not in feature["properties"]["coordinates"]


def test_a_failure_while_writing_leaves_the_old_file_and_no_rest(tmp_path):
    target = tmp_path / "route.csv"
    target.write_text("old")

    def fail():
        with written_whole(target) as temporary:
            temporary.write_text("half of the new")
            raise RuntimeError("half")

    with pytest.raises(RuntimeError, match="half"):
        fail()
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["route.csv"]


def test_a_full_disk_is_told_in_one_line(tmp_path):
    with (
        pytest.raises(tp.MapError, match="could not be written"),
        written_whole(tmp_path / "a.csv"),
    ):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_told_in_one_line_that_names_the_output(tmp_path):
    place = tmp_path / "no" / "such.csv"
    with pytest.raises(tp.MapError, match=r"such\.csv could not be written: No such file"):
        write_text(place)


def write_text(path):
    with written_whole(path) as temporary:
        temporary.write_text("new")


def test_a_name_of_any_length_that_a_file_can_have_is_written(tmp_path):
    longest = tmp_path / ("a" * 251 + ".csv")
    require_writable(longest)
    write_text(longest)
    assert longest.read_text() == "new"
    longer = tmp_path / ("a" * 252 + ".csv")
    with pytest.raises(tp.MapError, match="cannot be written: File name too long"):
        require_writable(longer)
    with pytest.raises(tp.MapError, match="could not be written: File name too long"):
        write_text(longer)
    assert [path.name for path in tmp_path.iterdir()] == [longest.name]


def test_a_folder_in_the_place_of_an_output_is_told_in_one_line(tmp_path):
    (tmp_path / "route.csv").mkdir()
    with pytest.raises(tp.MapError, match=r"route\.csv could not be written"):
        write_text(tmp_path / "route.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["route.csv"]


def test_looking_whether_a_file_can_be_written_leaves_nothing(tmp_path):
    require_writable(tmp_path / "new.csv")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(tp.MapError, match="directory"):
        require_writable(tmp_path)
    with pytest.raises(tp.MapError, match="cannot be written"):
        require_writable(tmp_path / "no" / "such.csv")


def test_a_solution_without_a_path_is_not_written(tmp_path):
    nothing = tp.RRTStar(samples=5, step=0.1, informed=False).solve(tp.scenes.load("one-peak"))
    with pytest.raises(tp.MapError, match="no path"):
        tp.write_route(nothing, tmp_path / "route.csv")
    shutil.rmtree(tmp_path / "none", ignore_errors=True)
    assert list(tmp_path.iterdir()) == []
