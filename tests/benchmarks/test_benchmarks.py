"""The benchmarks: every experiment in its smallest form, the report, peers that are missing."""

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import (
    bound,
    figures,
    fresh,
    large_maps,
    marching,
    paths,
    report as reports,
    run as runs,
    startup,
)
from benchmarks.__main__ import app
from benchmarks.peers import SCIKIT_FMM, Peer
from benchmarks.settings import SCENES, Scale, true_length
from benchmarks.timing import Reading, Stopwatch, Target, Timing, percent
from terrapath._support import memory
from terrapath.cli.main import run
from terrapath.errors import TerrapathError
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Store, rebuilt
from terrapath.problem import scenes

TINY = Scale(
    scenes=("one-peak",),
    target_gap=1e-2,
    bound_repeats=2,
    march_scenes=("one-peak",),
    lattices=((61, 2),),
    map_cells=(600,),
    path_repeats=2,
    slow_repeats=2,
    tree_samples=(500,),
    most_samples=2_000,
    warm_starts=2,
    cold_starts=1,
)


QUICK_COMMANDS = {(startup.HELP, False): 1e3, (("scenes",), True): 1e-3}


# Without OMPL and the libraries for meshes, which test_peers.py is about.
ALONE = ("bound", "fast-marching", "path", "large-maps", "startup")


def here(trial):
    """What a fresh process would measure, in this one."""
    return fresh.measure_marching(trial.scene, trial.planner)


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(runs, "QUICK", TINY)
    monkeypatch.setattr(startup, "LIMITS", QUICK_COMMANDS)
    # Whoever edits the package meanwhile changes nothing here.
    monkeypatch.setattr(runs, "_source_stamp", lambda: "this code")


@pytest.fixture
def without_peers(monkeypatch):
    # Importing a module that is None here raises what a missing one does.
    monkeypatch.setitem(sys.modules, SCIKIT_FMM.module, None)
    monkeypatch.setattr(marching.MarchTrial, "measure", here)


@pytest.fixture
def runner(tmp_path):
    return Runner(Store(tmp_path), 1)


# The report


@pytest.mark.slow
def test_the_command_writes_a_whole_report_and_measures_nothing_twice(tmp_path, tiny, monkeypatch):
    options = ["--quick", "--quiet", "--output", str(tmp_path)]
    assert run([*ALONE, *options], app) == 0
    text = (tmp_path / "report.md").read_text()
    assert "**Reduced run.**" in text
    assert "## Machine and versions" in text
    for name in ALONE:
        experiment = runs.EXPERIMENTS[name]
        assert f"## {experiment.title}" in text
        if name not in ("large-maps", "startup"):
            assert f"![{experiment.title}](benchmark-{name}.png)" in text
            assert (tmp_path / f"benchmark-{name}.png").stat().st_size > 10_000
    assert "| 600 |" in text
    assert "one-peak: gap of 1 %" in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert all(line.endswith(" |") for line in tables)
    assert "nan" not in text

    kinds = (
        *(bound.BoundTrial, marching.MarchTrial, paths.PathsTrial),
        *(large_maps.LargeMapTrial, startup.StartTrial),
    )
    for kind in kinds:
        monkeypatch.setattr(kind, "measure", lambda self: pytest.fail("measured again"))
    monkeypatch.setattr(figures, "save_figure", lambda figure, path: None)
    assert run([*ALONE, *options], app) == 0
    assert (tmp_path / "report.md").read_text() == text
    monkeypatch.setattr(runs, "_source_stamp", lambda: "other code")
    assert run([*ALONE, *options], app) == 2


def test_experiments_are_chosen_by_name(tmp_path, capsys):
    names = [*ALONE, "trees", "grids", "growth", "edges"]
    assert runs.chosen_experiments([]) == list(runs.EXPERIMENTS) == names
    assert runs.chosen_experiments(["path", "bound", "path"]) == ["bound", "path"]
    assert run(["speed", "--output", str(tmp_path / "new")], app) == 2
    message = capsys.readouterr().err
    assert "what='speed' is not known; choose some of bound, fast-marching, path" in message
    assert not (tmp_path / "new").exists()


def test_a_peer_that_is_missing_is_named_and_left_out(tmp_path, tiny, without_peers):
    report = runs.benchmark(["fast-marching"], tmp_path, quick=True)
    text = report.read_text()
    assert "scikit-fmm is not installed and was left out" in text
    assert "terrapath[bench]" in text
    assert "times scikit-fmm's seconds" not in text
    (file,) = (tmp_path / "trials").iterdir()
    assert json.loads(file.read_text())["result"]["peer"] is None


