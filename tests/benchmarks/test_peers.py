"""The benchmark's peers: programs in C++, OMPL through Python, lattices, growth, edges."""

import dataclasses
import itertools
import json
import math
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import (
    contenders,
    curves,
    edges,
    grids,
    growth,
    ompl_python,
    peer_report,
    problems,
    processes,
    programs,
    run as runs,
    trees,
)
from benchmarks.exchange import discs_of, panel_of, write_problem
from benchmarks.peers import OMPL_PYTHON, Peer
from benchmarks.settings import Scale
from benchmarks.timing import Target, Timing
from common import ROOT
from terrapath import Circle, Problem, Surface
from terrapath.errors import InputError, TerrapathError
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Store
from terrapath.problem import scenes
from terrapath.surface import metric

TINY = Scale(
    tree_scenes=("six-peaks",),
    tree_seeds=2,
    few_tree_seeds=1,
    sweep_seeds=1,
    final_seeds=2,
    tree_looks=(200, 800),
    cpp_looks=(0.01, 0.03),
    python_looks=(0.05, 0.1),
    grid_scenes=("three-peaks",),
    grid_nodes=(61,),
    mesh_nodes=(61,),
    grid_repeats=1,
    growth_samples=(1_000, 10_000),
    growth_repeats=1,
    edges=500,
    edge_repeats=2,
)
LOOK = {"wall": 0.5, "processor": 0.4}
PATH = [0.0, 0.0, 1.0, 9.0, 10.0, 10.0]


class FakeProgram:
    """A program in C++ that was there, and found one path at its second look."""

    version = "1.0"
    missing = "it is missing"

    def __init__(self):
        self.calls = []

    def run(self, arguments):
        self.calls.append(arguments[1:])
        first = {**LOOK, "cost": None, "path": []}
        second = {"wall": 1.0, "processor": 0.9, "cost": 20.0, "path": PATH}
        return {"looks": [first, second, {**second, "wall": 2.0, "processor": 1.9, "path": []}]}


@pytest.fixture
def fake_ompl(monkeypatch):
    program = FakeProgram()
    monkeypatch.setattr(trees, "OMPL_PLANNERS", program)
    monkeypatch.setattr(Peer, "version", "2.0")
    monkeypatch.setattr(trees, "run_fresh", lambda *task: program.run(["", "python"]))
    return program


@pytest.fixture
def no_peers(monkeypatch):
    absent = programs.Program("A program", "no_such_source.cpp")
    for module, name in ((trees, "OMPL_PLANNERS"), (edges, "EDGES_LOOP")):
        monkeypatch.setattr(module, name, absent)
    monkeypatch.setattr(Peer, "load", lambda self: None)


@pytest.fixture
def here(monkeypatch):
    """What fresh processes would measure, in this one."""
    monkeypatch.setattr(
        grids.GridTrial, "measure", lambda self: grids.measure_grid(self.scene, self.planner)
    )
    monkeypatch.setattr(
        growth.GrowthTrial, "measure", lambda self: growth.measure_growth(self.scene, self.planner)
    )


@pytest.fixture
def runner(tmp_path):
    return Runner(Store(tmp_path), 1)


# Trees


def test_trees_are_compared_with_their_best_options_and_stored(runner, fake_ompl, monkeypatch):
    data = trees.run_trees(TINY, runner)
    scene = data.scenes["six-peaks"]
    assert list(scene.found) == [c.label for c in contenders.contenders(12.0)]
    assert data.missing == []
    ours = scene.found[contenders.OURS].curve
    assert len(ours.seconds) == len(ours.middle) == 8  # 200 * 1.25^k below 800, and 800
    assert scene.optimum.length == problems.find_optimum("six-peaks", None, None).length
    theirs = scene.found[contenders.CPP_RRT].curve
    assert theirs.seconds == (0.4, 0.9, 1.9)
    length = metric.curve_length(
        problems.load_problem("six-peaks").surface, np.reshape(PATH, (-1, 2))
    )
    assert theirs.middle == (math.inf, length, length)
    assert theirs.time_to(length) == 0.9
    assert theirs.time_to(0.99 * length) is None
    # Seeds are never 0, which OMPL takes for none.
    assert {call[1] for call in fake_ompl.calls if call[0] == "rrt-star"} == {"1", "2"}
    lines = peer_report.trees_lines(data)
    assert any(line.startswith("| OMPL RRT\\* in C++ | range 1, ") for line in lines)
    assert all(line.endswith(" |") for line in lines if line.startswith("|"))

    monkeypatch.setattr(trees.TreeTrial, "measure", lambda self: pytest.fail("measured again"))
    assert trees.run_trees(TINY, runner) == data


