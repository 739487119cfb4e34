"""`terrapath plan`: results, outputs, exit codes, and one clear line for every bad input."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from rasterio.transform import from_origin

import terrapath as tp
from commands import ENDS, FAST, RAW, bad, json_of, refused
from terrapath.cli.main import run
from terrapath.planners import PLANNERS, finished


def test_json_has_the_promised_keys_and_the_path_is_as_long_as_it_says(capsys):
    code, answer = json_of(capsys, "six-peaks", *FAST, "--seed", "4", *RAW)
    assert code == 0
    promised = [
        "status",
        "planner",
        "length",
        "cost",
        "lower_bound",
        "gap",
        "seconds",
        "samples",
        "seed",
        "start",
        "goal",
        "path",
    ]
    assert set(promised) <= set(answer)
    assert answer["status"] == "solved"
    assert answer["planner"] == "rrt-star-r"
    assert answer["seed"] == 4
    assert answer["samples"] == 300
    assert answer["path"][0] == answer["start"] == [0.0, 0.0]
    assert answer["path"][-1] == answer["goal"] == [10.0, 10.0]
    surface = tp.scenes.load("six-peaks").surface
    assert tp.curve_length(surface, answer["path"]) == pytest.approx(answer["length"], rel=1e-9)


def test_the_command_and_the_library_give_the_same_route(capsys):
    _, answer = json_of(
        capsys, "one-peak", *FAST, "--seed", "2", "--step", "0.7", "--uniform", "--planner",
        "rrt-star", *RAW,
    )  # fmt: skip
    planner = tp.RRTStar(samples=300, seed=2, step=0.7, informed=False, metric="chord")
    solution = planner.solve(tp.scenes.load("one-peak"))
    assert answer["path"] == solution.path.points.tolist()
    assert answer["cost"] == solution.cost


def test_start_and_goal_can_be_given_and_equal_ends_give_a_path_of_length_zero(capsys):
    code, answer = json_of(capsys, "one-peak", "--start", "2,3", "--goal", "2,3")
    assert code == 0
    assert answer["length"] == 0.0
    assert answer["path"] == [[2.0, 3.0], [2.0, 3.0]]


def test_the_table_shows_what_was_asked_for(capsys):
    assert run(["plan", "three-peaks", *FAST]) == 0
    table = " ".join(capsys.readouterr().out.split())
    words = "status", "value", "ground length", "straight-line length", "climb", "side slope"
    proven = "lower bound", "no path is shorter", "gap", "planner's path", "% longer"
    for word in (*words, *proven, "edges pruned"):
        assert word in table, word


def test_jacksboro_answers_in_metres_and_in_degrees(capsys):
    code, answer = json_of(capsys, "jacksboro", "--samples", "2000", *RAW)
    assert code == 0
    assert answer["unit"] == "m"
    assert answer["start_lonlat"] == pytest.approx(tp.scenes.JACKSBORO_START, abs=1e-9)
    assert answer["goal_lonlat"] == pytest.approx(tp.scenes.JACKSBORO_GOAL, abs=1e-9)
    from pyproj import Geod

    geod = Geod(ellps="WGS84")
    on_earth = geod.line_length(*np.array(answer["path_lonlat"]).T)
    on_plane = np.hypot(*np.diff(answer["path"], axis=0).T).sum()
    assert on_plane == pytest.approx(on_earth, rel=1e-5)
    assert on_plane < answer["length"] <= answer["straight_length"]


def test_degrees_are_taken_for_jacksboro(capsys):
    code, answer = json_of(
        capsys, "jacksboro", "--samples", "2000", "--start", "-84.2,36.5", "--goal", "-84.15,36.6",
        *RAW,
    )  # fmt: skip
    assert code == 0
    assert answer["start_lonlat"] == pytest.approx([-84.2, 36.5], abs=1e-9)


def test_a_raster_with_layers_is_planned_and_written_in_every_format(dem, tmp_path, capsys):
    outputs = [tmp_path / f"route{suffix}" for suffix in (".geojson", ".csv", ".json", ".png")]
    arguments = [str(dem), *ENDS, *FAST, "--layer", f"rocks={dem}:2*50", "--plot", str(outputs[3])]
    for path in outputs[:3]:
        arguments += ["--output", str(path)]
    code, answer = json_of(capsys, *arguments)
    assert code == 0
    assert answer["layers"] == {"height": 1.0, "rocks": 50.0}
    assert answer["lower_bound"] <= answer["length"] <= answer["unrefined_length"]
    assert json.loads(outputs[2].read_text())["path"] == answer["path"]
    feature = json.loads(outputs[0].read_text())["features"][0]
    written = np.array(feature["geometry"]["coordinates"])  # to a tenth of a millimetre
    for place in (answer["path_lonlat"][0], answer["path_lonlat"][-1]):
        assert np.abs(written - place).max(axis=1).min() < 1e-8
    for key in (
        "value",
        "unit",
        "ground_length",
        "climb",
        "steepest_side",
        "length",
        "lower_bound",
        "gap",
        "unrefined_length",
    ):
        assert feature["properties"][key] == answer[key]
    header, *rows = outputs[1].read_text().splitlines()
    assert header == (
        "distance [m],value [weighted m],x,y,longitude,latitude,height [m],slope [degrees],"
        "ground slope [degrees],side slope [degrees],rocks"
    )
    ends = [float(text) for text in rows[-1].split(",")[:2]]
    assert ends == pytest.approx([answer["ground_length"], answer["value"]], rel=1e-9)
    assert answer["unit"] == "weighted m"
    assert outputs[3].read_bytes().startswith(b"\x89PNG")


def test_weights_change_the_route(dem, capsys):
    _, plain = json_of(capsys, str(dem), *ENDS, "--samples", "3000", *RAW)
    asked = [str(dem), *ENDS, "--samples", "3000", "--weight", "height=20"]
    _, steep = json_of(capsys, *asked, *RAW)
    assert steep["climb"] < 0.5 * plain["climb"]


BAD_ARGUMENTS = {
    "nothing": ([], "WHERE"),
    "unknown scene": (["nowhere"], "nowhere", "six-peaks"),
    "missing file": (["missing.tif", "--start", "0,0", "--goal", "1,1"], "missing.tif", "exist"),
    "start off the map": (["six-peaks", "--start", "20,3"], "start=(20, 3)", "x1 in [-1, 11]"),
    "goal off the map": (["six-peaks", "--goal", "3,-20"], "goal=(3, -20)", "x2 in [-1, 11]"),
    "one coordinate": (["six-peaks", "--start", "1"], "start='1'", "X,Y"),
    "three coordinates": (["six-peaks", "--goal", "1,2,3"], "goal='1,2,3'", "X,Y"),
    "words": (["six-peaks", "--goal", "a,b"], "goal='a,b'", "X,Y"),
    "NaN": (["six-peaks", "--start", "nan,2"], "start=(nan, 2)", "finite"),
    "infinity": (["six-peaks", "--start", "1,inf"], "start=(1, inf)", "finite"),
    "negative samples": (["six-peaks", "--samples", "-5"], "samples=-5", "1 to"),
    "no samples": (["six-peaks", "--samples", "0"], "samples=0"),
    "worded samples": (["six-peaks", "--samples", "many"], "--samples"),
    "negative step": (["six-peaks", "--step", "-1"], "step=-1", "above 0"),
    "NaN step": (["six-peaks", "--step", "nan"], "step=nan"),
    "negative seed": (["six-peaks", "--seed", "-1"], "seed=-1"),
    "bias above one": (["six-peaks", "--goal-bias", "2"], "goal_bias=2"),
    "no time": (["six-peaks", "--time-limit", "0"], "time_limit=0"),
    "unknown planner": (["six-peaks", "--planner", "rtt"], "'rtt'", "rrt-star-r"),
    "option of another planner": (
        ["six-peaks", "--planner", "rrt", "--radius-factor", "2"],
        "radius_factor",
        "rrt",
    ),
    "option of grid planners": (["six-peaks", "--spacing", "0.1"], "spacing", "step"),
    "too many nodes": (["six-peaks", "--planner", "a-star", "--spacing", "1e-6"], "wider"),
    "far too many nodes": (["six-peaks", "--planner", "optimal", "--spacing", "1e-9"], "wider"),
    "nine neighbours": (["six-peaks", "--planner", "a-star", "--neighbours", "9"], "neighbours=9"),
    "samples of optimal": (
        ["six-peaks", "--planner", "optimal", "--samples", "9"],
        "optimal has no option 'samples'",
        "target_gap, routes",
    ),
    "routes of a tree": (["six-peaks", "--routes", "2"], "rrt-star-r has no option 'routes'"),
    "no routes": (["six-peaks", "--planner", "optimal", "--routes", "0"], "routes=0"),
    "no gap": (["six-peaks", "--target-gap", "0"], "target_gap=0", "above 0"),
    "negative gap": (["six-peaks", "--target-gap", "-0.1"], "target_gap=-0.1", "above 0"),
    "NaN gap": (["six-peaks", "--target-gap", "nan"], "target_gap=nan"),
    "no gap of optimal": (["six-peaks", "--planner", "optimal", "--target-gap", "0"], "above 0"),
    "gap without bound": (
        ["six-peaks", "--no-bound", "--target-gap", "0.1"],
        "--target-gap",
        "--no-bound",
    ),
    "certificate without bound": (
        ["six-peaks", "--no-bound", "--certificate", "a.npz"],
        "--certificate",
        "--no-bound",
    ),
    "optimal without bound": (["six-peaks", "--planner", "optimal", "--no-bound"], "optimal"),
    "optimal unrefined": (["six-peaks", "--planner", "optimal", "--no-refine"], "optimal"),
    "certificate as text": (["six-peaks", "--certificate", "a.txt"], "a.txt", ".npz"),
    "certificate nowhere": (["six-peaks", "--certificate", "no/a.npz"], "no/a.npz", "directory"),
    "misspelt option": (["six-peaks", "--plannr", "rrt"], "--plannr", "--planner"),
    "layer on a scene": (["six-peaks", "--layer", "a=b.tif"], "--layer", "six-peaks"),
    "unknown weight": (["six-peaks", "--weight", "foo=3"], "foo", "resistance"),
    "negative weight": (["six-peaks", "--weight", "height=-3"], "height=-3"),
    "malformed weight": (["six-peaks", "--weight", "height"], "NAME=WEIGHT"),
    "degrees in the wrong order": (["jacksboro", "--start", "36.5,-84.2"], "longitude -84.4"),
    "name too long": (["six-peaks", "--obstacles", 300 * "a"], "cannot be a file", "too long"),
    "unknown format": (["six-peaks", "--output", "x.dxf"], "x.dxf", ".geojson"),
    "unknown picture": (["six-peaks", "--plot", "x.bmp"], "x.bmp", ".png"),
    "no directory": (["six-peaks", "--output", "no/where.csv"], "no/where.csv", "directory"),
    "same file twice": (["six-peaks", "--output", "a.csv", "--output", "a.csv"], "twice"),
}


@pytest.mark.parametrize("name", BAD_ARGUMENTS)
def test_bad_arguments_give_one_clear_line(name, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, *words = BAD_ARGUMENTS[name]
    bad(capsys, arguments, *words)
    assert list(tmp_path.iterdir()) == []


BAD_MAPS = {
    "no start": (["--goal", "500400,4000300"], "start is missing", "--start X,Y"),
    "off the map": (["--start", "1,2", "--goal", "500400,4000300"], "start=(1, 2)", "x1 in"),
    "in no-data": (["--start", "500070,4000330", "--goal", "500400,4000300"], "no-data"),
    "missing band": ([*ENDS, "--height-band", "7"], "band=7", "dem.tif"),
    "malformed layer": ([*ENDS, "--layer", "rocks"], "NAME=FILE"),
    "malformed layer weight": ([*ENDS, "--layer", "rocks=dem.tif:2*x"], "FILE[:BAND][*WEIGHT]"),
    "layer twice": ([*ENDS, "--layer", "a=dem.tif", "--layer", "a=dem.tif"], "twice"),
}


@pytest.mark.parametrize("name", BAD_MAPS)
def test_bad_questions_about_a_map_give_one_clear_line(name, dem, capsys, monkeypatch):
    monkeypatch.chdir(dem.parent)
    arguments, *words = BAD_MAPS[name]
    bad(capsys, ["dem.tif", *arguments], *words)


def test_damaged_files_give_one_clear_line(dem, tmp_path, capsys):
    damaged = tmp_path / "damaged.tif"
    damaged.write_bytes(dem.read_bytes()[:9000])
    bad(capsys, [str(damaged), *ENDS], "damaged.tif", "cannot be read")
    text = tmp_path / "text.tif"
    text.write_text("this is no raster")
    bad(capsys, [str(text), *ENDS], "text.tif", "cannot be read")
    bad(capsys, [str(tmp_path), *ENDS], "cannot be read")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_write_protected_directory_is_found_out_before_planning(tmp_path, capsys):
    tmp_path.chmod(0o500)
    bad(capsys, ["six-peaks", "--output", str(tmp_path / "a.csv")], "cannot be written")


def test_an_existing_file_survives_a_refused_command(tmp_path, capsys):
    kept = tmp_path / "kept.csv"
    kept.write_text("precious")
    bad(capsys, ["six-peaks", "--output", str(kept), "--start", "99,99"], "start=(99, 99)")
    assert kept.read_text() == "precious"


@pytest.fixture
def project(dem, monkeypatch):
    """A folder with a map, and a GeoPackage of two layers, that nothing changes."""
    monkeypatch.chdir(dem.parent)
    lake = geopandas.GeoSeries([shapely.box(500_200, 4_000_150, 500_260, 4_000_260)], crs=32617)
    for layer in ("lakes", "area"):
        lake.to_file("project.gpkg", layer=layer)
    Path("bag.bag2").mkdir()
    Path("bag.bag2/metadata.yaml").touch()
    Path("bag.bag2/dem.tif").write_bytes(dem.read_bytes())
    Path("link.gpkg").symlink_to("project.gpkg")
    before = {path: path.read_bytes() for path in dem.parent.rglob("*") if path.is_file()}
    yield dem.parent
    after = {path: path.read_bytes() for path in dem.parent.rglob("*") if path.is_file()}
    assert {path: after.get(path) for path in before} == before


REPLACED = {
    "a layer's file": ["--obstacles", "project.gpkg:lakes", "--output", "project.gpkg"],
    "obstacles": ["--obstacles", "project.gpkg", "--output", "../{here}/project.gpkg"],
    "the second of them": [
        *("--obstacles", "link.gpkg", "--obstacles", "dem.tif"),
        *("--output", "a.csv", "--output", "project.gpkg"),
    ],
    "by a link": ["--obstacles", "project.gpkg:lakes", "--output", "link.gpkg"],
    "the area to keep in": ["--keep-in", "project.gpkg:area", "--output", "project.gpkg"],
    "a layer by GDAL's name": ["--layer", "a=GPKG:project.gpkg:a", "--output", "project.gpkg"],
    "a cost in quotes": ["--cost", 'a=GPKG:"project.gpkg":a', "--output", "project.gpkg"],
    "a folder with an input": ["--layer", "rocks=bag.bag2/dem.tif:2", "--output", "bag.bag2"],
}


@pytest.mark.parametrize("name", REPLACED)
def test_no_output_replaces_an_input(name, project, capsys):
    asked = [text.format(here=project.name) for text in REPLACED[name]]
    bad(capsys, ["dem.tif", *ENDS, *FAST, *asked], asked[-1], "would replace the input", "another")
    assert not Path("a.csv").exists()


def test_no_output_of_a_scenario_replaces_an_input_of_it(project, capsys, monkeypatch):
    Path("a.toml").write_text(
        '[map]\npath = "dem.tif"\n[route]\nstart = [500100, 4000100]\ngoal = [500400, 4000300]\n'
        '[constraints]\nobstacles = ["project.gpkg:lakes"]\n[output]\nfiles = ["project.gpkg"]\n'
    )
    monkeypatch.chdir("/")
    bad(capsys, [str(project / "a.toml")], "project.gpkg", "would replace the input", "another")


def test_no_field_replaces_its_map(project, capsys):
    for output in ("dem.tif", str(project / "dem.tif")):
        asked = ["dem.tif", "--start", "500100,4000100", "--output", output]
        refused(capsys, "field", asked, repr(output), "would replace the input 'dem.tif'")
    Path("dem.toml").write_bytes(Path("dem.tif").read_bytes())
    refused(capsys, "init", ["dem.toml", "--force"], "would replace the input 'dem.toml'")


def test_an_output_beside_the_inputs_is_written(project, capsys):
    asked = ["dem.tif", *ENDS, *FAST, *RAW, "--obstacles", "project.gpkg:lakes"]
    for _ in range(2):
        assert json_of(capsys, *asked, "--output", "lakes.gpkg", "--output", "dem.csv")[0] == 0
    assert Path("lakes.gpkg").exists()


def test_one_file_by_two_names_is_named_twice(project, capsys):
    bad(capsys, ["one-peak", "--output", "a.csv", "--output", f"../{project.name}/a.csv"], "twice")


def test_no_path_within_the_limits_exits_with_3_and_writes_nothing(tmp_path, capsys):
    output = tmp_path / "a.geojson"
    arguments = ["six-peaks", "--samples", "20", "--uniform", "--output", str(output)]
    assert run(["plan", *arguments]) == 3
    captured = capsys.readouterr()
    assert "not-found" in captured.out
    assert "no path was found" in captured.err
    assert list(tmp_path.iterdir()) == []
    code, answer = json_of(capsys, *arguments)
    assert code == 3
    assert answer["status"] == "not-found"
    assert answer["path"] is None
    assert answer["length"] is None


@pytest.mark.parametrize("planner", PLANNERS)
def test_an_enclosed_goal_exits_with_4(planner, tmp_path, capsys):
    heights = np.zeros((40, 40))
    heights[8:20, 8:20] = -9999.0
    heights[12:16, 12:16] = 0.0
    path = tmp_path / "moat.tif"
    profile = {"driver": "GTiff", "width": 40, "height": 40, "count": 1, "dtype": "float64"}
    profile |= {"transform": from_origin(0.0, 40.0, 1.0, 1.0), "crs": "EPSG:32617"}
    with rasterio.open(path, "w", nodata=-9999.0, **profile) as dataset:
        dataset.write(heights, 1)
    asked = [str(path), "--start", "35,5", "--goal", "14,26", "--planner", planner]
    assert run(["plan", *asked]) == 4
    captured = capsys.readouterr()
    assert "unreachable" in captured.out
    assert "no path exists" in captured.err
    assert "different parts of the free space" in captured.err
    code, answer = json_of(capsys, *asked)
    assert code == 4
    assert answer["status"] == "unreachable"
    assert answer["path"] is answer["length"] is answer["lower_bound"] is None


def test_grid_planners_take_their_options(capsys):
    asked = ["one-peak", "--spacing", "0.4", "--neighbours", "8", "--planner"]
    answers = [json_of(capsys, *asked, name, *RAW) for name in ("dijkstra", "a-star")]
    assert [code for code, _ in answers] == [0, 0]
    assert answers[0][1]["cost"] == pytest.approx(answers[1][1]["cost"], rel=1e-14)
    assert answers[0][1]["seed"] is None
    expected = tp.AStar(spacing=0.4, neighbours=8).solve(tp.scenes.load("one-peak"))
    assert answers[1][1]["path"] == expected.path.points.tolist()


def test_ctrl_c_exits_with_130_and_writes_the_best_so_far(tmp_path):
    output = tmp_path / "best.json"
    program = (
        "import signal, sys, threading, time\n"
        "from terrapath.planners import rrt_star\n"
        "from terrapath.cli.main import run\n"
        "seen = rrt_star._reason_to_stop\n"
        "def interrupt(search, callback):\n"
        "    if search.samples >= 2048: signal.raise_signal(signal.SIGINT)\n"
        "    return seen(search, callback)\n"
        "rrt_star._reason_to_stop = interrupt\n"
        f"sys.exit(run(['plan', 'six-peaks', '--samples', '100000', '--output', {str(output)!r}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 128 + signal.SIGINT
    assert "Traceback" not in done.stderr
    answer = json.loads(output.read_text())
    assert answer["status"] == "interrupted"
    assert answer["samples"] == 2048
    assert answer["length"] > 17.018129


def test_a_path_is_refined_and_bounded_unless_told_otherwise(tmp_path, capsys):
    proof = tmp_path / "proof.npz"
    asked = ["one-peak", *FAST, "--seed", "3"]
    _, raw = json_of(capsys, *asked, *RAW)
    assert raw["unrefined_length"] is raw["lower_bound"] is raw["gap"] is None
    _, finished = json_of(capsys, *asked, "--certificate", str(proof))
    truth = tp.scenes.SCENES["one-peak"].true_length
    assert finished["unrefined_length"] == raw["length"] > truth
    assert finished["length"] == pytest.approx(truth, rel=1e-7)
    assert truth * 0.99 < finished["lower_bound"] <= truth
    gap = finished["length"] / finished["lower_bound"] - 1.0
    assert finished["gap"] == pytest.approx(gap)
    problem = tp.scenes.load("one-peak")
    assert tp.Certificate.load(proof).check(problem) == finished["lower_bound"]


def test_the_report_says_whether_the_target_gap_was_met(capsys):
    asked = ["plan", "one-peak", *FAST, "--target-gap"]
    assert run([*asked, "0.05"]) == 0
    assert "the target of 5 % is met" in capsys.readouterr().out
    assert run([*asked, "1e-9", "--time-limit", "0.001"]) == 0
    assert "the target of 1e-07 % is not met" in capsys.readouterr().out


def test_optimal_takes_its_options_and_shows_other_routes(capsys):
    asked = ["six-peaks", "--planner", "optimal", "--routes", "2", "--spacing", "0.1"]
    code, answer = json_of(capsys, *asked, "--target-gap", "0.01")
    assert code == 0
    truth = tp.scenes.SCENES["six-peaks"].true_length
    assert answer["length"] == pytest.approx(truth, rel=1e-7)
    assert answer["gap"] <= 0.01
    assert answer["stopped_by"] == "gap met"
    assert answer["alternatives"] == pytest.approx([truth], rel=1e-7)
    assert run(["plan", *asked, "--target-gap", "0.01"]) == 0
    assert "next best 17.0181" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_goal_may_lie_on_the_edge_of_the_bounds(planner, capsys):
    code, answer = json_of(capsys, "one-peak", "--planner", planner, "--goal", "11,4", *(
        [] if planner == "optimal" else RAW
    ))  # fmt: skip
    assert code == 0
    assert answer["path"][-1] == [11.0, 4.0]


def test_a_planner_without_a_path_gets_no_bound(capsys, monkeypatch):
    monkeypatch.setattr(finished, "lower_bound", None)
    monkeypatch.setattr(finished, "refine", None)
    code, answer = json_of(capsys, "six-peaks", "--samples", "20", "--uniform")
    assert code == 3
    assert answer["lower_bound"] is None


@pytest.mark.parametrize("stage", ["refine", "lower_bound"])
def test_ctrl_c_while_a_path_is_finished_loses_nothing(stage, tmp_path, capsys, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(finished, stage, interrupt)
    files = [tmp_path / "a.json", tmp_path / "a.geojson"]
    asked = ["six-peaks", *FAST, "--certificate", str(tmp_path / "a.npz"), "--json"]
    for file in files:
        asked += ["--output", str(file)]
    assert run(["plan", *asked]) == 130
    captured = capsys.readouterr()
    answer = json.loads(captured.out)
    assert answer["status"] == "interrupted"
    assert answer["length"] > 17.0181
    assert answer["lower_bound"] is None
    assert (answer["unrefined_length"] is None) == (stage == "refine")
    assert json.loads(files[0].read_text())["path"] == answer["path"]
    assert sorted(tmp_path.iterdir()) == sorted(files)
    assert "no lower bound was proven" in captured.err


def test_a_failure_while_a_path_is_finished_loses_nothing(capsys, monkeypatch):
    def fail(*_, **__):
        raise ArithmeticError("by zero")

    monkeypatch.setattr(finished, "refine", fail)
    monkeypatch.setattr(finished, "lower_bound", fail)
    assert run(["plan", "six-peaks", *FAST, "--json"]) == 0
    captured = capsys.readouterr()
    answer = json.loads(captured.out)
    assert answer["status"] == "solved"
    assert answer["unrefined_length"] is answer["lower_bound"] is None
    refining, bounding = captured.err.splitlines()
    assert refining.startswith("terrapath: the path could not be refined")
    assert bounding.startswith("terrapath: no better bound could be proven")
    assert "ArithmeticError: by zero" in refining
