"""Round trips: a route written in each format is read back by that format's own library."""

import csv
import json
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import geopandas
import gpxpy
import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from hypothesis import given, settings, strategies as st
from pyproj import CRS, Geod, Transformer
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

import terrapath as tp
from common import made_up
from terrapath._support.files import SHAPEFILE_PARTS, folder_written_whole, require_writable
from terrapath.io.routes import WRITERS, require_fitting_format
from terrapath.io.routes.places import parts_in_degrees
from terrapath.io.routes.profile import distinct, headings, slopes
from terrapath.surface.georeference import Georeference, local_projection

MOON = CRS.from_proj4("+proj=eqc +lat_ts=27.5 +lon_0=-53 +R=1737400 +units=m +no_defs")
# Planes, each with a place on it, map units: projected, in degrees, in feet, at the date line.
UTM = Georeference.from_projected("EPSG:32616")
TENNESSEE = Georeference(local_projection(CRS("EPSG:4326"), -84.25, 36.6), CRS("EPSG:4326"))
FEET = Georeference.from_projected("EPSG:2274")
FIJI = Georeference.from_projected("EPSG:3460")
LUNAR = Georeference(MOON, MOON)
PLANES = {
    "utm": (UTM, (740_000.0, 4_050_000.0)),
    "degrees": (TENNESSEE, (0.0, 0.0)),
    "feet": (FEET, (2_500_000.0, 700_000.0)),
    "fiji": (FIJI, (2_140_000.0, 4_000_000.0)),
    "moon": (LUNAR, (100_000.0, 830_000.0)),
    "none": (None, (0.0, 0.0)),
}
UNITS = {"utm": "m", "degrees": "m", "feet": "ft", "fiji": "m", "moon": "m"}
ON_EARTH = ("utm", "degrees", "feet", "fiji")
SIDE = 40_000.0  # map units: half of a region's side


def surface_on(plane, *, names=("height", "rocks"), units=("m", "")):
    """Waves, and a second layer that grows to the east."""
    reference, (x0, y0) = PLANES[plane]
    axis = np.linspace(-SIDE, SIDE, 33)
    x, y = np.meshgrid(axis, axis)
    layers = np.stack([500 + 300 * np.sin(x / 9000) * np.cos(y / 7000), x / SIDE])
    return tp.Surface.from_grid(
        layers[: len(names)], axis + x0, axis + y0, names=names, units=units, georeference=reference
    )


SURFACES = {plane: surface_on(plane) for plane in PLANES}


def solved(surface, points, **changes):
    problem = tp.Problem(surface, points[0], points[-1], name="made up")
    given = {"planner": "rrt-star-r", "seconds": 0.5, "seed": 3, "samples": 10, **changes}
    return made_up(problem, points, **given)


def route_on(plane, seed=0, count=7):
    """A wandering route, its points a few kilometres apart."""
    random = np.random.default_rng(seed)
    offsets = random.uniform(-0.95 * SIDE, 0.95 * SIDE, (count, 2))
    return solved(SURFACES[plane], offsets + PLANES[plane][1], lower_bound=1000.0)


def written(solution, folder, ending, **options):
    path = folder / f"route{ending}"
    tp.write_route(solution, path, **options)
    return path


def written_fully(solution, folder, ending):
    """With all points of the profile."""
    return written(solution, folder, ending, simplify=0.0)


def degrees_by_pyproj(plane, points):
    """Independently: longitude and latitude of plane coordinates."""
    reference = PLANES[plane][0]
    target = "EPSG:4326" if plane in ON_EARTH else reference.crs.geodetic_crs
    transformer = Transformer.from_crs(reference.crs, target, always_xy=True)
    return np.column_stack(transformer.transform(*np.asarray(points).T))


def metres_apart(a, b):
    """(m,): between places in degrees, on the ellipsoid."""
    return Geod(ellps="WGS84").inv(*np.asarray(a).T, *np.asarray(b).T)[2]


def metres_to_line(plane, lonlat, line):
    """How far places in degrees are from a route of the plane, plane units."""
    reference = PLANES[plane][0]
    points = reference.from_lonlat(np.asarray(lonlat))
    return shapely.distance(shapely.points(points), line)


seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=8, deadline=None)


# GeoJSON


