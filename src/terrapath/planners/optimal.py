"""The best solution there is: candidates from many searches, refined, with a certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..errors import tell_unfinished
from ..geodesics.alternatives import shortest
from ..problem import Path, Problem, Solution, Status
from ..validation import require_count, require_positive
from .base import (
    INTERRUPT,
    TIME_LIMIT,
    Callback,
    Progress,
    Stopper,
    answer_without_search,
    before_proof,
    least_limit,
    status_of,
)
from .candidates import Candidates
from .finished import with_bound


@dataclass(frozen=True, kw_only=True)
class Optimal:
    """Many searches for candidates, refinement for the digits, a certificate for proof.

    target_gap : (length - lower bound) / lower bound to reach. routes : how many locally
    shortest routes to look for. The shortest is the path, the others are its alternatives.
    spacing : of the nodes on which routes are searched first, map units; by default a 250th of the
    region's longer side, or a cell of the map where that is less. time_limit : seconds; a fifth of
    it is kept for the proof.

    Candidates are the straight line, on flat ground the shortest path round the corners of
    obstacles, and the routes of the distance fields from both ends. Where the fields leave a
    doubt, on rough ground and among obstacles, fields on ever finer lattices follow, A* with 32, 16
    and 8 neighbours, and a tree; where costs are in cells, instead, the sides of cells. All but the
    straight line are refined. The route from a start to a goal is the same as back. With a travel
    model the candidates are those of A*, on two lattices with 32, 16 and 8 neighbours, and of a
    tree, and the lower bound is the chord.

    ``stopped_by`` tells whether the gap was met. ``unrefined`` is the shortest path before
    refinement; it is also the path returned where the run ends before a route was refined.
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
        if (known := answer_without_search(problem, self.name, takes_travel=True)) is not None:
            return known
        limit = least_limit(self.time_limit, time_limit)
        return _Run(self, problem, callback, limit).solve()


class _Run:
    """One run: candidates in one direction, and an answer in the one that was asked for."""

    def __init__(
        self,
        planner: Optimal,
        problem: Problem,
        callback: Callback | None,
        time_limit: float | None,
    ) -> None:
        self.planner, self.given = planner, problem
        self.stopper, self.time_limit = Stopper(callback, before_proof(time_limit)), time_limit
        # One direction is solved, so that the other has the same answer.
        self.is_reversed = problem.goal < problem.start and problem.travel is None
        if self.is_reversed:
            problem = problem.between_checked(problem.goal, problem.start)
        self.candidates = Candidates(problem, self.stopper, planner.routes, planner.spacing)

    def solve(self) -> Solution:
        try:
            self.candidates.search()
        except KeyboardInterrupt:
            self.stopper.stopped_by = INTERRUPT
        self.tell_failures()
        solution = self.answer()
        if solution.path is None or self.stopper.stopped_by not in ("", TIME_LIMIT):
            return solution
        self.stopper.time_limit = self.time_limit
        return self.proven(solution)  # without time, it is at least the chord

    def tell_failures(self) -> None:
        """Say that routes could not be refined."""
        if failures := self.candidates.failures:
            some = "not every route could be refined"
            none = "no route could be refined; the path is a planner's own"
            tell_unfinished(some if self.candidates.found else none, failures[0])

    def directed(self, path: Path) -> Path:
        """A path, from the start that was given."""
        return self.given.path(path.points[::-1].copy()) if self.is_reversed else path

    def answer(self) -> Solution:
        """What was found, without a lower bound."""
        known, direct = self.candidates.found, self.candidates.direct
        if direct is not None and all(route.gauged > direct.gauged for route in known):
            known, direct = [direct, *known], None  # it could not be refined, or not yet
        routes = [self.directed(route) for route in shortest(known, self.planner.routes)]
        path = routes[0] if routes else None
        return Solution(
            problem=self.given,
            planner=self.planner.name,
            status=status_of(path, self.stopper.stopped_by),
            path=path,
            cost=None if path is None else path.value,
            seconds=self.stopper.seconds,
            samples=self.candidates.samples,
            stopped_by=self.stopper.stopped_by or "no path between the nodes",
            unrefined=None if direct is None else self.directed(direct),
            alternatives=tuple(routes[1:]),
        )

    def proven(self, solution: Solution) -> Solution:
        """The solution with the best lower bound that the time allows.

        Among obstacles on flat ground the path is exact, and bounds say little: one is enough.
        """
        target = self.planner.target_gap
        solution = with_bound(
            solution,
            target_gap=None if self.candidates.is_exact else target,
            time_limit=self.stopper.seconds_left,
            callback=self.watch_proof,
        )
        if solution.status is Status.INTERRUPTED:
            return solution
        self.stopper.is_late()
        return replace(solution, stopped_by=self.reason(solution))

    def watch_proof(self, progress: Progress) -> bool:
        """Show the progress of the proof; whether the callback stops it."""
        callback = self.stopper.callback
        is_over = callback is not None and bool(callback(progress))
        if is_over:
            self.stopper.stopped_by = "callback"
        return is_over

    def reason(self, solution: Solution) -> str:
        """What ended the run."""
        if solution.gap is not None and solution.gap <= self.planner.target_gap:
            return "gap met"
        if self.stopper.stopped_by:
            return self.stopper.stopped_by
        if self.given.travel is not None:
            return "all searches are done"
        return "exact on flat ground" if self.candidates.is_exact else "finest lattice"
