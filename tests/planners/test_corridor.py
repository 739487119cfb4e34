"""Large maps: coarse to fine, in a corridor around the coarse route."""

import json

import numpy as np
import pytest
import rasterio
import shapely
from rasterio import Affine

import terrapath as tp
from terrapath.cli.main import run
from terrapath.errors import InputError
from terrapath.io import open_map
from terrapath.planners import corridor, make_finished
from terrapath.planners.corridor import Corridor, Part, factor, plan_in_corridor
from terrapath.scenario import answers

COUNT, CELL = 300, 10.0
START, GOAL = (400.0, 500.0), (2600.0, 2400.0)
AXIS = CELL * (0.5 + np.arange(COUNT))


def heights():
    """Hills of a hundred metres, with a lake without data in the middle."""
    x, y = np.meshgrid(AXIS, AXIS)
    z = 60.0 * np.sin(x / 300.0) * np.cos(y / 220.0) + 25.0 * np.sin((x + 2.0 * y) / 160.0)
    z[np.hypot(x - 1500.0, y - 1500.0) < 400.0] = np.nan
    return z


def read(part):
    surface = tp.read_surface((heights(), AXIS, AXIS), within=part.within, decimate=part.decimate)
    area = None if part.corridor is None else part.corridor.area_on(surface)
    return tp.Problem(surface, START, GOAL, keep_in=area)


@pytest.fixture
def small_limits(monkeypatch):
    monkeypatch.setattr(answers, "MOST_CELLS", 10_000)
    monkeypatch.setattr(corridor, "COARSE_CELLS", 3_600)
    monkeypatch.setattr(corridor, "HALF_WIDTH", 6.0)


PLANNER = make_finished("fast-marching", refine=True, bound=True)


@pytest.fixture
def found(small_limits):
    parts = []

    def pose(part):
        parts.append(part)
        return read(part), ()

    return plan_in_corridor(pose, PLANNER, COUNT**2), parts


def test_the_fine_route_is_that_of_the_whole_map(found):
    solution, (rough, fine) = found
    assert solution.status is tp.Status.SOLVED
    assert (rough.within, rough.decimate, rough.corridor) == (None, 5, None)
    assert fine.decimate == 1
    whole = PLANNER.solve(read(Part()))
    assert solution.length == pytest.approx(whole.length, rel=2e-3)
    assert solution.length >= whole.length * (1.0 - 1e-7)


def test_the_route_stays_in_the_corridor_and_only_that_is_read(found):
    solution, (_, fine) = found
    assert solution.corridor.area.covers(solution.path.line)
    # A window that holds the corridor, and no more than a few coarse cells beyond it.
    window = shapely.box(*fine.within)
    assert window.contains(solution.corridor.area)
    margin = 5 * CELL * corridor.MARGIN
    assert solution.corridor.area.envelope.buffer(1.01 * margin, join_style="mitre").contains(
        window
    )
    assert solution.problem.surface.data.coefficients[0].size < COUNT**2


def test_the_bounds_are_of_the_corridor_and_of_the_map(found):
    solution, _ = found
    everywhere = solution.corridor.least_length(solution)
    chord = tp.chord(solution.problem.surface, START, GOAL)
    assert everywhere == pytest.approx(chord)
    assert everywhere <= solution.lower_bound <= solution.length
    solution.certificate.check(solution.problem)


def test_with_costs_nothing_is_said_of_the_whole_map(small_limits):
    # A track across the map that no coarse mean of costs can show.
    cost = np.ones((COUNT, COUNT))
    cost[20:22] = 0.05
    source = tp.LayerSource((cost, AXIS, AXIS))
    ends = (400.0, 850.0), (2600.0, 850.0)

    def pose(part):
        flat = (np.zeros((COUNT, COUNT)), AXIS, AXIS)
        surface = tp.read_surface(
            flat, within=part.within, decimate=part.decimate, costs={"cost": source}
        )
        area = None if part.corridor is None else part.corridor.area_on(surface)
        return tp.Problem(surface, *ends, keep_in=area), ()

    solution = plan_in_corridor(pose, PLANNER, COUNT**2)
    cheaper = tp.plan(pose(Part())[0], "fast-marching")
    assert cheaper.length < 0.99 * tp.chord(solution.problem.surface, *ends)
    assert solution.corridor.least_length(solution) is None


def test_a_narrower_corridor_is_obeyed(small_limits):
    solution = plan_in_corridor(lambda part: (read(part), ()), PLANNER, COUNT**2, half_width=55.0)
    assert solution.corridor.half_width == 55.0
    assert solution.path.line.distance(solution.corridor.coarse.path.line) <= 55.0
    assert (
        shapely.hausdorff_distance(solution.path.line, solution.corridor.coarse.path.line) <= 56.0
    )


