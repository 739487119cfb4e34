"""What is asked and what is answered: problem, path, status, solution."""

from __future__ import annotations

import copy
import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely

from ..errors import BlockedError, InputError, OutsideSurfaceError
from ..space.constraints import Constraints, outside_of
from ..space.free_space import Obstacle
from ..space.lattice import default_spacing
from ..space.slope_limit import Steepness
from ..surface import Surface, metric
from ..validation import Array, Bounds, as_bounds, as_point, require_not_negative

# Points a path is cut into to add up climb and draw profiles, unless the surface is finer.
PROFILE_POINTS = 256


class Problem:
    """Find a short path on a surface from start to goal through free space.

    surface : Surface. start, goal : (x1, x2), map units, in free space.
    bounds : (x1_min, x2_min, x1_max, x2_max), map units; by default the surface's.
    obstacles : shapely polygons and lines, ``Circle`` and ``Mask``, map units.
    The surface's no-data cells are obstacles too.
    radius : of the vehicle, map units; obstacles of all kinds are inflated by it, so that a path
    is never nearer to one. Points are obstacles, too, where there is a radius.
    max_slope : degrees; ground on which the first layer, without its weight, rises more is an
    obstacle. keep_in : shapely polygon or polygons that the vehicle stays inside of.
    ``obstacles`` are those given, ``free_space`` is what they leave to the vehicle's centre.
    Raises OutsideSurfaceError or InputError, naming the value and the remedy.
    """

    def __init__(
        self,
        surface: Surface,
        start: Any,
        goal: Any,
        bounds: Any = None,
        obstacles: Iterable[Obstacle] = (),
        *,
        radius: float = 0.0,
        max_slope: float | None = None,
        keep_in: Any = None,
        name: str = "",
    ) -> None:
        self.surface = surface
        self.name = name
        self.bounds = self._make_bounds(surface, bounds)
        try:
            given = (obstacles,) if isinstance(obstacles, Obstacle) else tuple(obstacles)
        except TypeError:
            raise InputError(
                f"obstacles={obstacles!r} is no list of obstacles; "
                "give shapely geometries, Circle or Mask"
            ) from None
        require_not_negative(radius=radius)
        self.obstacles: tuple[Obstacle, ...] = given
        self.radius = float(radius)
        self.max_slope = max_slope
        self.keep_in = keep_in
        # Ground beyond the bounds keeps the vehicle off, too.
        around = self.bounds.widened(self.radius)
        self.constraints = Constraints(
            bounds=self.bounds,
            obstacles=given,
            nodata=surface.nodata,
            steepness=None if max_slope is None else Steepness(surface, max_slope, around),
            outside=None if keep_in is None else outside_of(keep_in, self.bounds, self.radius),
            radius=self.radius,
        )
        self.free_space = self.constraints.free_space()
        self.start = self._check("start", start)
        self.goal = self._check("goal", goal)

    @staticmethod
    def _make_bounds(surface: Surface, bounds: Any) -> Bounds:
        if bounds is None:
            if surface.bounds is None:
                raise InputError(
                    "bounds=None: the surface has no edge, so the region to plan in must be "
                    "named; give bounds=(x1_min, x2_min, x1_max, x2_max)"
                )
            return surface.bounds
        rectangle = as_bounds(bounds)
        if surface.bounds is not None and not surface.bounds.encloses(rectangle):
            raise OutsideSurfaceError(
                f"bounds={tuple(rectangle)} reach beyond the surface, {surface.bounds}; "
                "shrink them, or check the axis order or the CRS"
            )
        return rectangle

    def _check(self, name: str, value: Any) -> tuple[float, float]:
        point = as_point(value, name)
        if not self.bounds.contains(np.array(point)):
            shown = f"{name}=({point[0]:.10g}, {point[1]:.10g}) is outside the bounds {self.bounds}"
            raise OutsideSurfaceError(f"{shown}; check the axis order or the CRS")
        if self.free_space.blocker(point) is None:
            return point
        blocker = self.constraints.blocker(point, self.surface.unit)
        shown = f"{name}=({point[0]:.10g}, {point[1]:.10g})"
        raise BlockedError(f"{shown} is {blocker}; move it to free ground")

    def between(self, start: Any, goal: Any, names: tuple[str, str] = ("start", "goal")) -> Problem:
        """The same ground with another start and goal, which errors call by ``names``."""
        other = copy.copy(self)
        for known in ("straight_length", "is_unreachable"):
            other.__dict__.pop(known, None)
        other.start, other.goal = self._check(names[0], start), self._check(names[1], goal)
        return other

    def path(self, points: Any) -> Path:
        """A path of this problem's surface through the given points."""
        return Path(self.surface, np.asarray(points, np.float64))

    @property
    def default_spacing(self) -> float:
        """The spacing of nodes, map units, where none is asked for."""
        return default_spacing(self.bounds, self.surface.resolution)

    @cached_property
    def straight_length(self) -> float:
        """Length on the surface of the straight way from start to goal, obstacles or not."""
        return metric.curve_length(self.surface, [self.start, self.goal])

    @cached_property
    def is_unreachable(self) -> bool:
        """Is it proven that no path leads from start to goal?"""
        return self.free_space.separates(self.start, self.goal)

    def __repr__(self) -> str:
        # Also of a problem that is only half made, as debuggers show one whose end is refused.
        known = vars(self)
        name = f"{known['name']}: " if known.get("name") else ""
        start, goal, bounds, surface = (
            known.get(key, "?") for key in ("start", "goal", "bounds", "surface")
        )
        return f"Problem({name}{start} to {goal} within {bounds}; {surface!r})"


