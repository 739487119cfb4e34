"""Runs commands, and checks what they print."""

import json

from terrapath.cli.main import run

FAST = ["--samples", "300"]
# What the planner found, and nothing more.
RAW = ["--no-refine", "--no-bound"]
# A plan that few kernels are compiled for.
FEW_KERNELS = ["plan", "six-peaks", "--planner", "rrt-star", "--samples", "200", "--no-bound"]


ENDS = ["--start", "500100,4000100", "--goal", "500400,4000300"]


def json_of(capsys, *arguments):
    code = run(["plan", *arguments, "--json"])
    captured = capsys.readouterr()
    assert captured.err == ""
    return code, json.loads(captured.out)


def refused(capsys, command, arguments, *words):
    """Run a command, and require one line on standard error that contains all the words."""
    assert run([command, *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("terrapath: ")
    assert captured.err.count("\n") == 1
    assert "Traceback" not in captured.err
    for word in words:
        assert word in captured.err, captured.err


def bad(capsys, arguments, *words):
    refused(capsys, "plan", arguments, *words)
