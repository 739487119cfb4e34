"""The paper's ground truth: a fan of geodesics, and those that end exactly at the goal."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._support.watching import MustStop
from ..errors import GroundWarning, InputError, tell
from ..geodesics.rays import (
    TOLERANCE,
    Geodesic,
    Miss,
    Ray,
    closest_approach,
    hit,
    is_bracket,
    trace_ray,
)
from ..problem import Path, Problem, Solution, Status
from ..surface.metric import is_rough
from ..validation import Array, as_point, require_count, require_positive
from .base import (
    TAKES_TRAVEL,
    Callback,
    Progress,
    Stopper,
    answer_without_search,
    least_limit,
    require_metric,
)

# Rays that pass the goal within this share of the region's side are near it: 0.5 in the paper's
# region of 12 x 12.
NEAR_SHARE = 1.0 / 24.0

# Rays are as long as this many times the straight line on the surface. The shortest geodesic is no
# longer than that line; the rest is a margin.
LONGEST_SHARE = 1.05

# A ray's steps are at most the region's side over this, so that no close approach is missed.
STEPS_PER_SIDE = 40.0


@dataclass(frozen=True, eq=False)
class Fan:
    """All rays of a traversal, and what they found.

    misses : where each ray comes closest to the goal. radius : rays that come within it are near
    the goal, map units. geodesics : those found that end exactly at the goal, shortest first.
    interrupted : by Ctrl-C, before all rays were traced.
    """

    rays: tuple[Ray, ...]
    misses: tuple[Miss, ...]
    radius: float
    geodesics: tuple[Geodesic, ...]
    interrupted: bool = False

    @property
    def angles(self) -> Array:
        """(n,), radians."""
        return np.array([ray.angle for ray in self.rays])

    @property
    def closest(self) -> Array:
        """(n,), planar distance of each ray's closest approach, map units."""
        return np.array([miss.distance for miss in self.misses])

    @property
    def near(self) -> npt.NDArray[np.bool_]:
        """(n,), which rays come within the radius."""
        return np.asarray(self.closest <= self.radius)

    @property
    def paper_ray(self) -> int | None:
        """The shortest ray of those that pass near the goal: the paper's answer."""
        lengths = np.array([miss.arc_length for miss in self.misses])
        if not np.any(self.near):
            return None
        return int(np.argmin(np.where(self.near, lengths, np.inf)))

    @property
    def paper_length(self) -> float | None:
        """The length of that ray, up to where it is closest to the goal, map units."""
        return None if self.paper_ray is None else self.misses[self.paper_ray].arc_length


