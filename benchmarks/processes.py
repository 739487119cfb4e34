"""Measures that need a process of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from terrapath._kernels.compiler import cache_statistics
from terrapath.errors import TerrapathError

# Numerical libraries would otherwise use every core.
ONE_CORE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run_fresh(module: str, task: dict[str, Any], what: str, timeout: float | None = None) -> Any:
    """Run a module of this package in a fresh process; returns its answer to a task, from JSON.

    what : names the work in a TerrapathError, where it fails. timeout : seconds. One core is used.
    A process that had to compile kernels is run again: it allocates from memory that the compiler
    has freed, so its peak memory says nothing.
    """
    reply = _reply(module, task, what, timeout)
    if reply["compiled"]:
        reply = _reply(module, task, what, timeout)
    return reply["found"]


def _reply(module: str, task: dict[str, Any], what: str, timeout: float | None) -> Any:
    command = [sys.executable, "-m", f"{__package__}.{module}", json.dumps(task)]
    environment = {**os.environ, **ONE_CORE}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=environment, timeout=timeout
        )
    except subprocess.TimeoutExpired:
        raise TerrapathError(f"{what} did not end within {timeout:g} s") from None
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no message"]
        raise TerrapathError(f"{what} ended with code {done.returncode}: {lines[-1]}")
    # Libraries may print something first.
    return json.loads(done.stdout.strip().splitlines()[-1])


def answer(measure: Callable[..., Any]) -> None:
    """In the fresh process: measure with the task's entries as arguments, and print JSON."""
    found = measure(**json.loads(sys.argv[1]))
    reply = {"compiled": cache_statistics()["compiled"], "found": found}
    print(json.dumps(reply, default=asdict))