def test_a_tour_has_its_corridor_along_all_legs(small_limits):
    via = [(500.0, 2500.0)]
    solution = plan_in_corridor(lambda part: (read(part), via), PLANNER, COUNT**2)
    assert [leg.problem.goal for leg in solution.legs] == [via[0], GOAL]
    assert solution.corridor.area.covers(solution.path.line)
    stops = np.array([START, via[0], GOAL])
    chords = tp.chord(solution.problem.surface, stops[:-1], stops[1:])
    assert solution.corridor.least_length(solution) == pytest.approx(chords.sum())


def test_without_a_coarse_way_nothing_is_proven(small_limits):
    walled = heights()
    walled[:, 140:150] = np.nan

    def pose(part):
        options = {"within": part.within, "decimate": part.decimate}
        return tp.Problem(tp.read_surface((walled, AXIS, AXIS), **options), START, GOAL), ()

    solution = plan_in_corridor(pose, PLANNER, COUNT**2)
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.stopped_by == "no path on the map read 5 times coarser"
    assert solution.corridor is None


def test_what_only_the_coarse_map_forbids_has_a_remedy(small_limits):
    def pose(part):
        return tp.Problem(read(part).surface, (1500.0, 1500.0), GOAL), ()

    with pytest.raises(
        InputError, match=r"on the map read 5 times coarser: start=.*--corridor none"
    ):
        plan_in_corridor(pose, PLANNER, COUNT**2)


@pytest.mark.parametrize(("cells", "most", "expected"), [(10, 10, 1), (11, 10, 2), (1e8, 1e6, 10)])
def test_factors_bring_the_cells_down(cells, most, expected):
    assert factor(cells, most) == expected
    assert cells / expected**2 <= most


def write_map(path, crs, transform):
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        count=1,
        height=COUNT,
        width=COUNT,
        dtype="float32",
        crs=crs,
        transform=transform,
        nodata=np.nan,
    ) as dataset:
        dataset.write(heights().astype(np.float32)[::-1], 1)
    return path


UTM = Affine(CELL, 0.0, 500_000.0, 0.0, -CELL, 5_003_000.0)
DEGREES = Affine(1e-4, 0.0, 15.0, 0.0, -1e-4, 45.03)


def test_cells_are_counted_from_the_header(tmp_path):
    path = write_map(tmp_path / "map.tif", "EPSG:32633", UTM)
    with open_map(path) as opened:
        assert opened.cells() == COUNT**2
        part = opened.cells((500_000.0, 5_000_000.0, 501_000.0, 5_001_000.0))
    assert 100**2 <= part <= 120**2


@pytest.mark.parametrize("is_geographic", [False, True])
def test_the_command_plans_large_maps_in_a_corridor(
    is_geographic, small_limits, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    if is_geographic:
        write_map("map.tif", "EPSG:4326", DEGREES)
        ends = ["--start", "15.004,45.005", "--goal", "15.026,45.024"]
    else:
        write_map("map.tif", "EPSG:32633", UTM)
        ends = ["--start", "500400,5000500", "--goal", "502600,5002400"]
    command = ["plan", "map.tif", *ends, "--planner", "fast-marching", "--output", "r.geojson"]
    assert run([*command, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["bound_holds"] == "in the corridor"
    assert record["corridor_decimate"] == 5
    assert record["lower_bound_everywhere"] <= record["lower_bound"] <= record["length"]
    assert run([*command, "--corridor", "none", "--json"]) == 0
    whole = json.loads(capsys.readouterr().out)
    assert "corridor_decimate" not in whole
    assert record["length"] == pytest.approx(whole["length"], rel=3e-3)
    assert run(command) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "no path in the corridor is shorter" in shown
    assert "planned on the map read 5 times coarser" in shown
    assert "keep-in area" not in shown  # nobody asked for one
    properties = json.loads((tmp_path / "r.geojson").read_text())["features"][0]["properties"]
    assert properties["bound_holds"] == "in the corridor"


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--goal", "502000,5001000"], "several goals"),
        (["--certificate", "proof.npz"], "--certificate"),
    ],
)
def test_what_needs_the_whole_map_says_so(
    options, what, small_limits, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    write_map("map.tif", "EPSG:32633", UTM)
    ends = ["--start", "500400,5000500", "--goal", "502600,5002400"]
    assert run(["plan", "map.tif", *ends, *options]) == 2
    captured = capsys.readouterr().err
    assert what in captured
    assert "--corridor none" in captured
    assert captured.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["map.tif"]


def test_a_corridor_has_a_width(small_limits):
    rough = PLANNER.solve(read(Part(decimate=5)))
    with pytest.raises(InputError, match="corridor=0"):
        Corridor(rough, 0.0, 5)


def test_a_start_that_is_missing_has_nothing_to_do_with_the_coarse_map(
    small_limits, tmp_path, capsys
):
    write_map(tmp_path / "map.tif", "EPSG:32633", UTM)
    assert run(["plan", str(tmp_path / "map.tif"), "--goal", "502600,5002400"]) == 2
    assert capsys.readouterr().err.startswith("terrapath: start is missing")
