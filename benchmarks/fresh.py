"""Fast marching, measured in a fresh process: ``python -m ... TASK``."""

from __future__ import annotations

from typing import Any

import numpy as np

from terrapath._support.memory import forget_peak, peak_memory
from terrapath.distance.field import DistanceField, march_from
from terrapath.distance.medium import Medium
from terrapath.problem import Problem, scenes
from terrapath.space.lattice import Lattice

from .marching import Marched, MarchRuns
from .peers import SCIKIT_FMM
from .processes import answer
from .timing import Reading, Timing, timed

# Nodes on a side of the lattice on which everything runs once before it is measured.
SMALL = 61


class Bench:
    """One scene on one lattice."""

    def __init__(self, problem: Problem, nodes: int) -> None:
        self.problem = problem
        self.lattice = Lattice(problem.bounds, nodes, nodes)

    def medium(self) -> Medium:
        """The ground on the lattice, and all edges."""
        return Medium(self.problem.surface, self.lattice, self.problem.free_space)

    def march(self, medium: Medium) -> DistanceField:
        """The distance field from the start."""
        return march_from(medium, self.problem.start)

    def distance(self) -> float:
        """The distance from start to goal, map units."""
        return float(self.march(self.medium()).at(self.problem.goal))

    def laps(self) -> list[Reading]:
        """The times for the edges and for the march."""
        medium, edges = timed(self.medium)
        return [edges, timed(lambda: self.march(medium))[1]]

    def peer_lap(self, skfmm: Any) -> Reading:
        """The peer's time on the same lattice, on flat ground, all speeds 1, second order."""
        lattice, start = self.lattice, self.problem.start
        phi = np.ones((lattice.ny, lattice.nx))
        speed = np.ones_like(phi)
        column = round((start[0] - lattice.bounds.x1_min) / lattice.dx)
        row = round((start[1] - lattice.bounds.x2_min) / lattice.dy)
        phi[row, column] = -1.0
        return timed(lambda: skfmm.travel_time(phi, speed, dx=lattice.dx, order=2))[1]


def measure_marching(scene: str, runs: MarchRuns) -> Marched:
    """Measure memory first, then seconds; Terrapath and the peer take turns."""
    problem = scenes.load(scene)
    Bench(problem, SMALL).distance()
    forget_peak()
    before = peak_memory()
    bench = Bench(problem, runs.nodes)
    distance = bench.distance()
    peak = peak_memory()
    skfmm = None if runs.peer is None else SCIKIT_FMM.load()
    laps, peer_laps = [], []
    for _ in range(runs.repeats):
        laps.append(bench.laps())
        if skfmm is not None:
            peer_laps.append(bench.peer_lap(skfmm))
    edges, march = (Timing.of(readings) for readings in zip(*laps, strict=True))
    peer = Timing.of(peer_laps) if peer_laps else None
    return Marched(edges, march, peer, distance, before, peak)


if __name__ == "__main__":
    answer(lambda scene, **runs: measure_marching(scene, MarchRuns(**runs)))
