"""The experiments of the paper's section 5: the numbers it prints, and how each is run here."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import InputError
from ..planners import GeodesicTraversal, RRTStar
from ..problem import scenes
from ..surface import metric
from ..validation import Point
from .measures import FanSummary, FanTrial, PathTrial, PlannedPath, Sweep, SweepSummary, SweepTrial
from .nonsmooth import SmoothedPath, smoothing_convergence
from .runner import Runner


@dataclass(frozen=True)
class Printed:
    """The numbers that the paper prints for a scene. Lengths are in map units."""

    rrt_star_r: float  # mean of RRT*-R
    geodesic: float  # length by geodesic traversal
    directions: int  # number of rays of that traversal
    chord: float  # mean of the chord baseline


PRINTED = {
    "one-peak": Printed(16.19926, 16.14253, 200, 16.5047),
    "three-peaks": Printed(15.44211, 15.37167, 400, 16.1702),
    "six-peaks": Printed(17.18928, 17.02196, 600, 19.438),
}
# The length to which the paths of the paper's convergence experiment converge.
PRINTED_LIMIT = 15.12566
CONVERGENCE_SCENE = "three-peaks"
REPEAT_SCENES = ("repeat-3d", "repeat-4d")
SENSITIVITY_SCENES = ("one-peak", "six-peaks")
# The step of all experiments, map units, and the steps that are compared with it.
STEP = 1.0
STEPS = (0.5, 1.0, 2.0, 4.0)
# The search for the true length covers 75 degrees to either side of the goal. On repeat-4d the
# shortest path is outside the paper's sector, [0, 90] degrees.
SECTOR = (-math.pi / 6.0, 2.0 * math.pi / 3.0)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The numbers of samples and runs. The defaults are the paper's, where it gives them."""

    samples: int = 10_000  # in one run
    seeds: int = 10  # runs of a planner on a scene
    repeats: int = 150  # runs on each scene of the repeat experiment
    convergence_samples: tuple[int, ...] = tuple(range(2_000, 20_001, 2_000))
    convergence_runs: int = 10  # with each number of samples
    directions: int = 4_000  # of the search for the true length, and of the sensitivity


FULL = Scale()
QUICK = Scale(
    samples=2_000,
    seeds=3,
    repeats=15,
    convergence_samples=(1_000, 2_000, 4_000),
    convergence_runs=3,
    directions=1_200,
)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a reproduction. Trials have the seeds ``seed``, ``seed`` + 1, and so on."""

    scale: Scale = field(default=FULL)
    seed: int = 0

    def planner(self, run: int = 0, *, chord: bool = False, **options: Any) -> RRTStar:
        """RRT*-R, or its chord baseline, as the paper runs it."""
        given: dict[str, Any] = {"samples": self.scale.samples, "step": STEP, **options}
        return RRTStar(
            informed=False,
            seed=self.seed + run,
            metric="chord" if chord else "riemannian",
            **given,
        )

    def paths(self, scene: str, runs: int, **options: Any) -> list[PathTrial]:
        """Trials that differ only in their seeds."""
        return [PathTrial(scene, self.planner(run, **options)) for run in range(runs)]

    def truth(self, scene: str) -> FanTrial:
        """The search for the true length, with the scale's number of directions."""
        planner = GeodesicTraversal(directions=self.scale.directions, sector=SECTOR)
        return FanTrial(scene, planner)


def _check_truth(scene: str, truth: FanSummary, lengths: Iterable[float]) -> None:
    """Raise InputError where a path is shorter than the shortest geodesic found.

    In that case the search for geodesics was too coarse.
    """
    shortest = min(lengths)
    if shortest < truth.true_length * (1.0 - 1e-9):
        raise InputError(
            f"a path of length {shortest:.9f} was found on {scene}, shorter than the shortest "
            f"geodesic of the search, {truth.true_length:.9f}; raise its number of directions"
        )


@dataclass(frozen=True)
class StepEffect:
    """The paths that the planners find with one step."""

    step: float  # map units
    rrt_star_r: list[PlannedPath]  # one for each seed
    chord: list[PlannedPath]


@dataclass(frozen=True)
class SceneData:
    """A scene, solved by RRT*-R, by its chord baseline and by geodesic traversal."""

    scene: str
    printed: Printed
    truth: FanSummary  # of the search for the true length
    traversal: FanSummary  # with the paper's number of directions
    steps: list[StepEffect]  # one for each of STEPS

    def at(self, step: float) -> StepEffect:
        """The runs with this step."""
        return next(effect for effect in self.steps if effect.step == step)


def run_scene(scene: str, settings: Settings, runner: Runner) -> SceneData:
    """The paper's experiment on one-peak, three-peaks or six-peaks."""
    printed = PRINTED[scene]
    paper_fan = FanTrial(scene, GeodesicTraversal(directions=printed.directions))
    truth, traversal = runner.run(f"{scene}, geodesics", [settings.truth(scene), paper_fan])
    seeds = settings.scale.seeds
    batches = [
        settings.paths(scene, seeds, step=step, chord=chord)
        for step in STEPS
        for chord in (False, True)
    ]
    found = runner.run(f"{scene}, trees", [trial for batch in batches for trial in batch])
    _check_truth(scene, truth, (path.length for path in found))
    split = [found[k : k + seeds] for k in range(0, len(found), seeds)]
    effects = [StepEffect(step, split[2 * k], split[2 * k + 1]) for k, step in enumerate(STEPS)]
    return SceneData(scene, printed, truth, traversal, effects)