def test_of_the_best_three_of_a_sweep_more_seeds_choose(runner, monkeypatch):
    contender = contenders.contenders(12.0)[0]
    sweep = dict(zip(contender.choices, (5, 3, 9, 1, 2, 4, 6, 7, 8, 10, 11, 12), strict=True))
    # All others would be better still with more seeds, and are not tried.
    final = dict.fromkeys(sweep, 0)
    first, second, third = sorted(sweep, key=sweep.get)[:3]
    final |= {first: 3, second: 1, third: 2}

    def ranked(self, asked, choices, seeds):
        assert asked is contender
        return sorted(choices, key={TINY.sweep_seeds: sweep, TINY.final_seeds: final}[seeds].get)

    monkeypatch.setattr(trees._Comparison, "_ranked", ranked)
    assert trees._Comparison("six-peaks", TINY, runner)._best_options(contender) == second


def test_between_two_looks_the_logarithm_of_the_time_goes_with_the_length():
    timing = tuple(Timing((s,), (s,)) for s in (1.0, 4.0, 16.0))
    lengths = (math.inf, 12.0, 10.0)
    curve = curves.MedianCurve(timing, lengths, lengths, lengths)
    assert curve.time_between_looks(11.0) == pytest.approx(8.0)
    assert curve.time_between_looks(10.0) == pytest.approx(16.0)
    assert curve.time_between_looks(12.0) == curve.time_between_looks(13.0) == 4.0
    assert curve.time_between_looks(9.0) is None


def test_targets_of_trees_are_ratios_at_equal_length():
    def best(label, program, seconds, lengths):
        contender = contenders.Contender(label=label, program=program, planner="x", choices=((),))
        timing = tuple(Timing((s,), (s,)) for s in seconds)
        return trees.Best(contender, (), curves.MedianCurve(timing, lengths, lengths, lengths))

    found = {
        contenders.OURS: best("", contenders.TERRAPATH, (0.01, 0.02), (10.4, 10.0)),
        contenders.OURS_INFORMED: best("", contenders.TERRAPATH, (0.01, 0.03), (10.4, 10.0)),
        contenders.CPP_RRT: best("", contenders.CPP, (1.0, 2.0, 3.0), (11.0, 10.3, 10.3)),
        contenders.PYTHON_RRT: best("", contenders.PYTHON, (5.0, 9.0), (math.inf, 10.5)),
    }
    scene = trees.SceneTrees(problems.Optimum(10.0, None), found)
    data = trees.TreesData({"flat": scene}, 20, [], {})
    cpp, python, near = trees.trees_targets(data)
    assert cpp.found == pytest.approx(2.0 / 0.02)
    assert cpp.met
    assert "within 3 %" in cpp.what
    assert python.found == pytest.approx(9.0 / 0.01)
    # None of OMPL's got within 0.5 %; the longest of them tried for 9 s.
    assert near.found == pytest.approx(9.0 / 0.03)
    assert "at least" in near.what
    lost = dataclasses.replace(
        scene, found={**found, contenders.OURS: found[contenders.PYTHON_RRT]}
    )
    cpp, *_ = trees.trees_targets(trees.TreesData({"flat": lost}, 20, [], {}))
    assert not cpp.met
    assert "does not get within 3 %" in cpp.verdict
    # Options that end nearer set the length; each side then has those that get there first.
    late = {
        contenders.in_the_end(contenders.OURS): best("", contenders.TERRAPATH, (0.05,), (10.0,)),
        contenders.in_the_end(contenders.CPP_RRT): best("", contenders.CPP, (4.0,), (10.2,)),
    }
    for ours, seconds in ((found[contenders.OURS], 0.02), (found[contenders.PYTHON_RRT], 0.05)):
        both = dataclasses.replace(scene, found={**found, **late, contenders.OURS: ours})
        cpp, *_ = trees.trees_targets(trees.TreesData({"flat": both}, 20, [], {}))
        assert cpp.found == pytest.approx(4.0 / seconds)
        assert "within 2 %" in cpp.what


def test_a_target_from_below():
    assert Target("", 20.0, "", 25.0, at_least=True).met
    missed = Target("", 20.0, "", 5.0, at_least=True)
    assert missed.verdict == "**not met**, 0.25 times the limit"