def _sampled(points: Array, finest: float) -> Array:
    """A polyline (m, 2) with its pieces cut into equal ones that are no longer than ``finest``.

    They stay as they are where that is 0.
    """
    moves = np.diff(points, axis=0)
    sizes = np.hypot(*moves.T) / finest if finest > 0.0 else np.ones(len(moves))
    counts = np.maximum(np.ceil(sizes), 1.0).astype(np.intp)
    piece = np.repeat(np.arange(len(moves)), counts)
    place = np.arange(1, len(piece) + 1) - np.repeat(np.cumsum(counts) - counts, counts)
    # The last place is the piece's end, whatever rounding makes of the share.
    shares = np.where(place == counts[piece], 1.0, place * (1.0 / counts)[piece])
    return np.concatenate([points[:1], points[piece] + shares[:, None] * moves[piece]])


@dataclass(frozen=True, eq=False)
class Path:
    """A polyline of the plane, read as a curve on the surface above it.

    points : (m, 2), map units, from start to goal.
    """

    surface: Surface
    points: Array

    @cached_property
    def length(self) -> float:
        """True length under h, map units, to 1e-9 relative."""
        return metric.curve_length(self.surface, self.points)

    @cached_property
    def line(self) -> shapely.LineString:
        """The path on the plane."""
        return shapely.LineString(self.points)

    @cached_property
    def profile(self) -> Profile:
        """The path sampled finely enough to see every feature of the surface."""
        finest = min(0.25 * self.surface.resolution, self.line.length / PROFILE_POINTS)
        points = _sampled(self.points, finest)
        steps = metric.segment_lengths(self.surface, points[:-1], points[1:])
        distance = np.concatenate([[0.0], np.cumsum(steps)])
        values, costs = self.surface.values(points), self.surface.cost_values(points)
        return Profile(points, distance, values, costs)

    @cached_property
    def contributions(self) -> dict[str, float]:
        """What makes up the length: shares that add up to 1, by the profile.

        A step ds under h without costs is the sum of dx_i^2 / ds over all coordinates of R^n:
        "plane" is the share of the plane's, and each layer has its own. Costs have what they
        multiply the length by on top, which is below 0 where that is below 1; several divide it
        by their logarithms.
        """
        surface, profile = self.surface, self.profile
        steps = np.diff(np.hstack([profile.points, profile.values * surface.data.weights]), axis=0)
        sizes = np.maximum(np.linalg.norm(steps, axis=1), 1e-300)
        parts = np.square(steps) / sizes[:, None]
        amounts = {"plane": float(parts[:, :2].sum())}
        for layer, part in zip(surface.layers, parts[:, 2:].T, strict=True):
            amounts[layer.name] = float(part.sum())
        if surface.costs:
            middles = 0.5 * (profile.points[1:] + profile.points[:-1])
            weights = np.array([layer.weight for layer in surface.costs])
            logs = weights * np.log(surface.cost_values(middles))
            total = logs.sum(axis=1)
            each = np.where(np.abs(total) > 1e-12, np.expm1(total) / (total + 1e-300), 1.0)
            for layer, log in zip(surface.costs, logs.T, strict=True):
                amounts[layer.name] = float((log * each * sizes).sum())
        whole = sum(amounts.values())
        if whole == 0.0:
            return dict.fromkeys(amounts, 0.0)
        return {name: amount / whole for name, amount in amounts.items()}

    @cached_property
    def climb(self) -> float:
        """Sum of all rises of the first layer along the path, in its unit."""
        rises = np.diff(self.profile.values[:, 0])
        return float(rises[rises > 0.0].sum())


