"""Every planner and the distance field on one random map, before the judges of ``judges.py``."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import shapely

import judges
import terrapath as tp
from occupancy_grids import OccupancyGrid, random_grid
from rough_maps import RoughMap, pathological_map, random_map
from terrapath.planners.registry import make_finished

KINDS: dict[str, Callable[[int], Any]] = {
    "rough": random_map,
    "grids": random_grid,
    "pathological": pathological_map,
}

# What is run: the planner's name and its options.
PLANNERS: dict[str, tuple[str, dict[str, Any]]] = {
    "optimal": ("optimal", {}),
    "reversed": ("optimal", {}),
    "rrt-star-r": ("rrt-star-r", {}),
    "rrt-star-r refined": ("rrt-star-r", {"refine": True}),
    "rrt-star": ("rrt-star", {}),
    "rrt": ("rrt", {}),
    "dijkstra 8": ("dijkstra", {"neighbours": 8}),
    "dijkstra": ("dijkstra", {}),
    "dijkstra 32 refined": ("dijkstra", {"neighbours": 32, "refine": True}),
    "a-star 8": ("a-star", {"neighbours": 8}),
    "a-star 16 refined": ("a-star", {"refine": True}),
    "a-star 32": ("a-star", {"neighbours": 32}),
    "fast-marching": ("fast-marching", {}),
    "fast-marching refined": ("fast-marching", {"refine": True}),
    "fast-marching bounded": ("fast-marching", {"refine": True, "bound": True}),
    "geodesic-traversal": ("geodesic-traversal", {}),
}
ALWAYS = ("optimal", "reversed", "rrt-star-r")
MAY_FAIL = ("rrt", "geodesic-traversal")
# Their cost is that of their edges, which is to be near the truth.
BELIEVERS = ("rrt-star-r", "dijkstra 8", "dijkstra", "a-star 8", "a-star 32")
FIELD, STRAIGHT = "field", "the straight line"
# The field of the same map under a larger weight.
STEEP_FIELD, STEEPER = "steep field", 10.0
FIELDS = (FIELD, STEEP_FIELD)

FIELD_PATHS = 12  # places that a field's path is asked to
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


def plan(trial: Trial, problem: tp.Problem, who: str) -> Any:
    """A planner's solution, its time judged; None where it raised."""
    name, options = PLANNERS[who]
    planner = make_finished(name, **options)
    started, worked = time.perf_counter(), time.process_time()
    solution = trial.attempt(who, lambda: planner.solve(problem, time_limit=trial.limit))
    # On a busy machine the clock goes on while others work, so the lesser of two counts.
    seconds = min(time.perf_counter() - started, time.process_time() - worked)
    trial.figure(f"seconds of {who}", seconds)
    if seconds > trial.limit + 1.0:
        trial.fault("time", who, f"{seconds:.1f} s under a limit of {trial.limit:g} s")
    return solution


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
    if math.isfinite(there) and "rrt-star-r" in answers:
        trial.figure("rrt-star-r / optimal", answers["rrt-star-r"].value / there)


def straight_value(scene: Scene, united: shapely.Geometry) -> float:
    """Value of the straight line, infinite where it is not free."""
    start, goal = scene.ends("optimal")
    gap = judges.CLEARANCE * scene.ground.cell.min()
    if not judges.are_clear(united, start[None], goal[None], gap)[0]:
        return math.inf
    return judges.value_of(scene.ground, np.array([start, goal]))


# The distance field


def judge_field(trial: Trial, scene: Scene, reached: judges.Reach, who: str = FIELD) -> float:
    """The field from the start; returns the value of its path to the goal."""
    problem = scene.problem
    made = trial.attempt(
        who,
        lambda: tp.distance_field(
            problem.surface,
            problem.start,
            bounds=problem.bounds,
            obstacles=problem.obstacles,
            max_slope=problem.max_slope,
        ),
    )
    if made is None:
        return math.inf
    judge_values(trial, scene, made, who)
    known = np.flatnonzero(np.isfinite(reached.distances))
    at = trial.attempt(who, lambda: made.at(reached.points[known]))
    if at is None:
        return math.inf
    missing = ~np.isfinite(at)
    if missing.any():
        worst = reached.points[known[missing]][0]
        trial.fault("field-infinite", who, f"{missing.sum()} of {len(at)} places, as {worst}")
    far = np.isfinite(at) & (reached.distances[known] > 0.0)
    if far.any():
        trial.figure(f"{who} / graph", (at[far] / reached.distances[known][far]).max())
    picked = np.random.default_rng(0).choice(known, min(FIELD_PATHS, len(known)), replace=False)
    for place in reached.points[picked]:
        judge_field_path(trial, scene, made, place, who)
    return judge_field_path(trial, scene, made, np.array(problem.goal), who)


