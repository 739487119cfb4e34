"""Scenario files: every option, errors by line and key, schema, init, and what overrides what."""

import dataclasses
import json
import tomllib
import zipfile
from pathlib import Path

import geopandas
import numpy as np
import pyproj
import pytest
import rasterio
import shapely
from rasterio.transform import from_origin
from typer.main import get_command

import terrapath as tp
from common import ROOT
from terrapath.cli.main import application, run
from terrapath.errors import InputError
from terrapath.io.vectors.layers import read_layers
from terrapath.planners import tours
from terrapath.scenario import Scenario, scenario_schema
from terrapath.scenario.scenario import LayerTable, options
from terrapath.scenario.toml import read_scenario

QUICK = ["--samples", "400", "--no-bound"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder to run in, with a map beside it."""
    (tmp_path / "maps").mkdir()
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    y, x = np.mgrid[0:40, 0:50] * 10.0
    height = 30.0 * np.exp(-((x - 250) ** 2 + (y - 200) ** 2) / 8000.0)
    height[5:9, 5:9] = -9999.0
    profile = {
        "driver": "GTiff", "width": 50, "height": 40, "count": 3, "dtype": "float64",
        "crs": "EPSG:32617", "transform": from_origin(500_000.0, 4_000_400.0, 10.0, 10.0),
        "nodata": -9999.0,
    }  # fmt: skip
    with rasterio.open(tmp_path / "maps" / "dem.tif", "w", **profile) as dataset:
        for band, values, name in (
            (1, np.where(x > 250, 1.0, 0.0), "slope of the dem"),
            (2, height, "DEM, metres"),
            (3, np.where(y > 150, 2.0, 1.0), "going"),
        ):
            dataset.write(values, band)
            dataset.set_band_description(band, name)
    return tmp_path / "work"


def answer_of(capsys, *arguments):
    code = run(["plan", *map(str, arguments), "--json"])
    captured = capsys.readouterr()
    assert code == 0, captured.err
    return json.loads(captured.out)


def refused(capsys, arguments, *words):
    assert run([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("terrapath: ")
    assert captured.err.count("\n") == 1
    for word in words:
        assert word in captured.err, captured.err


def scenario(text, path="scenario.toml"):
    Path(path).write_text(text)
    return path


# One source of names, defaults and help


def flags_of(command):
    return {
        flag
        for parameter in get_command(application()).commands[command].params
        for flag in (*parameter.opts, *parameter.secondary_opts)
        if flag.startswith("-")
    }


def test_every_option_of_plan_is_in_a_scenario_and_the_other_way_round():
    declared = {flag for entry in options() for word in entry.flags for flag in word.split("/")}
    assert flags_of("plan") - {"--help", "-h"} == declared
    without_flag = [(entry.section, entry.key) for entry in options() if not entry.flags]
    assert without_flag == [("map", "path"), ("map", "scene")]  # the command's WHERE
    schema = scenario_schema()
    for entry in options():
        section = schema["$defs"][f"{entry.section.capitalize()}Section"]
        assert section["additionalProperties"] is False
        known = section["properties"][entry.key]
        assert known["description"] == entry.option.help
        if entry.default not in (None, (), {}):
            assert known["default"] == entry.default


def test_defaults_are_those_of_the_planners_and_of_read_surface():
    import inspect

    asked, read = Scenario(), inspect.signature(tp.read_surface).parameters
    assert asked.map.fill_holes == read["fill_holes"].default
    assert asked.map.smooth == read["smoothing"].default
    assert asked.constraints.radius == inspect.signature(tp.Problem).parameters["radius"].default
    assert asked.planner.own == {}


def test_the_committed_schema_is_current():
    committed = json.loads((ROOT / "docs" / "scenario.schema.json").read_text())
    assert committed == scenario_schema(), "run: terrapath schema > docs/scenario.schema.json"


def test_the_schema_is_printed(capsys):
    assert run(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == scenario_schema()


def test_help_reads_no_scenario():
    import subprocess
    import sys

    program = (
        "import sys\nfrom terrapath.cli.main import run\n"
        "for command in ('plan', 'init', 'schema'):\n    assert run([command, '--help']) == 0\n"
        "assert not {'terrapath.scenario.toml', 'numpy', 'tomllib'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr


# Reading


FULL = """
[map]
path = "../maps/dem.tif"
height_band = 2
fill_holes = 50.0
smooth = 20
layers.rocks = { file = "../maps/dem.tif", weight = 50 }
[map.costs.going]
file = "../maps/dem.tif"
band = 3
weight = 0.5
[map.weights]
height = 10
[route]
start = [500100, 4000100]
goal = [[500400, 4000300], [500200, 4000350.5]]
all_goals = true
via = [[500250, 4000050]]
bounds = [500000.0, 4000000.0, 500500.0, 4000400.0]
[constraints]
obstacles = ["lake.geojson", "/abs/wall.gpkg"]
radius = 5.0
max_slope = 30
keep_in = "area.geojson"
[planner]
name = "fast-marching"
refine = false
spacing = 5
[output]
files = ["route.geojson"]
certificate = "proof.npz"
"""


def test_values_are_read_as_they_stand_and_paths_from_the_files_folder(tmp_path):
    file = tmp_path / "full.toml"
    file.write_text(FULL)
    asked = read_scenario(file)
    raster = str(tmp_path / "../maps/dem.tif")
    assert asked.map.path == raster
    assert asked.map.smooth == 20.0
    assert asked.map.layers == {"rocks": LayerTable(file=raster, band=1, weight=50.0)}
    assert asked.map.costs == {"going": LayerTable(file=raster, band=3, weight=0.5)}
    assert asked.map.weights == {"height": 10.0}
    assert asked.route.start == (500100.0, 4000100.0)
    assert asked.route.goals == ((500400.0, 4000300.0), (500200.0, 4000350.5))
    assert asked.constraints.obstacles == (str(tmp_path / "lake.geojson"), "/abs/wall.gpkg")
    assert asked.planner.own == {"spacing": 5.0}
    assert asked.output.certificate == str(tmp_path / "proof.npz")
    assert read_scenario(file) == asked
    with pytest.raises(dataclasses.FrozenInstanceError):
        asked.map.path = "other"


def test_a_layer_of_a_file_is_looked_for_beside_the_scenario(folder, capsys):
    lakes = geopandas.GeoDataFrame(geometry=[shapely.box(2, 6, 4, 8)], crs="EPSG:32617")
    for name in ("lakes", "area"):
        lakes.to_file("../maps/data.gpkg", layer=name)
    file = scenario(
        '[map]\nscene = "one-peak"\n[constraints]\nobstacles = ["data.gpkg:lakes", "data.gpkg"]\n'
        'keep_in = "data.gpkg:area"\n',
        "../maps/a.toml",
    )
    limits = read_scenario(file).constraints
    assert limits.obstacles == ("../maps/data.gpkg:lakes", "../maps/data.gpkg")
    assert limits.keep_in == "../maps/data.gpkg:area"
    counts = [len(list(read_layers(Path(name)))) for name in limits.obstacles]
    assert counts == [1, 2]


# Named as GDAL does, or nowhere to be found: another program's word for it stays.
OTHER_NAMES = [
    "/vsizip/maps.zip/dem.tif",
    "/vsizip//abs/maps.zip/dem.tif",
    "/vsicurl/https://example.org/dem.tif",
    "https://example.org/dem.tif",
    'NETCDF:"dem.nc":height',
    "GPKG:data.gpkg:heights",
    "missing.gpkg:lakes",
    ":lakes",
    "folder:",
]


@pytest.mark.parametrize("name", OTHER_NAMES)
def test_names_that_gdal_alone_understands_stay_as_they_are(name, tmp_path):
    for folder in ("https", "folder"):
        (tmp_path / folder).mkdir()
    for file in ("dem.nc", "data.gpkg"):
        (tmp_path / file).touch()
    file = tmp_path / "a.toml"
    file.write_text(
        f"[map]\npath = '{name}'\n[map.layers.rocks]\nfile = '{name}'\n"
        f"[constraints]\nobstacles = ['{name}']\n"
    )
    asked = read_scenario(file)
    assert (
        asked.map.path == asked.map.layers["rocks"].file == asked.constraints.obstacles[0] == name
    )


def test_outputs_with_a_colon_go_beside_the_scenario(tmp_path):
    file = tmp_path / "a.toml"
    file.write_text(
        '[map]\nscene = "one-peak"\n[output]\nfiles = ["route-12:30.geojson", "/abs/a:b.csv"]\n'
        'plot = "route-12:30.png"\n'
    )
    output = read_scenario(file).output
    assert output.files == (str(tmp_path / "route-12:30.geojson"), "/abs/a:b.csv")
    assert output.plot == str(tmp_path / "route-12:30.png")


def test_one_goal_and_a_list_of_goals_are_told_apart(tmp_path):
    file = tmp_path / "a.toml"
    for text, goals in (("[1, 2]", ((1.0, 2.0),)), ("[[1, 2]]", ((1.0, 2.0),)), ("[]", ())):
        file.write_text(f'[map]\nscene = "one-peak"\n[route]\ngoal = {text}\n')
        assert read_scenario(file).route.goals == goals


# Text that stands for {X}; what the one line says.
HEAD = '# a comment\n[map]\nscene = "one-peak"\n\n'
WRONG = {
    "a word for a number": ('[constraints]\nradius = "wide"', "line 6", "'wide'", "number"),
    "true for a number": ("[constraints]\nradius = true", "line 6", "True", "a finite number"),
    "not a number": ("[constraints]\nradius = nan", "line 6", "a finite number"),
    "infinity": ("[planner]\nstep = inf", "line 6", "step", "a finite number"),
    "a fraction": ("[planner]\nsamples = 1.5", "line 6", "samples", "1.5", "a whole number"),
    "a number for a word": ("[planner]\nname = 3", "line 6", "name in [planner] is 3", "text"),
    "a number for a switch": ("[route]\nlatlon = 1", "line 6", "latlon", "true or false"),
    "one coordinate": ("[route]\nstart = [1]", "line 6", "start in [route] is [1]", "[X, Y]"),
    "text for a point": ('[route]\nstart = "1,2"', "line 6", "'1,2'", "[X, Y]"),
    "a bad waypoint": (
        "[route]\nvia = [[1, 2],\n  [3]]\ngoal = [1, 2]",
        "line 6",
        "via",
        "a list of points",
    ),
    "a date": ("[route]\nstart = 2026-01-01", "line 6", "start", "[X, Y]"),
    "three corners": ("[route]\nbounds = [1, 2, 3]", "line 6", "bounds", "[X1, Y1, X2, Y2]"),
    "one file for a list": ('[output]\nfiles = "a.csv"', "line 6", "files", "a list of paths"),
    "a word for a length": ('[map.layers.a]\nfile = "a"\nband = "b"', "line 7", "layers.a.band"),
    "a layer without a file": ("[map.layers.a]\nband = 2", "line 5", "layers.a", "'file'"),
    "a weight in words": ('[map.weights]\nheight = "much"', "line 6", "weights.height", "number"),
    "a section as a value": ("[route]\n[constraints]\n[planner]\n[[output]]", "line 8", "[output]"),
    "a misspelt key": ("[route]\nstrat = [1, 2]", "line 6", "'strat'", "[route]", "start?"),
    "a key of another section": ("[route]\nradius = 3", "line 6", "radius in [constraints]?"),
    "a flag's name": ('[planner]\nplanner = "rrt"', "line 6", "did you mean name?"),
    "a flag's name elsewhere": ('[output]\noutput = ["a.csv"]', "line 6", "did you mean files?"),
    "an unlike key": ("[route]\nxyzzy = 3", "line 6", "'xyzzy'", "choose one of start, goal"),
    "a misspelt section": ("[rout]\nstart = [1, 2]", "line 5", "[rout]", "did you mean route?"),
    "a misspelt key of a layer": ('[map.layers.a]\nflie = "a"', "line 6", "'flie'", "file?"),
    "no TOML": ("[route\n", "line 5", "not valid TOML"),
    "twice": ("[route]\nstart = [1, 2]\nstart = [1, 2]", "line 7", "not valid TOML"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_with_line_key_value_and_remedy(name, folder, capsys):
    text, *words = WRONG[name]
    refused(capsys, ["plan", scenario(HEAD + text + "\n")], "scenario.toml", *words)
    refused(capsys, ["check", "scenario.toml", "proof.npz"], *words)
    assert [path.name for path in folder.iterdir()] == ["scenario.toml"]


def test_files_that_are_no_scenarios_give_one_clear_line(folder, capsys):
    refused(capsys, ["plan", "missing.toml"], "missing.toml", "No such file")
    Path("folder.toml").mkdir()
    refused(capsys, ["plan", "folder.toml"], "folder.toml", "not a file")
    Path("binary.toml").write_bytes(b"\n\n\xff\xfe\x00")
    refused(capsys, ["plan", "binary.toml"], "binary.toml, line 3", "UTF-8")
    Path("large.toml").write_bytes(b"#" * 2_000_000)
    refused(capsys, ["plan", "large.toml"], "large.toml", "bytes")
    refused(capsys, ["plan", scenario("x = " + "[" * 100_000, "deep.toml")], "deep.toml")
    refused(capsys, ["plan", scenario("", "empty.toml")], "neither a path nor a scene")
    both = '[map]\npath = "a.tif"\n\nscene = "one-peak"\n'
    refused(capsys, ["plan", scenario(both, "both.toml")], "line 4", "both a path and a scene")
    digits = f'[map]\nscene = "one-peak"\n[planner]\nseed = {"9" * 5000}\n'
    refused(capsys, ["plan", scenario(digits, "digits.toml")], "digits.toml")


def test_lines_are_right_in_a_file_of_every_form(folder, capsys):
    """The wrong key's line, found by putting it at every place of a long file in turn."""
    lines = (ROOT / "docs" / "scenarios.md").read_text().split("```toml\n")[1].split("```")[0]
    given = lines.split("\n")
    for k, line in enumerate(given):
        if line.startswith("["):
            text = "\n".join([*given[: k + 1], "# kept", "zzzzzz = {}", *given[k + 1 :]])
            refused(capsys, ["plan", scenario(text)], f"line {k + 3}:", "zzzzzz")


# Overriding


def test_the_command_line_counts_before_the_file(folder, capsys):
    file = scenario(
        '[map]\nscene = "six-peaks"\nweights = { height = 2.0, resistance = 3.0 }\n'
        "[route]\ngoal = [9.0, 8.0]\nvia = [[2, 2]]\n"
        "[planner]\nsamples = 300\nseed = 5\nbound = false\n"
    )
    answer = answer_of(capsys, file)
    assert (answer["samples"], answer["seed"]) == (600, 5)  # of two legs
    assert answer["goal"] == [9.0, 8.0]
    assert answer["layers"] == {"height": 2.0, "resistance": 3.0}
    given = ["--seed", "6", "--goal", "1,4", "--weight", "height=1", "--via", "1,1", "--via", "1,3"]
    answer = answer_of(capsys, file, *given)
    assert (answer["samples"], answer["seed"]) == (900, 6)
    assert [leg["goal"] for leg in answer["legs"]] == [[1.0, 1.0], [1.0, 3.0], [1.0, 4.0]]
    assert answer["layers"] == {"height": 1.0, "resistance": 3.0}


def test_a_scenario_and_its_options_give_the_same_route(folder, capsys):
    lake = shapely.box(500_200, 4_000_150, 500_260, 4_000_260)
    frame = geopandas.GeoDataFrame(geometry=[lake], crs="EPSG:32617").to_crs("EPSG:4326")
    frame.to_file("lake.geojson")
    dem = "../maps/dem.tif"
    file = scenario(
        f'[map]\npath = "{dem}"\nheight_band = 2\n[map.layers.x]\nfile = "{dem}"\nweight = 50\n'
        "[route]\nstart = [500100, 4000100]\ngoal = [500400, 4000300]\n"
        '[constraints]\nobstacles = ["lake.geojson"]\nradius = 8\n'
        "[planner]\nsamples = 400\nbound = false\n"
    )
    by_file = answer_of(capsys, file)
    by_options = answer_of(
        capsys, dem, "--height-band", 2, "--layer", f"x={dem}:1*50", "--start", "500100,4000100",
        "--goal", "500400,4000300", "--obstacles", "lake.geojson", "--radius", "8", *QUICK,
    )  # fmt: skip
    assert by_file["path"] == by_options["path"]
    assert shapely.LineString(by_file["path"]).distance(lake) >= 8.0 - 0.02  # as the file bends


def test_constraints_hold_on_the_raster(folder, capsys):
    dem = "../maps/dem.tif"
    area = shapely.box(500_050, 4_000_020, 500_450, 4_000_380)
    geopandas.GeoDataFrame(geometry=[area], crs="EPSG:32617").to_file("area.gpkg")
    ends = ["--start", "500100,4000200", "--goal", "500420,4000200", "--height-band", "2"]
    free = answer_of(capsys, dem, *ends, *QUICK)
    held = answer_of(capsys, dem, *ends, *QUICK, "--max-slope", 8, "--keep-in", "area.gpkg")
    surface = tp.read_surface(dem, height_band=2)

    def steepest(answer):
        path = tp.Problem(surface, answer["start"], answer["goal"]).path(answer["path"])
        slopes = surface.jet(path.profile.points)[1] if hasattr(surface, "jet") else None
        if slopes is None:
            points, step = path.profile.points, 0.01
            moved = [surface.values(points + offset)[:, 0] for offset in
                     ((step, 0), (-step, 0), (0, step), (0, -step))]  # fmt: skip
            rise = np.hypot(moved[0] - moved[1], moved[2] - moved[3]) / (2 * step)
        else:
            rise = np.linalg.norm(slopes, axis=-1)
        return np.degrees(np.arctan(rise)).max()

    assert steepest(free) > 12.0
    assert steepest(held) <= 8.0 + 1e-3
    assert area.contains(shapely.LineString(held["path"]))


def test_bounds_are_in_the_maps_own_coordinates(folder, capsys):
    dem = "../maps/dem.tif"
    asked = ["--height-band", 2, "--start", "500300,4000100", "--goal", "500420,4000300", *QUICK]
    answer = answer_of(capsys, dem, *asked, "--bounds", "500290,4000020,500450,4000390")
    x = np.array(answer["path"])[:, 0]
    assert x.min() >= 500_290
    assert x.max() <= 500_450
    refused(capsys, ["plan", dem, *asked, "--bounds", "0,0,1,1"], "0")
    refused(capsys, ["plan", dem, *asked, "--bounds", "1,2,3"], "bounds='1,2,3'", "X1,Y1,X2,Y2")
    refused(capsys, ["plan", "six-peaks", "--bounds", "3,3,1,1"], "empty")


# lat,lon


def test_latitude_and_longitude_are_taken(folder, capsys):
    dem = "../maps/dem.tif"
    geographic = pyproj.Transformer.from_crs("EPSG:32617", "EPSG:4326")  # lat, lon
    stops = [(500_100, 4_000_100), (500_250, 4_000_050), (500_400, 4_000_300)]
    start, via, goal = (",".join(map(repr, geographic.transform(*stop))) for stop in stops)
    answer = answer_of(
        capsys, dem, "--height-band", 2, "--latlon", "--start", start, "--via", via, "--goal", goal,
        *QUICK,
    )  # fmt: skip
    found = [answer["start"], *(leg["goal"] for leg in answer["legs"])]
    assert np.abs(np.subtract(found, stops)).max() < 1e-3
    turned = ["plan", dem, "--latlon", "--height-band", "2", "--goal", goal]
    refused(capsys, [*turned, "--start", "-81,36.1"], "start=(-81, 36.1)", "lat,lon")
    refused(capsys, [*turned, "--start", "-100,36.1"], "start=(-100, 36.1)", "lat,lon")
    refused(capsys, ["plan", "six-peaks", "--latlon", "--start", "1,1"], "--latlon", "no CRS")


# Goals and certificates


def test_several_goals_are_answered_and_reported(folder, capsys):
    asked = ["six-peaks", "--goal", "9,2", "--goal", "2,3", *QUICK]
    near = answer_of(capsys, *asked)
    assert near["goal"] == [2.0, 3.0]
    assert [goal["status"] for goal in near["goals"]] == ["farther", "solved"]
    every = answer_of(capsys, *asked, "--all-goals")
    assert [goal["status"] for goal in every["goals"]] == ["solved", "solved"]
    assert every["path"] == near["path"] == every["goals"][1]["path"]
    assert every["goals"][0]["path"][-1] == [9.0, 2.0]
    assert run(["plan", *asked, "--all-goals", "--via", "1,1", "-q"]) == 0
    table = capsys.readouterr().out
    for words in ("Goals", "9, 2", "2, 3", "Legs", "1, 1"):
        assert words in table
    refused(capsys, ["plan", "six-peaks", "--all-goals"], "--all-goals", "--goal")


def test_certificates_of_legs_are_numbered_and_hold(folder, capsys):
    file = scenario(
        '[map]\nscene = "one-peak"\n[route]\nvia = [[8, 2]]\n[planner]\nsamples = 300\n'
        '[output]\ncertificate = "proof.npz"\nquiet = true\n'
    )
    assert run(["plan", file]) == 0
    capsys.readouterr()
    assert {path.name for path in folder.iterdir()} == {file, "proof-1.npz", "proof-2.npz"}
    for k in (1, 2):
        assert run(["check", file, f"proof-{k}.npz", "--leg", str(k)]) == 0
        assert "holds" in capsys.readouterr().out
    refused(capsys, ["check", file, "proof-1.npz", "--leg", "2"], "start or goal differ")
    refused(capsys, ["check", file, "proof-1.npz"], "2 legs", "--leg")
    refused(capsys, ["check", file, "proof-1.npz", "--leg", "3"], "--leg 3")
    two = ["check", file, "proof-1.npz", "--goal", "1,1", "--goal", "2,2"]
    refused(capsys, two, "one goal", "2 are given")


def test_a_field_minds_obstacles_of_its_scenario(folder, capsys):
    wall = shapely.box(500_200, 4_000_000, 500_220, 4_000_300)
    geopandas.GeoDataFrame(geometry=[wall], crs="EPSG:32617").to_file("wall.gpkg")
    file = scenario(
        '[map]\npath = "../maps/dem.tif"\nheight_band = 2\n[route]\nstart = [500100, 4000100]\n'
        '[constraints]\nobstacles = ["wall.gpkg"]\n[planner]\nspacing = 10\n'
    )
    assert run(["field", file, "--output", "f.npz"]) == 0
    capsys.readouterr()
    with np.load("f.npz") as archive:
        column = np.abs(archive["x"] - 500_210).argmin()
        row = np.abs(archive["y"] - 4_000_100).argmin()
        assert np.isnan(archive["distance"][row, column]) or np.isinf(
            archive["distance"][row, column]
        )
        beyond = archive["distance"][row, np.abs(archive["x"] - 500_300).argmin()]
    assert beyond > 400.0  # round the wall's end, not through it


# init


@pytest.mark.parametrize("name", ["six-peaks", "jacksboro"])
def test_the_scenario_of_a_scene_plans_as_it_stands(name, folder, capsys):
    assert run(["init", name]) == 0
    assert f"{name}.toml" in capsys.readouterr().out
    written = answer_of(capsys, f"{name}.toml", *QUICK)
    direct = answer_of(capsys, name, *QUICK)
    assert written["length"] == pytest.approx(direct["length"], rel=0.05)
    assert np.abs(np.subtract(written["start"], direct["start"])).max() < 1.0


def test_the_scenario_of_a_map_plans_as_it_stands_from_anywhere(folder, capsys, monkeypatch):
    assert run(["init", "../maps/dem.tif", "--output", "a.toml"]) == 0
    capsys.readouterr()
    asked = read_scenario("a.toml")
    assert asked.map.height_band == 2  # "slope of the dem" is no height
    text = Path("a.toml").read_text()
    for words in ("2 DEM, metres", "3 going", "[map.layers.going]"):
        assert words in text
    monkeypatch.chdir("/")
    answer = answer_of(capsys, folder / "a.toml", *QUICK)
    assert answer["status"] == "solved"
    assert np.hypot(*np.subtract(answer["start"], answer["goal"])) > 400.0


def test_the_scenario_of_a_map_in_an_archive_names_it_as_gdal_does(folder, capsys):
    with zipfile.ZipFile("maps.zip", "w") as archive:
        archive.write("../maps/dem.tif", "dem.tif")
    name = f"/vsizip/{Path('maps.zip').resolve()}/dem.tif"
    assert run(["init", name, "--output", "a.toml"]) == 0
    assert capsys.readouterr().err == ""
    assert read_scenario("a.toml").map.path == name
    assert answer_of(capsys, "a.toml", *QUICK)["status"] == "solved"


def test_a_map_without_a_crs_is_given_one(folder, capsys):
    with rasterio.open("../maps/dem.tif") as dataset:
        profile, values = dataset.profile, dataset.read(2)
    with rasterio.open("bare.tif", "w", **{**profile, "count": 1, "crs": None}) as dataset:
        dataset.write(values, 1)
    assert run(["init", "bare.tif", "--crs", "EPSG:32632"]) == 0
    assert read_scenario("bare.toml").map.crs == "EPSG:32632"
    capsys.readouterr()
    assert answer_of(capsys, "bare.toml", *QUICK)["crs"] == "EPSG:32632"


def test_every_key_stands_in_a_written_scenario_and_can_be_switched_on(folder, capsys):
    assert run(["init", "one-peak"]) == 0
    text = Path("one-peak.toml").read_text()
    in_files = [entry for entry in options() if entry.key != "allow_external"]
    for entry in in_files:
        shown = entry.key if entry.default != {} else f"[{entry.section}.{entry.key}"
        assert f"\n{shown}" in text or f"\n# {shown}" in text, entry.key
        for line in entry.option.help.split(". ")[0].split()[:3]:
            assert line in text
    switched = [
        line.removeprefix("# ")
        if line.startswith("# ") and (" = " in line or line.startswith(("# [map.", "# [travel.")))
        else line
        for line in text.split("\n")
    ]
    kept = [line for line in switched if not line.startswith(("#", "scene ="))]
    data = tomllib.loads("\n".join(kept))
    for entry in in_files:
        assert entry.key in data[entry.section] or entry.key == "scene", entry.key
    scenario("\n".join(kept), "all.toml")
    assert read_scenario("all.toml").planner.name == "rrt-star-r"


def test_init_overwrites_nothing_unless_forced(folder, capsys):
    Path("one-peak.toml").write_text("precious")
    refused(capsys, ["init", "one-peak"], "one-peak.toml exists", "--force")
    assert Path("one-peak.toml").read_text() == "precious"
    assert run(["init", "one-peak", "--force"]) == 0
    capsys.readouterr()
    assert read_scenario("one-peak.toml").map.scene == "one-peak"
    refused(capsys, ["init", "nowhere"], "nowhere", "six-peaks")
    refused(capsys, ["init", "missing.tif"], "missing.tif")
    refused(capsys, ["init", "one-peak", "--output", "a.txt"], "a.txt", ".toml")
    refused(capsys, ["init", "one-peak", "--output", "no/a.toml"], "no/a.toml")
    Path("text.tif").write_text("no raster")
    refused(capsys, ["init", "text.tif"], "text.tif")
    assert not Path("text.toml").exists()


# Interrupts and remarks


def test_an_interrupt_in_a_middle_leg_writes_nothing(folder, capsys, monkeypatch):
    from terrapath.planners.base import INTERRUPT, without_path

    solve = tours._Tour.leg

    def interrupt(tour, leg, number, count):
        if number == 2:
            raise KeyboardInterrupt
        return solve(tour, leg, number, count)

    def leg(tour, problem, number, count):
        try:
            return interrupt(tour, problem, number, count)
        except KeyboardInterrupt:
            return without_path(problem, "rrt", tp.Status.INTERRUPTED, INTERRUPT)

    monkeypatch.setattr(tours._Tour, "leg", leg)
    code = run(["plan", "one-peak", "--via", "8,2", "--output", "a.json", *QUICK, "--json"])
    captured = capsys.readouterr()
    assert code == 130
    record = json.loads(captured.out)
    assert record["status"] == "interrupted"
    assert record["path"] is None
    assert [leg["status"] for leg in record["legs"]] == ["solved", "interrupted"]
    assert list(folder.iterdir()) == []


def test_repairs_are_one_line_each_on_standard_error(folder, capsys):
    bow = shapely.Polygon([(-84.3, 36.6), (-84.2, 36.65), (-84.2, 36.6), (-84.3, 36.65)])
    record = {"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(bow)}
    Path("bow.json").write_text(json.dumps({"type": "FeatureCollection", "features": [record]}))
    code = run(["plan", "jacksboro", "--obstacles", "bow.json", *QUICK, "--json"])
    captured = capsys.readouterr()
    assert code == 0
    assert json.loads(captured.out)["status"] == "solved"
    assert captured.err
    assert all(line.startswith("terrapath: ") for line in captured.err.splitlines())
    assert "bow.json" in captured.err


def test_python_reads_scenarios_too(folder):
    scenario('[map]\nscene = "one-peak"\n[planner]\nsmaples = 3\n')
    with pytest.raises(InputError, match="did you mean samples"):
        read_scenario("scenario.toml")