def geojson_feature(path):
    return json.loads(path.read_text())["features"][0]


@pytest.mark.parametrize("plane", ON_EARTH)
@given(seed=seeds)
@few
def test_geojson_goes_through_the_points_where_pyproj_says_they_are(plane, seed, tmp_path_factory):
    solution = route_on(plane, seed)
    path = written_fully(solution, tmp_path_factory.mktemp("r"), ".geojson")
    geometry = shapely.from_geojson(json.dumps(geojson_feature(path)["geometry"]))
    places = shapely.get_coordinates(geometry)
    assert np.abs(places[:, 0]).max() <= 180.0
    expected = degrees_by_pyproj(plane, solution.path.points)
    nearest = [metres_apart(places, np.tile(place, (len(places), 1))).min() for place in expected]
    assert max(nearest) < 1e-3
    assert metres_apart(places[[0, -1]], expected[[0, -1]]).max() < 1e-3


@pytest.mark.parametrize("plane", ["utm", "degrees", "fiji", "moon"])
@given(seed=seeds)
@few
def test_straight_lines_of_a_geojson_stay_within_a_metre_of_the_route(plane, seed):
    points = route_on(plane, seed, count=4).path.points
    line = shapely.LineString(points)
    for part in parts_in_degrees(PLANES[plane][0], points):
        # A dense walk along the straight lines in degrees.
        walk = shapely.get_coordinates(shapely.segmentize(shapely.LineString(part.lonlat), 0.002))
        assert metres_to_line(plane, walk, line).max() < 1.0


def test_short_legs_get_no_points_that_the_planner_did_not_give():
    points = np.array([(0, 0), (900, 500), (1500, -300)], float)
    (part,) = parts_in_degrees(TENNESSEE, points)
    assert part.points.tolist() == points.tolist()


def test_a_route_over_the_antimeridian_is_cut_there(tmp_path):
    _, (_, y0) = PLANES["fiji"]
    back, _ = FIJI.from_lonlat(np.array([[180.0, -17.0], [-179.9, -17.0]]))
    ends = [(back[0] - 9000, y0), (back[0] + 9000, y0 + 4000), (back[0] - 9000, y0 + 8000)]
    solution = solved(SURFACES["fiji"], np.array(ends))
    feature = geojson_feature(written(solution, tmp_path, ".geojson"))
    assert feature["geometry"]["type"] == "MultiLineString"
    parts = [np.array(part) for part in feature["geometry"]["coordinates"]]
    assert len(parts) == 3
    assert [np.sign(part[:, 0].mean()) for part in parts] == [1, -1, 1]
    assert [parts[0][-1, 0], parts[1][0, 0], parts[1][-1, 0], parts[2][0, 0]] == [
        180, -180, -180, 180,
    ]  # fmt: skip
    for a, b in pairwise(parts):
        assert a[-1, 1] == b[0, 1]
    heights = feature["properties"]["heights"]
    assert [len(part) for part in heights] == [len(part) for part in parts]
    assert heights[0][-1] == heights[1][0]
    # The parts together are as long as the route on the plane, to the scale of the projection.
    together = sum(Geod(ellps="WGS84").line_length(*part.T) for part in parts)
    assert together == pytest.approx(solution.path.line.length, rel=1e-3)


def test_a_route_that_only_touches_the_antimeridian_is_one_line():
    (x, y), _ = FIJI.from_lonlat(np.array([[180.0, -17.0], [-179.9, -17.0]]))
    parts = parts_in_degrees(FIJI, np.array([(x - 4000, y), (x, y), (x - 4000, y + 3000)]))
    assert all(len(np.unique(part.lonlat, axis=0)) > 1 for part in parts)
    assert min(part.lonlat[:, 0].min() for part in parts) > 179


def test_a_route_past_a_pole_keeps_near_the_pole():
    polar = Georeference.from_projected("EPSG:3031")
    parts = parts_in_degrees(polar, np.array([(-20_000.0, 30.0), (20_000.0, 30.0)]))
    places = np.concatenate([part.lonlat for part in parts])
    assert places[:, 1].max() < -89.8
    assert np.abs(polar.from_lonlat(places)[:, 1] - 30.0).max() < 0.01


