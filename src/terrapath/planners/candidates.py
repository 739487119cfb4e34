"""Candidates for the shortest route: what many searches find, refined, and the best of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from ..distance.field import DistanceField, march_both
from ..distance.medium import Medium
from ..geodesics.alternatives import is_same, routes_of_fields
from ..geodesics.refinement import refine
from ..geodesics.visibility import is_flat, shortest_taut_path
from ..problem import Path, Problem, Status
from ..space.lattice import Lattice, Spacing
from ..surface.bounds import Bounds
from ..surface.metric import is_rough
from .base import REFINING, SEARCHING, Progress, Stopper, lattices, straight_path
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


class Candidates:
    """The searches of one run, and the routes that they have found so far.

    problem : in the direction in which it is solved. count : how many locally shortest routes are
    asked for. spacing : of the nodes of the first fields, map units.

    found : the routes that are refined. direct : the shortest path that is not, where that was
    better when it came. is_exact : is the shortest route known, on flat ground? is_sure : does
    what was searched show every route that could be shorter? trying : which search, in words.
    """

    def __init__(
        self, problem: Problem, stopper: Stopper, count: int, spacing: float | None
    ) -> None:
        self.problem, self.stopper = problem, stopper
        self.count, self.spacing = count, spacing
        self.is_rough = is_rough(problem.relief, problem.bounds)
        first = next(lattices(problem, spacing))
        self.samples, self.total = 0, 2 * first.nx * first.ny
        self.direct: Path | None = None
        self.found: list[Path] = []
        self.searched: dict[AStar | RRTStar, Path | None] = {}
        self.tried: set[AStar | RRTStar] = set()
        self.failures: list[Exception] = []
        self.trying = SEARCHING
        self.is_exact = self.is_sure = self.is_through_cells = False
        self.polished = math.inf  # the best length after it was refined again
        self.first_fields: tuple[DistanceField, DistanceField] | None = None
        self.fields: tuple[DistanceField, DistanceField]  # of both ends, on the last lattice

    @property
    def best(self) -> float:
        """The length of the best path so far, map units; under a pace what it costs, gauged."""
        known = self.found if self.direct is None else [*self.found, self.direct]
        return min((path.gauged for path in known), default=math.inf)

    @property
    def rival(self) -> float:
        """The length that a further route must be below to be of use, map units.

        On rough ground refinement takes most of the time, so other routes come last.
        """
        if not self.found or (len(self.found) < self.count and not self.is_rough):
            return math.inf
        return self.shortest.gauged

    @property
    def shortest(self) -> Path:
        """The shortest of the routes that are refined."""
        return min(self.found, key=lambda route: route.gauged)

    def must_stop(self, settled: int = 0) -> bool:
        """Show the progress; must the run stop? settled : nodes of the search in hand."""
        progress = Progress(
            self.samples + settled,
            max(self.total, self.samples + settled),
            self.stopper.seconds,
            self.best + self.problem.taken_off,
            stage=self.trying,
        )
        return self.stopper.must_stop(progress)

    def search(self) -> None:
        """Search until it is sure or must stop; then what is left to do with the best route."""
        for what, search in self.searches():
            self.trying = what
            search()
            if self.is_sure or self.must_stop():
                break
        if self.stopper.stopped_by:
            return
        self.trying = REFINING
        if self.is_rough or self.is_through_cells:
            self.polish()
        if self.is_rough:
            self.try_other_routes()

    def searches(self) -> Iterator[tuple[str, Callable[[], object]]]:
        """The searches in their order, with what the progress calls each.

        What is quick comes first, then what gains most for its time.
        """
        yield "trying the straight line", self.try_straight_line
        if self.problem.travel is not None:
            yield from self.searches_under_a_pace()
            return
        if self.problem.surface.cost_cells is not None:
            yield "trying the sides of cells", self.try_sides
            yield "trying A*", partial(self.try_planner, AStar(neighbours=NEIGHBOURS[0]))
            yield "trying a tree", partial(self.try_planner, RRTStar())
        if is_flat(self.problem):
            yield "trying the corners of obstacles", self.try_corners
        elif self.is_rough:
            # The fields' own paths are long there before they are refined, which takes its time.
            yield "trying A*", partial(self.path_of, AStar(neighbours=NEIGHBOURS[0]))
        yield "trying distance fields", self.try_fields
        yield "trying finer fields", self.try_finer_fields
        if self.is_rough:
            yield REFINING, self.polish
        for neighbours in NEIGHBOURS:
            what = f"trying A* with {neighbours} neighbours"
            yield what, partial(self.try_planner, AStar(neighbours=neighbours))
        yield "trying a tree", partial(self.try_planner, RRTStar())

    def searches_under_a_pace(self) -> Iterator[tuple[str, Callable[[], object]]]:
        """Those that know the direction, on lattices of two spacings."""
        for spacing in (
            self.spacing,
            0.5 * min(next(lattices(self.problem, self.spacing)).spacing),
        ):
            for neighbours in NEIGHBOURS:
                planner = AStar(neighbours=neighbours, spacing=spacing)
                what = f"trying A* with {neighbours} neighbours"
                yield what, partial(self.try_planner, planner)
        yield "trying a tree", partial(self.try_planner, RRTStar())
        yield REFINING, self.polish

    # Searches

    def try_straight_line(self) -> None:
        """The straight line is not refined."""
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
        count = 1 if self.is_rough else self.count
        for lattice in lattices(self.problem, self.spacing):
            if self.try_fields_on(lattice, count) or self.stopper.stopped_by:
                break
        self.first_fields = self.fields

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
        if planner not in self.tried and (path := self.path_of(planner)) is not None:
            self.tried.add(planner)
            self.refine(path)

    def path_of(self, planner: AStar | RRTStar) -> Path | None:
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
        if not near.any():
            return self.problem.bounds
        # On the roughest ground the nodes around an end need not be near.
        box, ends = one.lattice.around(near), (self.problem.start, self.problem.goal)
        (x0, x1), (y0, y1) = (sorted(places) for places in zip(*ends, strict=True))
        return Bounds(
            min(box.x1_min, x0), min(box.x2_min, y0), max(box.x1_max, x1), max(box.x2_max, y1)
        )

    # Routes

    def refine(self, path: Path) -> None:
        """Refine a candidate and keep it; where that fails, keep it as it is."""
        rival = self.rival
        try:
            path = refine(self.problem, path, must_stop=self.stopper.is_late, rival=rival)
        except Exception as error:
            self.failures.append(error)
        if path.gauged <= rival:
            self.keep(path)

    def polish(self) -> None:
        """Refine the best route again while it gains: on rough ground once is not all."""
        for _ in range(MOST_POLISHES if self.found else 0):
            before = self.best
            if before >= self.polished * (1.0 - GAIN) or self.must_stop():
                break
            self.refine(self.shortest)
            if self.best >= before * (1.0 - GAIN):
                break
        self.polished = self.best

    def try_other_routes(self) -> None:
        """Look for the other routes that are asked for, through the nodes of the first fields."""
        self.trying = "looking for other routes"
        if self.first_fields is not None and 0 < len(self.found) < self.count:
            self.fields = self.first_fields
            self.refine_routes(self.shortest, self.count, only_shorter=False)

    def refine_routes(self, direct: Path, count: int, only_shorter: bool = True) -> None:
        """Refine the routes of the fields; each is kept as soon as it is done."""
        rival = self.rival if self.is_rough and only_shorter else math.inf
        try:
            for route in routes_of_fields(
                self.problem,
                self.fields,
                direct,
                count,
                only_shorter=only_shorter,
                rival=rival,
                failed=self.failures.append,
                must_stop=self.must_stop,
                is_late=self.stopper.is_late,
            ):
                self.keep(route)
        except Exception as error:
            self.failures.append(error)

    def keep_unrefined(self, path: Path) -> None:
        """Keep a path, for what is returned if nothing better comes, where it is the shortest."""
        if path.gauged < self.best and self.problem.allows(path):
            self.direct = path

    def keep(self, route: Path) -> None:
        """Keep a route unless it touches an obstacle, or is one of those that are known."""
        if not self.problem.allows(route):
            return
        for k, other in enumerate(self.found):
            if is_same(self.problem, route, other):
                if route.gauged < other.gauged:
                    self.found[k] = route
                return
        self.found.append(route)