def test_peers_that_are_missing_are_named_and_left_out(runner, no_peers, here):
    data = trees.run_trees(TINY, runner)
    own = [contenders.OURS, contenders.OURS_INFORMED, contenders.OURS_REFINED]
    own += [contenders.in_the_end(contenders.OURS)]
    assert list(data.scenes["six-peaks"].found) == own
    assert trees.trees_targets(data) == []
    text = "\n".join(peer_report.trees_lines(data))
    assert "A program was left out: its source comes with terrapath's repository" in text
    assert "pip install 'terrapath[bench]'" in text

    found = edges.run_edges(TINY, runner)
    assert [target.unit for target in edges.edges_targets(found)] == ["ns"]
    assert "A program was left out" in "\n".join(peer_report.edges_lines(found))

    table = grids.run_grids(TINY, runner)
    assert {row.method for row in table.rows} == {"fast-marching", "dijkstra-8", "dijkstra-32"}
    assert len(table.missing) == 3


def test_a_path_through_an_obstacle_is_refused():
    problem = problems.load_problem("three-peaks-discs")
    with pytest.raises(TerrapathError, match="meets an obstacle"):
        curves.true_length_of(problem, [0.0, 0.0, 10.0, 10.0])


def test_quartiles_of_runs_of_which_some_found_nothing():
    def curve(*lengths):
        return curves.Curve(tuple(curves.CurvePoint(1.0, 1.0, n, n) for n in lengths))

    found = curves.MedianCurve.of([curve(None, 3.0), curve(None, 2.0), curve(4.0, 1.0)])
    assert found.middle == (math.inf, 2.0)
    assert found.low == (math.inf, 2.0)
    assert found.best == 2.0


# Problems as other programs get them


def test_discs_alone_are_handed_over():
    surface = Surface.from_peaks([[(1.0, 0.5, 5.0, 5.0)]])
    round_one = Problem(surface, (0, 0), (10, 10), scenes.REGION, [Circle(5, 5, 1)], radius=0.5)
    assert discs_of(round_one).tolist() == [[5.0, 5.0, 1.5]]
    slope = Problem(surface, (0, 0), (10, 10), scenes.REGION, max_slope=30.0, name="steep")
    with pytest.raises(InputError, match="steep: programs in C\\+\\+ take no obstacles but discs"):
        discs_of(slope)
    with pytest.raises(InputError, match="no obstacles but discs"):
        discs_of(scenes.load("jacksboro"))
    assert len(discs_of(problems.load_problem("jacksboro"))) == 0


def grounds():
    random = np.random.default_rng(3)
    values = random.normal(size=(2, 12, 17)).cumsum(axis=1)
    x, y = np.linspace(-2.0, 13.0, 17), np.linspace(-1.0, 11.0, 12)
    spline = Surface.from_grid(values, x, y, weights=[1.0, 0.3])
    return [
        scenes.load("six-peaks"),
        Problem(spline, (0, 0), (10, 10), scenes.REGION, [Circle(5, 5, 1)]),
    ]


@pytest.mark.parametrize("problem", grounds(), ids=["peaks", "spline"])
def test_the_objective_in_numpy_is_line_r(problem):
    measure = ompl_python.line_r_with_numpy(problem)
    for ax, ay, bx, by in edges.random_edges(problem, 50):
        expected = metric.line_r(problem.surface, (ax, ay), (bx, by))
        assert measure(ax, ay, bx, by) == pytest.approx(expected, rel=1e-12)
    # Longer than a panel: the sum of its halves.
    a, b = np.array([0.0, 1.0]), np.array([1.5 * panel_of(problem), 1.0])
    b = np.minimum(b, 10.9)
    count = math.ceil(math.dist(a, b) / panel_of(problem))
    places = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
    expected = metric.line_r(problem.surface, places[:-1], places[1:]).sum()
    assert measure(*a, *b) == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("problem", grounds(), ids=["peaks", "spline"])
def test_line_r_in_cpp_is_ours(problem):
    if programs.EDGES_LOOP.problem is not None:
        pytest.skip(programs.EDGES_LOOP.missing)
    ends = edges.random_edges(problem, 300)
    reading, lengths = edges.loop_lengths(problem, ends)
    expected = metric.line_r(problem.surface, ends[:, :2], ends[:, 2:])
    np.testing.assert_allclose(lengths, expected, rtol=1e-12)
    assert reading.wall > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["six-peaks", "three-peaks-discs"])