def test_geojson_on_the_moon_says_so(tmp_path):
    solution = route_on("moon")
    feature = geojson_feature(written_fully(solution, tmp_path, ".geojson"))
    places = np.array(feature["geometry"]["coordinates"])
    expected = degrees_by_pyproj("moon", solution.path.points)
    for place in expected:
        assert np.abs(places - place).max(axis=1).min() < 1e-8
    assert "WGS" not in feature["properties"]["coordinates"]
    assert "degrees on" in feature["properties"]["coordinates"]


def test_geojson_tells_what_the_route_is_and_where_it_comes_from(tmp_path):
    solution = route_on("utm")
    properties = geojson_feature(written(solution, tmp_path, ".geojson"))["properties"]
    assert properties["value"] == solution.value
    assert properties["unit"] == "weighted m"
    assert properties["ground_length"] == solution.path.ground_length
    assert properties["points_planned"] == len(solution.path.points)
    assert properties["length"] == solution.length
    assert properties["climb"] == solution.path.climb
    assert properties["lower_bound"] == 1000.0
    assert properties["gap"] == pytest.approx(solution.length / 1000.0 - 1.0)
    assert properties["planned_in"] == "EPSG:32616"
    assert properties["layers"] == {"height": 1.0, "rocks": 1.0}
    assert properties["software"] == f"terrapath {tp.__version__}"
    assert properties["seed"] == 3
    assert properties["height_unit"] == "m"
    points = geojson_feature(tmp_path / "route.geojson")["geometry"]["coordinates"]
    assert len(properties["heights"]) == len(points)
    assert np.array(points).shape[1] == 2  # heights are no third coordinate


# GeoPackage


@pytest.mark.parametrize("plane", list(PLANES))
def test_a_geopackage_holds_the_very_points_in_the_planes_crs(plane, tmp_path):
    solution = route_on(plane)
    path = written_fully(solution, tmp_path, ".gpkg")
    route = geopandas.read_file(path, layer="route")
    profile = solution.path.profile
    assert shapely.get_coordinates(route.geometry).tolist() == profile.points.tolist()
    assert route.length[0] != solution.length  # geopandas' length is that on the plane
    assert route["length"][0] == route["value"][0] == solution.length
    assert route["unit"][0] == "weighted " + ("units" if plane == "none" else UNITS[plane])
    points = geopandas.read_file(path, layer="points")
    assert shapely.get_coordinates(points.geometry).tolist() == profile.points.tolist()
    np.testing.assert_allclose(points["height [m]"], profile.values[:, 0], rtol=1e-14)
    assert points["rocks"].tolist() == profile.values[:, 1].tolist()
    waypoints = geopandas.read_file(path, layer="waypoints")
    assert waypoints["role"].tolist() == ["start", "goal"]
    if plane == "none":
        assert route.crs is None
        return
    expected = degrees_by_pyproj(plane, solution.path.points)
    target = "EPSG:4326" if plane in ON_EARTH else route.crs.geodetic_crs
    found = shapely.get_coordinates(route.to_crs(target).geometry)[profile.corners]
    assert metres_apart(found, expected).max() < 0.01


def test_a_geopackage_leaves_no_journals_and_the_same_route_the_same_bytes(tmp_path):
    first = written(route_on("utm"), tmp_path, ".gpkg").read_bytes()
    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    again = written(route_on("utm"), tmp_path, ".gpkg").read_bytes()
    assert first == again
    assert before is pyogrio.get_gdal_config_option("OGR_CURRENT_DATE") is None
    assert [path.name for path in tmp_path.iterdir()] == ["route.gpkg"]


# GPX


@pytest.mark.parametrize("plane", ON_EARTH)
def test_a_gpx_track_is_the_profile_in_the_right_place(plane, tmp_path):
    solution = route_on(plane)
    document = gpxpy.parse(written_fully(solution, tmp_path, ".gpx").read_text())
    track = document.tracks[0].segments[0].points
    found = np.array([(p.longitude, p.latitude) for p in track])
    profile = solution.path.profile
    assert metres_apart(found, degrees_by_pyproj(plane, profile.points)).max() < 1e-3
    heights = [p.elevation for p in track]
    np.testing.assert_allclose(heights, profile.values[:, 0], atol=1e-4)
    assert [w.name for w in document.waypoints] == ["start", "goal"]
    assert all(p.time is None for p in track)


