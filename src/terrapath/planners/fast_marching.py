"""Fast marching: the shortest path down the distance field."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from ..eikonal import Medium, march_from
from ..lattice import Lattice, default_spacing
from ..problem import Problem, Solution, Status
from ..validation import require_positive
from .base import Callback, Progress, answer_without_search

# Where no path is found the lattice may be too coarse for a gap: so often it is made finer.
HALVINGS = 2


@dataclass(frozen=True, kw_only=True)
class FastMarching:
    """The eikonal equation of h on a lattice, and the steepest way down its solution.

    spacing : of the nodes, map units; by default a 250th of the region's longer side, or a cell
    of a finer map. Where no path is found, half and a quarter of it are tried.

    ``cost`` is the distance that the field gives at the goal, ``samples`` the nodes settled.
    Source: Mirebeau 2014 (stencils); Sethian 1996 (fast marching).
    """

    spacing: float | None = None

    def __post_init__(self) -> None:
        if self.spacing is not None:
            require_positive(spacing=self.spacing)

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "fast-marching"

    def solve(self, problem: Problem, *, callback: Callback | None = None) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True."""
        if (known := answer_without_search(problem, self.name)) is not None:
            return known
        started = time.perf_counter()
        spacing = self.spacing or default_spacing(problem.bounds, problem.surface.resolution)
        settled, stopped = 0, False
        for _ in range(HALVINGS + 1):
            lattice = Lattice.spanning(problem.bounds, spacing)
            total = lattice.nx * lattice.ny

            def watch(count: int, total: int = total) -> bool:
                nonlocal settled, stopped
                settled = count
                seconds = time.perf_counter() - started
                report = Progress(count, total, seconds, math.inf)
                stopped = callback is not None and bool(callback(report))
                return stopped

            try:
                medium = Medium.of_surface(problem.surface, lattice, problem.free_space)
                field = march_from(
                    problem.surface, problem.free_space, problem.start, medium, watch=watch
                )
            except KeyboardInterrupt:
                return self._without_path(problem, started, settled, Status.INTERRUPTED)
            path = field.path_to(problem.goal)
            if path is not None:
                return Solution(
                    problem=problem,
                    planner=self.name,
                    status=Status.SOLVED,
                    path=path,
                    cost=float(field.at(problem.goal)),
                    seconds=time.perf_counter() - started,
                    samples=settled,
                    stopped_by=f"{lattice.nx:,} x {lattice.ny:,} nodes",
                )
            if stopped:
                break
            spacing *= 0.5
        return self._without_path(problem, started, settled, Status.NOT_FOUND)

    def _without_path(
        self, problem: Problem, started: float, settled: int, status: Status
    ) -> Solution:
        reason = "interrupt" if status is Status.INTERRUPTED else "no way between the nodes"
        return Solution(
            problem=problem,
            planner=self.name,
            status=status,
            path=None,
            cost=None,
            seconds=time.perf_counter() - started,
            samples=settled,
            stopped_by=reason,
        )
