"""Fast marching: the shortest path, by descent of the distance field."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..distance.field import DistanceField, march_from
from ..distance.medium import Medium
from ..errors import GroundWarning, tell
from ..problem import Path, Problem, Solution
from ..space.lattice import Lattice
from ..validation import require_positive
from .base import (
    INTERRUPT,
    Callback,
    Progress,
    Stopper,
    answer_without_search,
    lattices,
    least_limit,
    status_of,
)

# Where a path is longer than its field says by more than this share, the field cannot be trusted.
# It is 0.1 % at most on smooth ground and real maps, a third on a volcano exaggerated ten times.
DOUBTFUL = 0.1


@dataclass(frozen=True, kw_only=True)
class FastMarching:
    """The eikonal equation of h on a lattice, and steepest descent on its solution.

    spacing : of the lattice's nodes, map units; by default a 250th of the region's longer side,
    or a cell of the map where that is less. Where no path is found, half and a quarter of it are
    tried. time_limit : seconds, checked while the field is solved.

    ``cost`` is the value of the field at the goal, ``samples`` the number of nodes settled. Where
    the path is longer than that by a tenth or more, the ground is too rough for the lattice: a
    GroundWarning says so.
    Source: Mirebeau 2014 (stencils); Sethian 1996 (fast marching).
    """

    spacing: float | None = None
    time_limit: float | None = None

    def __post_init__(self) -> None:
        optional = {"spacing": self.spacing, "time_limit": self.time_limit}
        require_positive(**{name: value for name, value in optional.items() if value is not None})

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "fast-marching"

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True.

        time_limit : seconds for this call; the lower of it and the option counts.
        """
        if (known := answer_without_search(problem, self.name)) is not None:
            return known
        stopper = Stopper(callback, least_limit(self.time_limit, time_limit))
        return _Run(self, problem, stopper).solve()


class _Run:
    """One run, and how far it has come."""

    def __init__(self, planner: FastMarching, problem: Problem, stopper: Stopper) -> None:
        self.planner, self.problem = planner, problem
        self.stopper = stopper
        self.settled, self.total = 0, 0

    def solve(self) -> Solution:
        problem = self.problem
        try:
            for lattice in lattices(problem, self.planner.spacing):
                field = self.march(lattice)
                path = field.path_to(problem.goal)
                if path is not None:
                    value = float(field.at(problem.goal))
                    _tell_doubt(path, value)
                    return self.answer(path, value, f"{lattice.nx:,} x {lattice.ny:,} nodes")
                if self.stopper.stopped_by:
                    break
        except KeyboardInterrupt:
            self.stopper.stopped_by = INTERRUPT
        return self.answer(None, None, self.stopper.stopped_by or "no path between the nodes")

    def march(self, lattice: Lattice) -> DistanceField:
        """The distance field, solved as far as the time limit allows."""
        problem = self.problem
        self.total = lattice.nx * lattice.ny
        is_late = self.stopper.is_late
        medium = Medium(problem.surface, lattice, problem.free_space, is_late)
        return march_from(medium, problem.start, watch=self.must_stop)

    def must_stop(self, settled: int) -> bool:
        self.settled = settled
        progress = Progress(settled, self.total, self.stopper.seconds, math.inf)
        return self.stopper.must_stop(progress)

    def answer(self, path: Path | None, cost: float | None, stopped_by: str) -> Solution:
        return Solution(
            problem=self.problem,
            planner=self.planner.name,
            status=status_of(path, stopped_by),
            path=path,
            cost=cost,
            seconds=self.stopper.seconds,
            samples=self.settled,
            stopped_by=stopped_by,
        )


def _tell_doubt(path: Path, value: float) -> None:
    """Warn where a path, before it is refined, is far longer than its field says."""
    if value > 0.0 and path.length > (1.0 + DOUBTFUL) * value:
        tell(
            GroundWarning(
                f"the path of fast-marching is {path.length / value - 1.0:.0%} longer than its "
                "field says: the ground is too rough for its nodes, and there may be far shorter "
                "routes; optimal looks farther"
            )
        )
