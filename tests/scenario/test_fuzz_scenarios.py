"""Damaged scenarios: one clear line or a plan, never a traceback, a hang or half a file."""

import random
import signal
import warnings
from importlib import import_module

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from rasterio.transform import from_origin
from typer.main import get_command

from common import made_up
from terrapath.cli.main import run
from terrapath.scenario import answers
from terrapath.scenario.outputs import RouteOutputs

main = import_module("terrapath.cli.main")

SECONDS = 20  # for one damaged file, before it counts as hanging

SCENE = """\
# a scenario
[map]
scene = "six-peaks"
[map.weights]
height = 2.0
resistance = 1
[route]
start = [0.5, 0.25]
goal = [[9, 9], [8.0, 2.0]]
via = [
  [5, 2],
]
all_goals = false
bounds = [-1.0, -1, 11, 11.0]
[constraints]
radius = 0.05
[planner]
name = "rrt-star-r"
samples = 200
seed = 3
refine = true
step = 1.0
target_gap = 0.1
[output]
files = ["route.json", "route.csv"]
plot = "route.png"
quiet = true
json = false
"""

MAP = """\
[map]
path = "dem.tif"
height_band = 1
smooth = 15.0
fill_holes = 40
crs = "EPSG:32617"
layers.rocks = { file = "dem.tif", band = 2, weight = 50.0 }
[route]
start = [500100.0, 4000100.0]
goal = [500200, 4000160]
latlon = false
[constraints]
obstacles = ["wall.geojson"]
radius = 1
max_slope = 85
keep_in = "area.geojson"
[planner]
name = "optimal"
spacing = 5.0
time_limit = 10
[output]
files = ["route.geojson"]
certificate = "proof.npz"
"""

WORDS = [
    "nan", "inf", "-inf", "1e308", "-1", "0", "0.0", "1e-300", "1_000", "9" * 400, "true", "false",
    '""', '"x"', '"\\u0000"', '"six-peaks"', '"dem.tif"', '"missing.tif"', '"."', "[]", "[[]]",
    "{}", "[1, 2]", "[1, 2, 3]", "[[1, 2], [3]]", "[nan, 1]", "2026-01-01", "12:00:00", "0x10",
    "'''", '"""', "[", "]", "{", "=", ".", "#", "\n", "[map]", "[[map]]", "[route.start]", "a = 1",
    "map", "route", "planner", "goal", '"\U0001f5fb"', "\ufeff", "\x00", "\r", "'NETCDF:\"a\":b'",
    '"/vsizip/a.zip/b.tif"', '"' + "a" * 5000 + '"', "[" * 500, "1e999999999", "-0", "+inf",
]  # fmt: skip


def mutated_bytes(text, generator):
    data = bytearray(text.encode())
    for _ in range(generator.choice([1, 1, 2, 4, 16])):
        place = generator.randrange(len(data) + 1)
        kind = generator.randrange(4)
        if kind == 0:
            data[place:place] = bytes([generator.randrange(256)])
        elif kind == 1:
            del data[place : place + generator.choice([1, 1, 3, 40])]
        elif kind == 2 and place < len(data):
            data[place] ^= 1 << generator.randrange(8)
        else:
            start = generator.randrange(len(data) + 1)
            data[place:place] = data[start : start + generator.choice([1, 5, 60])]
        data = data or bytearray(b"[")
    return bytes(data)


def mutated_tokens(text, generator):
    lines = text.split("\n")
    for _ in range(generator.choice([1, 1, 2, 3])):
        k = generator.randrange(len(lines))
        key, equals, value = lines[k].partition(" = ")
        kind = generator.randrange(6)
        if kind <= 2 and equals:
            lines[k] = f"{key} = {generator.choice(WORDS)}"
        elif kind == 3 and equals:
            lines[k] = f"{generator.choice(WORDS)} = {value}"
        elif kind == 4:
            lines.insert(generator.randrange(len(lines) + 1), lines.pop(k))
        else:
            lines.insert(k, generator.choice([*WORDS, *lines]))
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def straight_answer(run):
    """In place of planning: the problem is made, its ends are checked, a line is drawn.

    Where that touches an obstacle the solution does not return it: exit code 3.
    """
    problem = run._itinerary().problem
    return made_up(problem, [problem.start, problem.goal], planner=run.planner.name), ()


def give_up(*_):
    raise TimeoutError("a damaged scenario hangs")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    y, x = np.mgrid[0:20, 0:25] * 10.0
    height = 3.0 * np.exp(-((x - 125) ** 2 + (y - 100) ** 2) / 4000.0)
    profile = {
        "driver": "GTiff", "width": 25, "height": 20, "count": 2, "dtype": "float64",
        "transform": from_origin(500_000.0, 4_000_200.0, 10.0, 10.0), "nodata": -9999.0,
    }  # fmt: skip
    with rasterio.open(tmp_path / "dem.tif", "w", crs="EPSG:32617", **profile) as dataset:
        dataset.write(height, 1)
        dataset.write(x / 250.0, 2)
    shapes = {
        "wall": shapely.box(500_120, 4_000_050, 500_125, 4_000_150),
        "area": shapely.box(500_020, 4_000_020, 500_230, 4_000_180),
    }
    for name, shape in shapes.items():
        frame = geopandas.GeoDataFrame(geometry=[shape], crs="EPSG:32617").to_crs("EPSG:4326")
        frame.to_file(tmp_path / f"{name}.geojson")
    monkeypatch.chdir(tmp_path)
    # Typer makes its commands anew for every call, which takes as long as all the rest.
    command = get_command(main.application())
    monkeypatch.setattr(main, "application", lambda names: command)
    # What is drawn and written has tests of its own, and would go where a mutation says.
    monkeypatch.setattr(answers._Run, "whole", straight_answer)
    monkeypatch.setattr(RouteOutputs, "write", lambda *_: None)
    return tmp_path


def answers_cleanly(file, content, capsys):
    """Is it planned (True) or refused in one line (False)? All else is a failure."""
    file.write_bytes(content)
    before = sorted(file.parent.iterdir())
    previous = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of libraries; the project's own are shown as lines
            code = run(["plan", str(file)])
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)
    captured = capsys.readouterr()
    assert code in {0, 2, 3}
    lines = captured.err.split("\n")[:-1]
    assert all(line.startswith("terrapath: ") for line in lines), captured.err
    assert "Traceback" not in captured.err
    if code == 2:
        assert captured.out == ""
        assert lines, "nothing says what is wrong"
        assert len(lines[-1]) < 6000
    assert sorted(file.parent.iterdir()) == before
    return code != 2


@pytest.mark.parametrize("mutate", [mutated_bytes, mutated_tokens])
@pytest.mark.parametrize(
    ("text", "count"), [pytest.param(SCENE, 800, marks=pytest.mark.slow), (MAP, 300)]
)
def test_damaged_scenarios_are_planned_or_refused_in_one_line(text, count, mutate, folder, capsys):
    file = folder / "scenario.toml"
    assert answers_cleanly(file, text.encode(), capsys)  # undamaged
    generator = random.Random(5)
    good = sum(answers_cleanly(file, mutate(text, generator), capsys) for _ in range(count))
    assert 0 < good < count  # both happen, or the mutations say nothing
