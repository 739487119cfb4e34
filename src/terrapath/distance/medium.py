"""A surface and its free space on a lattice, and the march of distances through it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .._kernels.distance import bellman, calendar_queue, edges, ground, hopf_lax, quartet, ray, star
from .._kernels.space.free_space import Grid
from .._kernels.surface.cells import NO_CELLS, CostCells
from .._kernels.surface.metric_rows import columns_of, fill_samples
from .._kernels.surface.surfaces import Spline
from .._support.side_by_side import on_all_cores
from .._support.watching import MustStop, WatchCount, never
from ..errors import InputError
from ..space.free_space import FreeSpace
from ..space.lattice import Lattice
from ..surface import Surface
from ..surface.metric import chord, feature_size
from ..validation import Array, PointLike

# Bytes.
CACHE_LINE = 64

# Nodes settled between two checks of the callback and of Ctrl-C.
CHUNK = 20_000

# The edges of all nodes are numbered in 31 bits; on the steepest ground 28 a node.
MOST_NODES = (2**31 - 1) // star.HALF

# Nodes within this distance of the source, in nodes, are seeds: a straight path leads there. It is
# the length of the longest edge, so that no segment of a star lies beyond the source.
SEED_RADIUS = 5.9

# Nodes whose values differ by less than this share of the least edge are settled in any order.
DAY_SHARE = 0.1

# A path along edges begins at a node within this distance of the goal, in nodes.
REACH = 3.0

# An edge between neighbouring nodes has at least three samples, and two for each feature of the
# surface; but no more pieces than this.
MOST_PIECES = 4
# On smooth ground a piece may be longer than an edge: it is this share of a feature.
FEATURES_PER_PIECE = 0.5


class EdgeTree(NamedTuple):
    """Shortest paths along edges; the last node is the source."""

    values: Array  # (n + 1,), map units
    before: npt.NDArray[np.int32]  # (n + 1,): the node before each on its path


class Medium:
    """A surface and its free space on a lattice, prepared for marching from any source.

    must_stop : is asked many times a second. Where it says True, there are no edges, and a march
    reaches nothing but the source's surroundings.
    """

    def __init__(
        self,
        surface: Surface,
        lattice: Lattice,
        free_space: FreeSpace,
        must_stop: MustStop = never,
    ) -> None:
        self.surface, self.lattice, self.free_space = surface, lattice, free_space
        self.ground = _sample(surface, lattice)
        self.stars = _lay_stars(self.ground, lattice, free_space, must_stop)
        costs = [self.stars.base, self.stars.others]
        self.least_edge = min(float(cost.min(initial=math.inf)) for cost in costs)
        per, (layers, rows, columns) = 2 * self.ground.pieces, self.ground.heights.shape
        self.data = bellman.Medium(
            self.ground,
            self.ground.heights.reshape(layers, rows * columns),
            self.ground.costs.reshape(len(self.ground.costs), rows * columns),
            columns,
            self.ground.pieces * (star.NORTH * columns + star.EAST),
            self.stars,
            star.NORTH * lattice.nx + star.EAST,
            (per * np.abs(star.DIRECTIONS).max(axis=1) <= self.ground.reach).astype(np.uint8),
            free_space.data,
            lattice.data,
            1.0 / lattice.nx,
            free_space.has_obstacles,
        )

    def march(
        self,
        source: tuple[float, float],
        *,
        limit: float = math.inf,
        watch: WatchCount | None = None,
    ) -> tuple[Array, Array]:
        """Distances from a source, map units, and these over the chord: both (ny, nx).

        They are infinite where no edge leads. limit : nodes farther than this are not settled, map
        units. watch : is called now and then with the number of nodes settled; returning True
        stops the march.
        """
        lattice, count = self.lattice, self.lattice.nx * self.lattice.ny
        cost = float(self.surface.cost(np.asarray(source)))
        begin = bellman.Source(*self._place(source), lift_of(self.surface, source), cost)
        state = _state_of(count)
        seeds, costs = self._seeds(source, SEED_RADIUS)
        day = calendar_queue.typical_day(lattice.data, self.surface.typical_cost)
        in_order = DAY_SHARE * self.least_edge <= day
        if not in_order:
            day = DAY_SHARE * self.least_edge
        # Out of order, a day is settled wholly, so that no node within the limit is left out.
        last = float(limit) if in_order else limit + day
        front = calendar_queue.front_of(state.values["u"], state.values["u"], day, costs)
        hopf_lax.plant(front, state, seeds, costs)
        settled, chunk = 0, CHUNK
        while chunk == CHUNK:
            chunk = hopf_lax.march(self.data, front, state, begin, CHUNK, last, in_order)
            settled += chunk
            if watch is not None and watch(settled):
                break
        known = state.values.reshape(lattice.ny, lattice.nx)
        del state, front  # before the copies are made
        u, tau = known["u"].copy(), known["tau"].copy()
        beyond = (u > limit) | (tau == math.inf)
        u[beyond] = tau[beyond] = math.inf
        return u, tau

    def _place(self, point: PointLike) -> tuple[float, float]:
        """Column and row of a point, in nodes."""
        lattice = self.lattice
        x, y = (np.asarray(point) - lattice.bounds[:2]) / lattice.spacing
        return float(x), float(y)

    def _seeds(self, source: PointLike, radius: float) -> tuple[npt.NDArray[np.int64], Array]:
        """The nodes near a source that a free segment leads to, and their distances.

        radius : in nodes.
        """
        lattice, place = self.lattice, self._place(source)
        rows, columns = (
            np.arange(max(math.ceil(at - radius), 0), min(math.floor(at + radius), last) + 1)
            for at, last in ((place[1], lattice.ny - 1), (place[0], lattice.nx - 1))
        )
        columns, rows = (a.ravel() for a in np.meshgrid(columns.astype(int), rows.astype(int)))
        points = np.column_stack([lattice.x[columns], lattice.y[rows]])
        near = np.hypot(columns - place[0], rows - place[1]) <= radius
        starts = np.broadcast_to(np.asarray(source), points.shape)
        near &= self.free_space.segments_are_free(starts, points)
        seeds = (rows * lattice.nx + columns)[near].astype(np.int64)
        costs, per = np.empty(len(seeds)), 2 * self.ground.pieces
        nodes = np.column_stack([columns[near], rows[near]]).astype(np.float64)
        ray.fill_rays(self.ground, per * place[0], per * place[1], per * nodes, costs)
        least = chord(self.surface, np.broadcast_to(source, points[near].shape), points[near])
        return seeds, np.maximum(costs, least)

    def edge_tree(self, source: tuple[float, float]) -> EdgeTree:
        """The shortest paths along edges from a source to all nodes."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        count = self.lattice.nx * self.lattice.ny
        beside, values = self._seeds(source, SEED_RADIUS)
        tails, directions, costs = star.list_edges(self.stars)
        heads = tails + self.data.steps[directions]
        # The source is one more node.
        pairs = (np.append(tails, np.full(len(beside), count)), np.append(heads, beside))
        graph = csr_array((np.append(costs, values), pairs), shape=(count + 1, count + 1))
        values, before = dijkstra(graph, directed=False, indices=count, return_predecessors=True)
        return EdgeTree(values, before)

    def along_edges(self, tree: EdgeTree, goal: Array) -> npt.NDArray[np.int64] | None:
        """The nodes (k,) of the shortest path along edges from a goal (2,) to a tree's source.

        None where no edges lead there.
        """
        beside, values = self._seeds(goal, REACH)
        values = values + tree.values[beside]
        if not np.isfinite(values).any():
            return None
        nodes = [int(beside[np.argmin(values)])]
        while (before := int(tree.before[nodes[-1]])) < len(tree.before) - 1:
            nodes.append(before)
        return np.array(nodes)


