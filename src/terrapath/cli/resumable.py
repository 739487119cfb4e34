"""Experiments whose finished trials are kept, so that a run that was stopped can continue."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import typer

from .._support.watching import Watch
from .console import ExitCode, bar_for_each, remark


def run_resumable(work: Callable[[Watch], Path], output: Path, quiet: bool) -> int:
    """Run work that writes a report. Print where the report is; after Ctrl-C, how to continue."""
    try:
        with bar_for_each(quiet) as watch:
            report = work(watch)
    except KeyboardInterrupt:
        remark(
            f"interrupted; the finished trials are kept in {output / 'trials'}, and the same "
            "command continues from there"
        )
        return ExitCode.INTERRUPTED
    typer.echo(report)
    return ExitCode.SOLVED
