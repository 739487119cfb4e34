"""Kernels compiled in a second process: it may save time, and never costs an answer."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from terrapath._kernels import cache, second_core
from terrapath._kernels.second_core import SecondCore
from terrapath.cli.main import run
from terrapath.planners import warmup
from terrapath.planners.base import PROVING, REFINING, Progress
from terrapath.scenario import answers

NOTHING = "nothing at all"  # no rehearsal: the process ends by itself


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(second_core, "cores", lambda: 2)


def compile_something():
    for listener in tuple(cache.listeners):
        listener("a kernel")


def is_running(process):
    return process.poll() is None


@pytest.mark.usefixtures("two_cores")
def test_the_process_starts_with_the_first_compilation_and_only_once():
    with SecondCore(NOTHING) as second:
        assert second.process is None
        compile_something()
        process = second.process
        assert process is not None
        compile_something()
        assert second.process is process
        second.wait()
        assert process.returncode == 0
        compile_something()  # which nobody waits for any more
        assert second.process is None
    assert second.start not in cache.listeners


@pytest.mark.usefixtures("two_cores")
def test_it_ends_with_the_context_whatever_happens():
    started = []

    def interrupted():
        with SecondCore(NOTHING) as second:
            second.start()
            started.append(second.process)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not is_running(started[0])
    assert started[0].returncode is not None  # and no zombie is left
    assert started[0].stdin.closed
    assert not cache.listeners


@pytest.mark.usefixtures("two_cores")
def test_one_that_hangs_is_not_waited_for_for_ever(monkeypatch):
    monkeypatch.setattr(second_core, "LONGEST_WAIT", 0.05)
    with SecondCore(NOTHING) as second:
        second.start()
        process = second.process
        os.kill(process.pid, signal.SIGSTOP)
        second.wait()
        assert process.returncode == -signal.SIGKILL


@pytest.mark.parametrize("executable", ["", None, "/nowhere/python"])
@pytest.mark.usefixtures("two_cores")
def test_where_no_process_can_be_started_there_is_none(executable, monkeypatch):
    monkeypatch.setattr(sys, "executable", executable)
    with SecondCore(NOTHING) as second:
        compile_something()
        assert second.process is None
        second.wait()


def test_on_one_core_there_is_none(monkeypatch):
    monkeypatch.setattr(second_core, "cores", lambda: 1)
    with SecondCore(NOTHING) as second:
        compile_something()
        assert second.process is None


def test_cores_are_those_of_this_process():
    assert 1 <= second_core.cores() <= os.cpu_count()


def test_it_stops_where_kernels_cannot_be_kept(monkeypatch):
    second_core._require_keeping("a kernel")
    monkeypatch.setattr(cache, "unkept", lambda: "no room")
    with pytest.raises(SystemExit):
        second_core._require_keeping("a kernel")


# What it rehearses


def test_only_what_is_asked_for_is_rehearsed(monkeypatch):
    done = []
    work = [warmup.Rehearsal(n, lambda n=n: done.append(n)) for n in ("one", "two", "three")]
    monkeypatch.setattr(warmup, "rehearsals", lambda: work)
    monkeypatch.setattr(warmup, "serve_first_core", lambda: done.append("serving"))
    warmup.rehearse(["three", "one", "unknown"])
    assert done == ["serving", "one", "three"]


class Recorder(SecondCore):
    """Tells what is asked of it, and starts nothing."""

    told: list

    def start(self, kernel=""):
        self.told.append("start")

    def wait(self):
        self.told.append("wait")


@pytest.fixture
def recorder(monkeypatch):
    Recorder.told = []
    monkeypatch.setattr(second_core, "SecondCore", Recorder)
    monkeypatch.setattr(warmup, "SecondCore", Recorder)
    return Recorder.told


def test_a_warm_up_does_half_of_the_work_on_either_core(recorder, monkeypatch):
    def rehearsal(name):
        return warmup.Rehearsal(name, lambda: recorder.append(name))

    monkeypatch.setattr(warmup, "rehearsals", lambda: [rehearsal(f"{i}") for i in range(4)])
    monkeypatch.setattr(warmup, "_listed", lambda directory: None)
    monkeypatch.setattr(warmup, "_write_list", lambda directory, names: None)
    warmup.warm_up()
    assert recorder == ["0", "1", "wait", "2", "3"]  # all of it, whatever the other one did


def test_each_class_of_surface_is_one_half():
    names = [rehearsal.name for rehearsal in warmup.rehearsals()]
    half = len(names) // 2
    assert all(name.endswith(" on peaks") for name in names[:half])
    assert all(name.endswith(" on spline") for name in names[half:])


def progress(stage):
    return Progress(1, 1, 0.0, 1.0, stage=stage)


@pytest.mark.parametrize("surface_class", list(warmup.SURFACES))
def test_the_bound_is_rehearsed_and_waited_for_when_it_is_begun(surface_class, recorder):
    seen = []
    with second_core.SecondCore(
        second_core.rehearsal_name("lower bounds", surface_class)
    ) as second:
        watch = answers._waiting(second, lambda told: seen.append(told.stage))
        assert not watch(progress(REFINING))
        assert recorder == []
        watch(progress(PROVING))
        assert recorder == ["wait"]
        assert answers._waiting(second, None)(progress(REFINING)) is False
        assert answers._waiting(second, lambda told: True)(progress(REFINING)) is True
    assert seen == [REFINING, PROVING]
    assert second_core.rehearsal_name("lower bounds", surface_class) in {
        rehearsal.name for rehearsal in warmup.rehearsals()
    }


@pytest.mark.parametrize(("arguments", "waits"), [([], True), (["--no-bound"], False)])
def test_a_plan_waits_for_it_before_the_bound(arguments, waits, recorder, capsys):
    asked = ["plan", "six-peaks", "--samples", "200", "--json", "--quiet", *arguments]
    assert run(asked) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "solved"
    # Each sign of progress of the proof waits; only the first has anything to wait for.
    assert ("wait" in recorder) is waits


# Whole processes

START = """
import os, sys, time
from terrapath._kernels import second_core
second_core.cores = lambda: 2
with second_core.SecondCore("lower bounds on peaks") as second:
    second.start()
    print(second.process.pid, flush=True)
    {then}
"""


def started(tmp_path, then):
    """A process and the number of the second one, which is at its work."""
    first = subprocess.Popen(
        [sys.executable, "-c", START.format(then=then)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    return first, int(first.stdout.readline())


def ends(process_id):
    """Does the process end, before its work would be done?"""
    for _ in range(600):
        status = Path(f"/proc/{process_id}/stat")
        try:
            if status.read_text().rsplit(")", 1)[1].split()[0] == "Z":
                return True  # ended; whoever takes orphans in has not looked yet
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.1)
    return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_whatever_ends_the_first_process_ends_the_second(number, tmp_path):
    first, second = started(tmp_path, "time.sleep(600)")
    first.send_signal(number)
    first.wait()
    first.stdout.close()
    assert ends(second)


@pytest.mark.slow
def test_what_it_compiled_is_found_in_the_cache(tmp_path):
    first, _ = started(tmp_path, "second.wait()")
    assert first.wait() == 0
    first.stdout.close()
    code = (
        "from terrapath.planners import warmup\n"
        "from terrapath._kernels.compiler import cache_statistics\n"
        "warmup._prove(warmup.peaks()); print(cache_statistics()['compiled'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) == 0
