"""Start-up: how long the command takes from the prompt to the answer, warm or cold."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from typing import Any

from terrapath.errors import TerrapathError
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial

from .settings import Scale
from .timing import Reading, Stopwatch, Target, Timing

HELP, PLAN = ("--help",), ("plan", "six-peaks", "--json")
COMMAND = "from terrapath.cli import main; main()"


@dataclass(frozen=True, kw_only=True)
class StartRuns:
    """The settings of a trial."""

    arguments: tuple[str, ...]
    cold: bool  # each process finds an empty cache of kernels
    repeats: int

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return f"{self.arguments[0].strip('-')}-{'cold' if self.cold else 'warm'}"

    @property
    def label(self) -> str:
        """The name in the report."""
        return f"`terrapath {' '.join(self.arguments)}`, {'cold' if self.cold else 'warm'}"


@dataclass(frozen=True)
class Started:
    """The times of whole processes, one after another."""

    timing: Timing


@dataclass(frozen=True)
class StartTrial(Trial[Started]):
    """One command, in processes of its own and with its own cache of kernels."""

    planner: StartRuns

    @property
    def settings(self) -> dict[str, Any]:
        """The settings; nothing but the command counts."""
        return {"options": asdict(self.planner)}

    def measure(self) -> Started:
        """Run it several times, after one run that is not measured unless it is to be cold."""
        runs = self.planner
        with tempfile.TemporaryDirectory() as shared:
            if not runs.cold:
                run_afresh(runs.arguments, shared)
            readings = [self._reading(shared) for _ in range(runs.repeats)]
        return Started(Timing.of(readings))

    def _reading(self, shared: str) -> Reading:
        if not self.planner.cold:
            return run_afresh(self.planner.arguments, shared)
        with tempfile.TemporaryDirectory() as empty:
            return run_afresh(self.planner.arguments, empty)


def run_afresh(arguments: tuple[str, ...], cache: str) -> Reading:
    """How long the command takes in a fresh process that keeps its kernels in ``cache``."""
    before, watch = _seconds_of_children(), Stopwatch()
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, *arguments],
        # An installed package has its bytecode on disk.
        env={**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONDONTWRITEBYTECODE": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    wall = watch.read().wall
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no message"]
        raise TerrapathError(
            f"terrapath {' '.join(arguments)} ended with code {done.returncode}: {lines[-1]}"
        )
    # Where the system gives no times of children, only wall time is known.
    return Reading(wall, _seconds_of_children() - before or wall)


def _seconds_of_children() -> float:
    """Processor seconds of all processes that were started here and have ended."""
    spent = os.times()
    return spent.children_user + spent.children_system


@dataclass(frozen=True)
class StartData:
    """Each command, warm or cold, and its times."""

    found: list[tuple[StartRuns, Started]]


LIMITS = {(HELP, False): 0.3, (PLAN, False): 1.5, (PLAN, True): 20.0}  # seconds


def run_startup(scale: Scale, runner: Runner) -> StartData:
    """Measure each command."""
    commands = [
        StartRuns(
            arguments=arguments,
            cold=cold,
            repeats=scale.cold_starts if cold else scale.warm_starts,
        )
        for arguments, cold in LIMITS
    ]
    trials = [StartTrial("start", runs) for runs in commands]
    return StartData(list(zip(commands, runner.run("start-up", trials), strict=True)))


def startup_targets(data: StartData) -> list[Target]:
    """The seconds of whole processes."""
    return [
        Target(f"{runs.label}: whole process", limit, "s", found.timing.seconds)
        for runs, found in data.found
        if (limit := LIMITS.get((runs.arguments, runs.cold))) is not None
    ]
