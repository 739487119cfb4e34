"""The distance field: how far every node of a lattice is from a source, by fast marching."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._kernels.distance import calendar_queue, descent, ground, hopf_lax, star
from .._kernels.surface.metric_rows import columns_of, fill_samples
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

# The edges of all nodes are numbered in 31 bits; on the steepest ground a node has 64.
MOST_NODES = (2**31 - 1) // (2 * star.HALF)

# Nodes within this distance of the source, in nodes, are seeds: a straight way leads there.
SEED_RADIUS = 1.5

# An edge between neighbouring nodes has at least three samples, and two for each feature of the
# surface; but no more pieces than this.
MOST_PIECES = 4

# Is called with the number of nodes settled so far; returning True stops the march.
Watch = Callable[[int], bool | None]


class Medium:
    """A surface and its free space on a lattice, prepared for marching from any source."""

    def __init__(self, surface: Surface, lattice: Lattice, free_space: FreeSpace) -> None:
        self.surface, self.lattice, self.free_space = surface, lattice, free_space
        self.ground = _sample(surface, lattice)
        self.stars = _lay_stars(self.ground, lattice, free_space)
        self.data = hopf_lax.Medium(
            self.ground, self.stars, free_space.data, lattice.data, free_space.has_obstacles
        )

    def march(
        self, source: tuple[float, float], *, limit: float = math.inf, watch: Watch | None = None
    ) -> tuple[Array, Array]:
        """Distances from a source, map units, and these over the chord: both (ny, nx).

        They are infinite where no edge leads. limit : nodes farther than this are not settled, map
        units. watch : is called now and then with the number of nodes settled; returning True
        stops the march.
        """
        lattice, count = self.lattice, self.lattice.nx * self.lattice.ny
        place = (np.asarray(source) - lattice.bounds[:2]) / (lattice.dx, lattice.dy)
        lift = self.surface.lift(np.asarray(source))[2:]
        begin = hopf_lax.Source(float(place[0]), float(place[1]), np.ascontiguousarray(lift))
        state = hopf_lax.State(
            tau=np.full(count, math.inf),
            best=np.full(count, hopf_lax.UNSEEN, np.uint8),
            queued=np.zeros(count, np.uint8),
            links=np.zeros(count, calendar_queue.LINK),
        )
        seeds, values = self._seeds(source, place)
        front = self._front(values)
        state.tau[seeds] = float(self.surface.cost(np.asarray(source)))
        hopf_lax.plant(front, state, seeds, values)
        settled, chunk = 0, CHUNK
        while chunk == CHUNK:
            chunk = hopf_lax.march(self.data, front, state, begin, CHUNK, float(limit))
            settled += chunk
            if watch is not None and watch(settled):
                break
        shape = (lattice.ny, lattice.nx)
        return front.u.reshape(shape), state.tau.reshape(shape)

    def _seeds(
        self, source: tuple[float, float], place: Array
    ) -> tuple[npt.NDArray[np.int64], Array]:
        """The nodes beside the source that a free segment leads to, and their distances."""
        lattice = self.lattice
        rows, columns = (
            np.arange(max(math.ceil(at - SEED_RADIUS), 0), min(at + SEED_RADIUS + 1e-9, last) + 1)
            for at, last in ((place[1], lattice.ny - 1), (place[0], lattice.nx - 1))
        )
        columns, rows = (a.ravel() for a in np.meshgrid(columns.astype(int), rows.astype(int)))
        points = np.column_stack([lattice.x[columns], lattice.y[rows]])
        near = np.hypot(columns - place[0], rows - place[1]) <= SEED_RADIUS
        starts = np.broadcast_to(np.asarray(source), points.shape)
        near &= self.free_space.segments_are_free(starts, points)
        seeds = (rows * lattice.nx + columns)[near].astype(np.int64)
        costs = np.empty(len(seeds))
        pieces = 2 * self.ground.pieces
        ground.fill_rays(
            self.surface.data, np.asarray(source), np.ascontiguousarray(points[near]), pieces, costs
        )
        return seeds, costs

    def _front(self, values: Array) -> calendar_queue.Front:
        lattice, count = self.lattice, self.lattice.nx * self.lattice.ny
        width = BUCKET_SHARE * math.sqrt(lattice.dx * lattice.dy) / max(lattice.nx, lattice.ny)
        width *= self.surface.typical_cost
        front = calendar_queue.Front(
            u=np.full(count, np.inf),
            trial=np.full(count, np.inf),
            heads=np.full(BUCKETS, -1, np.int32),
            days_per_unit=1.0 / width,
            counters=np.zeros(2, np.int64),
        )
        if len(values):
            front.counters[calendar_queue.DAY] = int(values.min() / width)
        return front


def _sample(surface: Surface, lattice: Lattice) -> ground.Ground:
    """Heights and costs between and at the nodes."""
    features = max(lattice.dx, lattice.dy) / surface.resolution
    import os
    pieces = min(max(math.ceil(features - 1e-9), int(os.environ.get('PIECES','1'))), MOST_PIECES)
    per = 2 * pieces
    grid = lattice.data._replace(
        dx=lattice.dx / per,
        dy=lattice.dy / per,
        nx=(lattice.nx - 1) * per + 1,
        ny=(lattice.ny - 1) * per + 1,
    )
    heights = np.empty((len(surface.data.weights), grid.ny, grid.nx))
    costs = np.empty((1 if surface.costs else 0, grid.ny, grid.nx))
    fill_samples(surface.data, grid, columns_of(surface.data, grid), heights, costs)
    return ground.Ground(heights, costs, grid.dx, grid.dy, pieces, surface.least_cost)


def _lay_stars(samples: ground.Ground, lattice: Lattice, free_space: FreeSpace) -> star.Stars:
    """The edges that a march needs, without those that touch an obstacle."""
    count = lattice.nx * lattice.ny
    if count > MOST_NODES:
        raise InputError(
            f"the lattice has {lattice.nx:,} x {lattice.ny:,} nodes, more than {MOST_NODES:,} in "
            "all; give a wider spacing"
        )
    ahead, back = np.zeros(count, np.uint32), np.zeros(count, np.uint32)
    first = np.zeros(count + 1, np.int32)
    star.choose_edges(samples, lattice.nx, lattice.ny, ahead, back)
    if free_space.has_obstacles:
        star.cut_edges(free_space.data, lattice.data, ahead, back)
    star.count_edges(ahead, back, first)
    edges = int(first[-1])
    stars = star.Stars(first, np.empty(edges, np.uint8), np.empty(edges, np.float32))
    star.lay_edges(samples, lattice.nx, ahead, back, stars)
    return stars


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