def _sample(surface: Surface, lattice: Lattice) -> ground.Ground:
    """Heights and costs between and at the nodes."""
    size = feature_size(surface)
    features = max(lattice.dx / size[0], lattice.dy / size[1])
    pieces = min(max(math.ceil(features - 1e-9), 1), MOST_PIECES)
    per = 2 * pieces
    grid = lattice.data._replace(
        dx=lattice.dx / per,
        dy=lattice.dy / per,
        nx=(lattice.nx - 1) * per + 1,
        ny=(lattice.ny - 1) * per + 1,
    )
    heights = np.empty((len(surface.data.weights), grid.ny, grid.nx))
    costs = np.empty((0 if surface.cost_data is None else 1, grid.ny, grid.nx))
    fill_samples(surface.data, grid, columns_of(surface.data, grid), heights, costs)
    reach = 2.0 * max(1.0, FEATURES_PER_PIECE / features) if features > 0.0 else math.inf
    floor, cells = surface.least_cost, _cells_in_samples(surface, grid)
    return ground.Ground(heights, costs, grid.dx, grid.dy, pieces, reach, floor, cells)


def _cells_in_samples(surface: Surface, grid: Grid) -> CostCells:
    """The costs that are constant in cells; places and sizes are in samples."""
    if surface.cost_cells is None or not isinstance(surface.data, Spline):
        return NO_CELLS
    cells = surface.data.cells
    return cells._replace(
        x0=(cells.x0 - grid.x0) / grid.dx,
        y0=(cells.y0 - grid.y0) / grid.dy,
        dx=cells.dx / grid.dx,
        dy=cells.dy / grid.dy,
    )


