"""OMPL through Python, in a process of its own: ``python -m ... TASK``.

It is what a user of OMPL's Python package would write: the objective is a class in Python that
measures edges by Line-R with NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from terrapath._kernels.surface.surfaces import Peaks, Spline
from terrapath.problem import Problem
from terrapath.validation import Array

from .exchange import discs_of, panel_of
from .problems import load_problem
from .processes import answer
from .timing import Stopwatch

# Boole's weights. The end of a panel is the beginning of the next, so it has both weights there.
WEIGHTS = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0

Gradients = Callable[[Array], Array]  # points (m, 2) -> weighted gradients (m, layers, 2)


def _gradients_of_peaks(surface: Peaks) -> Gradients:
    layers = len(surface.weights)
    amplitude, falloff = surface.peaks[:, 0], surface.peaks[:, 1]
    centres = surface.peaks[:, 2:]
    # (layers, peaks): the weight of a peak's own layer, 0 elsewhere.
    owner = np.repeat(np.arange(layers), np.diff(surface.first))
    shares = np.where(owner == np.arange(layers)[:, None], surface.weights[:, None], 0.0)
    factors = -2.0 * amplitude * falloff

    def gradients(points: Array) -> Array:
        offsets = points[:, None, :] - centres
        sizes = factors * np.exp(-falloff * np.einsum("mpi,mpi->mp", offsets, offsets))
        return np.asarray(np.einsum("lp,mpi->mli", shares, sizes[:, :, None] * offsets))

    return gradients


# The coefficients of the four cubic B-splines on a cell, by powers of the place in it.
_BASIS = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0
_SLOPES = _BASIS[:, 1:] * np.arange(1, 4)


def _gradients_of_spline(surface: Spline) -> Gradients:
    _, rows, columns = surface.coefficients.shape
    window = np.arange(4)

    def basis(place: Array) -> tuple[Array, Array]:
        powers = place[:, None] ** np.arange(4)
        return powers @ _BASIS.T, powers[:, :3] @ _SLOPES.T

    def gradients(points: Array) -> Array:
        s = (points[:, 0] - surface.x0) / surface.dx
        t = (points[:, 1] - surface.y0) / surface.dy
        i = np.clip(np.floor(s), 0, columns - 4).astype(np.int64)
        j = np.clip(np.floor(t), 0, rows - 4).astype(np.int64)
        bx, sx = basis(s - i)
        by, sy = basis(t - j)
        patch = surface.coefficients[
            :, (j[:, None] + window)[:, :, None], (i[:, None] + window)[:, None, :]
        ]
        slopes = np.empty((len(points), len(surface.weights), 2))
        slopes[..., 0] = np.einsum("lmji,mj,mi->ml", patch, by, sx) / surface.dx
        slopes[..., 1] = np.einsum("lmji,mj,mi->ml", patch, sy, bx) / surface.dy
        slopes *= surface.weights[:, None]
        return slopes

    return gradients


def line_r_with_numpy(problem: Problem) -> Callable[[float, float, float, float], float]:
    """Line-R in panels over the segment from (ax, ay) to (bx, by), map units."""
    data = problem.surface.data
    gradients = _gradients_of_peaks(data) if isinstance(data, Peaks) else _gradients_of_spline(data)
    panel = panel_of(problem)

    def length(ax: float, ay: float, bx: float, by: float) -> float:
        v = np.array([bx - ax, by - ay])
        panels = max(math.ceil(math.hypot(*v) / panel), 1)
        places = (np.arange(panels)[:, None] + np.arange(5) / 4.0).ravel() / panels
        slopes = gradients(np.array([ax, ay]) + places[:, None] * v) @ v
        speeds = np.sqrt(v @ v + np.einsum("ml,ml->m", slopes, slopes))
        return float((speeds.reshape(panels, 5) @ WEIGHTS).sum() / panels)

    return length


def _is_free(problem: Problem) -> Callable[[float, float, float, float], bool]:
    discs = [tuple(map(float, disc)) for disc in discs_of(problem)]

    def free(ax: float, ay: float, bx: float, by: float) -> bool:
        dx, dy = bx - ax, by - ay
        squared = dx * dx + dy * dy
        for x, y, radius in discs:
            t = ((x - ax) * dx + (y - ay) * dy) / squared if squared > 0.0 else 0.0
            t = min(max(t, 0.0), 1.0)
            if math.hypot(ax + t * dx - x, ay + t * dy - y) <= radius:
                return False
        return True

    return free


def _make_objective(space: Any, problem: Problem) -> Any:
    from ompl import base

    line_r = line_r_with_numpy(problem)

    class LineRObjective(base.OptimizationObjective):  # type: ignore[misc]
        def stateCost(self, state: Any) -> Any:  # noqa: N802
            return base.Cost(0.0)

        def motionCost(self, a: Any, b: Any) -> Any:  # noqa: N802
            return base.Cost(line_r(a[0], a[1], b[0], b[1]))

        def motionCostHeuristic(self, a: Any, b: Any) -> Any:  # noqa: N802
            return base.Cost(math.hypot(b[0] - a[0], b[1] - a[1]))

    return LineRObjective(space)


def _make_space(problem: Problem) -> Any:
    from ompl import base

    free = _is_free(problem)

    class DiscValidator(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any, last: Any = None) -> bool:  # noqa: N802
            return free(a[0], a[1], b[0], b[1])

    plane = base.RealVectorStateSpace(2)
    bounds, given = base.RealVectorBounds(2), problem.bounds
    for k, (low, high) in enumerate(zip(given[:2], given[2:], strict=True)):
        bounds.setLow(k, low)
        bounds.setHigh(k, high)
    plane.setBounds(bounds)
    space = base.SpaceInformation(plane)
    space.setStateValidityChecker(lambda state: free(state[0], state[1], state[0], state[1]))
    if problem.obstacles:
        space.setMotionValidator(DiscValidator(space))
    space.setup()
    return space


def _make_definition(space: Any, problem: Problem) -> Any:
    from ompl import base

    definition = base.ProblemDefinition(space)
    ends = []
    for point in (problem.start, problem.goal):
        state = space.allocState()
        state[0], state[1] = point
        ends.append(state)
    definition.setStartAndGoalStates(*ends)
    definition.setOptimizationObjective(_make_objective(space, problem))
    return definition


PLANNERS = {
    "rrt-star": "RRTstar",
    "informed-rrt-star": "InformedRRTstar",
    "bit-star": "BITstar",
}


# The bindings give no access to the parameters of planners by name. So here are their names in C++,
# and how to set them in Python.
SETTERS = {
    "range": ("setRange", float),
    "use_k_nearest": ("setKNearest", bool),
    "rewire_factor": ("setRewireFactor", float),
    "samples_per_batch": ("setSamplesPerBatch", int),
}


def _path(definition: Any) -> list[float]:
    states = definition.getSolutionPath().getStates()
    return [float(state[k]) for state in states for k in (0, 1)]


def looks(problem: Problem, task: dict[str, Any]) -> list[dict[str, Any]]:
    """Run the planner and look at its path from time to time, as the program in C++ does."""
    from ompl import base, geometric, util

    util.noOutputHandler()
    util.RNG.setSeed(task["seed"] + 1)
    space = _make_space(problem)
    definition = _make_definition(space, problem)
    objective = definition.getOptimizationObjective()
    planner = getattr(geometric, PLANNERS[task["planner"]])(space)
    for name, value in task["options"]:
        setter, kind = SETTERS[name]
        getattr(planner, setter)(kind(value))
    planner.setProblemDefinition(definition)
    watch = Stopwatch()
    planner.setup()
    found: list[dict[str, Any]] = []
    following, last = min(task["first"], task["last"]), None
    while True:
        left = following - watch.read().wall
        if left > 0.0:
            planner.solve(base.timedPlannerTerminationCondition(left))
        reading, cost, path = watch.read(), None, []
        if definition.hasExactSolution():
            cost = definition.getSolutionPath().cost(objective).value()
            path = [] if cost == last else _path(definition)
            last = cost
        found.append({**reading._asdict(), "cost": cost, "path": path})
        if following >= task["last"]:
            return found
        following = min(following * task["growth"], task["last"])


if __name__ == "__main__":
    answer(lambda **task: {"looks": looks(load_problem(task["scene"]), task)})
