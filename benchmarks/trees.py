"""RRT*-R beside OMPL's planners: how the length of their paths falls with time."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial
from terrapath.planners import plan

from .contenders import (
    CPP,
    CPP_RRT,
    OURS,
    OURS_INFORMED,
    PYTHON,
    PYTHON_RRT,
    TERRAPATH,
    Contender,
    Options,
    contenders,
    in_the_end,
)
from .curves import Curve, CurvePoint, MedianCurve, curve_of_looks
from .exchange import write_problem
from .peers import OMPL_PYTHON, Peer
from .problems import Optimum, OptimumRuns, find_optimum, load_problem, problem_settings
from .processes import run_fresh
from .programs import OMPL_PLANNERS, Program
from .settings import Scale
from .timing import Target, Timing, percent, timed


class Looks(NamedTuple):
    """When a run is looked at, in samples or seconds."""

    growth: float  # ratio of the samples or seconds of one look to those of the look before
    share: float  # a run has this share of all samples or seconds


SWEEP, SHOWN = Looks(1.5, 0.5), Looks(1.25, 1.0)

# The number of choices of options that are tried with more seeds after a sweep with few: among few
# seeds, a single one that finds a good valley late decides the median.
FINALISTS = 3

# The excess over the optimum that all should get below, and the excesses that are shown.
NEAR = 5e-3
LEVELS = (5e-2, 2e-2, 1e-2, NEAR)

# The targets: ratios of OMPL's time to ours.
CPP_TARGET, PYTHON_TARGET, NEAR_TARGET = 20.0, 500.0, 20.0

# Seconds that a Python process may take until it plans, on the slowest machine.
LOADING = 120.0


@dataclass(frozen=True, kw_only=True)
class TreeRun:
    """A planner, its options and its seed: the settings of a trial."""

    program: str
    version: str | None
    planner: str
    options: Options
    seed: int
    first: float  # the first look: samples for Terrapath's planners, seconds for the others
    last: float
    growth: float

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return f"{self.program}-{self.planner}"

    @property
    def looks(self) -> list[int]:
        """The numbers of samples after which the run is looked at."""
        count = max(math.ceil(math.log(self.last / self.first, self.growth) - 1e-9), 0)
        return [
            *(round(self.first * self.growth**k) for k in range(count)),
            round(self.last),
        ]


@dataclass(frozen=True)
class TreeTrial(Trial[Curve]):
    """One run of one planner."""

    planner: TreeRun

    @property
    def settings(self) -> dict[str, Any]:
        """The problem and the options."""
        return {"scene": problem_settings(self.scene), "options": asdict(self.planner)}

    def measure(self) -> Curve:
        """Plan, and look at the path from time to time."""
        if self.planner.program == TERRAPATH:
            return self._grow()
        problem = load_problem(self.scene)
        answer = self._in_cpp() if self.planner.program == CPP else self._in_python()
        return curve_of_looks(problem, answer["looks"])

    def _grow(self) -> Curve:
        """Plan anew for each look, with its number of samples, so that only planning is timed."""
        run, problem = self.planner, load_problem(self.scene)
        options = {"seed": run.seed, **dict(run.options)}
        plan(problem, run.planner, samples=run.looks[0], **options)
        points = []
        for samples in run.looks:
            solution, reading = timed(
                lambda samples=samples: plan(problem, run.planner, samples=samples, **options)  # type: ignore[misc]
            )
            points.append(CurvePoint(*reading, solution.cost, solution.length))
        return Curve(tuple(points))

    def _in_cpp(self) -> Any:
        run = self.planner
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "problem"
            write_problem(path, load_problem(self.scene))
            numbers = map(repr, (run.seed + 1, run.last, run.first, run.growth))
            options = [f"{name}={value}" for name, value in run.options]
            return OMPL_PLANNERS.run([path, run.planner, *numbers, *options])

    def _in_python(self) -> Any:
        task = {"scene": self.scene, **asdict(self.planner)}
        what = f"{self.planner.planner} of OMPL through Python on {self.scene}"
        return run_fresh("ompl_python", task, what, 10.0 * self.planner.last + LOADING)


@dataclass(frozen=True)
class Best:
    """A contender on one scene, with its best options."""

    contender: Contender
    options: Options
    curve: MedianCurve


@dataclass(frozen=True)
class SceneTrees:
    """All contenders on one scene."""

    optimum: Optimum
    found: dict[str, Best]  # by label

    def excess(self, length: float) -> float:
        """The relative excess of a length over the optimum."""
        return length / self.optimum.length - 1.0

    def time_within(self, label: str, excess: float) -> float | None:
        """Seconds until the median excess is at most this; None where it never is."""
        return self.found[label].curve.time_to(self.optimum.length * (1.0 + excess))


@dataclass(frozen=True)
class TreesData:
    """All scenes."""

    scenes: dict[str, SceneTrees]
    seeds: int
    missing: list[str]  # a sentence for each peer that is missing
    versions: dict[str, str]


def _score(contender: Contender, curve: MedianCurve, optimum: Optimum) -> tuple[float, float]:
    """A key for sorting, the best first: the time to get near, else the length that is reached."""
    near = optimum.length * (1.0 + NEAR)
    seconds = None if contender.late else curve.time_between_looks(near)
    return (math.inf if seconds is None else seconds, curve.best)


class _Comparison:
    """All contenders on one scene, one after another."""

    def __init__(self, scene: str, scale: Scale, runner: Runner) -> None:
        self.scene, self.scale, self.runner = scene, scale, runner
        runs = OptimumRuns(target_gap=scale.optimum_gap, time_limit=scale.optimum_seconds)
        self.optimum = find_optimum(scene, runs, runner)
        self.found: dict[str, Best] = {}

    def add(self, contender: Contender) -> None:
        """Run a contender with its best options and all seeds."""
        options = self._best_options(contender)
        seeds = self.scale.few_tree_seeds if contender.few else self.scale.tree_seeds
        curve = self._curve(contender, options, seeds, SHOWN)
        self.found[contender.label] = Best(contender, options, curve)

    def _best_options(self, contender: Contender) -> Options:
        if contender.as_of in self.found:
            return self.found[contender.as_of].options
        if len(contender.choices) == 1:
            return contender.choices[0]
        swept = self._ranked(contender, contender.choices, self.scale.sweep_seeds)
        return self._ranked(contender, swept[:FINALISTS], self.scale.final_seeds)[0]

    def _ranked(
        self, contender: Contender, choices: Sequence[Options], seeds: int
    ) -> list[Options]:
        """The choices of options by the median of this many seeds, the best first."""
        scored = {
            options: _score(contender, self._curve(contender, options, seeds, SWEEP), self.optimum)
            for options in choices
        }
        return sorted(scored, key=scored.__getitem__)

    def _runs(
        self, contender: Contender, options: Options, seeds: int, looks: Looks
    ) -> list[TreeRun]:
        """One run for each seed."""
        scale = self.scale
        first, last = {
            TERRAPATH: (scale.tree_looks[0], scale.tree_looks[1]),
            CPP: (scale.cpp_looks[0], scale.cpp_looks[1]),
            PYTHON: (scale.python_looks[0], scale.python_looks[1]),
        }[contender.program]
        version = {TERRAPATH: None, CPP: OMPL_PLANNERS.version, PYTHON: OMPL_PYTHON.version}
        return [
            TreeRun(
                program=contender.program,
                version=version[contender.program],
                planner=contender.planner,
                options=options,
                seed=seed,
                first=float(first),
                last=looks.share * last,
                growth=looks.growth,
            )
            for seed in range(seeds)
        ]

    def _curve(
        self, contender: Contender, options: Options, seeds: int, looks: Looks
    ) -> MedianCurve:
        runs = self._runs(contender, options, seeds, looks)
        stage = f"{self.scene}, {contender.label}".replace("\\", "")
        return MedianCurve.of(self.runner.run(stage, [TreeTrial(self.scene, r) for r in runs]))

    def result(self) -> SceneTrees:
        """The comparison. Where a path is shorter than the optimum, it becomes the optimum."""
        shortest = min((best.curve.best for best in self.found.values()), default=math.inf)
        length = min(self.optimum.length, shortest)
        return SceneTrees(replace(self.optimum, length=length), self.found)


def _present() -> tuple[set[str], dict[str, str], list[str]]:
    """Programs that can be run, their versions, and a sentence for each of the others."""
    peers: dict[str, Program | Peer] = {CPP: OMPL_PLANNERS, PYTHON: OMPL_PYTHON}
    versions = {name: peer.version for name, peer in peers.items()}
    missing = [peer.missing for name, peer in peers.items() if versions[name] is None]
    present = {name: version for name, version in versions.items() if version is not None}
    return {TERRAPATH, *present}, present, missing


def run_trees(scale: Scale, runner: Runner) -> TreesData:
    """Compare all contenders on each scene."""
    present, versions, missing = _present()
    found = {}
    for scene in scale.tree_scenes:
        comparison = _Comparison(scene, scale, runner)
        for contender in contenders(load_problem(scene).bounds.side):
            if contender.program in present:
                comparison.add(contender)
        found[scene] = comparison.result()
    return TreesData(found, scale.tree_seeds, missing, versions)


def _at_equal_length(scene: SceneTrees, peer: str) -> tuple[float | None, str]:
    """The ratio of the peer's seconds to ours, for the shortest median length that it reaches.

    Each has the options that get there first. Where there is no ratio, the text says why;
    otherwise it is that length's excess.
    """

    def curves_of(label: str) -> list[MedianCurve]:
        return [
            scene.found[name].curve for name in (label, in_the_end(label)) if name in scene.found
        ]

    def least_time(curves: list[MedianCurve], length: float) -> float:
        times = (curve.time_to(length) for curve in curves)
        return min((seconds for seconds in times if seconds is not None), default=math.inf)

    theirs = curves_of(peer)
    shortest = min(curve.best for curve in theirs)
    if math.isinf(shortest):
        return None, "it found no path in the time it was given"
    seconds, ours = least_time(theirs, shortest), least_time(curves_of(OURS), shortest)
    level = percent(scene.excess(shortest))
    if math.isinf(ours):
        return None, f"{OURS} does not get within {level}"
    return seconds / ours, level


def ompl_labels(scene: SceneTrees) -> list[str]:
    """The contenders that are OMPL's."""
    return [label for label, best in scene.found.items() if best.contender.program != TERRAPATH]


