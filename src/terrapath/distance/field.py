"""The distance field: the eikonal equation of h on a lattice, by fast marching."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._kernels.distance import calendar_queue, dependents, descent, eikonal as kernels, stencils
from .._kernels.surface.metric_rows import ROWS, columns_of
from ..errors import InputError, OutsideSurfaceError
from ..problem import Path, Problem
from ..space.free_space import FreeSpace, Obstacle
from ..space.lattice import Lattice
from ..surface import Surface
from ..validation import Array, PointLike, as_array, as_point, as_points
from .source import SEED_RADIUS, SourceModel, model_source, near_distance, window_radius

if TYPE_CHECKING:
    from ..space.constraints import Area

# The width of a bucket of the queue: this many spacings of nodes, divided by the nodes of a side.
BUCKET_SHARE = 4.0
BUCKETS = 2**14

# Nodes settled between two checks of the callback and of Ctrl-C.
CHUNK = 100_000

# The length of a step on a path back to the source, in nodes.
STEP = 0.5

# The vectors of stencils are stored in 16 bits.
LONGEST_SIDE = 2**15 - 1
# On average a node has at most 6 + 8 dependents, and all these are numbered in 31 bits.
MOST_NODES = (2**31 - 1) // 14

# The nodes of a lattice as kernels store them, (ny * nx,) of ``stencils.NODE``.
Nodes = npt.NDArray[np.void]

# Is called with the number of nodes settled so far; returning True stops the march.
Watch = Callable[[int], bool | None]


class Medium:
    """A metric on a lattice, prepared for fast marching from any source.

    nodes : the stencil of each node. typical_cost : of the surface, a factor on lengths.
    """

    def __init__(self, lattice: Lattice, nodes: Nodes, typical_cost: float = 1.0) -> None:
        self.lattice = lattice
        self.nodes = nodes
        self.typical_cost = typical_cost
        self.dependents = self._dependents()

    @classmethod
    def of_surface(
        cls, surface: Surface, lattice: Lattice, free_space: FreeSpace | None = None
    ) -> Medium:
        """The metric h of a surface; no link between nodes touches an obstacle."""
        nodes = _surface_stencils(surface, lattice)
        if free_space is not None and free_space.has_obstacles:
            stencils.cut_links(free_space.data, lattice.data, nodes)
        return cls(lattice, nodes, surface.typical_cost)

    @classmethod
    def around(cls, surface: Surface, lattice: Lattice, blocked: npt.NDArray[np.bool_]) -> Medium:
        """The metric h of a surface; links may touch obstacles, but ``blocked`` nodes are left out.

        blocked : (ny, nx).
        """
        nodes = _surface_stencils(surface, lattice)
        if blocked.any():
            stencils.block_nodes(lattice.data, blocked.ravel().astype(np.uint8), nodes)
        return cls(lattice, nodes, surface.typical_cost)

    def shrink(self, factors: Array) -> None:
        """Multiply lengths at the nodes by factors (ny, nx). This changes the medium itself."""
        scale = 1.0 / np.square(np.asarray(factors, np.float64).ravel())
        for rho in ("rho0", "rho1", "rho2"):
            self.nodes[rho] *= scale

    @classmethod
    def of_tensors(cls, tensors: npt.ArrayLike, lattice: Lattice) -> Medium:
        """Any Riemannian metric.

        tensors : (ny, nx, 3), h11, h12 and h22 at the nodes. Raises InputError where one is not
        positive definite.
        """
        given = as_array(tensors, "tensors", shape=(lattice.ny, lattice.nx, 3))
        if not (given[..., 0] * given[..., 2] > given[..., 1] ** 2).all():
            raise InputError("tensors hold one that is not positive definite; check their order")
        nodes = _allocate(lattice)
        stencils.lay_tensor_stencils(given, lattice.data, nodes)
        return cls(lattice, nodes)

    def _dependents(self) -> dependents.Dependents:
        nx, first = self.lattice.nx, np.zeros(len(self.nodes) + 1, np.int32)
        # The number of a node's dependents is stored one place after the node, and then summed up.
        dependents.note_dependents(self.nodes, nx, first[1:], np.empty(0, np.uint32))
        np.cumsum(first, dtype=np.int32, out=first)
        entries = np.empty(first[-1], np.uint32)
        dependents.note_dependents(self.nodes, nx, first, entries)
        first[1:] = first[:-1]  # each now points to its end, where the next begins
        first[0] = 0
        return dependents.Dependents(first, entries)

    def march(
        self, model: SourceModel, *, limit: float = math.inf, watch: Watch | None = None
    ) -> Array:
        """Distances (ny, nx) from the source, map units; infinite where not reached.

        limit : nodes farther than this are not settled, map units. watch : is called now and then
        with the number of nodes settled; returning True stops the march.
        """
        lattice = self.lattice
        source = kernels.Source(*model[:5])
        front = self._front(model)
        rows = slice(model.row, model.row + model.values.shape[0])
        columns = slice(model.column, model.column + model.values.shape[1])
        window = self.nodes["links"].reshape(lattice.ny, lattice.nx)[rows, columns]
        window[~np.isnan(model.values)] |= stencils.WINDOW
        try:
            kernels.plant(
                self.nodes, front, self.dependents, lattice.nx, model.seeds, model.seed_values
            )
            self._settle(front, source, limit, watch)
        finally:
            window &= ~np.uint16(stencils.WINDOW)
        return front.u.reshape(lattice.ny, lattice.nx)

    def _front(self, model: SourceModel) -> calendar_queue.Front:
        lattice, count = self.lattice, len(self.nodes)
        width = BUCKET_SHARE * math.sqrt(lattice.dx * lattice.dy) / max(lattice.nx, lattice.ny)
        width *= self.typical_cost
        front = calendar_queue.Front(
            u=np.full(count, np.inf),
            trial=np.full(count, np.inf),
            heads=np.full(BUCKETS, -1, np.int32),
            days_per_unit=1.0 / width,
            counters=np.zeros(2, np.int64),
        )
        if len(model.seeds):
            front.counters[calendar_queue.DAY] = int(model.seed_values.min() / width)
        return front

    def _settle(
        self,
        front: calendar_queue.Front,
        source: kernels.Source,
        limit: float,
        watch: Watch | None,
    ) -> None:
        settled = 0
        while True:
            chunk = kernels.march(
                self.nodes, front, self.dependents, source, self.lattice.nx, CHUNK, float(limit)
            )
            settled += chunk
            stopped = watch is not None and watch(settled)
            if stopped or chunk < CHUNK:
                return


def _surface_stencils(surface: Surface, lattice: Lattice) -> Nodes:
    """Nodes with the stencils of the metric h."""
    nodes, grid = _allocate(lattice), lattice.data
    columns, row = columns_of(surface.data, grid), np.empty((ROWS, lattice.nx))
    stencils.lay_surface_stencils(surface.data, grid, columns, row, nodes)
    return nodes


def _allocate(lattice: Lattice) -> Nodes:
    sides, count = (lattice.nx, lattice.ny), lattice.nx * lattice.ny
    if max(sides) > LONGEST_SIDE or count > MOST_NODES:
        raise InputError(
            f"the lattice has {lattice.nx:,} x {lattice.ny:,} nodes, more than {LONGEST_SIDE:,} "
            f"on a side or {MOST_NODES:,} in all; give a wider spacing"
        )
    return np.zeros(count, stencils.NODE)


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Distances under h from one source, at the nodes of a lattice.

    surface, free_space : where distances are measured. source : (x1, x2), map units. medium : the
    metric on the lattice. values : (ny, nx), map units, infinite where no path was found on the
    lattice. problem : from the source to itself, with the constraints that were asked for; None
    where the field was not made from a problem.
    """

    surface: Surface
    free_space: FreeSpace
    source: tuple[float, float]
    medium: Medium
    values: Array
    problem: Problem | None = None

    @property
    def lattice(self) -> Lattice:
        """Where the values lie."""
        return self.medium.lattice

    def at(self, points: npt.ArrayLike) -> Array:
        """Distances (...) from the source to points (..., 2), map units; infinite if not reached.

        The field is interpolated by cubics where it is smooth. At a kink, where shortest paths
        from two sides meet, and near obstacles, the value is the least distance over the nodes
        nearby that a free segment leads to. At a node on a kink it is a little higher than in
        ``values``, and more accurate.
        Raises OutsideSurfaceError where a point is outside the bounds.
        """
        array = as_points(points)
        flat = np.ascontiguousarray(array.reshape(-1, 2))
        self._require_inside(flat)
        values = np.empty(len(flat))
        descent.fill_distances(self.surface.data, self.free_space.data, self._field, flat, values)
        near = np.flatnonzero(self._is_near_source(flat))
        direct = near_distance(self.surface, self.source, flat[near])
        seen = self._sees_source(flat[near])
        values[near[seen]] = direct[seen]
        return values.reshape(array.shape[:-1])

    @property
    def _field(self) -> descent.Field:
        return descent.Field(
            self.values, self.lattice.data, *self.source, self.free_space.has_obstacles
        )

    def _require_inside(self, points: Array) -> None:
        bounds = self.lattice.bounds
        outside = np.flatnonzero(~bounds.contains(points))
        if len(outside):
            x, y = points[outside[0]]
            raise OutsideSurfaceError(
                f"({x:.10g}, {y:.10g}) is outside the bounds {bounds}; "
                "check the axis order or the CRS"
            )

    def _is_near_source(self, points: Array) -> npt.NDArray[np.bool_]:
        offsets = (points - np.asarray(self.source)) / (self.lattice.dx, self.lattice.dy)
        return np.asarray(np.hypot(*offsets.T) <= SEED_RADIUS)

    def _sees_source(self, points: Array) -> npt.NDArray[np.bool_]:
        starts = np.broadcast_to(np.asarray(self.source), points.shape)
        return self.free_space.segments_are_free(starts, points)

    def path_to(self, goal: PointLike) -> Path | None:
        """The path from the source to a goal (x1, x2), map units; None where there is none.

        It follows steepest descent under h where the field is smooth and the ground is free.
        Elsewhere it goes to the best node nearby that a free segment leads to.
        Raises OutsideSurfaceError where the goal is outside the bounds.
        """
        end = np.array([as_point(goal, "goal")])
        distance = float(self.at(end)[0])
        if not math.isfinite(distance):
            return None
        # On the plane, no shortest path is longer than its length over the least cost; and it
        # visits each node only a few times.
        farthest = distance / self.surface.least_cost / min(self.lattice.dx, self.lattice.dy)
        most = min(1.2 * farthest / STEP, 4.0 * self.values.size / STEP)
        points = np.empty((int(most) + 16, 2))
        points[0] = end[0]
        count = descent.trace(self.surface.data, self.free_space.data, self._field, STEP, points)
        return Path(self.surface, points[:count][::-1].copy()) if count else None

    @cached_property
    def reached(self) -> float:
        """Share of the nodes that were reached."""
        return float(np.isfinite(self.values).mean())


