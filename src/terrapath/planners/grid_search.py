"""Dijkstra's algorithm and A*: shortest paths through the nodes of a lattice."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from .._kernels.planners import grid_search as kernels, tree as trees
from ..errors import InputError
from ..problem import Path, Problem, Solution
from ..space.lattice import Lattice
from ..surface import Surface
from ..validation import Array, require_count, require_positive
from .base import (
    INTERRUPT,
    TIME_LIMIT,
    Callback,
    Progress,
    answer_without_search,
    lattices,
    least_limit,
    status_of,
)
from .rrt_star import FEATURES_PER_PANEL

# Vertices settled between two looks at the clock, the callback and Ctrl-C.
CHUNK = 4096

# For each number of neighbours: how many columns or rows away the farthest one is.
REACH = {8: 1, 16: 2, 32: 3}

# Vertices are on a straight line where it turns by no more than this, radians. That allows for
# rounding in the coordinates of a map.
STRAIGHT = 1e-7

# Why a search ends without a path; a finer lattice may show one.
NO_WAY_ON = "no path on from the nodes reached"
WITHOUT_PATH = (NO_WAY_ON, *(f"no node can be seen from the {end}" for end in ("start", "goal")))

Integers = npt.NDArray[np.int64]

# A box of nodes, first and last column and row, that holds none.
NO_NODES = np.array([0, -1, 0, -1])


@dataclass(frozen=True, kw_only=True)
class Dijkstra:
    """The shortest path through the nodes of a grid, by Dijkstra's algorithm (1959).

    spacing : of the nodes, map units; by default at most a 250th of the region's longer side, or a
    cell of the map or of a mask where that is less, with nodes at the centres of cells. Where no
    path is found, half and a quarter of it are tried.
    neighbours : of a node: 8; 16, with the knight's moves; or 32, with those to (1, 3) and
        (2, 3) too. However fine the grid, paths on level ground are up to 8.2 %, 2.7 % and
        1.3 % longer than the straight line, because they can take so few directions.
    time_limit : seconds.

    Edges are measured as in RRT*-R: by Line-R in panels, and never below the chord.
    """

    spacing: float | None = None
    neighbours: int = 16
    time_limit: float | None = None

    def __post_init__(self) -> None:
        require_count(neighbours=self.neighbours)
        if self.neighbours not in REACH:
            raise InputError(f"neighbours={self.neighbours} must be 8, 16 or 32")
        optional = {"spacing": self.spacing, "time_limit": self.time_limit}
        require_positive(**{name: value for name, value in optional.items() if value is not None})

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "dijkstra"

    @property
    def informed(self) -> bool:
        """Is the search directed at the goal?"""
        return False

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True.

        time_limit : seconds for this call; the lower of it and the option counts.
        Ctrl-C, too, ends the search, with the best path so far. ``samples`` are the vertices
        settled. Raises InputError where the spacing makes more nodes than can be numbered.
        """
        limit = least_limit(self.time_limit, time_limit)
        return _search_grid(problem, self, callback, limit)


@dataclass(frozen=True, kw_only=True)
class AStar(Dijkstra):
    """Dijkstra's algorithm, directed at the goal: A* (Hart, Nilsson and Raphael 1968).

    Its heuristic is the chord to the goal; with a travel model that is the straight line of
    constant grade. No edge is shorter than its chord, so the heuristic is consistent: the cost is
    the same as Dijkstra's, and fewer vertices are settled.
    """

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "a-star"

    @property
    def informed(self) -> bool:
        """Is the search directed at the goal?"""
        return True


def _offsets(neighbours: int) -> Integers:
    """(neighbours, 2): columns and rows to each neighbour; none lies behind another one."""
    steps = range(-REACH[neighbours], REACH[neighbours] + 1)
    return np.array([(i, j) for j in steps for i in steps if math.gcd(i, j) == 1], np.int64)


def _nodes_around(lattice: Lattice, point: tuple[float, float], reach: int) -> Integers:
    """First and last column, first and last row of the nodes at most ``reach`` cells away."""
    s = (point[0] - lattice.bounds.x1_min) / lattice.dx
    t = (point[1] - lattice.bounds.x2_min) / lattice.dy
    columns = (math.ceil(s - reach), math.floor(s + reach))
    rows = (math.ceil(t - reach), math.floor(t + reach))
    last = [lattice.nx - 1, lattice.nx - 1, lattice.ny - 1, lattice.ny - 1]
    return np.clip(np.array([*columns, *rows], np.int64), 0, last)