def test_gpx_elevations_are_metres_or_none_at_all(tmp_path):
    points = route_on("utm").path.points
    for unit, metres in (("ft", 0.3048), ("us-ft", 1200 / 3937), ("K", None), ("", None)):
        solution = solved(surface_on("utm", units=(unit, "")), points)
        document = gpxpy.parse(written(solution, tmp_path, ".gpx").read_text())
        found = document.tracks[0].segments[0].points[0].elevation
        if metres is None:
            assert found is None
            assert "without elevations" in document.tracks[0].description
        else:
            assert found == pytest.approx(metres * solution.path.profile.values[0, 0], abs=1e-4)


@pytest.mark.parametrize(("plane", "why"), [("moon", "not on Earth"), ("none", "no CRS")])
def test_gpx_is_refused_off_earth_before_planning(plane, why, tmp_path):
    with pytest.raises(tp.MapError, match=rf"route\.gpx.*{why}.*\.geojson"):
        require_fitting_format(tmp_path / "route.gpx", PLANES[plane][0])
    with pytest.raises(tp.MapError, match=why):
        written(route_on(plane), tmp_path, ".gpx")
    require_fitting_format(tmp_path / "route.geojson", PLANES[plane][0])
    assert list(tmp_path.iterdir()) == []


# CSV and JSON


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    return header, np.array(rows, float)


@pytest.mark.parametrize("plane", list(PLANES))
def test_a_csv_is_the_profile_to_the_last_digit(plane, tmp_path):
    solution = route_on(plane)
    header, rows = rows_of(written_fully(solution, tmp_path, ".csv"))
    degrees = [] if plane == "none" else ["longitude", "latitude"]
    slope = ["slope [degrees]", "ground slope [degrees]", "side slope [degrees]"]
    value = f"value [{solution.unit}]"
    places = ["x", "y", *degrees]
    assert header == ["distance [m]", value, *places, "height [m]", *slope, "rocks"]
    column = dict(zip(header, rows.T, strict=True))
    profile = solution.path.profile
    assert np.column_stack([column["x"], column["y"]]).tolist() == profile.points.tolist()
    assert column["distance [m]"].tolist() == profile.distance.tolist()
    assert column[value].tolist() == profile.value.tolist()
    assert column["rocks"].tolist() == profile.values[:, 1].tolist()
    if degrees:
        found = np.column_stack([column[name] for name in degrees])
        assert metres_apart(found, degrees_by_pyproj(plane, profile.points)).max() < 1e-3


def test_json_is_the_record_and_the_same_each_time(tmp_path):
    solution = route_on("utm")
    text = written(solution, tmp_path, ".json").read_text()
    record = json.loads(text)
    assert record["path"] == solution.path.points.tolist()
    expected = degrees_by_pyproj("utm", solution.path.points)
    assert metres_apart(np.array(record["path_lonlat"]), expected).max() < 1e-3
    assert record["via"] == []
    assert text == written(solution, tmp_path, ".json").read_text()


def test_numbers_that_json_does_not_have_never_get_into_it(tmp_path):
    solution = replace(
        route_on("utm"),
        cost=np.inf,
        lower_bound=np.nan,
        seconds=-np.inf,
        counters={"k": np.int64(3)},
    )
    for ending in (".json", ".geojson"):
        text = written(solution, tmp_path, ending).read_text()
        json.loads(text, parse_constant=pytest.fail)
    record = json.loads((tmp_path / "route.json").read_text())
    assert record["cost"] is record["lower_bound"] is record["gap"] is record["seconds"] is None
    assert record["counters"] == {"k": 3}


# ROS