def march_from(
    surface: Surface,
    free_space: FreeSpace,
    source: tuple[float, float],
    medium: Medium,
    *,
    limit: float = math.inf,
    watch: Watch | None = None,
) -> DistanceField:
    """The distance field of one source in a medium that is prepared already.

    limit, watch : as of ``Medium.march``.
    """

    def is_visible(points: Array) -> npt.NDArray[np.bool_]:
        starts = np.broadcast_to(np.asarray(source), points.shape)
        return free_space.segments_are_free(starts, points)

    model = model_source(
        medium.lattice,
        source,
        window_radius(surface, medium.lattice),
        lambda points: near_distance(surface, source, points),
        is_visible if free_space.has_obstacles else None,
    )
    values = medium.march(model, limit=limit, watch=watch)
    return DistanceField(surface, free_space, source, medium, values)


def distance_field(
    surface: Surface,
    start: PointLike,
    *,
    bounds: Sequence[float] | None = None,
    obstacles: Iterable[Obstacle] = (),
    radius: float = 0.0,
    max_slope: float | None = None,
    keep_in: Area | None = None,
    spacing: float | None = None,
    watch: Watch | None = None,
) -> DistanceField:
    """Distances on the surface from a start to everywhere, by fast marching.

    start : (x1, x2), map units, in free space.
    bounds, obstacles, radius, max_slope, keep_in : as of ``Problem``.
    spacing : of the nodes, map units; by default a 250th of the region's longer side, or a cell
    of the map where that is less.
    watch : is called now and then with the number of nodes settled; returning True stops the march.
    Raises OutsideSurfaceError or InputError, naming the value and the remedy.
    """
    problem = Problem(
        surface,
        start,
        start,
        bounds,
        obstacles,
        radius=radius,
        max_slope=max_slope,
        keep_in=keep_in,
    )
    return field_of(problem, spacing=spacing, watch=watch)


def field_of(
    problem: Problem, *, spacing: float | None = None, watch: Watch | None = None
) -> DistanceField:
    """Distances from a problem's start through its free space; see ``distance_field``."""
    surface = problem.surface
    chosen = problem.default_spacing if spacing is None else spacing
    lattice = Lattice.spanning(problem.bounds, chosen)
    medium = Medium.of_surface(surface, lattice, problem.free_space)
    field = march_from(surface, problem.free_space, problem.start, medium, watch=watch)
    return replace(field, problem=problem)
