"""What holds of any answer: of a planner's path, of all paths together, of a distance field.

Nothing here calls the package. What is wrong becomes a ``Fault`` of a ``Trial``.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import shapely

import judges
import terrapath as tp

# What is compared with all others.
ALWAYS = ("optimal", "reversed", "rrt-star-r")
MAY_FAIL = ("rrt", "geodesic-traversal")
# Their cost is that of their edges, which is to be near the truth.
BELIEVERS = ("rrt-star-r", "dijkstra 8", "dijkstra", "a-star 8", "a-star 32")
STRAIGHT = "the straight line"
BEATEN = 1e-6
BELIEF = 1e-3
SAME = 1e-9


class Fault(NamedTuple):
    """What is wrong, in a word, and the numbers."""

    what: str
    who: str
    details: str


class Answer(NamedTuple):
    """A planner's answer, and its path's value by the judges; infinite without a path.

    is_free : does the path touch nothing? Others need not be as short as one that does.
    """

    solution: Any
    value: float
    is_free: bool = True

    @property
    def cut(self) -> str:
        """A note where the time limit ended the search."""
        return ", cut short" if "time" in self.solution.stopped_by else ""


@dataclass
class Trial:
    """One map under judgement. tell : is told which stage begins. limit : seconds a planner has."""

    limit: float = 10.0
    tell: Callable[[str], object] = lambda stage: None
    may_refuse: bool = False  # a clear line is a right answer
    faults: list[Fault] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)

    def fault(self, what: str, who: str, details: object) -> None:
        self.faults.append(Fault(what, who, str(details)))

    def figure(self, name: str, value: float) -> None:
        self.figures[name] = float(value)

    def attempt(self, who: str, call: Callable[[], Any]) -> Any:
        """What a call returns; None where it raises, which is noted."""
        self.tell(who)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return call()
        except tp.TerrapathError as error:
            clear = self.may_refuse and "\n" not in str(error)
            if clear:
                self.figure(f"{who} refuses", 1.0)
            else:
                self.fault("refused", who, f"{error!s:.150}")
        except MemoryError as error:
            self.fault("memory", who, f"{error!s:.150}")
        except Exception as error:
            self.fault("crash", who, f"{type(error).__name__}: {error!s:.150}")
        return None


@dataclass(frozen=True)
class Scene:
    """What the judges know of a map.

    walls : closed parts. exists : does a path surely exist? is_plane : one without costs.
    """

    problem: tp.Problem
    ground: judges.Ground
    walls: list[shapely.Geometry]
    exists: bool
    is_plane: bool = False

    def ends(self, who: str) -> tuple[np.ndarray, np.ndarray]:
        start, goal = np.array(self.problem.start), np.array(self.problem.goal)
        return (goal, start) if who == "reversed" else (start, goal)


# Paths


def judge_solution(trial: Trial, scene: Scene, who: str, solution: Any) -> Answer:
    """What holds of any planner's answer."""
    if solution.path is None:
        missing = "unreachable" if solution.status is tp.Status.UNREACHABLE else "not-found"
        if scene.exists and (missing == "unreachable" or who not in MAY_FAIL):
            trial.fault(missing, who, f"a path exists; {solution.stopped_by}")
        return Answer(solution, math.inf)
    trial.tell(f"judging {who}")
    value, is_free = judge_path(trial, scene, who, solution.path.points)
    believed = getattr(solution, "value", solution.length)
    if math.isinf(value):
        return Answer(solution, value, False)
    if not math.isclose(believed, value, rel_tol=1e-6):
        trial.fault("value", who, f"says {believed:.10g}, quadrature {value:.10g}")
    if who in BELIEVERS and value > 0.0:
        error = solution.cost / value - 1.0
        trial.figure(f"error of the cost of {who}", error)
        if abs(error) > BELIEF:
            trial.fault("cost", who, f"believes {solution.cost:.6g}, quadrature {value:.6g}")
    return Answer(solution, value, is_free)


def judge_path(trial: Trial, scene: Scene, who: str, points: np.ndarray) -> tuple[float, bool]:
    """What holds of any path from the start to the goal; its value, and does it touch nothing?"""
    start, goal = scene.ends(who)
    if not (
        np.isfinite(points).all() and (points[0] == start).all() and (points[-1] == goal).all()
    ):
        trial.fault("ends", who, f"from {points[0]} to {points[-1]}")
        return math.inf, False
    x0, y0, x1, y1 = scene.problem.bounds
    if (points < (x0, y0)).any() or (points > (x1, y1)).any():
        trial.fault("outside", who, "the path leaves the bounds")
        return math.inf, False
    if (depth := judges.touches(scene.walls, points)) is not None:
        trial.fault("touches", who, f"{depth:.3g} of its path within obstacles")
    value = judges.value_of(scene.ground, points)
    straight = float(judges.chord(scene.ground, start, goal)[0])
    if value < straight * (1.0 - SAME):
        trial.fault("below-chord", who, f"{value:.10g} < {straight:.10g}")
    return value, depth is None


