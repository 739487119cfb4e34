"""The benchmarks in one directory: trials, pictures, report."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import terrapath
from terrapath import __version__
from terrapath._support.files import require_writable, written_whole
from terrapath._support.watching import Watch, watch_nothing
from terrapath.errors import InputError
from terrapath.paper.report import processor
from terrapath.paper.reproduce import REPORT_FILE, TRIALS, claim
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Store

from . import (
    bound,
    edges,
    figures,
    grids,
    growth,
    large_maps,
    marching,
    paths,
    peer_figures,
    peer_report,
    report,
    startup,
    trees,
)
from .settings import FULL, QUICK, Scale
from .timing import Target, Timing, percent


@dataclass(frozen=True)
class Experiment:
    """What is measured, and how it is shown. The other functions get what ``run`` returns."""

    title: str
    run: Callable[[Scale, Runner], Any]
    targets: Callable[[Any], list[Target]]
    lines: Callable[[Any], list[str]]
    timings: Callable[[Any], list[Timing]]
    draw: Callable[[Any, Path], list[Path]]

    def finding(self, data: Any, directory: Path) -> report.Finding:
        """Draw the experiment's pictures; returns its section of the report."""
        return report.Finding(
            self.title,
            self.targets(data),
            self.lines(data),
            self.timings(data),
            self.draw(data, directory),
        )


EXPERIMENTS = {
    "bound": Experiment(
        "Lower bounds: gap against time",
        bound.run_bound,
        bound.bound_targets,
        report.bound_lines,
        lambda data: [step.timing for found in data.values() for step in found.steps],
        figures.draw_bound,
    ),
    "fast-marching": Experiment(
        "Fast marching: seconds, memory, error",
        marching.run_marching,
        marching.marching_targets,
        report.marching_lines,
        lambda data: [row.found.whole for row in data.rows],
        figures.draw_marching,
    ),
    "path": Experiment(
        f"Paths within {percent(paths.NEAR)} of the shortest",
        paths.run_paths,
        paths.paths_targets,
        report.paths_lines,
        lambda data: [runs.timing for found in data.found.values() for runs in found],
        figures.draw_paths,
    ),
    "large-maps": Experiment(
        "Large maps: seconds and memory",
        large_maps.run_large_maps,
        large_maps.large_maps_targets,
        report.large_maps_lines,
        lambda data: [found.timing for found in data.found.values()],
        lambda data, directory: [],
    ),
    "startup": Experiment(
        "Start-up: from the prompt to the answer",
        startup.run_startup,
        startup.startup_targets,
        report.startup_lines,
        lambda data: [found.timing for _, found in data.found],
        lambda data, directory: [],
    ),
    "trees": Experiment(
        "Trees beside OMPL",
        trees.run_trees,
        trees.trees_targets,
        peer_report.trees_lines,
        trees.trees_timings,
        peer_figures.draw_trees,
    ),
    "grids": Experiment(
        "Lattices and meshes: seconds and error",
        grids.run_grids,
        grids.grids_targets,
        peer_report.grids_lines,
        lambda data: [row.found.timing for row in data.rows],
        peer_figures.draw_grids,
    ),
    "growth": Experiment(
        "Growth of RRT\\*-R: seconds and memory",
        growth.run_growth,
        growth.growth_targets,
        peer_report.growth_lines,
        lambda data: [row.found.timing for row in data.rows],
        peer_figures.draw_growth,
    ),
    "edges": Experiment(
        "Edges: Line-R in a batch",
        edges.run_edges,
        edges.edges_targets,
        peer_report.edges_lines,
        lambda data: [found.ours for found in data.found.values()],
        lambda data, directory: [],
    ),
}


def chosen_experiments(what: Sequence[str]) -> list[str]:
    """The names of the chosen experiments, each once; all where none is named."""
    for name in what:
        if name not in EXPERIMENTS:
            raise InputError(f"what={name!r} is not known; choose some of {', '.join(EXPERIMENTS)}")
    return [name for name in EXPERIMENTS if not what or name in what]


def _source_stamp() -> str:
    """A hash of the package's source, so that times of other code are not mixed with these."""
    package = Path(terrapath.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def benchmark(
    what: Sequence[str] = (),
    output: str | Path = "benchmark",
    *,
    quick: bool = False,
    watch: Watch = watch_nothing,
) -> Path:
    """Measure, draw and report.

    what : some of ``EXPERIMENTS``; all where none is named. output : a directory; a run that was
    stopped there continues, with the same code on the same machine. quick : fewer repetitions
    and smaller lattices. Returns the report's path.
    Raises InputError where the directory belongs to a run with other settings.
    """
    names = chosen_experiments(what)
    scale = QUICK if quick else FULL
    directory = Path(output)
    record = {"version": __version__, "source": _source_stamp(), "quick": quick}
    claim(directory, {**record, "machine": processor()})
    for file in (directory / REPORT_FILE, directory / TRIALS / REPORT_FILE):
        require_writable(file)
    # One at a time: trials that run side by side would disturb each other's clocks.
    with Runner(Store(directory / TRIALS), 1, watch) as runner:
        data = {name: EXPERIMENTS[name].run(scale, runner) for name in names}
    found = {name: EXPERIMENTS[name].finding(data[name], directory) for name in names}
    path = directory / REPORT_FILE
    with written_whole(path) as temporary:
        temporary.write_text(report.make_report(found, scale), encoding="utf-8")
    return path
