"""How the time and the memory of RRT*-R grow with the number of samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from terrapath._support.memory import forget_peak, peak_memory
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial
from terrapath.planners import plan
from terrapath.problem import Problem, scenes
from terrapath.surface import Surface

from .processes import answer, run_fresh
from .settings import Scale
from .timing import Target, Timing, timed

GROWTH_TARGET = 13.0  # ratio of the seconds, for ten times the samples
BYTES_TARGET = 200.0  # for a sample
# With fewer samples, most of the memory is used by other things.
FEWEST_SAMPLES = 100_000


def _four_layers() -> Problem:
    """Height and resistance of repeat-4d, and two more layers."""
    layers = [
        scenes.REPEAT_HEIGHT,
        scenes.REPEAT_RESISTANCE,
        [(2.0, 0.3, 4.0, 4.0), (1.5, 0.5, 8.0, 2.0)],
        [(1.0, 0.2, 6.0, 9.0), (2.0, 0.4, 2.0, 5.0)],
    ]
    surface = Surface.from_peaks(layers)
    return Problem(surface, scenes.START, scenes.GOAL, scenes.REGION, name="four-layers")


DEFAULTS = "six-peaks, default options"

GROUND: dict[str, Callable[[], Problem]] = {
    "six-peaks": lambda: scenes.load("six-peaks"),
    DEFAULTS: lambda: scenes.load("six-peaks"),
    "four-layers": _four_layers,
}


def options_on(ground: str) -> dict[str, Any]:
    """The planner's options; without the default ones samples are drawn everywhere."""
    return {} if ground == DEFAULTS else {"informed": False}


@dataclass(frozen=True, kw_only=True)
class GrowthRuns:
    """The settings of a trial."""

    samples: int
    repeats: int

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return f"growth-{self.samples}"


@dataclass(frozen=True)
class GrowthFound:
    """The measures of a fresh process."""

    timing: Timing
    length: float | None  # map units; None where no path was found
    vertices: int
    memory_before: int | None  # the process's, bytes; None where the system gives none
    memory_peak: int | None


@dataclass(frozen=True)
class GrowthTrial(Trial[GrowthFound]):
    """One number of samples, in a process of its own."""

    planner: GrowthRuns

    @property
    def settings(self) -> dict[str, Any]:
        """The settings; the ground depends on its name alone."""
        options = {**options_on(self.scene), **asdict(self.planner)}
        return {"ground": self.scene, "options": options}

    def measure(self) -> GrowthFound:
        """Start the process and read its answer."""
        task = {"scene": self.scene, **asdict(self.planner)}
        return self.decode(run_fresh("growth", task, f"{self.planner.samples:,} samples"))


@dataclass(frozen=True)
class GrowthRow:
    """One number of samples."""

    scene: str
    samples: int
    found: GrowthFound

    @property
    def bytes_per_sample(self) -> float | None:
        """Peak memory above the memory before; None where there are too few samples."""
        before, peak = self.found.memory_before, self.found.memory_peak
        if before is None or peak is None or self.samples < FEWEST_SAMPLES:
            return None
        return (peak - before) / self.samples


@dataclass(frozen=True)
class GrowthData:
    """All grounds with all numbers of samples, the fewest first."""

    rows: list[GrowthRow]


def run_growth(scale: Scale, runner: Runner) -> GrowthData:
    """Measure each ground with each number of samples."""
    trials = [
        GrowthTrial(ground, GrowthRuns(samples=samples, repeats=scale.growth_repeats))
        for ground in GROUND
        for samples in scale.growth_samples
    ]
    found = runner.run("growth", trials)
    pairs = zip(trials, found, strict=True)
    return GrowthData([GrowthRow(t.scene, t.planner.samples, f) for t, f in pairs])


def growth_targets(data: GrowthData) -> list[Target]:
    """The growth of time, the memory for a sample, and that a path is found."""
    targets = []
    for row in data.rows:
        tenth = (o for o in data.rows if (o.scene, 10 * o.samples) == (row.scene, row.samples))
        for other in tenth:
            ratio = row.found.timing.seconds / other.found.timing.seconds
            what = f"{row.scene}: seconds of {row.samples:,} samples over {other.samples:,}"
            targets.append(Target(what, GROWTH_TARGET, "", ratio))
        if row.bytes_per_sample is not None:
            what = f"{row.scene}, {row.samples:,} samples: memory a sample"
            targets.append(Target(what, BYTES_TARGET, "bytes", row.bytes_per_sample))
    largest = max(row.samples for row in data.rows)
    complete = [r for r in data.rows if (r.scene, r.samples) == ("four-layers", largest)]
    for row in complete:
        share = None if row.found.length is None else 1.0
        what = f"four layers, {largest:,} samples: complete, with a path"
        targets.append(Target(what, 1.0, "", share, "no path was found", at_least=True))
    return targets


# In the fresh process


def measure_growth(scene: str, runs: GrowthRuns) -> GrowthFound:
    """Measure the memory of the first run and the seconds of all."""
    problem = GROUND[scene]()

    def grow(samples: int) -> Any:
        return plan(problem, "rrt-star-r", samples=samples, **options_on(scene))

    grow(500)
    forget_peak()
    before = peak_memory()
    solution, lap = timed(lambda: grow(runs.samples))
    peak, laps = peak_memory(), [lap]
    length, vertices = solution.length, solution.counters["vertices"]
    del solution
    laps += [timed(lambda: grow(runs.samples))[1] for _ in range(runs.repeats - 1)]
    return GrowthFound(Timing.of(laps), length, vertices, before, peak)


if __name__ == "__main__":
    answer(lambda scene, **runs: measure_growth(scene, GrowthRuns(**runs)))
