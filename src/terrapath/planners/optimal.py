"""The best answer there is: candidates from fast marching, refined, with a certificate."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

from ..distinct_routes import routes_of_fields
from ..bounding import lower_bound
from ..certificate import Certificate
from ..eikonal import Medium, march_from
from ..lattice import Lattice, default_spacing
from ..problem import Path, Problem, Solution, Status
from ..validation import require_count, require_positive
from .base import Callback, Progress, answer_without_search
from .finishing import with_certificate

# Where no path is found the lattice may be too coarse for a gap: so often it is made finer.
HALVINGS = 2


@dataclass(frozen=True, kw_only=True)
class Optimal:
    """Fast marching for the candidates, refinement for the digits, a certificate for proof.

    target_gap : (length - lower bound) / lower bound to reach. routes : locally shortest
    routes to look for; the shortest is the answer, the others are its alternatives.
    spacing : of the nodes on which routes are searched, map units; by default a 250th of the
    region's longer side. time_limit : seconds, looked at between the stages.

    ``stopped_by`` says which gap was reached.
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

    def solve(self, problem: Problem, *, callback: Callback | None = None) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True."""
        if (known := answer_without_search(problem, self.name)) is not None:
            return known
        return _Run(self, problem, callback).solve()


class _Run:
    """One run: the clock, and what was found so far."""

    def __init__(self, planner: Optimal, problem: Problem, callback: Callback | None) -> None:
        self.planner, self.problem, self.callback = planner, problem, callback
        self.started = time.perf_counter()
        self.samples, self.stopped = 0, False
        self.best = math.inf
        self.certificate: Certificate | None = None

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.started

    def report(self, settled: int = 0) -> bool:
        """Tell the callback how it stands; True where the run is to stop."""
        progress = Progress(self.samples + settled, 0, self.seconds, self.best)
        if self.callback is not None and self.callback(progress):
            self.stopped = True
        limit = self.planner.time_limit
        return self.stopped or (limit is not None and self.seconds > limit)

    def solve(self) -> Solution:
        routes: tuple[Path, ...] = ()
        interrupted = False
        try:
            routes = self.find_routes()
            if routes:
                self.best = routes[0].length
                self.prove()
        except KeyboardInterrupt:
            interrupted = True
        return self.answer(routes, interrupted)

    def find_routes(self) -> tuple[Path, ...]:
        """The locally shortest routes, on a finer lattice where a coarse one shows none."""
        problem = self.problem
        spacing = self.planner.spacing or default_spacing(problem.bounds)
        for _ in range(HALVINGS + 1):
            lattice = Lattice.spanning(problem.bounds, spacing)
            medium = Medium.of_surface(problem.surface, lattice, problem.free_space)
            fields = []
            for end in (problem.start, problem.goal):
                field = march_from(
                    problem.surface, problem.free_space, end, medium, watch=self.report
                )
                self.samples += int(field.reached * lattice.nx * lattice.ny)
                fields.append(field)
            routes = routes_of_fields(problem, fields[0], fields[1], self.planner.routes)
            if routes or self.report():
                return routes
            spacing *= 0.5
        return ()

    def prove(self) -> None:
        """Refine the bound until the gap is met."""

        def watch(certificate: Certificate) -> bool:
            self.certificate = certificate
            return self.report()

        limit = self.planner.time_limit
        self.certificate = lower_bound(
            self.problem,
            length=self.best,
            target_gap=self.planner.target_gap,
            time_limit=None if limit is None else max(limit - self.seconds, 1e-9),
            watch=watch,
        )

    def answer(self, routes: tuple[Path, ...], interrupted: bool) -> Solution:
        status = Status.SOLVED if routes else Status.NOT_FOUND
        solution = Solution(
            problem=self.problem,
            planner=self.planner.name,
            status=Status.INTERRUPTED if interrupted else status,
            path=routes[0] if routes else None,
            cost=routes[0].length if routes else None,
            seconds=self.seconds,
            samples=self.samples,
            stopped_by="no way between the nodes",
            alternatives=routes[1:],
        )
        if not routes:
            return solution
        if self.certificate is None:
            return replace(solution, stopped_by="interrupted")
        solution = with_certificate(solution, self.certificate)
        assert solution.gap is not None
        target = self.planner.target_gap
        met = "gap met" if solution.gap <= target else f"gap of {target:.3%} not met"
        return replace(solution, stopped_by=f"{met}: {solution.gap:.4%}")