def test_ompl_in_cpp_believes_what_our_edges_say(scene):
    if programs.OMPL_PLANNERS.problem is not None:
        pytest.skip(programs.OMPL_PLANNERS.missing)
    problem = problems.load_problem(scene)
    run = trees.TreeRun(
        program=contenders.CPP,
        version="",
        planner="rrt-star",
        options=(("range", 3.0),),
        seed=0,
        first=0.1,
        last=0.2,
        growth=2.0,
    )
    trial = trees.TreeTrial(scene, run)
    first, last = trial._in_cpp()["looks"]
    assert 0.1 <= first["wall"] < last["wall"]
    path = np.reshape(first["path"], (-1, 2))
    assert tuple(path[0]) == problem.start
    assert tuple(path[-1]) == problem.goal
    chords = metric.chord(problem.surface, path[:-1], path[1:])
    # Some edges are longer than a panel.
    measure = ompl_python.line_r_with_numpy(problem)
    ours = [measure(*a, *b) for a, b in itertools.pairwise(path)]
    assert first["cost"] == pytest.approx(np.maximum(ours, chords).sum(), rel=1e-12)
    assert curves.true_length_of(problem, path) > 15.0


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["rrt-star", "bit-star"])
def test_ompl_through_python_goes_around_obstacles(planner):
    if OMPL_PYTHON.version is None:
        pytest.skip(OMPL_PYTHON.missing)
    everyone = contenders.contenders(12.0)
    as_of = next(
        c.as_of for c in everyone if (c.program, c.planner) == (contenders.PYTHON, planner)
    )
    options = next(c.choices for c in everyone if c.label == as_of)[-1]
    task = {"scene": "three-peaks-discs", "planner": planner, "options": options, "seed": 0}
    found = processes.run_fresh(
        "ompl_python", {**task, "first": 0.5, "last": 1.0, "growth": 2.0}, "OMPL"
    )
    curve = curves.curve_of_looks(problems.load_problem("three-peaks-discs"), found["looks"])
    assert len(curve.points) == 2
    assert curve.points[-1].length > 15.3
    assert curve.points[-1].cost == pytest.approx(curve.points[-1].length, rel=0.05)


# Programs


def test_a_program_that_does_not_compile_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(programs, "SOURCES", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "broken.cpp").write_text("int main( {")
    (tmp_path / "surface.hpp").write_text("")
    broken = programs.Program("Broken", "broken.cpp")
    assert broken.version is None
    if broken._compiler is None:
        assert "a C++ compiler" in broken.missing
    else:
        assert "broken.cpp does not compile here: " in broken.missing
    monkeypatch.setenv("CXX", "no-such-compiler")
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert "apt-get install g++" in programs.Program("Other", "broken.cpp").missing


def test_a_program_needs_its_library(monkeypatch):
    # The sources are the repository's, wherever the package is installed.
    monkeypatch.setattr(programs, "SOURCES", ROOT / "benchmarks" / "cpp")
    library = programs.Library("Nothing", ("no/such/header.h",), "NONE", ())
    program = programs.Program("Planners", "planners.cpp", library, "libnothing-dev")
    assert library.found_version is None
    assert program.missing == "Planners was left out: it needs libnothing-dev."


def test_a_program_that_fails_is_one_line(monkeypatch):
    monkeypatch.setattr(programs.Program, "_compile", lambda self: sys.executable)
    program = programs.Program("It", "edges.cpp")
    with pytest.raises(TerrapathError, match=r"It ended with code 3: told why"):
        program.run(["-c", "import sys; print('told why', file=sys.stderr); sys.exit(3)"])
    assert program.run(["-c", "print('{}')"]) == {}


def test_a_process_that_takes_too_long_is_ended(monkeypatch):
    def late(command, **options):
        raise subprocess.TimeoutExpired(command, options["timeout"])

    monkeypatch.setattr(subprocess, "run", late)
    with pytest.raises(TerrapathError, match="it did not end within 5 s"):
        processes.run_fresh("growth", {}, "it", timeout=5.0)


def test_what_a_process_measures_that_compiled_is_measured_again(monkeypatch):
    replies = [{"compiled": 2, "found": "first"}, {"compiled": 0, "found": "second"}]

    def done(command, **options):
        return subprocess.CompletedProcess(command, 0, json.dumps(replies.pop(0)), "")

    monkeypatch.setattr(subprocess, "run", done)
    assert processes.run_fresh("growth", {}, "it") == "second"
    assert replies == []


# Lattices, growth, edges


def test_lattices_and_meshes_tell_the_distance(runner, here):
    data = grids.run_grids(TINY, runner)
    errors = {row.method: row.error for row in data.rows}
    assert abs(errors["fast-marching"]) < 0.005
    # Along few directions, and none for isotropic costs.
    assert errors["dijkstra-8"] > errors["dijkstra-32"] > 0.0
    bounds = {"exact-mesh": 0.01, "heat": 0.05, "mesh-marching": 0.05, "edge-flips": 0.2}
    for method, bound in {**bounds, "mcp": 0.2}.items():
        if grids.METHODS[method].is_there:
            assert abs(errors[method]) < bound, method
    for line in peer_report.grids_lines(data)[-len(errors) :]:
        assert not line or line.startswith("| three-peaks |")


