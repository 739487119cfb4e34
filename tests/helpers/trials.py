"""Every planner and the distance field on one random map, before the judges of ``judges.py``."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

import judges
import terrapath as tp
from occupancy_grids import OccupancyGrid, random_grid
from rough_maps import RoughMap, pathological_map, random_map
from terrapath.planners.registry import make_finished
from verdicts import (
    ALWAYS,
    MAY_FAIL,
    STRAIGHT,
    Answer,
    Fault,
    Scene,
    Trial,
    compare,
    judge_exactness,
    judge_field_path,
    judge_plane,
    judge_solution,
    judge_values,
)

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
FIELD = "field"
# The field of the same map under a larger weight.
STEEP_FIELD, STEEPER = "steep field", 10.0
FIELDS = (FIELD, STEEP_FIELD)
FIELD_PATHS = 12  # places that a field's path is asked to


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