@dataclass
class _Search:
    """A running search: the graph, the clock and the options."""

    problem: Problem
    planner: Dijkstra
    lattice: Lattice
    nodes: kernels.Nodes
    graph: kernels.Graph
    options: kernels.Options
    time_limit: float | None  # seconds
    started: float = field(default_factory=time.perf_counter)

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.started

    @property
    def goal(self) -> int:
        return len(self.graph.vertices) - 1

    @property
    def best_cost(self) -> float:
        return float(self.graph.places[self.goal, trees.COST]) + self.problem.taken_off

    @property
    def settled(self) -> int:
        return int(self.graph.counters[kernels.SETTLED])

    @property
    def progress(self) -> Progress:
        return Progress(self.settled, len(self.graph.vertices), self.seconds, self.best_cost)

    @property
    def is_late(self) -> bool:
        return self.time_limit is not None and self.seconds >= self.time_limit

    def relax_start(self) -> None:
        """Relax the edges of the start, row by row: there are many where it sees no near node."""
        _, _, first, last = self.nodes.joins[0]
        for row in range(first, last + 2):
            if self.is_late:
                return
            self.relax_row(row)

    def relax_row(self, row: int) -> None:
        """Relax the edges from the start to one row of its nodes; after the last, to the goal."""
        surface, space = self.problem.priced.data, self.problem.free_space.data
        kernels.relax_around_start(surface, space, self.nodes, self.graph, self.options, row)

    def advance(self, most: int) -> None:
        """Settle at most this many vertices."""
        surface, space = self.problem.priced.data, self.problem.free_space.data
        kernels.search(surface, space, self.nodes, self.graph, self.options, most)

    def sees_a_node(self, point: tuple[float, float], box: Integers) -> bool:
        """Does a free segment lead from the point to a node of the box? No, where it is late.

        box : first and last column, first and last row.
        """
        space, (west, east, south, north) = self.problem.free_space.data, box
        rows = (np.array([west, east, row, row]) for row in range(south, north + 1))
        return any(
            not self.is_late and kernels.any_node_is_near(space, self.nodes, row, *point)
            for row in rows
        )

    def join(self, end: int, point: tuple[float, float]) -> bool:
        """Join the start (0) or goal (1) to the nodes nearby, or else to those farther away.

        False where no free segment leads to any node, or where it is late.
        """
        reach = REACH[self.planner.neighbours]
        while True:
            box = _nodes_around(self.lattice, point, reach)
            if self.sees_a_node(point, box):
                self.nodes.joins[end] = box
                return True
            if reach >= max(self.lattice.nx, self.lattice.ny) or self.is_late:
                return False
            reach *= 2


def _allocate(lattice: Lattice, surface: Surface) -> kernels.Graph:
    """The arrays of a search. Parts that are never used take no memory."""
    size = lattice.nx * lattice.ny + 2
    try:
        return kernels.Graph(
            vertices=np.zeros(size, kernels.VERTEX),
            places=np.empty((size, trees.LIFTED + len(surface.layers))),
            heap=np.empty(size + 1, kernels.ENTRY),
            counters=np.zeros(kernels.COUNTERS, np.int64),
            floor=surface.least_cost,
        )
    except MemoryError:
        raise InputError(
            f"{lattice.nx:,} x {lattice.ny:,} nodes do not fit in memory; give a wider spacing"
        ) from None


def _prepare(
    problem: Problem, planner: Dijkstra, lattice: Lattice, time_limit: float | None
) -> _Search:
    """Open the start; so the kernels are loaded, or compiled, before the clock starts."""
    nodes = kernels.Nodes(
        x=lattice.x,
        y=lattice.y,
        offsets=_offsets(planner.neighbours),
        joins=np.array([NO_NODES, NO_NODES]),
    )
    graph = _allocate(lattice, problem.priced)
    (x0, y0), (x1, y1) = problem.start, problem.goal
    cells_apart = max(abs(x1 - x0) / lattice.dx, abs(y1 - y0) / lattice.dy)
    options = kernels.Options(
        panel=float(FEATURES_PER_PANEL * problem.surface.resolution),
        informed=planner.informed,
        direct=cells_apart <= REACH[planner.neighbours],
    )
    search = _Search(problem, planner, lattice, nodes, graph, options, time_limit)
    kernels.begin(problem.priced.data, graph, *problem.start, *problem.goal)
    search.advance(0)
    search.relax_row(-1)  # there is no such row
    kernels.any_node_is_near(problem.free_space.data, nodes, NO_NODES, *problem.start)
    search.started = time.perf_counter()
    return search


