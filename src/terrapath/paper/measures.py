"""What trials measure: paths of tree planners, fans of geodesics, and how their ends move."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..geodesics.rays import Geodesic, Ray, trace_ray
from ..planners import GeodesicTraversal, RRTStar
from ..problem import Problem, Status
from .trials import Trial

# The angle between two neighbouring rays that show how fast rays move apart, radians.
PAIR_ANGLE = math.radians(0.1)


@dataclass(frozen=True)
class PlannedPath:
    """A path that a tree planner found. Lengths are in map units."""

    length: float  # true length under h
    cost: float  # the planner's own measure of it
    points: tuple[tuple[float, float], ...]  # map units, from start to goal


@dataclass(frozen=True)
class PathTrial(Trial[PlannedPath]):
    """A run of a tree planner. The seed is one of the planner's options."""

    planner: RRTStar

    def measure(self) -> PlannedPath:
        """Plan. After Ctrl-C the planner returns its best path so far; here it is raised again."""
        solution = self.planner.solve(self.problem)
        if solution.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if solution.path is None or solution.length is None or solution.cost is None:
            raise InputError(f"{self.planner} found no path on {self.scene}; give it more samples")
        points = tuple((float(x), float(y)) for x, y in solution.path.points)
        return PlannedPath(solution.length, solution.cost, points)


@dataclass(frozen=True)
class ExactGeodesic:
    """A geodesic that ends at the goal."""

    angle: float  # of its first step on the plane, radians
    length: float  # map units
    jacobi_at_goal: float  # movement of its end, map units per radian
    conjugate_points: tuple[float, ...]  # arc lengths, map units


@dataclass(frozen=True)
class FanSummary:
    """The result of a traversal of geodesics."""

    near: int  # rays that come within the radius of the goal
    paper_length: float | None  # what the paper's method gives, map units
    geodesics: tuple[ExactGeodesic, ...]  # shortest first

    @property
    def true_length(self) -> float:
        """Length of the shortest geodesic to the goal, map units."""
        return self.geodesics[0].length


def _exact(geodesic: Geodesic) -> ExactGeodesic:
    conjugate = tuple(float(s) for s in geodesic.conjugate_points)
    return ExactGeodesic(
        float(geodesic.angle), float(geodesic.length), float(geodesic.jacobi_at_goal), conjugate
    )


@dataclass(frozen=True)
class FanTrial(Trial[FanSummary]):
    """A traversal of geodesics."""

    planner: GeodesicTraversal

    def measure(self) -> FanSummary:
        """Trace the fan, and find all geodesics that end at the goal."""
        fan = self.planner.fan(self.problem)
        if not fan.geodesics:
            raise InputError(
                f"{self.planner} found no geodesic to the goal of {self.scene}; "
                "give more directions"
            )
        length = None if fan.paper_length is None else float(fan.paper_length)
        return FanSummary(int(fan.near.sum()), length, tuple(map(_exact, fan.geodesics)))


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Rays of one length in many directions; they may leave the region."""

    directions: int
    length: float  # map units
    sector: tuple[float, float] = (0.0, 0.5 * math.pi)  # radians, the paper's

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return "sweep"

    def _ray(self, problem: Problem, angle: float) -> Ray:
        return trace_ray(problem.surface, problem.start, angle, self.length)

    def rays(self, problem: Problem) -> list[Ray]:
        """The rays, in the order of their directions."""
        angles = np.linspace(*self.sector, self.directions)
        return [self._ray(problem, float(angle)) for angle in angles]

    def around(self, problem: Problem, angle: float) -> list[Ray]:
        """Two rays close to a direction, one on either side."""
        return [self._ray(problem, angle + side * PAIR_ANGLE) for side in (-0.5, 0.5)]


@dataclass(frozen=True)
class SweepSummary:
    """How far the end of a ray moves with its direction; one entry for each ray."""

    angles: tuple[float, ...]  # radians
    movement: tuple[float, ...]  # map units per radian


@dataclass(frozen=True)
class SweepTrial(Trial[SweepSummary]):
    """How far the ends of rays move with their directions, from the Jacobi field."""

    planner: Sweep

    def measure(self) -> SweepSummary:
        """Trace the rays."""
        rays = self.planner.rays(self.problem)
        movement = tuple(abs(float(ray.jacobi[-1])) for ray in rays)
        return SweepSummary(tuple(ray.angle for ray in rays), movement)
