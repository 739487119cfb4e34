"""The paper's experiments: trials that survive, resume and repeat; the report and its numbers."""

import dataclasses
import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from terrapath import RRTStar
from terrapath.cli.main import run
from terrapath.errors import InputError
from terrapath.paper import experiments, figures, reproduce, trials
from terrapath.paper.measures import (
    ExactGeodesic,
    FanSummary,
    FanTrial,
    PathTrial,
    PlannedPath,
    Sweep,
    SweepTrial,
)
from terrapath.paper.report import make_report
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Store
from terrapath.planners import GeodesicTraversal
from terrapath.problem import scenes

# Small enough for a test, in place of the quick scale.
TINY = (
    "Scale(samples=400, seeds=1, repeats=2, convergence_samples=(300, 400), "
    "convergence_runs=4, directions=500)"
)
TINY_SCALE = eval(TINY, {"Scale": experiments.Scale})
TRIALS_OF_CONVERGENCE = 1 + 2 * 4


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(reproduce, "QUICK", TINY_SCALE)


def make(directory, **options):
    return reproduce.reproduce("convergence", directory, quick=True, **{"workers": 1, **options})


def contents(directory):
    """Bytes of the report and of all trials."""
    files = [directory / "report.md", *sorted((directory / "trials").iterdir())]
    return {file.name: file.read_bytes() for file in files}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run of one experiment that nothing disturbed."""
    directory = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduce, "QUICK", TINY_SCALE)
        make(directory)
    return directory


def program(directory, disturb, workers, when="stage == 'convergence, trees' and done == 3"):
    """Source of a process that is disturbed, by default after its third tree."""
    return (
        "import os, signal, sys, threading\n"
        "from contextlib import contextmanager\n"
        "import terrapath.cli.resumable as command\n"
        "from terrapath.cli.main import run\n"
        "from terrapath.paper import reproduce\n"
        "from terrapath.paper.experiments import Scale\n"
        f"reproduce.QUICK = {TINY}\n"
        "@contextmanager\n"
        "def bar_for_each(quiet):\n"
        "    def watch(stage, done, total):\n"
        f"        if {when}: {disturb}\n"
        "    yield watch\n"
        "command.bar_for_each = bar_for_each\n"
        f"sys.exit(run(['reproduce', 'convergence', '--quick', '--output', {str(directory)!r}, "
        f"'--workers', '{workers}']))\n"
    )


def run_program(source):
    return subprocess.run(
        [sys.executable, "-c", source],
        capture_output=True,
        text=True,
        check=False,
        timeout=80,
        start_new_session=True,
    )


def test_a_killed_run_goes_on_and_reports_the_same(finished, tmp_path, tiny):
    killed = run_program(program(tmp_path, "os.kill(os.getpid(), signal.SIGKILL)", workers=1))
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "report.md").exists()
    kept = {file: file.stat().st_mtime_ns for file in (tmp_path / "trials").glob("[!.]*.json")}
    assert 4 <= len(kept) < TRIALS_OF_CONVERGENCE
    make(tmp_path)
    assert all(file.stat().st_mtime_ns == time for file, time in kept.items())
    for file in (tmp_path / "trials").glob(".*"):
        file.unlink()  # what the killed processes were writing
    assert contents(tmp_path) == contents(finished)


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_keeps_the_trials_and_says_how_to_go_on(tmp_path, workers):
    stopped = run_program(program(tmp_path, "signal.raise_signal(signal.SIGINT)", workers))
    assert stopped.returncode == 130
    assert "Traceback" not in stopped.stderr
    assert "the same command continues from there" in stopped.stderr
    assert len(stopped.stderr.splitlines()) == 1
    kept = list((tmp_path / "trials").iterdir())
    assert len(kept) >= 4
    assert len(kept) < TRIALS_OF_CONVERGENCE or workers > 1
    assert not (tmp_path / "report.md").exists()
    assert all(json.loads(file.read_text())["digest"] for file in kept)


def test_ctrl_c_in_a_terminal_is_silent_in_workers_that_are_just_starting(tmp_path):
    signal_all = "threading.Timer(0.7, os.killpg, (0, signal.SIGINT)).start()"
    stopped = run_program(program(tmp_path, signal_all, workers=2, when="done == 0"))
    assert stopped.returncode == 130
    assert "Traceback" not in stopped.stderr
    assert len(stopped.stderr.splitlines()) == 1


def test_processes_give_what_one_gives(finished, tmp_path, tiny):
    make(tmp_path, workers=2)
    assert contents(tmp_path) == contents(finished)
    assert len(contents(finished)) == TRIALS_OF_CONVERGENCE + 1


def test_a_finished_run_measures_nothing_again(finished, monkeypatch, tiny):
    monkeypatch.setattr(PathTrial, "measure", lambda self: pytest.fail("measured again"))
    monkeypatch.setattr(FanTrial, "measure", lambda self: pytest.fail("measured again"))
    before = contents(finished)
    make(finished)
    assert contents(finished) == before


@pytest.mark.parametrize("other", [{"seed": 1}, {"quick": False}])
def test_a_directory_of_other_settings_is_refused(finished, capsys, other):
    options = {"seed": 0, "quick": True, **other}
    flags = ["--seed", str(options["seed"]), *(["--quick"] if options["quick"] else [])]
    before = contents(finished)
    assert run(["reproduce", "convergence", "--output", str(finished), *flags]) == 2
    message = capsys.readouterr().err
    assert "name another --output, or delete it" in message
    assert "seed=0" in message
    assert len(message.splitlines()) == 1
    assert contents(finished) == before


@pytest.mark.parametrize("name", ["thesis.tex", "report.md"])
def test_a_directory_of_somebody_else_is_refused(tmp_path, capsys, name):
    (tmp_path / name).write_text("mine")
    assert run(["reproduce", "one-peak", "--output", str(tmp_path)]) == 2
    assert f"holds {name} and no settings.json" in capsys.readouterr().err
    assert (tmp_path / name).read_text() == "mine"


def test_damaged_settings_and_files_in_the_way_are_refused(tmp_path, capsys):
    (tmp_path / "settings.json").write_text("{")
    assert run(["reproduce", "one-peak", "--output", str(tmp_path)]) == 2
    assert "cannot be read" in capsys.readouterr().err
    assert run(["reproduce", "--output", str(tmp_path / "settings.json")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_an_unknown_experiment_is_one_line_with_the_known_ones(tmp_path, capsys):
    assert run(["reproduce", "two-peaks", "--output", str(tmp_path / "new")]) == 2
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1
    for name in ["two-peaks", "all", *experiments.EXPERIMENTS]:
        assert name in message
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("flags", [["--workers", "0"], ["--seed", "-1"]])
def test_bad_options_are_refused(tmp_path, capsys, flags):
    assert run(["reproduce", "one-peak", "--output", str(tmp_path / "new"), *flags]) == 2
    assert flags[1] in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def edit_length(text):
    record = json.loads(text)
    record["result"]["length"] -= 1.0
    return trials.canonical(record)


DAMAGE = {
    "cut off": lambda text: text[: len(text) // 2],
    "empty": lambda text: "",
    "a number edited": edit_length,
    "another shape": lambda text: "[1, 2]",
    "not text": lambda text: "\udcff\udcfe",
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_trial_is_measured_again(tmp_path, damage):
    trial = PathTrial("one-peak", RRTStar(samples=400))
    store = Store(tmp_path)
    (whole,) = Runner(store, 1).run("first", [trial])
    text = store.path(trial).read_text()
    store.path(trial).write_bytes(DAMAGE[damage](text).encode(errors="surrogateescape"))
    assert store.load(trial) is None
    assert Runner(store, 1).run("again", [trial]) == [whole]
    assert store.path(trial).read_text() == text


def test_every_result_comes_back_from_its_file_as_it_was(tmp_path):
    listed = [
        PathTrial("three-peaks", RRTStar(samples=400)),
        FanTrial("one-peak", GeodesicTraversal(directions=40)),
        SweepTrial("one-peak", Sweep(directions=5, length=16.0)),
    ]
    store = Store(tmp_path)
    for trial in listed:
        (result,) = Runner(store, 1).run("first", [trial])
        assert store.load(trial) == result


CHANGES = {
    "samples": 11,
    "step": 0.5,
    "metric": "chord",
    "seed": 1,
    "radius_factor": 2.0,
    "goal_bias": 0.1,
    "informed": False,
    "prune": False,
    "panel": 2.0,
    "time_limit": 3.0,
    "target_length": 4.0,
}


def test_the_key_changes_with_every_setting(monkeypatch):
    assert set(CHANGES) == {field.name for field in dataclasses.fields(RRTStar)}
    planner = RRTStar(samples=10)
    keys = {PathTrial("one-peak", planner).key, PathTrial("three-peaks", planner).key}
    for name, value in CHANGES.items():
        changed = dataclasses.replace(planner, **{name: value})
        keys.add(PathTrial("one-peak", changed).key)
    for options in ({}, {"directions": 7}, {"sector": (0.0, 1.0)}, {"radius": 0.1}):
        keys.add(FanTrial("one-peak", GeodesicTraversal(**options)).key)
    trials._scene_settings.cache_clear()
    monkeypatch.setitem(scenes.SCENES, "one-peak", scenes.SCENES["four-peaks"])
    keys.add(PathTrial("one-peak", planner).key)
    trials._scene_settings.cache_clear()
    assert len(keys) == 2 + len(CHANGES) + 4 + 1


def test_the_key_is_the_same_in_every_process():
    trial = PathTrial("six-peaks", RRTStar(samples=10, seed=3))
    source = (
        "from terrapath import RRTStar\n"
        "from terrapath.paper.measures import PathTrial\n"
        "print(PathTrial('six-peaks', RRTStar(samples=10, seed=3)).key)"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    command = [sys.executable, "-c", source]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.strip() == trial.key


def test_a_true_length_that_a_path_beats_is_no_true_length():
    with pytest.raises(InputError, match="shorter than the shortest geodesic of the search"):
        experiments._check_truth("one-peak", fan_of(16.2), [16.3, 16.19])
    experiments._check_truth("one-peak", fan_of(16.2), [16.3, 16.2])


def test_a_search_that_fails_is_one_line():
    trial = PathTrial("one-peak", RRTStar(samples=3, step=0.1, informed=False))
    with pytest.raises(InputError, match="found no path on one-peak; give it more samples"):
        trial.measure()


# The report


def fan_of(length):
    return FanSummary(3, length + 0.01, (ExactGeodesic(0.4, length, 30.0, ()),))


def scene_data(scene, true_length):
    paths = [PlannedPath(true_length + k / 10, true_length - 0.1, ()) for k in (1, 2, 3)]
    steps = [experiments.StepEffect(step, paths, paths) for step in experiments.STEPS]
    truth = fan_of(true_length)
    return experiments.SceneData(scene, experiments.PRINTED[scene], truth, truth, steps)


TRUE_LENGTHS = {"one-peak": 16.142532164, "three-peaks": 15.368572424, "six-peaks": 17.018129404}


def test_the_tables_hold_the_papers_numbers_ours_and_the_true_lengths():
    found = {name: (scene_data(name, length), []) for name, length in TRUE_LENGTHS.items()}
    text = make_report(found, experiments.Settings())
    for number in [
        *("16.19926", "16.14253", "16.50470", "15.44211", "15.37167", "16.17020"),
        *("17.18928", "17.02196", "19.43800"),
        *("15.36857", "17.01813", "16.34253", "+0.35 %", "+0.48 %", "+1.01 %"),
    ]:
        assert number in text
    assert "Quick run" not in text


def test_the_report_says_what_was_chosen_and_what_was_left_out(finished):
    text = (finished / "report.md").read_text()
    assert "**Reduced run.** 400 samples instead of 10,000" in text
    assert "15.12566" in text
    assert "no scene that it prints was seen to have that length" in text
    assert "true length is 15.368572424" in text
    assert "| step | 1 map unit" in text
    assert "![Convergence](convergence.png)" in text
    assert "seconds" not in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert all(line.endswith(" |") for line in tables)


def test_the_quick_scale_says_so():
    text = make_report({}, experiments.Settings(scale=experiments.QUICK))
    assert "**Quick run.**" in text


# The experiments and their pictures


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """All experiments but the scenes, at the smallest scale."""
    settings = experiments.Settings(scale=dataclasses.replace(TINY_SCALE, samples=2_000))
    directory = tmp_path_factory.mktemp("everything")
    runner = Runner(Store(directory), 1)
    names = ["comparative", "repeat", "sensitivity"]
    return settings, {name: experiments.EXPERIMENTS[name](settings, runner) for name in names}


@pytest.mark.slow
def test_paths_without_resistance_are_shorter_until_it_is_counted(everything):
    data = everything[1]
    found = data["comparative"]
    (plain,), (full,) = found.planned_on("four-peaks"), found.planned_on("six-peaks")
    assert found.true_height_only <= plain.height_only < plain.with_resistance
    assert found.true_with_resistance <= full.with_resistance
    assert plain.most_resistance > full.most_resistance


@pytest.mark.slow
def test_no_path_is_shorter_than_the_true_length(everything):
    settings, data = everything
    for runs in data["repeat"]:
        assert len(runs.lengths) == settings.scale.repeats
        assert min(runs.lengths) > runs.truth.true_length


@pytest.mark.slow
def test_the_shortest_path_of_repeat_4d_is_outside_the_papers_sector(everything):
    data = everything[1]
    truth = data["repeat"][1].truth
    assert truth.true_length == pytest.approx(18.10199222, abs=1e-7)
    assert truth.geodesics[0].angle > np.pi / 2.0


@pytest.mark.slow
def test_the_sweep_is_the_derivative_of_the_end(everything):
    data = everything[1]
    six = data["sensitivity"][1]
    problem = scenes.load("six-peaks")
    for angle, movement in list(zip(six.found.angles, six.found.movement, strict=True))[::15]:
        low, high = (six.sweep._ray(problem, angle + d).points[-1] for d in (-1e-6, 1e-6))
        moved = np.asarray(problem.surface.lift(high) - problem.surface.lift(low))
        assert np.linalg.norm(moved) / 2e-6 == pytest.approx(movement, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comparative", "repeat", "sensitivity"])
def test_pictures_and_sections_are_made(everything, tmp_path, name):
    settings, data = everything
    pictures = figures.draw(name, data[name], settings, tmp_path)
    assert pictures
    assert all(path.stat().st_size > 20_000 for path in pictures)
    text = make_report({name: (data[name], pictures)}, settings)
    assert all(path.name in text for path in pictures)


def test_a_scene_is_run_and_drawn_with_four_panels(tmp_path, monkeypatch):
    scale = dataclasses.replace(TINY_SCALE, samples=1500)
    settings = experiments.Settings(scale=scale)
    monkeypatch.setattr(experiments, "STEPS", (1.0, 2.0))
    data = experiments.EXPERIMENTS["one-peak"](settings, Runner(Store(tmp_path), 1))
    assert data.truth.true_length == pytest.approx(16.142532164, abs=1e-8)
    assert data.traversal.true_length == pytest.approx(16.142532164, abs=1e-8)
    (path,) = data.at(1.0).rrt_star_r
    assert path.length > data.truth.true_length
    kept = []
    monkeypatch.setattr(figures, "save_figure", lambda figure, path: kept.append(figure))
    figures.draw("one-peak", data, settings, tmp_path)
    panels = [axes for axes in kept[0].axes if axes.get_title()]
    assert [axes.get_title()[:3] for axes in panels] == ["(a)", "(b)", "(c)", "(d)"]