def test_peers_are_found_or_not():
    assert Peer("numpy", "numpy").version == np.__version__
    assert Peer("nothing", "no_such_module").version is None


def test_a_busy_machine_is_told():
    busy = Timing((2.0, 3.0), (1.0, 1.0))
    assert "**other jobs ran beside them**" in reports._disturbance([busy])
    assert "quiet" in reports._disturbance([Timing((1.0,), (1.0,))])


# Clocks and targets


def test_seconds_are_the_median_of_the_clock_that_shows_less():
    timing = Timing.of([Reading(3.0, 1.0), Reading(1.5, 1.1), Reading(9.0, 1.4)])
    assert timing.seconds == 1.1
    assert timing.waiting == pytest.approx(3.0 / 1.1)
    assert (timing + timing).wall == (6.0, 3.0, 18.0)
    # Two cores at work: more processor time than wall time.
    assert Timing((1.0,), (1.9,)).seconds == 1.0


def test_a_stopwatch_goes_on():
    watch = Stopwatch()
    first, second = watch.read(), watch.read()
    assert 0.0 <= first.wall <= second.wall
    assert 0.0 <= first.processor <= second.processor


def test_targets_are_met_or_not_and_say_by_how_much():
    assert Target("", 0.2, "s", 0.1).verdict == "met, 0.5 times the limit"
    assert Target("", 0.2, "s", 0.2).met
    missed = Target("", 0.2, "s", 0.5)
    assert not missed.met
    assert missed.verdict == "**not met**, 2.5 times the limit"
    never = Target("", 0.2, "s", None, "the gap stays at 2 %")
    assert not never.met
    assert never.verdict == "**not met**: the gap stays at 2 %"
    assert percent(0.0012345) == "0.123 %"


TIMING = Timing((2.0, 3.0), (1.0, 1.5))
RESULTS = [
    bound.BoundFound((bound.ProvenStep(100, 0.01, TIMING, TIMING),) * 2),
    marching.Marched(TIMING, TIMING, None, 16.0, None, 5),
    marching.Marched(TIMING, TIMING, TIMING, 16.0, 4, 5),
    paths.PathsFound(TIMING, (0.1, 0.2), None),
]


@pytest.mark.parametrize("result", RESULTS)
def test_results_come_back_from_json_as_they_were(result):
    record = json.loads(json.dumps(dataclasses.asdict(result)))
    assert rebuilt(type(result), record) == result


# The experiments


def test_bounds_get_better_and_their_times_grow(runner):
    data = bound.run_bound(dataclasses.replace(TINY, target_gap=5e-4), runner)
    (found,) = data.values()
    gaps = [step.gap for step in found.steps]
    assert gaps == sorted(gaps, reverse=True)
    assert 0.0 < gaps[-1] <= 5e-4 < gaps[-2]
    assert all(len(step.timing.wall) == len(step.check.wall) == 2 for step in found.steps)
    for repetition in range(2):
        walls = [step.timing.wall[repetition] for step in found.steps]
        assert walls == sorted(walls)
    assert found.first_within(1.0) == found.steps[0]
    assert found.first_within(1e-9) is None
    missed = bound.bound_targets({"one-peak": bound.BoundFound(found.steps[:1])})
    assert [target.what for target in missed] == ["one-peak: gap of 1 %", "one-peak: gap of 0.1 %"]


@pytest.mark.slow
def test_fast_marching_is_near_the_truth_beside_its_peer(runner, monkeypatch):
    pytest.importorskip("skfmm")
    monkeypatch.setattr(marching.MarchTrial, "measure", here)
    data = marching.run_marching(TINY, runner)
    (row,) = data.rows
    assert abs(row.error) < 0.01
    assert row.found.ratio > 0.0
    assert row.found.whole.wall[0] > row.found.march.wall[0]
    assert len(row.found.peer.wall) == 2
    assert row.bytes_per_node is None  # too few nodes to tell


def march_row(scene, nodes, **fields):
    found = marching.Marched(TIMING, TIMING, TIMING, true_length(scene), 10**8, 5 * 10**8)
    return marching.MarchRow(scene, nodes, dataclasses.replace(found, **fields))