def test_meshes_are_laid_over_the_surface():
    problem = scenes.load("three-peaks")
    lattice = grids.Lattice(problem.bounds, 13, 13)
    vertices, triangles, start, goal = grids._mesh(problem, lattice)
    assert vertices.shape == (169, 3)
    assert triangles.shape == (288, 3)
    assert vertices[start].tolist()[:2] == [0.0, 0.0]
    assert vertices[goal].tolist()[:2] == [10.0, 10.0]
    flat = vertices[triangles][..., :2]
    sides = flat[:, 1:] - flat[:, :1]
    # Each turns to the left, and together they cover the square.
    areas = 0.5 * (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    assert areas == pytest.approx(np.full(288, 0.5))


def test_growth_is_told_with_its_targets(runner, here):
    data = growth.run_growth(TINY, runner)
    assert [(row.scene, row.samples) for row in data.rows] == [
        (ground, samples) for ground in growth.GROUND for samples in (1_000, 10_000)
    ]
    assert len(growth.GROUND["four-layers"]().surface.layers) == 4
    assert all(row.found.length > 14.0 for row in data.rows)
    assert all(row.bytes_per_sample is None for row in data.rows)  # too few to tell
    six, defaults, four, complete = growth.growth_targets(data)
    assert six.what == "six-peaks: seconds of 10,000 samples over 1,000"
    assert six.found > 1.0
    assert defaults.what == "six-peaks, default options: seconds of 10,000 samples over 1,000"
    assert four.limit == growth.GROWTH_TARGET
    assert complete.met
    grown = growth.GrowthFound(Timing((1.0,), (1.0,)), None, 9, 10**6, 10**6 + 15 * 10**7)
    row = growth.GrowthRow("four-layers", 10**6, grown)
    memory, incomplete = growth.growth_targets(growth.GrowthData([row]))
    assert memory.found == 150.0
    assert not incomplete.met


def test_edges_are_random_but_the_same_and_inside():
    problem = edges.ground("spline")
    ends = edges.random_edges(problem, 200)
    assert (ends == edges.random_edges(problem, 200)).all()
    assert problem.bounds.contains(ends.reshape(-1, 2)).all()
    assert np.hypot(*(ends[:, 2:] - ends[:, :2]).T).max() <= edges.LONGEST
    exact = metric.line_r(edges.ground("peaks").surface, ends[:, :2], ends[:, 2:])
    fitted = metric.line_r(problem.surface, ends[:, :2], ends[:, 2:])
    np.testing.assert_allclose(fitted, exact, rtol=2e-3)


@pytest.mark.slow
def test_edges_are_timed_beside_the_loop(runner):
    data = edges.run_edges(TINY, runner)
    assert set(data.found) == {"spline", "peaks"}
    assert data.nanoseconds(Timing((1.0,), (1.0,))) == 2e6
    if data.version is None:
        pytest.skip(edges.EDGES_LOOP.missing)
    assert all(found.difference < 1e-12 for found in data.found.values())
    assert len(edges.edges_targets(data)) == 2


def test_a_report_of_peers_is_written(tmp_path, monkeypatch, fake_ompl, here):
    monkeypatch.setattr(runs, "QUICK", TINY)
    monkeypatch.setattr(runs, "_source_stamp", lambda: "this code")
    monkeypatch.setattr(grids.Method, "is_there", property(lambda self: self.peer is None))
    names = ["trees", "grids", "growth", "edges"]
    text = runs.benchmark(names, tmp_path, quick=True).read_text()
    for name in names[:3]:
        assert (tmp_path / f"benchmark-{name}.png").stat().st_size > 10_000
        assert f"(benchmark-{name}.png)" in text
    assert "at least 20 |" in text
    assert "nan" not in text
    (file, *_) = (tmp_path / "trials").glob("six-peaks-ompl-cpp-bit-star-*")
    assert json.loads(file.read_text())["settings"]["options"]["planner"] == "bit-star"


def test_problems_write_whole_numbers_of_floats(tmp_path):
    problem = problems.load_problem("three-peaks-discs")
    write_problem(tmp_path / "problem", problem)
    numbers = np.fromfile(tmp_path / "problem")
    assert numbers[:8].tolist() == [*problem.bounds, *problem.start, *problem.goal]
    assert numbers[-3:].tolist() == [9.3, 4.0, 1.0]
