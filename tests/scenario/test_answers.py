"""Questions answered in Python: the same as on the command line, from any thread, told as data."""

import json
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import shapely
from rasterio.transform import from_origin

import terrapath as tp
from commands import json_of
from common import one_line
from rasters import write
from terrapath.planners import corridor
from terrapath.scenario import answers

START, GOAL = (500_080.0, 4_000_080.0), (500_520.0, 4_000_320.0)
FAST = {"samples": 400}


@pytest.fixture
def dem(tmp_path, monkeypatch):
    """A hill of 30 m on 60 by 40 cells of 10 m, in UTM."""
    monkeypatch.chdir(tmp_path)
    y, x = np.mgrid[0:40, 0:60] * 10.0
    hill = 30.0 * np.exp(-((x - 300.0) ** 2 + (y - 200.0) ** 2) / 8000.0)
    return write("dem.tif", hill, from_origin(500_000.0, 4_000_400.0, 10.0, 10.0))


def timeless(record):
    """What is the same in every run."""
    same = {key: value for key, value in record.items() if key != "seconds"}
    return same | {"legs": [timeless(leg) for leg in same.get("legs", [])]}


def plain(answer):
    """Its record as JSON gives it back."""
    from terrapath.io.routes.record import dump

    return timeless(json.loads(dump(answer.record())))


# The same answers as the command's