@dataclass(frozen=True)
class ComparedPath:
    """A path's true length under the metrics of both scenes, and its profile."""

    planned_on: str  # the scene
    height_only: float  # length under h of four-peaks, map units
    with_resistance: float  # length under h of six-peaks, map units
    highest: float  # height along the path
    most_resistance: float  # along the path


@dataclass(frozen=True)
class ComparativeData:
    """Paths planned without and with the ground's resistance."""

    paths: list[ComparedPath]  # every seed on four-peaks, then every seed on six-peaks
    true_height_only: float  # true length on four-peaks, map units
    true_with_resistance: float  # true length on six-peaks, map units

    def planned_on(self, scene: str) -> list[ComparedPath]:
        """The paths that were planned on one of the scenes."""
        return [path for path in self.paths if path.planned_on == scene]


def _compare(scene: str, points: Sequence[Point]) -> ComparedPath:
    height_only, with_resistance = scenes.load("four-peaks"), scenes.load("six-peaks")
    met = with_resistance.path(points).profile.values.max(axis=0)
    return ComparedPath(
        scene,
        metric.curve_length(height_only.surface, points),
        metric.curve_length(with_resistance.surface, points),
        float(met[0]),
        float(met[1]),
    )


def run_comparative(settings: Settings, runner: Runner) -> ComparativeData:
    """Plan over the hills of six-peaks with and without resistance; measure under both metrics."""
    names = ("four-peaks", "six-peaks")
    truths = runner.run("comparative, geodesics", [settings.truth(name) for name in names])
    trials = [t for name in names for t in settings.paths(name, settings.scale.seeds)]
    found = runner.run("comparative, trees", trials)
    paths = [_compare(t.scene, path.points) for t, path in zip(trials, found, strict=True)]
    _check_truth(names[0], truths[0], (path.height_only for path in paths))
    _check_truth(names[1], truths[1], (path.with_resistance for path in paths))
    return ComparativeData(paths, truths[0].true_length, truths[1].true_length)


@dataclass(frozen=True)
class RepeatData:
    """Lengths of many runs on one scene."""

    scene: str
    lengths: list[float]  # map units
    truth: FanSummary  # of the search for the true length


def run_repeat(settings: Settings, runner: Runner) -> list[RepeatData]:
    """The same input many times, in 3-D and in 4-D."""
    truths = runner.run("repeat, geodesics", [settings.truth(name) for name in REPEAT_SCENES])
    runs = settings.scale.repeats
    trials = [t for name in REPEAT_SCENES for t in settings.paths(name, runs)]
    lengths = [path.length for path in runner.run("repeat, trees", trials)]
    data = [
        RepeatData(name, lengths[k * runs : (k + 1) * runs], truths[k])
        for k, name in enumerate(REPEAT_SCENES)
    ]
    for item in data:
        _check_truth(item.scene, item.truth, item.lengths)
    return data


@dataclass(frozen=True)
class ConvergenceData:
    """Path lengths by the number of samples."""

    scene: str
    samples: tuple[int, ...]
    lengths: list[list[float]]  # for each number of samples, map units
    true_length: float  # map units


def run_convergence(settings: Settings, runner: Runner) -> ConvergenceData:
    """Plan with rising numbers of samples, several times with each."""
    scale, scene = settings.scale, CONVERGENCE_SCENE
    (truth,) = runner.run("convergence, geodesics", [settings.truth(scene)])
    runs = scale.convergence_runs
    trials = [
        trial
        for samples in scale.convergence_samples
        for trial in settings.paths(scene, runs, samples=samples)
    ]
    lengths = [path.length for path in runner.run("convergence, trees", trials)]
    _check_truth(scene, truth, lengths)
    split = [lengths[k : k + runs] for k in range(0, len(lengths), runs)]
    return ConvergenceData(scene, scale.convergence_samples, split, truth.true_length)


@dataclass(frozen=True)
class SensitivityData:
    """How far the ends of a scene's geodesics move with their directions."""

    scene: str
    truth: FanSummary  # of the search for the true length
    sweep: Sweep  # the rays
    found: SweepSummary  # how far their ends move


def run_sensitivity(settings: Settings, runner: Runner) -> list[SensitivityData]:
    """End-point movement at the length of the shortest geodesic, against direction."""
    scenes_shown = SENSITIVITY_SCENES
    truths = runner.run("sensitivity, geodesics", [settings.truth(s) for s in scenes_shown])
    directions = settings.scale.directions
    sweeps = [Sweep(directions=directions, length=t.true_length) for t in truths]
    trials = [SweepTrial(s, sweep) for s, sweep in zip(scenes_shown, sweeps, strict=True)]
    found = runner.run("sensitivity, rays", trials)
    rows = zip(scenes_shown, truths, sweeps, found, strict=True)
    return [SensitivityData(*row) for row in rows]


def run_smoothing(settings: Settings, runner: Runner) -> list[SmoothedPath]:
    """Compare paths on smoothed edges with exact ones. It takes seconds, so nothing is stored."""
    runner.watch("smoothing", 0, 1)
    found = smoothing_convergence()
    runner.watch("smoothing", 1, 1)
    return found


def _scene_runner(scene: str) -> Callable[[Settings, Runner], SceneData]:
    return lambda settings, runner: run_scene(scene, settings, runner)


EXPERIMENTS: dict[str, Callable[[Settings, Runner], object]] = {
    **{scene: _scene_runner(scene) for scene in PRINTED},
    "comparative": run_comparative,
    "repeat": run_repeat,
    "convergence": run_convergence,
    "sensitivity": run_sensitivity,
    "smoothing": run_smoothing,
}