def test_targets_of_fast_marching_are_taken_where_they_apply():
    rows = [march_row("six-peaks", nodes) for nodes in (241, 961, 1001, 2001, 4001)]
    rows.append(march_row("one-peak", 1001, peer=None, memory_before=None, memory_peak=None))
    targets = marching.marching_targets(marching.MarchData(rows, "1"))
    named = {target.what.partition(", ")[2]: target for target in targets}
    assert named["1,001 x 1,001 nodes: times scikit-fmm's seconds"].found == 2.0
    assert not named["961 x 961 nodes: memory a node"].met
    assert named["4,001 x 4,001 nodes: memory in all"].found == 0.5
    assert named["241 x 241 nodes: error, against HamiltonFastMarching's"].met
    assert all(target.what.startswith("six-peaks") for target in targets)
    assert "+0.007 %" in "\n".join(reports.marching_lines(marching.MarchData(rows, "1")))


def test_a_fresh_process_that_fails_is_one_line(monkeypatch):
    def kill(command, **options):
        return subprocess.CompletedProcess(
            command, -9, "", "Traceback\n  here\nMemoryError: full\n"
        )

    monkeypatch.setattr(subprocess, "run", kill)
    trial = marching.MarchTrial("one-peak", marching.MarchRuns(nodes=4001, repeats=1, peer=None))
    with pytest.raises(
        TerrapathError, match=r"4,001 nodes .* ended with code -9: MemoryError: full"
    ):
        trial.measure()


@pytest.mark.skipif(sys.platform != "linux", reason="the peak is only reset on Linux")
def test_the_peak_of_memory_is_that_of_what_was_touched():
    memory.forget_peak()
    before = memory.peak_memory()
    held = np.ones(8_000_000)
    assert 60e6 < memory.peak_memory() - before < 90e6
    del held
    memory.forget_peak()
    assert memory.peak_memory() - before < 30e6


def test_every_planner_is_measured_and_lattices_never_get_near(runner):
    data = paths.run_paths(TINY, runner)
    found = dict(zip(data.labels, data.found["one-peak"], strict=True))
    refined = found["fast marching, refined"]
    assert refined.is_near
    assert 0.0 < refined.typical_excess < 1e-6
    assert found["optimal, with proof"].gap <= 1e-3
    assert refined.gap is None
    assert not any(found[name].is_near for name in found if "neighbours" in name)
    # Each repetition has its seed.
    assert len(set(found["RRT\\*-R, 500 samples"].excess)) == 2
    (target,) = paths.paths_targets(paths.PathsData(data.labels, {"six-peaks": [refined]}))
    assert target.found == refined.timing.seconds


def test_commands_are_measured_as_whole_processes(runner, monkeypatch):
    monkeypatch.setattr(startup, "LIMITS", QUICK_COMMANDS)
    data = startup.run_startup(TINY, runner)
    (helping, helped), (listing, listed) = data.found
    assert (helping.label, listing.label) == (
        "`terrapath --help`, warm",
        "`terrapath scenes`, cold",
    )
    assert (len(helped.timing.wall), len(listed.timing.wall)) == (2, 1)
    assert 0.0 < helped.timing.seconds < listed.timing.seconds
    assert [target.met for target in startup.startup_targets(data)] == [True, False]
    assert "| `terrapath --help`, warm |" in "\n".join(reports.startup_lines(data))
    assert json.loads(json.dumps(dataclasses.asdict(helped))) == {
        "timing": {"wall": list(helped.timing.wall), "processor": list(helped.timing.processor)}
    }


def test_a_cold_start_finds_an_empty_cache_and_a_warm_one_does_not(runner, monkeypatch):
    caches = []

    def note(arguments, cache):
        caches.append(cache)
        return Reading(1.0, 1.0)

    monkeypatch.setattr(startup, "run_afresh", note)
    runs_of = {
        cold: startup.StartRuns(arguments=("plan",), cold=cold, repeats=2) for cold in (True, False)
    }
    startup.StartTrial("start", runs_of[True]).measure()
    assert len(set(caches)) == 2
    caches.clear()
    startup.StartTrial("start", runs_of[False]).measure()
    assert len(caches) == 3
    assert len(set(caches)) == 1


def test_a_command_that_fails_is_one_line(tmp_path):
    with pytest.raises(TerrapathError, match=r"terrapath plan nowhere ended with code 2: "):
        startup.run_afresh(("plan", "nowhere"), str(tmp_path))


def test_the_scenes_are_those_with_a_true_length():
    assert len(SCENES) == 6
    assert set(SCENES) < set(scenes.names())
