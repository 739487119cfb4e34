"""Planning on maps of a hundred million cells, coarse to fine: seconds and memory."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrapath._support.memory import forget_peak, peak_memory
from terrapath.errors import TerrapathError
from terrapath.io import read_surface
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial
from terrapath.planners import make_finished
from terrapath.planners.corridor import Part, plan_in_corridor
from terrapath.problem import Problem
from terrapath.scenario.answers import MOST_CELLS

from .processes import answer, run_fresh
from .settings import Scale
from .timing import Reading, Target, Timing, timed

GIGABYTES_TARGET, TARGET_CELLS = 6.0, 10_000  # of a map with this many cells on a side

CELL = 10.0  # metres
ROWS_AT_ONCE = 500
WAVES = 8  # of lengths from 0.3 to 24 km
NOISE = 0.3  # in every cell, metres
STEEPEST = 30.0  # degrees


@dataclass(frozen=True, kw_only=True)
class LargeMapRuns:
    """The settings of a trial."""

    cells: int  # on a side
    planner: str = "fast-marching"

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return f"large-map-{self.cells}"


@dataclass(frozen=True)
class LargeMapFound:
    """The measures of a fresh process, with everything compiled before."""

    timing: Timing
    length: float  # map units
    coarse_length: float
    least_length: float  # lower bound for any path on the map
    corridor_bound: float  # lower bound for any path in the corridor
    memory_before: int | None  # the process's, bytes; None where the system gives none
    memory_peak: int | None


@dataclass(frozen=True)
class LargeMapTrial(Trial[LargeMapFound]):
    """One map, in a process of its own."""

    planner: LargeMapRuns

    @property
    def settings(self) -> dict[str, Any]:
        """The settings; the map depends on nothing else."""
        return {"map": self.scene, "options": asdict(self.planner)}

    def measure(self) -> LargeMapFound:
        """Write the map, start the process and read its answer."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "map.tif"
            write_map(path, self.planner.cells)
            task = {"path": str(path), **asdict(self.planner)}
            what = f"planning on {self.planner.cells:,} cells a side"
            return self.decode(run_fresh("large_maps", task, what))


@dataclass(frozen=True)
class LargeMapData:
    """All maps, by their cells on a side."""

    found: dict[int, LargeMapFound]


def run_large_maps(scale: Scale, runner: Runner) -> LargeMapData:
    """Measure maps of each size."""
    trials = [LargeMapTrial("hills", LargeMapRuns(cells=cells)) for cells in scale.map_cells]
    found = runner.run("large maps", trials)
    return LargeMapData(dict(zip(scale.map_cells, found, strict=True)))


def large_maps_targets(data: LargeMapData) -> list[Target]:
    """Memory."""
    targets = []
    for cells, found in data.found.items():
        if found.memory_peak is not None and cells >= TARGET_CELLS:
            what = f"map of {cells:,} x {cells:,} cells: memory in all"
            targets.append(Target(what, GIGABYTES_TARGET, "GB", found.memory_peak / 1e9))
    return targets


# The map


def write_map(path: Path, cells: int) -> None:
    """Write a map of hills of all sizes and a lake, 32-bit metres in UTM; always the same one."""
    import rasterio
    from rasterio.transform import from_origin

    random = np.random.default_rng(0)
    lengths = 300.0 * 2.0 ** np.repeat(np.arange(WAVES // 2), 2) * random.uniform(1, 10, WAVES)
    angles, phases = random.uniform(0.0, 2.0 * math.pi, (2, WAVES))
    profile: dict[str, Any] = {
        "driver": "GTiff",
        "width": cells,
        "height": cells,
        "count": 1,
        "dtype": "float32",
        "crs": "EPSG:32633",
        "transform": from_origin(300_000.0, 5_200_000.0, CELL, CELL),
        "tiled": True,
        "compress": "deflate",
        "predictor": 3,
        "nodata": math.nan,
    }
    axis = CELL * np.arange(cells)
    with rasterio.open(path, "w", **profile) as dataset:
        for first in range(0, cells, ROWS_AT_ONCE):
            x, y = np.meshgrid(axis, axis[first : first + ROWS_AT_ONCE])
            z = random.normal(scale=NOISE, size=x.shape)
            for length, angle, phase in zip(lengths, angles, phases, strict=True):
                along = x * math.cos(angle) + y * math.sin(angle)
                z += 0.03 * length * np.sin(2.0 * math.pi * along / length + phase)
            z[np.hypot(x - 0.5 * axis[-1], y - 0.45 * axis[-1]) < 0.12 * axis[-1]] = np.nan
            dataset.write(z.astype(np.float32), 1, window=((first, first + len(z)), (0, cells)))


# In the fresh process


def measure_large_map(path: str, runs: LargeMapRuns) -> LargeMapFound:
    """Plan from corner to corner, after a warm-up on a far smaller map."""
    planner = make_finished(runs.planner, refine=True, bound=True)

    def pose(part: Part) -> tuple[Problem, Sequence[Any]]:
        surface = read_surface(path, within=part.within, decimate=part.decimate)
        area = None if part.corridor is None else part.corridor.area_on(surface)
        side = runs.cells * CELL
        start = (300_000.0 + 0.04 * side, 5_200_000.0 - 0.04 * side)
        goal = (300_000.0 + 0.94 * side, 5_200_000.0 - 0.94 * side)
        return Problem(surface, start, goal, max_slope=STEEPEST, keep_in=area), ()

    coarsest = math.ceil(runs.cells / 500)
    planner.solve(pose(Part(decimate=coarsest))[0])
    forget_peak()
    before = peak_memory()
    cells = max(runs.cells**2, MOST_CELLS)
    solution, reading = timed(lambda: plan_in_corridor(pose, planner, cells))
    if solution.length is None or solution.lower_bound is None:
        raise TerrapathError(f"no path was found: {solution.stopped_by}")
    corridor = solution.corridor
    assert corridor is not None
    least = corridor.least_length(solution)
    assert least is not None  # because the map has no costs
    return LargeMapFound(
        Timing.of([Reading(*reading)]),
        solution.length,
        corridor.coarse_length,
        least,
        solution.lower_bound,
        before,
        peak_memory(),
    )


if __name__ == "__main__":
    answer(lambda path, **runs: measure_large_map(path, LargeMapRuns(**runs)))
