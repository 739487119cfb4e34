"""Experiments whose finished trials are kept, so that a run that was stopped can go on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import typer

from .._support.watching import Watch
from .console import ExitCode, bar_for_each, remark


def run_resumable(work: Callable[[Watch], Path], output: Path, quiet: bool) -> int:
    """Run what writes a report, and print where it is; after Ctrl-C, how to go on."""
    try:
        with bar_for_each(quiet) as watch:
            report = work(watch)
    except KeyboardInterrupt:
        remark(
            f"interrupted; the finished trials are kept in {output / 'trials'}, and the same "
            "command goes on from there"
        )
        return ExitCode.INTERRUPTED
    typer.echo(report)
    return ExitCode.SOLVED
