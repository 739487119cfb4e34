"""The distance field: how far every node of a lattice is from a source, by fast marching."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Event
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._kernels.distance import descent
from .._support.watching import WatchCount
from ..errors import InputError, OutsideSurfaceError
from ..problem import Path, Problem
from ..space.free_space import FreeSpace, Obstacle
from ..space.lattice import Lattice
from ..surface import Surface
from ..validation import Array, Point, PointLike, as_point, as_points
from .medium import EdgeTree, Medium, lift_of

if TYPE_CHECKING:
    from ..space.constraints import Area
    from ..space.slope_limit import SlopeMeasure

# The length of a step on a path back to the source, in nodes.
STEP = 0.5

# A path down the field that is this many times as long as the field says went astray, on very
# rough ground.
ASTRAY = 1.1


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Distances under h from one source, at the nodes of a lattice.

    source : (x1, x2), map units. medium : the ground on the lattice. values : (ny, nx), map units,
    infinite where no path was found on the lattice. ratios : (ny, nx), the values over the chord
    from the source without costs. problem : from the source to itself, with the constraints
    that were asked for; None where the field was not made from a problem.
    """

    source: tuple[float, float]
    medium: Medium
    values: Array
    ratios: Array
    problem: Problem | None = None

    @property
    def surface(self) -> Surface:
        """What distances are measured on."""
        return self.medium.surface

    @property
    def free_space(self) -> FreeSpace:
        """Where paths may lead."""
        return self.medium.free_space

    @property
    def lattice(self) -> Lattice:
        """Where the values lie."""
        return self.medium.lattice

    def at(self, points: npt.ArrayLike) -> Array:
        """Distances (...) from the source to points (..., 2), map units; infinite if not reached.

        The field is interpolated by cubics where it is smooth. At a kink, where shortest paths
        from two sides meet, and near obstacles, the value is the least distance over the nodes
        nearby that a free segment leads to. No value is below the chord.
        Raises OutsideSurfaceError where a point is outside the bounds.
        """
        array = as_points(points)
        flat = np.ascontiguousarray(array.reshape(-1, 2))
        self._require_inside(flat)
        values = np.empty(len(flat))
        descent.fill_distances(self.surface.data, self.free_space.data, self._field, flat, values)
        return values.reshape(array.shape[:-1])

    @cached_property
    def _field(self) -> descent.Field:
        return descent.Field(
            self.values,
            self.ratios,
            self.lattice.data,
            *self.source,
            lift_of(self.surface, self.source),
            self.free_space.has_obstacles,
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

    def path_to(self, goal: PointLike) -> Path | None:
        """The path from the source to a goal (x1, x2), map units; None where there is none.

        It follows steepest descent where the field is smooth and the ground is free. Elsewhere it
        goes to the best node nearby that a free segment leads to. Where that leads nowhere or
        astray, it follows the edges of the lattice. So there is a path where the field is finite.
        Raises OutsideSurfaceError where the goal is outside the bounds.
        """
        end = np.array([as_point(goal, "goal")])
        distance = float(self.at(end)[0])
        if not math.isfinite(distance):
            return None
        path = self._downhill(end[0], distance)
        if path is not None and path.length <= ASTRAY * distance:
            return path
        other = self._along_edges(end[0])
        paths = [found for found in (path, other) if found is not None]
        return min(paths, key=lambda found: found.length, default=None)

    def _downhill(self, goal: Array, distance: float) -> Path | None:
        """The path down the field; None where it leads nowhere."""
        # On the plane, no shortest path is longer than its length over the least cost; and it
        # visits each node only a few times.
        farthest = distance / self.surface.least_cost / min(self.lattice.spacing)
        most = min(1.2 * farthest / STEP, 4.0 * self.values.size / STEP)
        points = np.empty((int(most) + 16, 2))
        points[0] = goal
        count = descent.trace(self.surface.data, self.free_space.data, self._field, STEP, points)
        return Path(self.surface, points[:count][::-1].copy()) if count else None

    def _along_edges(self, goal: Array) -> Path | None:
        """The shortest path along the edges of the lattice."""
        nodes = self.medium.along_edges(self._edge_tree, goal)
        if nodes is None:
            return None
        places = self.lattice.points.reshape(-1, 2)[nodes]
        return Path(self.surface, np.vstack([goal, places, self.source])[::-1].copy())

    @cached_property
    def _edge_tree(self) -> EdgeTree:
        return self.medium.edge_tree(self.source)

    @cached_property
    def reached(self) -> float:
        """Share of the nodes that were reached."""
        return float(np.isfinite(self.values).mean())


def march_from(
    medium: Medium,
    source: tuple[float, float],
    *,
    limit: float = math.inf,
    watch: WatchCount | None = None,
) -> DistanceField:
    """The distance field of one source in a medium that is prepared already.

    limit, watch : as of ``Medium.march``.
    """
    values, ratios = medium.march(source, limit=limit, watch=watch)
    return DistanceField(source, medium, values, ratios)


def march_both(
    medium: Medium, start: Point, goal: Point, *, watch: WatchCount | None = None
) -> tuple[DistanceField, DistanceField]:
    """The distance fields of two sources, one on each core; see ``march_from``."""
    stop = Event()
    with ThreadPoolExecutor(1) as beside:
        other = beside.submit(march_from, medium, goal, watch=lambda settled: stop.is_set())
        try:
            field = march_from(medium, start, watch=watch)
            while not wait([other], timeout=0.1).done:
                if watch is not None and watch(field.values.size):
                    stop.set()
            return field, other.result()
        except BaseException:
            stop.set()
            raise


def distance_field(
    surface: Surface,
    start: PointLike,
    *,
    bounds: Sequence[float] | None = None,
    obstacles: Iterable[Obstacle] = (),
    radius: float = 0.0,
    max_slope: float | None = None,
    slope_measure: SlopeMeasure = "horn",
    keep_in: Area | None = None,
    spacing: float | None = None,
    watch: WatchCount | None = None,
) -> DistanceField:
    """Distances on the surface from a start to everywhere, by fast marching.

    start : (x1, x2), map units, in free space.
    bounds, obstacles, radius, max_slope, slope_measure, keep_in : as of ``Problem``.
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
        slope_measure=slope_measure,
        keep_in=keep_in,
    )
    return field_of(problem, spacing=spacing, watch=watch)


def field_of(
    problem: Problem, *, spacing: float | None = None, watch: WatchCount | None = None
) -> DistanceField:
    """Distances from a problem's start through its free space; see ``distance_field``.

    Raises InputError where the problem has a travel model.
    """
    if problem.travel is not None:
        raise InputError(
            f"travel={problem.travel.name!r}: distance fields know lengths alone, so far; leave "
            "the travel model out, or plan to each place with planner a-star"
        )
    surface = problem.surface
    chosen = problem.default_spacing if spacing is None else spacing
    lattice = Lattice.spanning(problem.bounds, chosen)
    medium = Medium(surface, lattice, problem.free_space)
    field = march_from(medium, problem.start, watch=watch)
    return replace(field, problem=problem)
