"""The best solution there is: candidates from fast marching, refined, with a certificate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..distance.field import DistanceField, Medium, march_from
from ..errors import tell_unfinished
from ..geodesics.alternatives import routes_of_fields, shortest
from ..problem import Path, Problem, Solution, Status
from ..validation import require_count, require_positive
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
from .finished import with_bound


@dataclass(frozen=True, kw_only=True)
class Optimal:
    """Fast marching for the candidates, refinement for the digits, a certificate for proof.

    target_gap : (length - lower bound) / lower bound to reach. routes : how many locally
    shortest routes to look for. The shortest is the path, the others are its alternatives.
    spacing : of the nodes on which routes are searched, map units; by default a 250th of the
    region's longer side, or a cell of the map where that is less. time_limit : seconds.

    ``stopped_by`` tells whether the gap was met. ``unrefined`` is the path down the distance
    field; it is also the path returned where the run ends before a route was refined.
    """

    target_gap: float = 1e-3
    routes: int = 3
    spacing: float | None = None
    time_limit: float | None = None

    def __post_init__(self) -> None:
        require_positive(target_gap=self.target_gap)
        require_count(routes=self.routes)
        optional = {"spacing": self.spacing, "time_limit": self.time_limit}
        require_positive(**{name: value for name, value in optional.items() if value is not None})

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "optimal"

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True.

        time_limit : seconds for this call; the lower of it and the option counts.
        Ctrl-C, too, ends the search, with the best path and the best bound so far.
        """
        if (known := answer_without_search(problem, self.name)) is not None:
            return known
        stopper = Stopper(callback, least_limit(self.time_limit, time_limit))
        return _Run(self, problem, stopper).solve()


class _Run:
    """One run, and what it has found so far."""

    def __init__(self, planner: Optimal, problem: Problem, stopper: Stopper) -> None:
        self.planner, self.problem = planner, problem
        self.stopper = stopper
        self.samples, self.total = 0, 0
        self.direct: Path | None = None
        self.routes: tuple[Path, ...] = ()

    def must_stop(self, settled: int = 0) -> bool:
        best = self.direct.length if self.direct is not None else math.inf
        progress = Progress(self.samples + settled, self.total, self.stopper.seconds, best)
        return self.stopper.must_stop(progress)

    def solve(self) -> Solution:
        try:
            self.find_routes()
        except KeyboardInterrupt:
            self.stopper.stopped_by = INTERRUPT
        solution = self.answer()
        if solution.path is None or self.stopper.stopped_by:
            return solution
        target = self.planner.target_gap
        solution = with_bound(
            solution,
            target_gap=target,
            time_limit=self.stopper.seconds_left,
            callback=self.stopper.must_stop,
        )
        if solution.status is Status.INTERRUPTED:
            return solution
        met = solution.gap is not None and solution.gap <= target
        self.stopper.is_late()
        reason = "gap met" if met else self.stopper.stopped_by or "finest lattice"
        return replace(solution, stopped_by=reason)

    def find_routes(self) -> None:
        """Find the locally shortest routes, on a finer lattice where a coarse one shows none."""
        problem = self.problem
        for lattice in lattices(problem, self.planner.spacing):
            self.total = self.samples + 2 * lattice.nx * lattice.ny
            medium = Medium.of_surface(problem.surface, lattice, problem.free_space)
            from_start = self.march(problem.start, medium)
            self.direct = from_start.path_to(problem.goal)
            self.routes = () if self.direct is None else (self.direct,)
            if self.must_stop():
                return
            if self.direct is not None:
                from_goal = self.march(problem.goal, medium)
                if not self.must_stop():
                    self.refine_routes(from_start, from_goal)
                return

    def march(self, end: tuple[float, float], medium: Medium) -> DistanceField:
        problem = self.problem
        field = march_from(problem.surface, problem.free_space, end, medium, watch=self.must_stop)
        self.samples += round(field.reached * field.values.size)
        return field

    def refine_routes(self, from_start: DistanceField, from_goal: DistanceField) -> None:
        """Refine the routes; each is kept as soon as it is done, whatever happens later."""
        problem, count = self.problem, self.planner.routes
        found: list[Path] = []
        failures: list[Exception] = []
        try:
            for route in routes_of_fields(
                problem,
                from_start,
                from_goal,
                count,
                failed=failures.append,
                must_stop=self.must_stop,
                is_late=self.stopper.is_late,
            ):
                if failures and not found:
                    # The first route could not be refined, but it is a path all the same.
                    found.extend(self.routes)
                found.append(route)
                self.routes = shortest(found, count)
        except Exception as error:
            failures.append(error)
        if failures:
            some = "not every route could be refined"
            none = "no route could be refined; the path is fast marching's"
            tell_unfinished(some if found else none, failures[0])

    def answer(self) -> Solution:
        """What was found, without a lower bound."""
        path = self.routes[0] if self.routes else None
        return Solution(
            problem=self.problem,
            planner=self.planner.name,
            status=status_of(path, self.stopper.stopped_by),
            path=path,
            cost=None if path is None else path.length,
            seconds=self.stopper.seconds,
            samples=self.samples,
            stopped_by=self.stopper.stopped_by or "no path between the nodes",
            unrefined=None if path is self.direct else self.direct,
            alternatives=self.routes[1:],
        )