def _near_target(name: str, scene: SceneTrees) -> Iterator[Target]:
    """The target beside the best of OMPL's planners.

    If none gets near, its time is at least all the time that the planners were given.
    """
    labels = ompl_labels(scene)
    if not labels:
        return
    times = {label: scene.time_within(label, NEAR) for label in labels}
    reached = {label: seconds for label, seconds in times.items() if seconds is not None}
    if reached:
        label = min(reached, key=reached.__getitem__)
        seconds, who = reached[label], f"{label}'s"
    else:
        seconds = max(scene.found[label].curve.seconds[-1] for label in labels)
        who = "all that OMPL's planners were given, none of which got there: at least"
    ours = scene.time_within(OURS_INFORMED, NEAR)
    yield Target(
        f"{name}: within {percent(NEAR)}, {who} seconds over those of {OURS_INFORMED}",
        NEAR_TARGET,
        "",
        None if ours is None else seconds / ours,
        f"{OURS_INFORMED} does not get there",
        at_least=True,
    )


def trees_targets(data: TreesData) -> list[Target]:
    """The ratios of seconds, scene by scene."""
    targets = []
    for name, scene in data.scenes.items():
        for peer, limit in ((CPP_RRT, CPP_TARGET), (PYTHON_RRT, PYTHON_TARGET)):
            if peer in scene.found:
                ratio, text = _at_equal_length(scene, peer)
                what = f"{name}: at equal length, {peer}'s seconds over {OURS}'s"
                what += "" if ratio is None else f" (within {text})"
                targets.append(Target(what, limit, "", ratio, text, at_least=True))
        targets += _near_target(name, scene)
    return targets


def trees_timings(data: TreesData) -> list[Timing]:
    """The times of the last look of each contender."""
    found = (best for scene in data.scenes.values() for best in scene.found.values())
    return [best.curve.timing[-1] for best in found]
