"""How long each planner takes from a problem to a path that is nearly the shortest."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median
from typing import Any

from terrapath.errors import InputError
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial
from terrapath.planners import plan
from terrapath.problem import Solution, Status, scenes

from .settings import Scale, true_length
from .timing import Reading, Target, Timing, percent, timed

# A path is near the shortest when it is longer by at most this share.
NEAR = 1e-3

# Options with which a planner runs all of its code, but only for a short time.
WARM_UP: dict[str, dict[str, Any]] = {
    "optimal": {"target_gap": 1.0},
    "rrt-star-r": {"samples": 500},
}

TARGET_SCENE, TARGET_SECONDS = "six-peaks", 0.1


@dataclass(frozen=True, kw_only=True)
class PathRuns:
    """A planner and its options: the settings of a trial."""

    label: str  # the name in tables
    planner: str
    options: tuple[tuple[str, Any], ...] = ()
    refine: bool = False
    seeded: bool = False  # each repetition has its own seed
    until_near: bool = False  # the planner stops when it believes its path near the shortest
    repeats: int

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return self.planner


@dataclass(frozen=True)
class PathsFound:
    """The paths that a planner found, one entry for each repetition."""

    timing: Timing
    excess: tuple[float, ...]  # over the true length, relative
    gap: float | None  # proven, where the planner proves one

    @property
    def is_near(self) -> bool:
        """Is every path near the shortest?"""
        return max(self.excess) <= NEAR

    @property
    def typical_excess(self) -> float:
        """The median excess."""
        return median(self.excess)


@dataclass(frozen=True)
class PathsTrial(Trial[PathsFound]):
    """One planner on one scene."""

    planner: PathRuns

    def measure(self) -> PathsFound:
        """Plan once shortly, to compile everything, then as often as the settings say."""
        self._plan(0, WARM_UP.get(self.planner.planner, {}))
        runs = [self._plan(seed) for seed in range(self.planner.repeats)]
        truth = true_length(self.scene)
        lengths = [self._length(solution) for solution, _ in runs]
        return PathsFound(
            Timing.of(reading for _, reading in runs),
            tuple(length / truth - 1.0 for length in lengths),
            runs[0][0].gap,
        )

    def _plan(self, seed: int, others: dict[str, Any] | None = None) -> tuple[Solution, Reading]:
        """Plan from the problem's numbers. others : options in place of the planner's own."""
        options = {**dict(self.planner.options), **(others or {})}
        if self.planner.seeded:
            options["seed"] = seed
        if self.planner.until_near:
            options["target_length"] = true_length(self.scene) * (1.0 + NEAR)
        name, refine = self.planner.planner, self.planner.refine
        return timed(lambda: plan(scenes.load(self.scene), name, refine=refine, **options))

    def _length(self, solution: Solution) -> float:
        if solution.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if solution.length is None:
            raise InputError(f"{self.planner.label} found no path on {self.scene}")
        return solution.length


def contenders(scale: Scale) -> list[PathRuns]:
    """All planners that are compared; the target is for the first."""
    fast, slow = scale.path_repeats, scale.slow_repeats
    trees = [
        PathRuns(
            label=f"RRT\\*-R, {samples:,} samples",
            planner="rrt-star-r",
            options=(("samples", samples),),
            seeded=True,
            repeats=slow,
        )
        for samples in scale.tree_samples
    ]
    grids = [
        PathRuns(
            label=f"{label}, {neighbours} neighbours",
            planner=planner,
            options=(("neighbours", neighbours),),
            repeats=slow,
        )
        for label, planner in (("Dijkstra", "dijkstra"), ("A\\*", "a-star"))
        for neighbours in (16, 32)
    ]
    return [
        PathRuns(
            label="fast marching, refined", planner="fast-marching", refine=True, repeats=fast
        ),
        PathRuns(label="fast marching", planner="fast-marching", repeats=fast),
        PathRuns(label="optimal, with proof", planner="optimal", repeats=slow),
        PathRuns(
            label="RRT\\*-R until near",
            planner="rrt-star-r",
            options=(("samples", scale.most_samples),),
            seeded=True,
            until_near=True,
            repeats=slow,
        ),
        *trees,
        *grids,
    ]


@dataclass(frozen=True)
class PathsData:
    """Every planner on every scene."""

    labels: list[str]
    found: dict[str, list[PathsFound]]  # for each scene, in the labels' order


def run_paths(scale: Scale, runner: Runner) -> PathsData:
    """Plan on each scene with each planner."""
    planners = contenders(scale)
    trials = [PathsTrial(scene, planner) for scene in scale.scenes for planner in planners]
    results = iter(runner.run("paths", trials))
    found = {scene: [next(results) for _ in planners] for scene in scale.scenes}
    return PathsData([planner.label for planner in planners], found)


def paths_targets(data: PathsData) -> list[Target]:
    """The first planner's seconds on one scene."""
    targets = []
    for scene, (first, *_) in data.found.items():
        if scene == TARGET_SCENE:
            what = f"{scene}: path within {percent(NEAR)} by {data.labels[0]}"
            seconds = first.timing.seconds if first.is_near else None
            instead = f"it is {percent(max(first.excess))} too long"
            targets.append(Target(what, TARGET_SECONDS, "s", seconds, instead))
    return targets