def read_path(folder):
    """The one nav_msgs/Path of a bag, by rosbags' reader."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(folder) as reader:
        ((connection, stamp, data),) = list(reader.messages())
        return connection, stamp, store.deserialize_cdr(data, connection.msgtype)


@pytest.mark.parametrize("plane", list(PLANES))
def test_a_bag_holds_the_profile_in_metres(plane, tmp_path):
    solution = route_on(plane)
    connection, stamp, message = read_path(written_fully(solution, tmp_path, ".bag2"))
    assert (connection.topic, connection.msgtype) == ("/plan", "nav_msgs/msg/Path")
    assert stamp == 0
    assert message.header.frame_id == message.poses[0].header.frame_id == "map"
    positions = [pose.pose.position for pose in message.poses]
    found = np.array([(p.x, p.y, p.z) for p in positions])
    metres = 1200 / 3937 if plane == "feet" else 1.0
    profile = solution.path.profile
    np.testing.assert_allclose(found[:, :2], metres * profile.points, rtol=1e-15)
    np.testing.assert_allclose(found[:, 2], profile.values[:, 0], rtol=1e-14)


def test_a_robot_looks_along_the_route(tmp_path):
    _, _, message = read_path(written(route_on("utm"), tmp_path, ".bag2"))
    poses = [pose.pose for pose in message.poses]
    positions = np.array([(p.position.x, p.position.y, p.position.z) for p in poses])
    turns = Rotation.from_quat([(q.x, q.y, q.z, q.w) for q in (pose.orientation for pose in poses)])
    ahead, left = turns.apply([1.0, 0.0, 0.0]), turns.apply([0.0, 1.0, 0.0])
    steps = np.diff(positions, axis=0)
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    cosines = (ahead[:-1] * steps).sum(axis=1)
    assert np.degrees(np.arccos(np.minimum(cosines, 1.0))).max() < 2.0
    assert np.abs(left[:, 2]).max() < 1e-12  # no roll


def files_of(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_bag_replaces_a_bag_and_the_same_route_gives_the_same_bytes(tmp_path):
    first = files_of(written(route_on("utm"), tmp_path, ".bag2"))
    other = files_of(written(route_on("utm", seed=1), tmp_path, ".bag2"))
    again = files_of(written(route_on("utm"), tmp_path, ".bag2"))
    assert first == again != other
    assert [path.name for path in tmp_path.iterdir()] == ["route.bag2"]


def test_what_is_no_bag_is_not_replaced(tmp_path):
    target = tmp_path / "route.bag2"
    target.mkdir()
    require_writable(target)  # empty: nothing is lost
    (target / "thesis.tex").write_text("years of work")
    for attempt in (require_writable, lambda path: tp.write_route(route_on("utm"), path)):
        with pytest.raises(tp.MapError, match=r"route\.bag2.*not|route\.bag2.*written"):
            attempt(target)
    assert [path.name for path in target.iterdir()] == ["thesis.tex"]
    other = tmp_path / "file.bag2"
    other.write_text("a file")
    with pytest.raises(tp.MapError, match="not a folder"):
        tp.write_route(route_on("utm"), other)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file.bag2", "route.bag2"]


def test_a_failure_while_a_bag_is_written_leaves_the_old_one(tmp_path, monkeypatch):
    before = files_of(written(route_on("utm"), tmp_path, ".bag2"))

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("rosbags.rosbag2.Writer.write", fail)
    with pytest.raises(tp.MapError, match=r"route\.bag2.*No space left"):
        written(route_on("utm", seed=1), tmp_path, ".bag2")
    assert files_of(tmp_path / "route.bag2") == before
    assert [path.name for path in tmp_path.iterdir()] == ["route.bag2"]


def test_a_bag_whose_place_is_taken_at_the_last_moment_comes_back(tmp_path, monkeypatch):
    target = tmp_path / "route.bag2"
    before = files_of(written(route_on("utm"), tmp_path, ".bag2"))
    rename = Path.rename

    def refuse(self, goal):
        if goal == target and self.name == target.name:
            raise OSError(13, "Permission denied")
        return rename(self, goal)

    def replaced():
        with folder_written_whole(target) as made:
            made.mkdir()

    monkeypatch.setattr(Path, "rename", refuse)
    with pytest.raises(tp.MapError, match="Permission denied"):
        replaced()
    assert files_of(target) == before


# Slopes


def test_slopes_of_a_tilted_plane_are_its_angles():
    axis = np.linspace(0, 100, 9)
    heights = np.tile(0.5 * axis, (9, 1))
    surface = tp.Surface.from_grid(heights, axis, axis)
    up, across, down = (0, 50), (50, 50), (50, 90)
    path = tp.Problem(surface, up, down).path([up, across, down, (10, 50)])
    found, points = slopes(path), path.profile.points
    steep = np.degrees(np.arctan(0.5))
    np.testing.assert_allclose(found.ground, steep, atol=1e-9)
    eastward = points[:, 1] == 50
    eastward[-1] = eastward[np.flatnonzero(points[:, 0] == 50)[0]] = False
    np.testing.assert_allclose(found.along[eastward], steep, atol=1e-9)
    north = (points[:, 0] == 50) & (points[:, 1] < 90)
    np.testing.assert_allclose(found.along[north], 0.0, atol=1e-9)
    expected = -np.degrees(np.arctan(0.5 * np.sqrt(0.5)))
    np.testing.assert_allclose(found.along[-1], expected, atol=1e-9)


def test_slopes_of_heights_in_feet_over_metres_are_true():
    points = route_on("utm").path.points
    metres, feet = (tp.Path(surface_on("utm", units=(unit, "")), points) for unit in ("m", "ft"))
    np.testing.assert_allclose(
        np.tan(np.radians(slopes(feet).along)), 0.3048 * np.tan(np.radians(slopes(metres).along))
    )


def test_standing_still_one_looks_where_one_looked():
    points = np.array([(0, 0), (0, 0), (2, 0), (2, 0), (2, 3), (2, 3)], float)
    assert headings(points).tolist() == [[1, 0], [1, 0], [1, 0], [0, 1], [0, 1], [0, 1]]
    assert np.hypot(*headings(points).T).tolist() == [1.0] * 6
    assert headings(points[:2]).tolist() == [[1, 0], [1, 0]]


# All formats


def test_start_at_the_goal_is_written_in_every_format(tmp_path):
    _, (x0, y0) = PLANES["utm"]
    solution = solved(SURFACES["utm"], np.array([(x0, y0), (x0, y0)]))
    for ending in WRITERS:
        written(solution, tmp_path, ending)
    assert len(list(tmp_path.glob("route.*"))) == len(WRITERS) + len(SHAPEFILE_PARTS)
    assert geojson_feature(tmp_path / "route.geojson")["geometry"]["type"] == "LineString"
    assert len(read_path(tmp_path / "route.bag2")[2].poses) == 2


ODD = [
    "height",
    'sand, "deep"\nand wet',
    "Höhe\u2603",
    "distance",
    "HEIGHT",
    "fid",
    "geom",
    "\udc80",
    "",
]


def test_layers_of_odd_names_are_columns_of_their_own(tmp_path):
    reference, (x0, y0) = PLANES["utm"]
    axis = np.linspace(-SIDE, SIDE, 9)
    values = np.random.default_rng(1).uniform(0, 1, (len(ODD), 9, 9))
    surface = tp.Surface.from_grid(values, axis + x0, axis + y0, names=ODD, georeference=reference)
    solution = solved(surface, np.array([(x0, y0), (x0 + 9000, y0 + 4000)]))
    for ending in WRITERS:
        written_fully(solution, tmp_path, ending)
    expected = solution.path.profile.values
    header, rows = rows_of(tmp_path / "route.csv")
    assert len(set(header)) == len(header) == 9 + len(ODD)
    assert header.count("distance [m]") == header.count("distance") == 1
    kept = [k for k, name in enumerate(header) if k == 6 or k > 9]
    assert rows[:, kept].tolist() == expected.tolist()
    table = geopandas.read_file(tmp_path / "route.gpkg", layer="points")
    names = [name for name in table.columns if name != "geometry"]
    assert names[0] == "distance [m]"
    assert len(names) == len(header)
    np.testing.assert_array_equal(table[[names[k] for k in kept]].to_numpy(), expected)
    assert set(json.loads((tmp_path / "route.json").read_text())["layers"]) == set(ODD)


@given(st.lists(st.text(max_size=6), min_size=1, max_size=12))
def test_names_of_columns_are_distinct_whatever_the_case(names):
    found = distinct(names, ["fid"])
    assert len({name.casefold() for name in [*found, "fid"]}) == len(names) + 1
    for name in found:
        name.encode("utf-8")
        assert len(name.splitlines()) == 1


@pytest.mark.parametrize("ending", [e for e in WRITERS if e not in {".bag2", ".shp"}])
def test_a_full_disk_leaves_the_old_file_and_no_rest(ending, tmp_path, monkeypatch):
    target, solution = tmp_path / f"route{ending}", route_on("utm")
    tp.write_route(solution, target)  # compiles what it needs, and keeps that in files
    target.write_text("old")

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    for write in ("write_text", "write_bytes", "open"):
        monkeypatch.setattr(f"pathlib.Path.{write}", fail)
    with pytest.raises(tp.MapError, match=rf"route\{ending}.*No space left"):
        tp.write_route(solution, target)
    monkeypatch.undo()
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


def contents(path):
    """Bytes by name, of a file or a folder, and of what lies beside a shapefile."""
    return files_of(path if path.is_dir() else path.parent)


def clear(folder):
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()


@pytest.mark.parametrize("ending", list(WRITERS))
def test_where_files_may_not_grow_a_route_is_whole_or_not_there(ending, tmp_path):
    resource = pytest.importorskip("resource")
    solution = route_on("utm")
    whole = contents(written(solution, tmp_path, ending))
    target, largest = tmp_path / f"route{ending}", max(map(len, whole.values()))
    limit, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    ended = []
    for share in (0.01, 0.2, 0.4, 0.7, 0.9, 0.97, 0.99, 1.0):
        clear(tmp_path)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(share * largest) + 1, most))
        try:
            tp.write_route(solution, target)
            ended.append("written")
        except tp.MapError as error:
            ended.append(str(error))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))
        assert any(tmp_path.iterdir()) == (ended[-1] == "written")
        if ended[-1] == "written":
            assert contents(target) == whole
    assert ended[-1] == "written"
    assert all("could not be written" in text for text in ended[:-1])


def test_an_unknown_ending_names_those_that_there_are(tmp_path):
    with pytest.raises(tp.MapError, match=r"route\.dxf.*\.geojson.*\.gpkg.*\.gpx.*\.bag2"):
        tp.write_route(route_on("utm"), tmp_path / "route.dxf")


def test_via_points_are_waypoints(tmp_path):
    plain = route_on("fiji", count=6)
    points, surface = plain.path.points, plain.problem.surface
    legs = tuple(solved(surface, points[k : k + 3]) for k in (0, 2, 4))
    solution = replace(plain, legs=legs)
    via = points[[2, 4]]
    expected = degrees_by_pyproj("fiji", via)
    for ending in WRITERS:
        written(solution, tmp_path, ending)
    features = json.loads((tmp_path / "route.geojson").read_text())["features"][1:]
    assert [f["properties"]["role"] for f in features] == ["via", "via"]
    found = np.array([f["geometry"]["coordinates"] for f in features])
    assert metres_apart(found, expected).max() < 1e-3
    document = gpxpy.parse((tmp_path / "route.gpx").read_text())
    assert [w.name for w in document.waypoints] == ["start", "via 1", "via 2", "goal"]
    found = np.array([(w.longitude, w.latitude) for w in document.waypoints[1:-1]])
    assert metres_apart(found, expected).max() < 1e-3
    waypoints = geopandas.read_file(tmp_path / "route.gpkg", layer="waypoints")
    assert waypoints["role"].tolist() == ["start", "via", "via", "goal"]
    assert shapely.get_coordinates(waypoints.geometry)[1:-1].tolist() == via.tolist()
    assert json.loads((tmp_path / "route.json").read_text())["via"] == via.tolist()


# The distance field, beside the routes


@pytest.mark.parametrize("plane", ["utm", "moon"])
def test_a_field_is_in_its_place(plane, tmp_path):
    reference, (x0, y0) = PLANES[plane]
    field = tp.distance_field(SURFACES[plane], (x0, y0), spacing=4000.0)
    tp.write_field(field, tmp_path / "field.tif")
    with rasterio.open(tmp_path / "field.tif") as dataset:
        assert dataset.descriptions == ("value (weighted m)",)
        assert dataset.units == ("weighted m",)
        assert CRS.from_wkt(dataset.crs.to_wkt()).is_exact_same(reference.crs) or CRS.from_wkt(
            dataset.crs.to_wkt()
        ).equals(reference.crs)
        for i, j in ((0, 0), (3, 7), (-1, -2)):
            x, y = field.lattice.x[i], field.lattice.y[j]
            assert next(dataset.sample([(x, y)])).item() == field.values[j, i]