CASES = {
    "a scene": ("six-peaks", {}, []),
    "a map": ("dem.tif", {"weights": {"height": 4}}, ["--weight", "height=4"]),
    "constraints": (
        "dem.tif",
        {"radius": 5, "max_slope": 30},
        ["--radius", "5", "--max-slope", "30"],
    ),
    "a tour": ("dem.tif", {"via": [(500_300.0, 4_000_050.0)]}, ["--via", "500300,4000050"]),
    "another planner": (
        "dem.tif",
        {"planner": "fast-marching", "spacing": 5.0, "bound": False, "samples": None},
        ["--planner", "fast-marching", "--spacing", "5", "--no-bound"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_python_answers_as_the_command_does(case, dem, capsys):
    where, options, flags = CASES[case]
    chosen = {**FAST, **options}
    chosen = {key: value for key, value in chosen.items() if value is not None}
    if "samples" in chosen:
        flags = [*flags, "--samples", "400"]
    if where == "dem.tif":
        chosen |= {"start": START, "goal": GOAL}
        flags = [*flags, "--start", "500080,4000080", "--goal", "500520,4000320"]
    answer = tp.scenario.answer(tp.scenario.load(where, **chosen))
    code, record = json_of(capsys, where, *flags)
    assert code == 0
    assert answer.solution.status is tp.Status.SOLVED
    assert plain(answer) == timeless(record)


def test_several_goals_are_all_answered(dem):
    goals = [GOAL, (500_100.0, 4_000_120.0)]
    asked = tp.scenario.load("dem.tif", start=START, goal=goals, all_goals=True, **FAST)
    answer = tp.scenario.answer(asked)
    assert [goal.goal for goal in answer.goals] == goals
    assert answer.solution.length == min(goal.solution.length for goal in answer.goals)
    assert [goal["status"] for goal in answer.record()["goals"]] == ["solved", "solved"]


def test_a_large_map_is_planned_on_in_a_corridor(dem, monkeypatch):
    asked = tp.scenario.load("dem.tif", start=START, goal=GOAL, **FAST)
    assert tp.scenario.answer(asked).solution.corridor is None
    monkeypatch.setattr(answers, "MOST_CELLS", 1_000)
    monkeypatch.setattr(corridor, "COARSE_CELLS", 600)
    found = tp.scenario.answer(asked).solution
    assert found.corridor is not None
    assert found.corridor.decimate == 2
    with pytest.raises(tp.InputError, match="several goals needs the whole map"):
        tp.scenario.answer(tp.scenario.load("dem.tif", start=START, goal=[GOAL, START], **FAST))


def test_degrees_are_answered_in_python_too(tmp_path):
    x = np.mgrid[0:30, 0:30][1]
    path = write(
        tmp_path / "degrees.tif", 5.0 * np.sin(x / 6.0), from_origin(11.0, 47.0, 0.001, 0.001), 4326
    )
    ends = {"start": (46.995, 11.005), "goal": (46.975, 11.025)}
    found = tp.scenario.answer(tp.scenario.load(path, latlon=True, **ends, **FAST)).solution
    swapped = {name: (lon, lat) for name, (lat, lon) in ends.items()}
    same = tp.scenario.answer(tp.scenario.load(path, **swapped, **FAST)).solution
    np.testing.assert_array_equal(found.path.points, same.path.points)


# Options


def test_options_stand_over_a_scenario_file(dem, tmp_path):
    file = tmp_path / "survey.toml"
    file.write_text('[map]\npath = "dem.tif"\n[planner]\nsamples = 700\nseed = 3\n')
    asked = tp.scenario.load(file, samples=400, output="route.geojson")
    assert (asked.planner.samples, asked.planner.seed) == (400, 3)
    assert asked.output.files == ("route.geojson",)


def test_a_scenario_of_version_0_1_is_read(dem, tmp_path):
    file = tmp_path / "old.toml"
    file.write_text(
        '[map]\npath = "dem.tif"\nheight_band = 1\nfill_holes = 0.0\nsmooth = "auto"\n'
        f"[route]\nstart = {list(START)}\ngoal = {list(GOAL)}\nall_goals = false\nvia = []\n"
        "latlon = false\n[constraints]\nobstacles = []\nradius = 0.0\n"
        '[planner]\nname = "rrt-star-r"\nrefine = true\nbound = true\nsamples = 400\n'
        'corridor = "auto"\n[output]\nfiles = []\njson = false\nquiet = false\n'
    )
    assert tp.scenario.answer(tp.scenario.load(file)).solution.status is tp.Status.SOLVED


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sampels": 3}, ("'sampels'", "did you mean samples?")),
        ({"neighbors": 8}, ("'neighbors'", "did you mean neighbours?")),
        ({"xyzzy": 8}, ("'xyzzy'", "choose one of height_band, fill_holes")),
        ({"samples": "3"}, ("samples in [planner] is '3'", "a whole number is expected")),
        ({"start": 3}, ("start in [route] is 3", "two finite numbers, [X, Y] is expected")),
        ({"start": (np.nan, 0)}, ("start in [route] is [nan, 0]", "two finite numbers")),
        ({"weights": {"height": "x"}}, ("weights.height in [map] is 'x'", "a finite number")),
        ({"layers": {"a": {"fil": "x"}}}, ("unknown key 'fil'", "did you mean file?")),
    ],
)
def test_a_wrong_option_is_one_line_with_the_nearest_known_one(options, words):
    with pytest.raises(tp.InputError) as caught:
        tp.scenario.load("one-peak", **options)
    message = one_line(caught)
    for word in words:
        assert word in message


@pytest.mark.parametrize("where", [None, 3, np.zeros((3, 3)), tp.scenes.load("one-peak")])
def test_what_is_no_path_is_refused_with_what_to_use(where):
    with pytest.raises(tp.InputError, match="is no path; name a scenario file") as caught:
        tp.scenario.load(where)
    assert "tp.plan" in one_line(caught)


def test_the_help_names_the_defaults_of_the_planners():
    from terrapath.planners import PLANNERS
    from terrapath.scenario.scenario import options

    owners = {"neighbours": "dijkstra", "directions": "geodesic-traversal", "routes": "optimal"}
    told = 0
    for entry in options("planner"):
        _, default, text = entry.option.help.partition("[default: ")
        if default and entry.key in {*owners, "samples", "seed", "radius_factor", "goal_bias"}:
            planner = PLANNERS[owners.get(entry.key, "rrt-star-r")]()
            assert float(text.partition("]")[0]) == getattr(planner, entry.key), entry.key
            told += 1
    assert told == 7
    wide = next(entry for entry in options("planner") if entry.key == "corridor").option.help
    assert f"over {answers.MOST_CELLS // 10**6} million cells" in wide
    assert f"{corridor.HALF_WIDTH:g} coarse cells" in wide


def test_points_and_paths_may_come_in_any_form():
    points = ([9.0, 9.0], [2.0, 2.0])
    for goals in (points, np.array(points), (tuple(p) for p in points), map(tuple, points)):
        assert tp.scenario.load("one-peak", goal=goals).route.goals == ((9.0, 9.0), (2.0, 2.0))
    assert tp.scenario.load("one-peak", goal=zip([9.0], [9.0], strict=True)).route.goals == (
        (9.0, 9.0),
    )


@pytest.mark.parametrize("call", [tp.scenario.answer, tp.scenario.field])
def test_what_is_no_scenario_is_refused_with_what_makes_one(call):
    with pytest.raises(tp.InputError, match=r"make one with tp\.scenario\.load") as caught:
        call("six-peaks")
    one_line(caught)


# Outputs


def test_files_are_written_when_asked(dem, tmp_path):
    asked = tp.scenario.load("dem.tif", start=START, goal=GOAL, output="route.geojson", **FAST)
    answer = tp.scenario.answer(asked)
    assert not (tmp_path / "route.geojson").exists()
    answer.write()
    assert json.loads((tmp_path / "route.geojson").read_text())["type"] == "FeatureCollection"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"output": "route.xyz"}, "no known format"),
        ({"output": ""}, "no known format"),
        ({"plot": ""}, "no known picture format"),
        ({"certificate": ""}, "no known format"),
        ({"output": "missing/route.csv"}, "cannot be written"),
        ({"plot": "dem.tif"}, "dem.tif"),
        ({"certificate": "proof.npz", "bound": False}, "--certificate needs a lower bound"),
        ({"all_goals": True}, "several goals"),
        ({"planner": "optimal", "refine": False}, "refines its routes"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_planned(options, words, dem, monkeypatch):
    monkeypatch.setattr(
        answers, "open_question", lambda scenario: pytest.fail("the map was opened")
    )
    with pytest.raises(tp.TerrapathError, match=words):
        tp.scenario.answer(tp.scenario.load("dem.tif", start=START, goal=GOAL, **options))


# Warnings


def test_warnings_are_data_and_nothing_is_printed(dem, tmp_path, capsys):
    pytest.importorskip("geopandas").GeoSeries([shapely.box(0, 0, 1, 1)], crs=32633).to_file(
        tmp_path / "far.geojson"
    )
    asked = tp.scenario.load("dem.tif", start=START, goal=GOAL, obstacles="far.geojson", **FAST)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        answer = tp.scenario.answer(asked)
    assert [type(warning) for warning in answer.warnings] == [tp.VectorWarning]
    assert "outside the map" in str(answer.warnings[0])
    assert caught == []
    assert capsys.readouterr() == ("", "")


# Fields and certificates


def test_a_field_and_a_certificate_are_had_from_a_scenario(dem, tmp_path):
    asked = tp.scenario.load("dem.tif", start=START, goal=GOAL, spacing=10.0)
    field = tp.scenario.field(asked)
    truth = tp.scenario.answer(asked_with(asked, "optimal")).solution
    assert field.at(GOAL) == pytest.approx(truth.length, rel=0.01)
    problem = tp.scenario.check(asked, truth.certificate)
    assert problem.goal == truth.problem.goal
    moved = tp.scenario.load("dem.tif", start=START, goal=(500_500.0, 4_000_300.0))
    with pytest.raises(tp.CertificateError):
        tp.scenario.check(moved, truth.certificate)


def asked_with(scenario, planner):
    return scenario.overridden({"planner": {"name": planner}})


# Threads


def test_threads_read_maps_and_plan_at_once(dem):
    asked = [
        tp.scenario.load("dem.tif", start=START, goal=GOAL, seed=seed, samples=200, bound=False)
        for seed in range(4)
    ]
    alone = [plain(tp.scenario.answer(one)) for one in asked]
    filters, hooks = list(warnings.filters), (__import__("sys").excepthook,)
    with ThreadPoolExecutor(4) as pool:
        together = [plain(found) for found in pool.map(tp.scenario.answer, asked * 3)]
    assert together == alone * 3
    assert list(warnings.filters) == filters
    assert (__import__("sys").excepthook,) == hooks


def test_a_watcher_sees_the_progress_and_stops_the_planner(dem):
    seen = []

    def watch(progress):
        seen.append(progress)
        return True

    asked = tp.scenario.load("dem.tif", start=START, goal=GOAL, samples=50_000)
    found = tp.scenario.answer(asked, watch=watch).solution
    assert found.samples < 50_000
    assert {progress.unit for progress in seen} == {"m"}