def judge_values(trial: Trial, scene: Scene, made: Any, who: str = FIELD) -> None:
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


def judge_field_path(
    trial: Trial, scene: Scene, made: Any, place: np.ndarray, who: str = FIELD
) -> float:
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


# Whole maps


def chosen(seed: int, asked: Iterable[str], extra: int) -> list[str]:
    """The planners of a trial: those asked for, or the main ones and a few others in turn."""
    if asked := list(asked):
        return [who for who in (*FIELDS, *PLANNERS) if who in asked]
    others = [who for who in PLANNERS if who not in ALWAYS]
    # Geodesic traversal is slow, and may fail.
    shares = np.array([0.3 if who in MAY_FAIL else 1.0 for who in others])
    random = np.random.default_rng([14, 3, seed])
    picked = random.choice(others, extra, replace=False, p=shares / shares.sum())
    fields = FIELDS if seed % 4 == 0 else FIELDS[:1]
    return [*fields, *ALWAYS, *picked]


def solve_all(trial: Trial, scene: Scene, planners: list[str]) -> dict[str, Answer]:
    answers = {}
    for who in planners:
        if who in FIELDS:
            continue
        start, goal = (tuple(end) for end in scene.ends(who))
        solution = plan(trial, scene.problem.between(start, goal), who)
        if solution is not None:
            answers[who] = judge_solution(trial, scene, who, solution)
    return answers


def scene_of(made: RoughMap, problem: tp.Problem) -> tuple[Scene, judges.Reach, shapely.Geometry]:
    """A map as the judges see it, what their own search reaches, and all walls as one."""
    walls, ground = made.walls(problem.constraints.steep), made.own_ground(problem.surface)
    united = judges.united(walls)
    reached = judges.reach(ground, united, made.start, made.goal)
    is_plane = made.ground == "plane" and made.cost is None
    return Scene(problem, ground, walls, reached.found, is_plane), reached, united


def try_map(made: RoughMap, trial: Trial, planners: list[str]) -> None:
    problem = trial.attempt("problem", made.problem)
    if problem is None:
        return
    trial.tell("the judges' own search")
    scene, reached, united = scene_of(made, problem)
    finer = judges.reach(scene.ground, united, made.start, made.goal, 16)
    others = {STRAIGHT: straight_value(scene, united)}
    if finer.found:
        others["the judges' graph"] = judges.value_of(scene.ground, finer.path())
    if FIELD in planners:
        others["the field's path"] = judge_field(trial, scene, reached)
    if STEEP_FIELD in planners:
        steeper = replace(made, weight=STEEPER * made.weight)
        judge_field(trial, *scene_of(steeper, steeper.problem())[:2], STEEP_FIELD)
    answers = solve_all(trial, scene, planners)
    compare(trial, answers, others)
    if scene.is_plane:
        judge_plane(trial, answers, others[STRAIGHT])


def judge_plane(trial: Trial, answers: dict[str, Answer], straight: float) -> None:
    """On a plane the straight line is the shortest path, where it is free."""
    if math.isinf(straight):
        return
    for who in ("optimal", "reversed"):
        if who in answers and straight * (1.0 + BEATEN) < answers[who].value < math.inf:
            trial.fault("not-exact", who, f"{answers[who].value:.10g}, straight {straight:.10g}")


def try_grid(made: OccupancyGrid, trial: Trial, planners: list[str]) -> None:
    problem = trial.attempt("problem", made.problem)
    if problem is None:
        return
    trial.tell("the judges' visibility graph")
    exact = judges.exact_length(made.blocked, made.start, made.goal, made.cell)
    x, y = made.centres
    scene = Scene(
        problem,
        judges.Ground(x, y, np.zeros(made.blocked.shape)),
        list(made.boxes),
        math.isfinite(exact),
    )
    answers = solve_all(trial, scene, planners)
    compare(trial, answers, {})
    for who, answer in answers.items():
        judge_exactness(trial, who, answer, exact)


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


def try_seed(
    kind: str,
    seed: int,
    *,
    planners: Iterable[str] = (),
    extra: int = 3,
    limit: float = 10.0,
    tell: Callable[[str], object] = lambda stage: None,
) -> tuple[str, list[Fault], dict[str, float]]:
    """The map of a kind and a seed in words, its faults and its figures."""
    tell("making the map")
    made = KINDS[kind](seed)
    trial = Trial(limit, tell, may_refuse=kind == "pathological")
    judge = try_grid if kind == "grids" else try_map
    judge(made, trial, chosen(seed, planners, extra))
    return str(made), trial.faults, trial.figures


def compile_all() -> None:
    """Run everything once, so that no planner's time is spent on compiling later."""
    for kind, seed in (("rough", 1), ("rough", 3), ("grids", 1), ("grids", 5)):
        try_seed(kind, seed, planners=[*FIELDS, *PLANNERS], limit=1.0)