class Profile(NamedTuple):
    """What a traveller meets along a path."""

    points: Array  # (m, 2), map units
    distance: Array  # (m,) length from the start under h, map units
    values: Array  # (m, layers), in the layers' units
    costs: Array  # (m, costs): what the cost layers multiply lengths by, weights left out


class Status(enum.Enum):
    """How a planner ended. An unreachable goal is a result, not an error."""

    SOLVED = "solved"
    NOT_FOUND = "not-found"
    UNREACHABLE = "unreachable"
    INTERRUPTED = "interrupted"

    @property
    def message(self) -> str:
        """What it means and what to do about it."""
        return _MESSAGES[self]


_MESSAGES = {
    Status.SOLVED: "a path was found",
    Status.NOT_FOUND: "no path was found within the limits: the goal may be enclosed, or more "
    "samples, a longer time limit or another step may find one",
    Status.UNREACHABLE: "no path exists: obstacles or no-data enclose the start or the goal",
    Status.INTERRUPTED: "stopped by the user; the path, if any, is the best so far",
}


class History(NamedTuple):
    """How the best cost fell, one entry a chunk of samples."""

    samples: Array  # (k,)
    seconds: Array  # (k,)
    best_cost: Array  # (k,), map units, infinite before the first path


class SearchTree(NamedTuple):
    """The vertices of a tree planner."""

    points: Array  # (n, 2), map units
    parents: np.ndarray[Any, np.dtype[np.int32]]  # (n,), -1 at the start
    costs: Array  # (n,), map units

    @property
    def segments(self) -> Array:
        """(n - 1, 2, 2): each edge from parent to child."""
        children = np.flatnonzero(self.parents >= 0)
        return np.stack([self.points[self.parents[children]], self.points[children]], axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """What a planner found.

    Lengths are in map units. ``length`` is the true length of the path whatever the
    planner optimised; ``cost`` is what the planner itself believed. ``path``, ``length``
    and ``cost`` are None where no path was found, and so is a bound not asked for.
    ``alternatives`` are further paths that the planner found, shortest first. Where the path
    was refined, ``unrefined`` is the planner's own. ``certificate`` proves the lower bound.
    """

    problem: Problem
    planner: str
    status: Status
    path: Path | None
    cost: float | None
    seconds: float
    samples: int = 0
    seed: int | None = None
    stopped_by: str = ""
    lower_bound: float | None = None
    alternatives: tuple[Path, ...] = ()
    unrefined: Path | None = None
    certificate: Any = None
    history: History | None = None
    tree: SearchTree | None = None
    counters: dict[str, int] = field(default_factory=dict)
    legs: tuple[Solution, ...] = ()  # of a tour, from each waypoint to the next
    options: dict[str, Any] = field(default_factory=dict)  # of the planner, as it was run
    corridor: Any = None  # where alone the lower bound holds; None for everywhere

    @property
    def length(self) -> float | None:
        """True length of the path under h, to 1e-9 relative."""
        return None if self.path is None else self.path.length

    @property
    def gap(self) -> float | None:
        """(length - lower_bound) / lower_bound; infinite where nothing above 0 is proven."""
        if self.length is None or self.lower_bound is None:
            return None
        if self.length == self.lower_bound:
            return 0.0
        if self.lower_bound == 0.0:
            return math.inf
        return (self.length - self.lower_bound) / self.lower_bound

    @property
    def stops(self) -> Array:
        """(k, 2): the start and where each leg ends, map units; two points without legs."""
        ends = [leg.problem.goal for leg in self.legs or (self,)]
        return np.array([self.problem.start, *ends])

    @property
    def straight_length(self) -> float:
        """Length on the surface of the straight ways from stop to stop, obstacles or not."""
        return sum(leg.problem.straight_length for leg in self.legs or (self,))

    @property
    def via(self) -> Array:
        """(k, 2): stops of the route between start and goal, map units; none without a route."""
        return self.stops[1:-1] if self.path is not None else np.empty((0, 2))

    @property
    def bounded(self) -> str:
        """What the lower bound speaks of, in words: "no path is shorter"."""
        which = " through these points" if self.legs else ""
        where = "" if self.corridor is None else " in the corridor"
        return f"no path{which}{where} is shorter"

    def __repr__(self) -> str:
        length = "no path" if self.length is None else f"length {self.length:.6f}"
        return (
            f"Solution({self.planner}: {self.status.value}, {length}, "
            f"{self.samples} samples, {self.seconds:.3f} s)"
        )