def _reason_to_stop(search: _Search, callback: Callback | None) -> str:
    """Why the search should end now; empty where it should not."""
    progress = search.progress
    stopped = callback is not None and callback(progress)
    if search.graph.vertices[search.goal]["slot"] == kernels.DONE:
        return "goal settled"
    if search.graph.counters[kernels.OPEN] == 0 and not search.is_late:
        return NO_WAY_ON
    if stopped:
        return "callback"
    return TIME_LIMIT if search.is_late else ""


def _run(search: _Search, callback: Callback | None) -> str:
    """Settle vertices until there is a reason to stop, and return it."""
    problem = search.problem
    try:
        for end, point in enumerate((problem.start, problem.goal)):
            is_joined = search.join(end, point) or search.options.direct
            if not (is_joined or search.is_late):
                return WITHOUT_PATH[1 + end]
        search.relax_start()
        most = CHUNK - search.settled  # the start is settled already
        while True:
            search.advance(0 if search.is_late else most)
            if reason := _reason_to_stop(search, callback):
                return reason
            most = CHUNK
    except KeyboardInterrupt:
        return INTERRUPT


def _path(search: _Search) -> Path | None:
    """The path to the goal; straight runs become one segment where that is free."""
    if math.isinf(search.best_cost):
        return None
    vertices = search.graph.vertices
    visited = [search.goal]
    while (parent := int(vertices[visited[-1]]["parent"])) >= 0:
        visited.append(parent)
    points = search.graph.places[visited[::-1], : trees.COST]
    # A start or goal that lies on a node is a vertex twice.
    points = points[np.append((points[1:] != points[:-1]).any(axis=1), True)]
    bends = points[_are_bends(points)]
    return search.problem.path(bends if search.problem.allows(bends) else points)


def _are_bends(points: Array) -> npt.NDArray[np.bool_]:
    """(m,), which points of a polyline (m, 2) are its ends, or points where it turns."""
    steps = np.diff(points, axis=0)
    dx, dy = steps.T / np.hypot(*steps.T)
    bends = np.ones(len(points), np.bool_)
    bends[1:-1] = np.abs(dx[1:] * dy[:-1] - dx[:-1] * dy[1:]) > STRAIGHT
    return bends


def _counters(graph: kernels.Graph) -> dict[str, int]:
    places = {
        "vertices": kernels.VERTICES,
        "edges considered": kernels.CONSIDERED,
        "edges pruned": kernels.PRUNED,
        "edges integrated": kernels.INTEGRATED,
        "edges tested for obstacles": kernels.CHECKED,
    }
    return {name: int(graph.counters[place]) for name, place in places.items()}


def _search_grid(
    problem: Problem, planner: Dijkstra, callback: Callback | None, time_limit: float | None
) -> Solution:
    """Search until the goal is settled, the time is up, or the callback stops it.

    Where a lattice shows no path, a finer one may.
    """
    answer = answer_without_search(problem, planner.name, takes_travel=True)
    if answer is not None:
        return answer
    started = None
    for lattice in lattices(problem, planner.spacing, at_cells=True):
        search = _prepare(problem, planner, lattice, time_limit)
        started = search.started = started or search.started
        stopped_by = _run(search, callback)
        if stopped_by not in WITHOUT_PATH:
            break
    return _solution(search, stopped_by)


def _solution(search: _Search, stopped_by: str) -> Solution:
    """What a search found until it was stopped."""
    seconds, path = search.seconds, _path(search)
    return Solution(
        problem=search.problem,
        planner=search.planner.name,
        status=status_of(path, stopped_by),
        path=path,
        cost=None if path is None else search.best_cost,
        seconds=seconds,
        samples=search.settled,
        stopped_by=stopped_by,
        counters=_counters(search.graph),
    )
