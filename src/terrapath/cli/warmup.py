"""``terrapath warmup``: compile the kernels before they are needed."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from .console import ExitCode, bar_for_all


def warmup_command(
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing.")] = False,
) -> int:
    """Compile all kernels now, so that no later run has to wait for them.

    They are kept on disk, in NUMBA_CACHE_DIR if it is set. Exit codes: 0 done, 2 they cannot be
    compiled or kept, 130 interrupted (what was compiled is kept).
    """
    from ..planners.warmup import warm_up

    started = time.perf_counter()
    with bar_for_all("compiling kernels", quiet) as watch:
        warmth = warm_up(watch)
    if quiet:
        return ExitCode.SOLVED
    what = "all kernels are compiled already"
    if warmth.compiled:
        seconds = time.perf_counter() - started
        what = f"compiled {warmth.compiled} kernels in {seconds:.0f} s"
    typer.echo(f"{what}: {warmth.size / 1e6:.1f} MB in {warmth.directory}")
    return ExitCode.SOLVED
