"""The problems that trees are compared on: built-in scenes, and one with obstacles."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any

import numpy as np

from terrapath.errors import TerrapathError
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial
from terrapath.planners import plan
from terrapath.problem import Problem, scenes
from terrapath.space.free_space import Circle

# Discs on the shortest path of three-peaks, and on the paths around them.
DISCS = (
    Circle(5.0, 4.6, 1.5),
    Circle(7.6, 7.0, 1.3),
    Circle(2.2, 6.2, 1.2),
    Circle(9.3, 4.0, 1.0),
)


def _three_peaks_discs() -> Problem:
    plain = scenes.load("three-peaks")
    return Problem(
        plain.surface, plain.start, plain.goal, plain.bounds, DISCS, name="three-peaks-discs"
    )


def _jacksboro() -> Problem:
    """The scene without the cells along its edges. Some have no data, and peers take no masks."""
    whole = scenes.load("jacksboro")
    cell = 2.0 * whole.surface.resolution
    low, high = whole.bounds[:2], whole.bounds[2:]
    inner = (*(x + cell for x in low), *(x - cell for x in high))
    return Problem(whole.surface, whole.start, whole.goal, inner, name="jacksboro")


OWN: dict[str, Callable[[], Problem]] = {
    "three-peaks-discs": _three_peaks_discs,
    "jacksboro": _jacksboro,
}


@cache
def load_problem(name: str) -> Problem:
    """The problem of that name: one of these, or a built-in scene."""
    return OWN[name]() if name in OWN else scenes.load(name)


@cache
def problem_settings(name: str) -> dict[str, Any]:
    """All that defines a problem; the surface as a hash, because a terrain model is too large."""
    problem = load_problem(name)
    digest = hashlib.sha256()
    for field, array in problem.surface.data._asdict().items():
        digest.update(field.encode())
        digest.update(np.asarray(array, np.float64).tobytes())
    return {
        "name": name,
        "surface": digest.hexdigest(),
        "start": list(problem.start),
        "goal": list(problem.goal),
        "bounds": list(problem.bounds),
        "obstacles": list(map(repr, problem.obstacles)),
    }


@dataclass(frozen=True, kw_only=True)
class OptimumRuns:
    """The settings of a trial."""

    target_gap: float
    time_limit: float  # seconds

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return "optimum"


@dataclass(frozen=True)
class Optimum:
    """The length of the shortest path, which others are compared with, map units."""

    length: float
    gap: float | None  # the proven gap; None where nothing is proven
    searched: bool = True  # found by ``optimal``; otherwise it is known to ten digits


@dataclass(frozen=True)
class OptimumTrial(Trial[Optimum]):
    """The shortest path that ``optimal`` finds."""

    planner: OptimumRuns

    @property
    def settings(self) -> dict[str, Any]:
        """The problem and the options."""
        return {"scene": problem_settings(self.scene), "options": asdict(self.planner)}

    def measure(self) -> Optimum:
        """Search and prove."""
        solution = plan(load_problem(self.scene), "optimal", **asdict(self.planner))
        if solution.length is None:
            raise TerrapathError(f"optimal found no path on {self.scene}: {solution.stopped_by}")
        return Optimum(solution.length, solution.gap)


def find_optimum(name: str, runs: OptimumRuns, runner: Runner) -> Optimum:
    """The length of a problem's shortest path: known, or searched for."""
    scene = scenes.SCENES.get(name)
    if scene is not None and scene.true_length is not None:
        return Optimum(scene.true_length, None, searched=False)
    (found,) = runner.run(f"optimum of {name}", [OptimumTrial(name, runs)])
    return found