def compare(trial: Trial, answers: dict[str, Answer], others: dict[str, float]) -> None:
    """All answers with one another. others : values of further paths, by their names."""
    values = {who: answer.value for who, answer in answers.items() if answer.is_free} | others
    best = min(values, key=values.__getitem__, default=None)
    if best is None or not math.isfinite(values[best]):
        return
    for who, answer in answers.items():
        bound = answer.solution.lower_bound
        if bound is not None and bound > values[best] * (1.0 + SAME):
            trial.fault("bound", who, f"{bound:.10g} > {values[best]:.10g} by {best}")
    compare_optimal(trial, answers, best, values[best])
    straight, default = others.get(STRAIGHT, math.inf), values.get("rrt-star-r", math.inf)
    if straight * (1.0 + BEATEN) < default < math.inf:
        trial.fault("beaten", "rrt-star-r", f"{default:.10g}, {STRAIGHT} {straight:.10g}")


def compare_optimal(trial: Trial, answers: dict[str, Answer], best: str, least: float) -> None:
    """``optimal`` against the best path of all, and its own way back."""
    for who in ("optimal", "reversed"):
        if who not in answers:
            continue
        answer = answers[who]
        why = f"{least:.10g} by {best}; stopped by {answer.solution.stopped_by!r}"
        # A run that found nothing is a fault already, and so is one whose route touches.
        if math.isfinite(answer.value) and answer.value > least * (1.0 + BEATEN):
            trial.fault(f"beaten{answer.cut}", who, f"{answer.value / least - 1:.2e}, {why}")
    there, back = (answers[who].value if who in answers else math.inf for who in ALWAYS[:2])
    if math.isfinite(there + back) and not math.isclose(there, back, rel_tol=SAME):
        cut = answers["optimal"].cut or answers["reversed"].cut
        trial.fault(f"reversal{cut}", "optimal", f"{there:.10g}, back {back / there - 1:+.1e}")
    if 0.0 < there < math.inf and "rrt-star-r" in answers:
        trial.figure("rrt-star-r / optimal", answers["rrt-star-r"].value / there)


def judge_plane(trial: Trial, answers: dict[str, Answer], straight: float) -> None:
    """On a plane the straight line is the shortest path, where it is free."""
    if math.isinf(straight):
        return
    for who in ("optimal", "reversed"):
        if who in answers and straight * (1.0 + BEATEN) < answers[who].value < math.inf:
            trial.fault("not-exact", who, f"{answers[who].value:.10g}, straight {straight:.10g}")


def judge_exactness(trial: Trial, who: str, answer: Answer, exact: float) -> None:
    """No path is shorter than the exact one, ``optimal`` is as short, and no bound is above it."""
    bound = answer.solution.lower_bound
    if bound is not None and bound > exact * (1.0 + SAME):
        trial.fault("bound", who, f"lower bound {bound:.10g} > exact {exact:.10g}")
    if math.isinf(answer.value):
        return
    if answer.value < exact * (1.0 - SAME):
        trial.fault("below-exact", who, f"{answer.value:.10g} < {exact:.10g}")
    if who in {"optimal", "reversed"} and answer.value > exact * (1.0 + BEATEN):
        reason = answer.solution.stopped_by
        details = f"{answer.value / exact - 1:.2e} above {exact:.10g}; stopped by {reason!r}"
        trial.fault(f"not-exact{answer.cut}", who, details)
    trial.figure(f"{who} / exact", answer.value / exact if exact > 0.0 else 1.0)


# Distance fields


def judge_values(trial: Trial, scene: Scene, made: Any, who: str) -> None:
    """Values of the field at its own nodes: not negative, not below the chord."""
    nodes = made.lattice.points.reshape(-1, 2)
    values = made.values.ravel()
    if np.isnan(values).any() or (values < 0.0).any():
        trial.fault("field-negative", who, f"{(~(values >= 0.0)).sum()} nodes, {values.min():g}")
    start = np.broadcast_to(scene.problem.start, nodes.shape)
    straight = judges.chord(scene.ground, start, nodes)
    shares = values / np.maximum(straight, 1e-300)
    low = (shares < 0.999) & (straight > 1e-9 * straight.max())
    trial.figure(f"{who} / chord", shares[straight > 0.0].min())
    if scene.is_plane and not scene.walls:
        # Near the source, along a level line, the chord is shorter than the scheme can tell.
        trial.figure(f"{who} / chord on an open plane, 95 %", np.quantile(shares, 0.95))
    if low.any():
        worst = int(np.argmin(np.where(low, shares, np.inf)))
        details = f"{low.mean():.2%} of nodes, {shares[worst]:.4f} of the chord at {nodes[worst]}"
        trial.fault("field-below-chord", who, details)


def judge_field_path(trial: Trial, scene: Scene, made: Any, place: np.ndarray, who: str) -> float:
    """The field's path to a place: there where the field is finite, and as long as it says."""
    at = trial.attempt(who, lambda: float(made.at(place[None])[0]))
    path = trial.attempt(f"{who} path", lambda: made.path_to(place))
    if path is None:
        if at is not None and math.isfinite(at):
            trial.fault("field-path", who, f"no path to {place}, though the field says {at:.6g}")
        return math.inf
    points = path.points
    ends = np.array([points[0], points[-1]])
    if not np.array_equal(ends, [scene.problem.start, place]):
        trial.fault("ends", f"{who} path", f"from {points[0]} to {points[-1]}, asked {place}")
        return math.inf
    if (depth := judges.touches(scene.walls, points)) is not None:
        trial.fault("touches", f"{who} path", f"to {place}: {depth:.3g} within obstacles")
        return math.inf
    value = judges.value_of(scene.ground, points)
    if at is not None and at > 0.0:
        ratio = value / at
        name = f"{who} path / {who}"
        trial.figure(name, max(trial.figures.get(name, 0.0), ratio))
    return value
