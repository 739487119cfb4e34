"""The best solution there is: candidates from many searches, refined, with a certificate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

from ..distance.field import DistanceField, march_both
from ..distance.medium import Medium
from ..errors import tell_unfinished
from ..geodesics.alternatives import is_same, routes_of_fields, shortest
from ..geodesics.refinement import refine
from ..geodesics.visibility import is_flat, shortest_taut_path
from ..problem import Path, Problem, Solution, Status
from ..space.lattice import Lattice, Spacing
from ..surface.bounds import Bounds
from ..surface.metric import is_rough
from ..validation import require_count, require_positive
from .base import (
    INTERRUPT,
    REFINING,
    SEARCHING,
    TIME_LIMIT,
    Callback,
    Progress,
    Stopper,
    answer_without_search,
    before_proof,
    lattices,
    least_limit,
    status_of,
    straight_path,
)
from .finished import with_bound
from .grid_search import AStar
from .rrt_star import RRTStar

# A field whose value at the goal is this near to the length of the best route, as a share, is taken
# to show every route that could be shorter. Elsewhere other searches follow, and finer fields.
SURE = 1e-4

# A finer field is solved where the best route may be this share longer than what a field says, at
# least; and while that takes no more nodes than this.
SLACK, MOST_NODES = 0.02, 1_000_000

# A search that shortens the best route by no more than this share has found nothing.
GAIN = 1e-6

# On rough ground the best route is refined again, at most so many times.
MOST_POLISHES = 4

# The numbers of neighbours with which A* looks for routes.
NEIGHBOURS = (32, 16, 8)


@dataclass(frozen=True, kw_only=True)
class Optimal:
    """Many searches for candidates, refinement for the digits, a certificate for proof.

    target_gap : (length - lower bound) / lower bound to reach. routes : how many locally
    shortest routes to look for. The shortest is the path, the others are its alternatives.
    spacing : of the nodes on which routes are searched first, map units; by default a 250th of the
    region's longer side, or a cell of the map where that is less. time_limit : seconds.

    Candidates are the straight line, on flat ground the shortest path round the corners of
    obstacles, and the routes of the distance fields from both ends. Where the fields leave a
    doubt, on rough ground and among obstacles, fields on ever finer lattices follow, A* with 32, 16
    and 8 neighbours, and a tree; where costs are in cells, instead, the sides of cells. All but the
    straight line are refined. The route from a start to a goal is the same as back.

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
        if (known := answer_without_search(problem, self.name)) is not None:
            return known
        limit = least_limit(self.time_limit, time_limit)
        return _Run(self, problem, callback, limit).solve()