@dataclass(frozen=True, kw_only=True)
class GeodesicTraversal:
    """Rays in many directions, as the paper does, and from them the exact geodesics to the goal.

    directions : how many rays. sector : (first, last) angle, radians; by default 45 degrees to
    either side of the goal, [0, pi/2] in the paper. radius : rays that come within it are near
    the goal, map units; by default a 24th of the region's side, 0.5 in the paper. tolerance :
    the largest error of the integrator in each step. time_limit : seconds.

    Where two neighbouring rays pass the goal on different sides, the geodesic between them that
    ends at the goal is solved for. Obstacles are not avoided: a geodesic that touches one is
    left out. Among obstacles and on rough ground a GroundWarning says that routes may be missed.
    Source: paper, section 5; appendix 6.1.
    """

    directions: int = 600
    sector: tuple[float, float] | None = None
    radius: float | None = None
    tolerance: float = TOLERANCE
    time_limit: float | None = None

    def __post_init__(self) -> None:
        require_count(directions=self.directions)
        if self.directions < 2:
            raise InputError(f"directions={self.directions} must be at least 2")
        require_positive(tolerance=self.tolerance)
        optional = {"radius": self.radius, "time_limit": self.time_limit}
        require_positive(**{name: value for name, value in optional.items() if value is not None})
        if self.sector is not None:
            first, last = as_point(self.sector, "sector")
            if first >= last:
                raise InputError(
                    f"sector={self.sector} must be two angles, the smaller first, radians"
                )

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "geodesic-traversal"

    def _angles(self, problem: Problem) -> Array:
        (x0, y0), (x1, y1) = problem.start, problem.goal
        towards = math.atan2(y1 - y0, x1 - x0)
        first, last = self.sector or (towards - 0.25 * math.pi, towards + 0.25 * math.pi)
        return np.linspace(first, last, self.directions)

    def _radius(self, problem: Problem) -> float:
        return self.radius or NEAR_SHARE * problem.bounds.side

    def _trace(self, problem: Problem, angle: float) -> Ray:
        return trace_ray(
            problem.surface,
            problem.start,
            angle,
            LONGEST_SHARE * problem.straight_length,
            bounds=problem.bounds,
            # Steps are lengths under h, which counts the cost.
            longest_step=problem.surface.typical_cost * problem.bounds.side / STEPS_PER_SIDE,
            tolerance=self.tolerance,
        )

    def _require_smooth(self, problem: Problem) -> None:
        """Raise InputError where costs leap from cell to cell: no geodesic crosses a leap."""
        cells = [layer.name for layer in problem.surface.costs if layer.kind == "cells"]
        if cells:
            raise InputError(
                f"planner={self.name} follows rays over smooth ground, and the cost "
                f"{', '.join(cells)} is constant in cells; read it with smooth_costs "
                "(--smooth-costs), or choose optimal"
            )

    def fan(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Fan:
        """Trace all rays, and find the geodesic between two of them as soon as both are there.

        A callback that returns True, the time limit (seconds) and Ctrl-C leave the fan with
        what it has. Raises InputError where costs are constant in cells.
        """
        self._require_smooth(problem)
        stopper = Stopper(callback, least_limit(self.time_limit, time_limit))
        misses: list[Miss] = []
        found: list[Geodesic] = []
        interrupted = False
        try:
            for angle in self._angles(problem):
                misses.append(closest_approach(self._trace(problem, float(angle)), problem.goal))
                found += self._hits(problem, misses[-2:], stopper.is_late)
                best = min((geodesic.length for geodesic in found), default=math.inf)
                seconds = stopper.seconds
                if stopper.must_stop(Progress(len(misses), self.directions, seconds, best)):
                    break
        except KeyboardInterrupt:
            interrupted = True
        rays = tuple(miss.ray for miss in misses)
        return Fan(rays, tuple(misses), self._radius(problem), _distinct(found), interrupted)

    def _hits(
        self, problem: Problem, neighbours: Sequence[Miss], must_stop: MustStop
    ) -> list[Geodesic]:
        """The geodesic in free space between two rays that pass the goal on two sides, if any."""
        if len(neighbours) < 2 or not is_bracket(*neighbours):
            return []
        geodesic = hit(
            problem.surface,
            problem.start,
            problem.goal,
            (neighbours[0], neighbours[1]),
            bounds=problem.bounds,
            tolerance=self.tolerance,
            must_stop=must_stop,
        )
        return [geodesic] if geodesic is not None and _is_free(problem, geodesic) else []

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """The shortest geodesic of the fan, its path sampled; ``cost`` is its exact length.

        ``callback`` sees the progress and stops the planner by returning True. time_limit :
        seconds for this call.
        """
        require_metric(
            problem, "geodesic-traversal", f"its rays are geodesics of h; {TAKES_TRAVEL}"
        )
        answer = answer_without_search(problem, self.name)
        if answer is not None:
            return answer
        _tell_doubts(problem)
        started = time.perf_counter()
        fan = self.fan(problem, callback=callback, time_limit=time_limit)
        paths = tuple(_path(problem, geodesic) for geodesic in fan.geodesics)
        status = Status.SOLVED if paths else Status.NOT_FOUND
        return Solution(
            problem=problem,
            planner=self.name,
            status=Status.INTERRUPTED if fan.interrupted else status,
            path=paths[0] if paths else None,
            cost=fan.geodesics[0].length if paths else None,
            seconds=time.perf_counter() - started,
            samples=len(fan.rays),
            stopped_by=_explain(fan),
            alternatives=paths[1:],
        )


def _tell_doubts(problem: Problem) -> None:
    """Warn where a fan of rays may miss the shortest path."""
    doubts = []
    if problem.free_space.has_obstacles:
        doubts.append("no ray goes round an obstacle")
    if is_rough(problem.surface, problem.bounds):
        doubts.append("on rough ground rays miss routes")
    if doubts:
        tell(
            GroundWarning(
                f"geodesic-traversal may miss the shortest path here, because "
                f"{' and '.join(doubts)}; optimal looks farther"
            )
        )


def _is_free(problem: Problem, geodesic: Geodesic) -> bool:
    points = geodesic.points
    return bool(problem.free_space.segments_are_free(points[:-1], points[1:]).all())


def _path(problem: Problem, geodesic: Geodesic) -> Path:
    """The geodesic's points, its ends exactly the problem's."""
    points = geodesic.points.copy()
    points[0], points[-1] = problem.start, problem.goal
    return problem.path(points)


def _distinct(geodesics: list[Geodesic]) -> tuple[Geodesic, ...]:
    """Shortest first, without those that were found twice."""
    kept: list[Geodesic] = []
    for geodesic in sorted(geodesics, key=lambda g: g.length):
        if all(abs(geodesic.angle - other.angle) > 1e-9 for other in kept):
            kept.append(geodesic)
    return tuple(kept)


def _explain(fan: Fan) -> str:
    """What the fan found, or how near its rays came, in words."""
    if fan.geodesics:
        return f"{len(fan.rays)} rays, {len(fan.geodesics)} geodesics"
    if not fan.rays:
        return "no ray was traced"
    k = int(np.argmin(fan.closest))
    return (
        f"no ray hits the goal; the closest of {len(fan.rays)} passes it at "
        f"{fan.closest[k]:.4g} (angle {fan.angles[k]:.4f} rad)"
    )
