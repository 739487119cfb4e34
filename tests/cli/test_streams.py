"""Standard output that nobody reads, or no disk takes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import terrapath as tp
from commands import FAST, RAW
from terrapath.cli.main import run


@pytest.fixture(params=["closed", "full"])
def lost_output(request):
    """A file descriptor that takes nothing."""
    if request.param == "closed":
        reading, writing = os.pipe()
        os.close(reading)
    elif not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full")
    else:
        writing = os.open("/dev/full", os.O_WRONLY)
    yield writing
    os.close(writing)


def command(*arguments, **streams):
    """The command in a process of its own, as the installed script runs it."""
    program = "from terrapath.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},
        text=True,
        check=False,
    )


ROUTE = ["plan", "one-peak", *FAST, *RAW]
SHOWN = {
    "a table": (ROUTE, "--output", "route.csv"),
    "JSON": ([*ROUTE, "--json"], "--output", "route.csv"),
    "a field": (["field", "one-peak", "--spacing", "0.5"], "--output", "field.npz"),
    "a scenario": (["init", "one-peak"], "--output", "one-peak.toml"),
}


@pytest.mark.parametrize("what", SHOWN)
def test_files_are_written_although_nothing_can_be_shown(what, lost_output, tmp_path):
    arguments, option, name = SHOWN[what]
    done = command(*arguments, option, tmp_path / name, stdout=lost_output)
    assert done.returncode == 5
    assert done.stderr.startswith("terrapath: standard output cannot be written: ")
    assert done.stderr.count("\n") == 1, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["scenes"], ["schema"]])
def test_what_is_only_shown_and_cannot_be_exits_with_5(arguments, lost_output):
    done = command(*arguments, stdout=lost_output)
    assert (done.returncode, done.stderr.count("\n")) == (5, 1), done.stderr


def test_unbuffered_output_that_is_lost_is_told_as_well(lost_output, tmp_path):
    unbuffered = {**os.environ, "PYTHONUNBUFFERED": "1"}
    done = command(*ROUTE, "--output", tmp_path / "route.csv", stdout=lost_output, env=unbuffered)
    assert (done.returncode, done.stderr.count("\n")) == (5, 1), done.stderr
    assert (tmp_path / "route.csv").exists()


def test_exit_codes_are_the_same_where_standard_error_is_lost(lost_output, tmp_path):
    assert command("plan", "nowhere", stderr=lost_output).returncode == 2
    few = ["--samples", "20", "--step", "0.1", "--uniform"]
    assert command("plan", "six-peaks", *few, stderr=lost_output).returncode == 3
    both = command(
        *ROUTE, "--output", tmp_path / "route.csv", stdout=lost_output, stderr=lost_output
    )
    assert both.returncode == 5
    assert (tmp_path / "route.csv").exists()


def test_a_full_disk_loses_no_answer(tmp_path, capsys, monkeypatch):
    def fail(*_, **__):
        raise tp.MapError("route.csv could not be written: No space left on device")

    monkeypatch.setattr("terrapath.io.write_route", fail)
    assert run([*ROUTE, "--output", str(tmp_path / "route.csv")]) == 2
    captured = capsys.readouterr()
    assert "what was minimised" in captured.out
    assert "No space left" in captured.err


@pytest.mark.parametrize("quiet", [[], ["--quiet"]])
def test_output_that_was_closed_from_the_beginning_is_told(tmp_path, quiet):
    program = (
        "import os, sys; os.close(1); sys.stdout = None; from terrapath.cli import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *ROUTE, *quiet, "--output", str(tmp_path / "route.csv")],
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert done.returncode == 5
    assert done.stderr.count("\n") == 1, done.stderr
    assert (tmp_path / "route.csv").exists()


def test_an_absurdly_long_name_makes_no_long_line(capsys):
    for arguments in (["--planner", "a" * 5000], ["--weight", f"{'b' * 5000}=2"]):
        assert run(["plan", "one-peak", *arguments]) == 2
        assert len(capsys.readouterr().err) < 1500
    with pytest.raises(tp.InputError, match="5,000 letters"):
        tp.Surface.from_grid([[[0.0] * 4] * 4], [0, 1, 2, 3], [0, 1, 2, 3], names=["c" * 5000])


INTERRUPTED = """
import builtins, sys
original = builtins.__import__
def interrupt(name, *rest):
    if name.endswith({name!r}):
        raise KeyboardInterrupt
    return original(name, *rest)
builtins.__import__ = interrupt
sys.argv = ["terrapath", "plan", "one-peak"]
from terrapath.cli import main
main()
"""


@pytest.mark.parametrize("name", ["typer", "console", "answers", "numpy"])
def test_an_interrupt_during_imports_is_no_traceback(name):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED.format(name=name)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (130, "")
