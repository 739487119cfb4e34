"""Routes are written with as many points as the map has detail, and stay free, near and as long.

The judges know the raster, the obstacles and what was written, and share no code with the package:
SciPy's spline, shapely, and the readers of the formats.
"""

import csv
import json
from itertools import pairwise

import geopandas
import gpxpy
import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings, strategies as st
from scipy.interpolate import RectBivariateSpline

import terrapath as tp
from common import REAL_MAPS, made_up
from terrapath.io.routes import WRITERS
from terrapath.io.routes.table import defused
from terrapath.problem.simplification import LENGTH_KEPT
from terrapath.surface.georeference import Georeference

CELL = 90.0
UTM = Georeference.from_projected("EPSG:32632")
ORIGIN = np.array([640_000.0, 5_190_000.0])


def rough_ground(seed, cells=81, relief=250.0):
    """Heights (ny, nx) with detail down to a few cells, and the axes."""
    random = np.random.default_rng(seed)
    axis = CELL * np.arange(cells)
    x, y = np.meshgrid(axis, axis)
    heights = np.zeros_like(x)
    for size in (4000.0, 1600.0, 700.0, 400.0):
        fx, fy, phase = random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(0, 7)
        heights += relief * size / 4000.0 * np.sin(2 * np.pi * (fx * x + fy * y) / size + phase)
    return heights, axis + ORIGIN[0], axis + ORIGIN[1]


def wiggly(problem, count, seed, turns=9):
    """A smooth path of many points from start to goal."""
    random = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, count)
    a, b = np.array(problem.start), np.array(problem.goal)
    across = np.array([a[1] - b[1], b[0] - a[0]])
    bow = sum(random.uniform(-0.3, 0.3) / k * np.sin(np.pi * k * t) for k in range(1, turns))
    points = a + t[:, None] * (b - a) + 0.5 * bow[:, None] * across
    points[[0, -1]] = a, b
    return points


def written_points(solution, folder, **options):
    """The points of the route in a GeoPackage, as GeoPandas reads them."""
    tp.write_route(solution, folder / "route.gpkg", **options)
    route = geopandas.read_file(folder / "route.gpkg", layer="route")
    return shapely.get_coordinates(route.geometry)


class Judge:
    """What SciPy's spline through the raster says of a polyline."""

    def __init__(self, heights, x, y):
        self.spline = RectBivariateSpline(x, y, heights.T, s=0)

    def lifted(self, points, step=CELL / 20):
        pieces = [points[:1]]
        for a, b in pairwise(points):
            count = max(int(np.ceil(np.linalg.norm(b - a) / step)), 1)
            pieces.append(a + np.linspace(0, 1, count + 1)[1:, None] * (b - a))
        walk = np.concatenate(pieces)
        return np.column_stack([walk, self.spline.ev(*walk.T)])

    def length(self, points):
        return np.linalg.norm(np.diff(self.lifted(points), axis=0), axis=1).sum()

    def farthest(self, planned, points):
        """How far the planned curve in space is from the lines in space between the points."""
        corners = np.column_stack([points, self.spline.ev(*points.T)])
        a, move = corners[:-1], np.diff(corners, axis=0)
        squares = np.maximum((move**2).sum(axis=1), 1e-300)
        largest = 0.0
        for p in self.lifted(planned):
            share = np.clip(((p - a) * move).sum(axis=1) / squares, 0, 1)
            largest = max(largest, np.linalg.norm(p - a - share[:, None] * move, axis=1).min())
        return largest


