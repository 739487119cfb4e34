"""A route as it is written: with as many points as the map has detail."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...problem import Path, Solution
from ...problem.path import Indices
from ...problem.simplification import cell_size, default_tolerance, simplified
from ...surface.georeference import amount
from ...validation import Array, require_not_negative


def of_model(solution: Solution) -> str:
    """Which travel model the value is of, in words; empty without one."""
    travel = solution.problem.travel
    return "" if travel is None else f" by {travel!r}"


@dataclass(frozen=True, eq=False)
class Route:
    """A solution's path, and which samples of its profile are written.

    tolerance : the farthest that the path is from the lines between the points written, map
    units, heights at their true scale. 0 where all samples are written.
    """

    solution: Solution
    path: Path
    tolerance: float
    samples: Indices

    @classmethod
    def of(
        cls, solution: Solution, tolerance: float | None = None, *, dense: bool = False
    ) -> Route:
        """The route of a solution that has a path.

        tolerance : by default a tenth of a cell. dense : points are at most a cell apart.
        """
        assert solution.path is not None
        problem, path = solution.problem, solution.path
        if tolerance is None:
            tolerance = default_tolerance(problem)
        require_not_negative(simplify=tolerance)
        if tolerance == 0.0:
            return cls(solution, path, 0.0, np.arange(len(path.profile.points)))
        longest = cell_size(problem) if dense else math.inf
        samples = simplified(problem, path, tolerance, solution.stops, longest=longest)
        return cls(solution, path, tolerance, samples)

    @cached_property
    def points(self) -> Array:
        """(m, 2): the points that are written, map units."""
        return np.asarray(self.path.profile.points[self.samples])

    @property
    def stop_names(self) -> list[str]:
        """What the start, the via points and the goal are called."""
        vias = range(1, len(self.solution.via) + 1)
        return ["start", *(f"via {k}" for k in vias), "goal"]

    @property
    def facts(self) -> dict[str, Any]:
        """What was done to the points."""
        return {
            "simplified_to": self.tolerance,
            "points": len(self.samples),
            "points_planned": len(self.path.points),
        }

    @property
    def description(self) -> str:
        """The route in words, for formats that have no columns for numbers."""
        solution, path = self.solution, self.path
        text = (
            f"{amount(path.ground_length, path.ground_unit)} on the ground, "
            f"climb {amount(path.climb, path.ground_unit)}, "
            f"descent {amount(path.descent, path.ground_unit)}, "
            f"steepest grade {100.0 * path.steepest:.3g} %, "
            f"steepest side slope {100.0 * path.steepest_side:.3g} %; "
            f"minimised: {amount(path.value, solution.unit)}{of_model(solution)}"
        )
        if solution.lower_bound is not None:
            bound = amount(solution.lower_bound, solution.unit)
            text += f", {solution.bound_in_words} than {bound}, gap {solution.gap_in_words}"
        if self.tolerance:
            near = amount(self.tolerance, path.surface.unit)
            text += f"; points are within {near} of the route"
        return f"{text}; {solution.planner}, seed {solution.seed}"
