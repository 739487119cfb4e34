"""The time to measure an edge by Line-R, beside a loop in C++."""

from __future__ import annotations

import tempfile
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from terrapath._kernels.surface.lengths import fill_line_r
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial
from terrapath.problem import Problem, scenes
from terrapath.surface import Surface
from terrapath.validation import Array

from .exchange import write_problem
from .programs import EDGES_LOOP
from .settings import Scale
from .timing import Reading, Target, Timing, timed

SPLINE_TARGET = 150.0  # nanoseconds for an edge
PEAKS_TARGET = 1.0  # times the seconds of the loop in C++

SAMPLES = 121  # on a side, of the spline
LONGEST = 1.0  # edge, map units


@cache
def ground(kind: str) -> Problem:
    """Six-peaks, with its exact peaks or with a spline through samples of both layers."""
    exact = scenes.load("six-peaks")
    if kind == "peaks":
        return exact
    axis = np.linspace(-1.0, 11.0, SAMPLES)
    points = np.stack(np.meshgrid(axis, axis), axis=-1)
    values = np.moveaxis(exact.surface.values(points), -1, 0)
    surface = Surface.from_grid(values, axis, axis)
    return Problem(surface, exact.start, exact.goal, exact.bounds, name="six-peaks, spline")


def random_edges(problem: Problem, count: int) -> Array:
    """(count, 4): the two ends of each edge, at most ``LONGEST`` apart, within the bounds."""
    random = np.random.default_rng(0)
    bounds = problem.bounds
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    start = random.uniform(low, high, (count, 2))
    angle, size = random.uniform(0.0, 2.0 * np.pi, count), random.uniform(0.0, LONGEST, count)
    end = start + np.column_stack([size * np.cos(angle), size * np.sin(angle)])
    return np.hstack([start, np.clip(end, low, high)])


@dataclass(frozen=True, kw_only=True)
class EdgeRuns:
    """The settings of a trial."""

    kind: str  # of surface
    edges: int
    repeats: int
    version: str | None  # of the loop in C++

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return f"edges-{self.kind}"


@dataclass(frozen=True)
class EdgesFound:
    """The seconds for all edges."""

    ours: Timing
    loop: Timing | None
    difference: float | None  # largest relative difference of an edge's two lengths


@dataclass(frozen=True)
class EdgesTrial(Trial[EdgesFound]):
    """One surface; Terrapath and the loop take turns."""

    planner: EdgeRuns

    def measure(self) -> EdgesFound:
        """Measure all edges, as often as the settings say."""
        runs, problem = self.planner, ground(self.planner.kind)
        edges = random_edges(problem, runs.edges)
        start, end = np.ascontiguousarray(edges[:, :2]), np.ascontiguousarray(edges[:, 2:])
        lengths, loops = np.empty(len(edges)), np.empty(len(edges))

        def measure_all() -> None:
            fill_line_r(problem.surface.data, start, end, lengths)

        measure_all()
        ours, theirs = [], []
        for _ in range(runs.repeats):
            ours.append(timed(measure_all)[1])
            if runs.version is not None:
                reading, loops = loop_lengths(problem, edges)
                theirs.append(reading)
        if not theirs:
            return EdgesFound(Timing.of(ours), None, None)
        difference = float(np.max(np.abs(lengths - loops) / np.maximum(lengths, 1e-300)))
        return EdgesFound(Timing.of(ours), Timing.of(theirs), difference)

    @property
    def settings(self) -> dict[str, Any]:
        """The settings; the edges depend on nothing else."""
        return {"scene": self.scene, "options": asdict(self.planner)}


def loop_lengths(problem: Problem, edges: Array) -> tuple[Reading, Array]:
    """The time of the loop in C++, run for the second time, and the lengths (m,), map units."""
    with tempfile.TemporaryDirectory() as folder:
        where = [Path(folder) / name for name in ("problem", "segments", "lengths")]
        write_problem(where[0], problem)
        edges.tofile(where[1])
        found = EDGES_LOOP.run([*where, "2"])
        lengths = np.fromfile(where[2])
    return Reading(found["wall"][-1], found["processor"][-1]), lengths


@dataclass(frozen=True)
class EdgesData:
    """The measures on both surfaces."""

    found: dict[str, EdgesFound]  # by kind
    edges: int
    missing: list[str]
    version: str | None  # of the loop in C++

    def nanoseconds(self, timing: Timing) -> float:
        """Nanoseconds for one edge."""
        return 1e9 * timing.seconds / self.edges


def run_edges(scale: Scale, runner: Runner) -> EdgesData:
    """Measure on a spline and on peaks."""
    version = EDGES_LOOP.version
    kinds = ("spline", "peaks")
    trials = [
        EdgesTrial(
            "six-peaks",
            EdgeRuns(kind=kind, edges=scale.edges, repeats=scale.edge_repeats, version=version),
        )
        for kind in kinds
    ]
    found = runner.run("edges", trials)
    missing = [] if version is not None else [EDGES_LOOP.missing]
    return EdgesData(dict(zip(kinds, found, strict=True)), scale.edges, missing, version)


def edges_targets(data: EdgesData) -> list[Target]:
    """The time on the spline, and the ratio to the loop on peaks."""
    spline, peaks = data.found["spline"], data.found["peaks"]
    what = "an edge on a spline surface with two layers, in a batch"
    targets = [Target(what, SPLINE_TARGET, "ns", data.nanoseconds(spline.ours))]
    if peaks.loop is not None:
        ratio = peaks.ours.seconds / peaks.loop.seconds
        what = "an edge on exact peaks: times the loop in C++"
        targets.append(Target(what, PEAKS_TARGET, "", ratio))
    return targets