@pytest.mark.parametrize("weight", [1.0, 10.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_22_km_on_cells_of_90_m_are_hundreds_of_points(seed, weight, tmp_path):
    heights, x, y = rough_ground(seed, cells=221)
    surface = tp.Surface.from_grid(heights, x, y, units=["m"], weights=[weight], georeference=UTM)
    problem = tp.Problem(surface, ORIGIN + 3500.0, ORIGIN + 16_500.0)
    planned = wiggly(problem, 39_303, seed)
    solution, judge = made_up(problem, planned), Judge(heights, x, y)
    assert solution.path.ground_length > 20_000.0
    points = written_points(solution, tmp_path)
    assert 50 < len(points) < 1000
    assert points[[0, -1]].tolist() == planned[[0, -1]].tolist()
    assert judge.length(points) == pytest.approx(judge.length(planned), rel=1e-4)
    assert judge.length(points) == pytest.approx(solution.path.ground_length, rel=1e-4)
    few = planned[:: len(planned) // 500]
    assert judge.farthest(few, points) < 0.1 * CELL + 0.05


def test_a_tolerance_is_kept_and_none_writes_all_points(tmp_path):
    heights, x, y = rough_ground(2)
    surface = tp.Surface.from_grid(heights, x, y, units=["m"], georeference=UTM)
    problem = tp.Problem(surface, ORIGIN + 900.0, ORIGIN + 6000.0)
    solution, judge = made_up(problem, wiggly(problem, 3000, 2)), Judge(heights, x, y)
    counts = []
    for tolerance in (200.0, 9.0, 2.0, 0.5):
        points = written_points(solution, tmp_path, simplify=tolerance)
        counts.append(len(points))
        assert (
            judge.farthest(solution.path.points[::7], points) < tolerance + 0.12
        )  # between samples
        table = geopandas.read_file(tmp_path / "route.gpkg", layer="route")
        assert table["simplified_to"][0] == tolerance
        assert table["points"][0] == len(points)
        assert table["points_planned"][0] == 3000
    assert counts[0] <= counts[1] < counts[2] < counts[3] < 3000
    assert len(written_points(solution, tmp_path, simplify=0.0)) >= 3000
    with pytest.raises(tp.InputError, match="simplify=-1"):
        written_points(solution, tmp_path, simplify=-1.0)


@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(["mask", "polygons", "both"]))
@settings(max_examples=12, deadline=None)
def test_simplified_routes_touch_nothing(seed, kind, tmp_path_factory):
    random = np.random.default_rng(seed)
    heights, x, y = rough_ground(seed % 7, cells=31)
    surface = tp.Surface.from_grid(heights, x, y, units=["m"], georeference=UTM)
    blocked = random.uniform(size=heights.shape) < 0.3
    blocked[2, 2] = blocked[-3, -3] = False
    start, goal = (x[2], y[2]), (x[-3], y[-3])
    discs = [
        shapely.Point(place).buffer(random.uniform(30, 150), quad_segs=3)
        for place in random.uniform((x[0], y[0]), (x[-1], y[-1]), (40, 2))
    ]
    discs = [d for d in discs if not d.intersects(shapely.MultiPoint([start, goal]))]
    obstacles = {"mask": [tp.Mask(blocked, x, y)], "polygons": discs}
    given_obstacles = obstacles.get(kind) or [*obstacles["mask"], *discs]
    problem = tp.Problem(surface, start, goal, obstacles=given_obstacles)
    solution = tp.plan(problem, "dijkstra", refine=True, bound=False)
    assume(solution.path is not None)
    folder = tmp_path_factory.mktemp("r")
    for tolerance in (None, 60.0, 500.0):
        points = written_points(solution, folder, simplify=tolerance)
        line = shapely.LineString(points)
        if kind != "mask":
            assert not any(line.intersects(disc) for disc in discs)
        if kind != "polygons":
            j, i = np.nonzero(blocked)
            half = 0.5 * CELL * (1 - 1e-9)
            squares = shapely.box(x[i] - half, y[j] - half, x[i] + half, y[j] + half)
            assert not shapely.intersects(squares, line).any()
        length = Judge(heights, x, y).length
        assert length(points) == pytest.approx(length(solution.path.points), rel=1e-4)


def test_stops_are_kept(tmp_path):
    heights, x, y = rough_ground(3)
    surface = tp.Surface.from_grid(0 * heights, x, y, units=["m"], georeference=UTM)
    points = ORIGIN + CELL * np.array([(5, 5), (20.25, 5), (40, 5), (60, 5.0)])
    problem = tp.Problem(surface, points[0], points[-1])
    legs = tuple(
        made_up(tp.Problem(surface, leg[0], leg[-1]), leg) for leg in (points[:2], points[1:])
    )
    solution = made_up(problem, points, legs=legs)
    assert written_points(solution, tmp_path).tolist() == points[[0, 1, 3]].tolist()


@pytest.mark.parametrize("ending", [e for e in WRITERS if e not in {".json", ".bag2"}])
def test_every_format_has_the_same_points_and_numbers(ending, tmp_path):
    heights, x, y = rough_ground(4)
    values = np.stack([heights, 0.01 * heights])
    surface = tp.Surface.from_grid(
        values, x, y, names=["height", "mud"], units=["m", ""], weights=[3.0, 50.0],
        georeference=UTM,
    )  # fmt: skip
    problem = tp.Problem(surface, ORIGIN + 900.0, ORIGIN + 6000.0, name="over the hill")
    solution = made_up(problem, wiggly(problem, 2000, 4))
    lonlat = UTM.to_lonlat(written_points(solution, tmp_path))
    target = tmp_path / f"route{ending}"
    tp.write_route(solution, target)
    path, numbers = solution.path, {}
    if ending == ".gpx":
        track = gpxpy.parse(target.read_text()).tracks[0]
        found = [(p.longitude, p.latitude) for p in track.segments[0].points]
        assert f"{path.ground_length:,.3f} m on the ground" in track.description
        assert f"minimised: {solution.value:,.3f} weighted m" in track.description
    elif ending == ".csv":
        with target.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        found = [(float(row["longitude"]), float(row["latitude"])) for row in rows]
        last = rows[-1]
        numbers = {"ground_length": last["distance [m]"], "value": last["value [weighted m]"]}
    else:
        layer = "route" if ending in {".gpkg", ".kml"} else None
        table = geopandas.read_file(target, layer=layer)
        found = shapely.get_coordinates(table.to_crs("EPSG:4326").geometry[0])
        short = {"ground_length": "ground_len", "steepest_side": "steep_side"}
        for name in ("value", "ground_length", "climb", "descent", "steepest", "steepest_side"):
            numbers[name] = table[short.get(name, name) if ending == ".shp" else name][0]
        assert table["unit"][0] == "weighted m"
    np.testing.assert_allclose(found, lonlat, atol=2e-8)
    for name, number in numbers.items():
        expected = solution.value if name == "value" else getattr(path, name)
        assert float(number) == pytest.approx(expected, rel=1e-9)


def test_a_record_holds_every_planned_point(tmp_path):
    heights, x, y = rough_ground(5)
    surface = tp.Surface.from_grid(heights, x, y, units=["m"], georeference=UTM)
    problem = tp.Problem(surface, ORIGIN + 900.0, ORIGIN + 6000.0)
    solution = made_up(problem, wiggly(problem, 2000, 4))
    tp.write_route(solution, tmp_path / "route.json")
    record = json.loads((tmp_path / "route.json").read_text())
    assert record["path"] == solution.path.points.tolist()
    assert record["value"] == record["length"] == solution.value
    assert record["unit"] == record["ground_unit"] == "m"


def test_a_robot_has_a_pose_in_every_cell(tmp_path):
    from terrapath.io.routes.route import Route

    heights, x, y = rough_ground(6)
    surface = tp.Surface.from_grid(0 * heights, x, y, units=["m"], georeference=UTM)
    problem = tp.Problem(surface, ORIGIN + 900.0, ORIGIN + 6000.0)
    solution = made_up(problem, np.array([problem.start, problem.goal]))
    assert len(Route.of(solution).points) == 2
    steps = np.hypot(*np.diff(Route.of(solution, dense=True).points, axis=0).T)
    assert 0.25 * CELL < steps.max() <= CELL


def test_the_length_is_kept_with_a_margin_for_other_measures():
    assert LENGTH_KEPT < 1e-4


# What a spreadsheet would run

FORMULAS = [
    "=1+1",
    "+1",
    "-1",
    "@SUM(A1)",
    "\t=1",
    " =cmd|' /C calc'!A0",
    "a;=1+1",
    "a,@b",
    "\uff1d1",
]


@pytest.mark.parametrize("name", FORMULAS)
def test_no_heading_of_a_csv_is_a_formula(name, tmp_path):
    heights, x, y = rough_ground(7)
    surface = tp.Surface.from_grid(
        np.stack([heights, heights]), x, y, names=["height", name], georeference=UTM
    )
    problem = tp.Problem(surface, ORIGIN + 900.0, ORIGIN + 6000.0)
    tp.write_route(made_up(problem, wiggly(problem, 50, 0)), tmp_path / "route.csv")
    text = (tmp_path / "route.csv").read_text(encoding="utf-8").splitlines()[0]
    for delimiter in ",;\t":  # as spreadsheets of several countries read it
        for cell in next(csv.reader([text], delimiter=delimiter)):
            assert cell.strip()[:1] not in set("=+-@\uff1d\uff0b\uff0d\uff20"), cell


@pytest.mark.parametrize("name", ["height [m]", "a-b", "x + y", "", "distance [m]", "10 = ten"])
def test_other_headings_stay(name):
    assert defused(name) == name


# A shapefile is several files


def test_a_shapefile_replaces_its_own_parts_and_no_others(tmp_path):
    heights, x, y = rough_ground(8)
    surface = tp.Surface.from_grid(heights, x, y, units=["m"], georeference=UTM)
    problem = tp.Problem(surface, ORIGIN + 900.0, ORIGIN + 6000.0)
    solution = made_up(problem, wiggly(problem, 50, 0))
    (tmp_path / "dem.prj").write_text("of dem.asc")
    with pytest.raises(tp.MapError, match=r"dem\.prj.*another file"):
        tp.write_route(solution, tmp_path / "dem.shp")
    assert [path.name for path in tmp_path.iterdir()] == ["dem.prj"]
    tp.write_route(solution, tmp_path / "route.shp")
    (tmp_path / "route.qix").write_text("an index of what was there")
    parts = {path.name: path.read_bytes() for path in tmp_path.glob("route.*")}
    tp.write_route(solution, tmp_path / "route.shp")
    again = {path.name: path.read_bytes() for path in tmp_path.glob("route.*")}
    parts.pop("route.qix")
    assert again == parts
    assert geopandas.read_file(tmp_path / "route.shp").crs == "EPSG:32632"


@pytest.mark.slow
@pytest.mark.parametrize("weight", [1.0, 3.0])
def test_a_real_map_in_degrees(weight, tmp_path):
    if not (REAL_MAPS / "srtm_oetztal.tif").exists():
        pytest.skip("the map is not here")
    surface = tp.read_surface(REAL_MAPS / "srtm_oetztal.tif").with_weights({"height": weight})
    bounds = surface.bounds
    low, size = np.array(bounds[:2]), np.array([bounds.width, bounds.height])
    problem = tp.Problem(surface, low + (0.3, 0.75) * size, low + (0.7, 0.35) * size)
    solution = tp.plan(problem, "fast-marching", refine=True, bound=False)
    points = written_points(solution, tmp_path)
    assert len(points) < 1000
    assert problem.allows(points)
    written = tp.Path(surface, points).ground_length
    assert written == pytest.approx(solution.path.ground_length, rel=1e-4)