class _Run:
    """One run, and what it has found so far."""

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
        self.is_reversed = problem.goal < problem.start
        self.problem = problem
        if self.is_reversed:
            self.problem = problem.between_checked(problem.goal, problem.start)
        first = next(lattices(self.problem, planner.spacing))
        self.samples, self.total = 0, 2 * first.nx * first.ny
        self.direct: Path | None = None
        self.found: list[Path] = []
        self.searched: dict[AStar | RRTStar, Path | None] = {}
        self.tried: set[AStar | RRTStar] = set()
        self.failures: list[Exception] = []
        self.trying = SEARCHING
        self.is_exact = self.is_sure = self.is_through_cells = False
        self.fields: tuple[DistanceField, DistanceField]  # of both ends, on the last lattice

    @property
    def best(self) -> float:
        """The length of the best path so far, map units."""
        known = self.found if self.direct is None else [*self.found, self.direct]
        return min((path.length for path in known), default=math.inf)

    @property
    def rival(self) -> float:
        """The length that a further route must be below to be of use, map units."""
        if len(self.found) < self.planner.routes:
            return math.inf
        return min(path.length for path in self.found)

    def must_stop(self, settled: int = 0) -> bool:
        progress = Progress(
            self.samples + settled,
            max(self.total, self.samples + settled),
            self.stopper.seconds,
            self.best,
            stage=self.trying,
        )
        return self.stopper.must_stop(progress)

    def solve(self) -> Solution:
        try:
            for what, search in self.searches():
                self.trying = what
                search()
                if self.is_sure or self.must_stop():
                    break
            self.polish()
        except KeyboardInterrupt:
            self.stopper.stopped_by = INTERRUPT
        self.tell_failures()
        solution = self.answer()
        if solution.path is None or self.stopper.stopped_by not in ("", TIME_LIMIT):
            return solution
        self.stopper.time_limit = self.time_limit
        return self.proven(solution)  # without time, it is at least the chord

    def searches(self) -> Iterator[tuple[str, Callable[[], object]]]:
        """The searches in their order, with what the progress calls each."""
        yield "trying the straight line", self.try_straight_line
        if self.problem.surface.cost_cells is not None:
            yield "trying the sides of cells", self.try_sides
            yield "trying A*", partial(self.try_planner, AStar(neighbours=NEIGHBOURS[0]))
        if is_flat(self.problem):
            yield "trying the corners of obstacles", self.try_corners
        elif is_rough(self.problem.surface, self.problem.bounds):
            # The fields' own paths are long there before they are refined, which takes its time.
            yield "trying A*", partial(self.try_planner, AStar())
            yield "trying a tree", partial(self.search, RRTStar())
        yield "trying distance fields", self.try_fields
        yield "trying finer fields", self.try_finer_fields
        for neighbours in NEIGHBOURS:
            what = f"trying A* with {neighbours} neighbours"
            yield what, partial(self.try_planner, AStar(neighbours=neighbours))
        yield "trying a tree", partial(self.try_planner, RRTStar())

    # Searches

    def try_straight_line(self) -> None:
        self.direct = straight_path(self.problem)

    def try_corners(self) -> None:
        """The exact shortest path on flat ground."""
        if (path := shortest_taut_path(self.problem, watch=self.must_stop).path) is not None:
            self.is_exact = not self.problem.free_space.circles
            self.refine(path)

    def try_sides(self) -> None:
        """The shortest path through points on the sides of cost cells; fields show others."""
        from ..geodesics.cell_routes import shortest_through_cells

        if (path := shortest_through_cells(self.problem, self.must_stop)) is not None:
            self.is_through_cells = True
            self.keep_unrefined(path)
            self.refine(path)

    def try_fields(self) -> None:
        """The routes of distance fields, on a finer lattice where a coarse one shows none."""
        for lattice in lattices(self.problem, self.planner.spacing):
            if self.try_fields_on(lattice, self.planner.routes) or self.stopper.stopped_by:
                return

    def try_fields_on(self, lattice: Lattice, routes: int) -> bool:
        """The routes of the distance fields on a lattice; False where they show none."""
        problem = self.problem
        self.total = self.samples + 2 * lattice.nx * lattice.ny
        is_late = self.stopper.is_late
        medium = Medium(problem.surface, lattice, problem.free_space, is_late)
        self.fields = march_both(medium, problem.start, problem.goal, watch=self.must_stop)
        self.samples += sum(round(f.reached * f.values.size) for f in self.fields)
        if self.stopper.stopped_by and not math.isfinite(self.distance):
            return False
        path = self.fields[0].path_to(problem.goal)
        if path is None:
            return False
        self.keep_unrefined(path)
        if not self.must_stop():
            self.refine_routes(path, routes)
        is_close = abs(self.distance - self.best) <= SURE * self.best
        self.is_sure = self.is_exact or self.is_through_cells or is_close
        return True

    @property
    def distance(self) -> float:
        """What the fields say is the length, map units."""
        return float(self.fields[0].at(self.problem.goal))

    def try_planner(self, planner: AStar | RRTStar) -> None:
        """Refine the path of another planner, once."""
        path = self.search(planner)
        if path is not None and planner not in self.tried:
            self.tried.add(planner)
            self.refine(path)

    def search(self, planner: AStar | RRTStar) -> Path | None:
        """The path of another planner, which searches once."""
        if planner in self.searched:
            return self.searched[planner]
        solution = planner.solve(
            self.problem,
            callback=lambda progress: self.must_stop(progress.samples),
            time_limit=self.stopper.seconds_left,
        )
        self.samples += solution.samples
        path = self.searched[planner] = solution.path
        if path is not None:
            self.keep_unrefined(path)
        if solution.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return path

    def try_finer_fields(self) -> None:
        """Fields on ever finer lattices, where a shorter route could lead."""
        lattice = self.fields[0].lattice
        spacing, seconds_per_node = lattice.spacing, 0.0
        while math.isfinite(self.best) and not self.must_stop():
            spacing = Spacing(0.5 * spacing.x, 0.5 * spacing.y)
            lattice, before = Lattice.spanning(self.window(), spacing), self.best
            nodes, left = lattice.nx * lattice.ny, self.stopper.seconds_left
            is_late = left is not None and nodes * seconds_per_node > left
            started = self.stopper.seconds
            if nodes > MOST_NODES or is_late or not self.try_fields_on(lattice, 1):
                return
            if self.is_sure and self.best >= before * (1.0 - GAIN):
                return
            seconds_per_node = (self.stopper.seconds - started) / nodes

    def window(self) -> Bounds:
        """The part of the bounds where a route could be shorter than the best, by the fields."""
        one, other = self.fields
        longest = self.best * (1.0 + max(SLACK, 2.0 * abs(self.distance / self.best - 1.0)))
        near = one.values + other.values <= longest
        return one.lattice.around(near) if near.any() else self.problem.bounds

    # Routes

    def refine(self, path: Path) -> None:
        """Refine a candidate and keep it; where that fails, keep it as it is."""
        rival = self.rival
        try:
            path = refine(self.problem, path, must_stop=self.stopper.is_late, rival=rival)
        except Exception as error:
            self.failures.append(error)
        if path.length <= rival:
            self.keep(path)

    def polish(self) -> None:
        """Refine the best route again while it gains: on rough ground once is not all."""
        rounds = MOST_POLISHES if is_rough(self.problem.surface, self.problem.bounds) else 0
        for _ in range(rounds if self.found else 0):
            before = self.best
            if self.stopper.stopped_by or self.stopper.is_late():
                return
            self.trying = REFINING
            self.refine(min(self.found, key=lambda route: route.length))
            if self.best >= before * (1.0 - GAIN):
                return

    def refine_routes(self, direct: Path, count: int) -> None:
        """Refine the routes of the fields; each is kept as soon as it is done."""
        try:
            for route in routes_of_fields(
                self.problem,
                self.fields,
                direct,
                count,
                only_shorter=True,
                failed=self.failures.append,
                must_stop=self.must_stop,
                is_late=self.stopper.is_late,
            ):
                self.keep(route)
        except Exception as error:
            self.failures.append(error)

    def keep_unrefined(self, path: Path) -> None:
        """Keep a path, for what is returned if nothing better comes, where it is the shortest."""
        if path.length < self.best and self.problem.allows(path):
            self.direct = path

    def keep(self, route: Path) -> None:
        """Keep a route unless it touches an obstacle, or is one of those that are known."""
        if not self.problem.allows(route):
            return
        for k, other in enumerate(self.found):
            if is_same(self.problem, route, other):
                if route.length < other.length:
                    self.found[k] = route
                return
        self.found.append(route)

    # The answer

    def tell_failures(self) -> None:
        if self.failures:
            some = "not every route could be refined"
            none = "no route could be refined; the path is a planner's own"
            tell_unfinished(some if self.found else none, self.failures[0])

    def directed(self, path: Path) -> Path:
        """A path, from the start that was given."""
        return self.given.path(path.points[::-1].copy()) if self.is_reversed else path

    def answer(self) -> Solution:
        """What was found, without a lower bound."""
        known, direct = self.found, self.direct
        if direct is not None and all(route.length > direct.length for route in known):
            known, direct = [direct, *known], None  # it could not be refined, or not yet
        routes = [self.directed(route) for route in shortest(known, self.planner.routes)]
        path = routes[0] if routes else None
        return Solution(
            problem=self.given,
            planner=self.planner.name,
            status=status_of(path, self.stopper.stopped_by),
            path=path,
            cost=None if path is None else path.length,
            seconds=self.stopper.seconds,
            samples=self.samples,
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
            target_gap=None if self.is_exact else target,
            time_limit=self.stopper.seconds_left,
            callback=self.stopper.must_stop,
        )
        if solution.status is Status.INTERRUPTED:
            return solution
        self.stopper.is_late()
        return replace(solution, stopped_by=self.reason(solution))

    def reason(self, solution: Solution) -> str:
        """What ended the run."""
        if solution.gap is not None and solution.gap <= self.planner.target_gap:
            return "gap met"
        if self.stopper.stopped_by:
            return self.stopper.stopped_by
        return "exact on flat ground" if self.is_exact else "finest lattice"