def _lay_stars(
    samples: ground.Ground, lattice: Lattice, free_space: FreeSpace, must_stop: MustStop
) -> star.Stars:
    """The edges that a march needs, without those that touch an obstacle; none where it stops."""
    count = lattice.nx * lattice.ny
    if count > MOST_NODES:
        raise InputError(
            f"the lattice has {lattice.nx:,} x {lattice.ny:,} nodes, more than {MOST_NODES:,} in "
            "all; give a wider spacing"
        )
    parts, (ahead, back) = _parts(lattice), star.base_edges(lattice.nx, lattice.ny)
    wide = np.zeros(count, np.uint8)

    def choose(rows: tuple[int, int]) -> None:
        star.choose_edges(samples, lattice.nx, lattice.ny, rows, ahead, back, wide)

    def cut(rows: tuple[int, int]) -> None:
        star.cut_edges(free_space.data, lattice.data, rows, ahead, back)

    # Both change edges that lead to rows beside theirs, so no two parts side by side at a time.
    for change in (choose, cut) if free_space.has_obstacles else (choose,):
        for some in (parts[::2], parts[1::2]):
            if not on_all_cores(change, some, must_stop):
                return _no_stars(count)
    first = np.empty(count, np.int32)
    others = np.empty(star.count_others(ahead, first), np.float32)
    base = np.full((count, 4), np.inf, np.float32)
    stars = star.Stars(ahead, back, base, first, others, wide)

    def lay(rows: tuple[int, int]) -> None:
        waiting, counts = np.zeros((star.HALF, 3), edges.WAITING), np.zeros(star.HALF, np.int64)
        edges.lay_edges(samples, lattice.nx, lattice.ny, rows, stars, waiting, counts)

    return stars if on_all_cores(lay, parts, must_stop) else _no_stars(count)


def _state_of(count: int) -> bellman.State:
    """The state of so many nodes of which nothing is known."""
    known, nodes = _aligned(count, bellman.VALUE), _aligned(count, bellman.NODE)
    known["u"] = known["tau"] = math.inf
    return bellman.State(known, nodes, quartet.make_quartet(), quartet.make_quartet())


def _aligned(count: int, kind: np.dtype[Any]) -> npt.NDArray[Any]:
    """So many records, zeros, of which none lies on two cache lines."""
    room = np.zeros(count * kind.itemsize + CACHE_LINE, np.uint8)
    begin = -room.ctypes.data % CACHE_LINE
    return room[begin : begin + count * kind.itemsize].view(kind)


def _parts(lattice: Lattice) -> list[tuple[int, int]]:
    """The rows of a lattice in parts of about CHUNK nodes, each as its first row and its end.

    No edge leads from a part beyond the ones beside it.
    """
    step = max(CHUNK // lattice.nx, 2 * star.FARTHEST)
    return [(row, min(row + step, lattice.ny)) for row in range(0, lattice.ny, step)]


def _no_stars(count: int) -> star.Stars:
    none, first = np.zeros(count, np.uint32), np.zeros(count, np.int32)
    base, others = np.full((count, 4), np.inf, np.float32), np.empty(0, np.float32)
    return star.Stars(none, none, base, first, others, np.zeros(count, np.uint8))


def lift_of(surface: Surface, point: PointLike) -> Array:
    """The weighted heights (layers,) of a point, map units."""
    return np.ascontiguousarray(surface.lift(np.asarray(point))[2:])
