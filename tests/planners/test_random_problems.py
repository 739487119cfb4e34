"""Hundreds of random problems: every path is free, every tree is a tree, by shapely alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, assume, given, settings, strategies as st

import planner_oracles as oracles
import terrapath as tp
from layouts import star

SIDE = 10.0
BOUNDS = (0.0, 0.0, SIDE, SIDE)
SEEDED = 260
DRAWN = 300  # together well over 500


@dataclass(frozen=True)
class Case:
    """A problem as plain data, and how to solve it."""

    layers: tuple  # of peaks
    polygons: tuple
    circles: tuple  # of (x1, x2, radius)
    start: tuple[float, float]
    goal: tuple[float, float]
    on_spline: bool
    planner: str
    options: tuple
    seed: int
    samples: int

    def problem(self):
        """The problem; None where the start or the goal is not free, by shapely."""
        ends = shapely.points([self.start, self.goal])
        if self.polygons and shapely.intersects(ends[:, None], list(self.polygons)).any():
            return None
        for x, y, radius in self.circles:
            if (shapely.distance(ends, shapely.Point(x, y)) <= radius).any():
                return None
        surface = tp.Surface.from_peaks(self.layers)
        if self.on_spline:
            axis = np.linspace(0.0, SIDE, 17)
            grid = np.stack(np.meshgrid(axis, axis), axis=-1)
            surface = tp.Surface.from_grid(np.moveaxis(surface.values(grid), -1, 0), axis, axis)
        circles = [tp.Circle(*circle) for circle in self.circles]
        return tp.Problem(surface, self.start, self.goal, BOUNDS, [*self.polygons, *circles])


# Made by Hypothesis


def numbers(low, high):
    """Numbers to nine digits: nothing on a map is smaller, and shapely's distances underflow."""
    return st.floats(low, high).map(lambda value: round(value, 9))


places = st.tuples(numbers(0.0, SIDE), numbers(0.0, SIDE))
peaks = st.tuples(numbers(-4.0, 6.0), numbers(0.05, 1.0), numbers(0.0, SIDE), numbers(0.0, SIDE))
stars = st.builds(
    star,
    numbers(0.0, SIDE),
    numbers(0.0, SIDE),
    st.lists(numbers(0.05, 2.5), min_size=3, max_size=9),
    numbers(0.0, 6.28),
    st.sampled_from([0.0, 0.0, 0.6]),
).filter(shapely.is_valid)
boxes = st.builds(
    lambda x, y, w, h: shapely.box(x, y, x + w, y + h),
    st.integers(-1, 9),
    st.integers(-1, 9),
    st.integers(1, 4),
    st.integers(1, 4),
)
cases = st.builds(
    Case,
    layers=st.lists(st.lists(peaks, min_size=1, max_size=4), min_size=1, max_size=3).map(tuple),
    polygons=st.lists(stars | boxes, max_size=7).map(tuple),
    circles=st.lists(
        st.tuples(numbers(0.0, SIDE), numbers(0.0, SIDE), numbers(0.05, 1.8)), max_size=3
    ).map(tuple),
    start=places,
    goal=places,
    on_spline=st.sampled_from([False, False, False, True]),
    planner=st.sampled_from(oracles.TREE_PLANNERS),
    options=st.fixed_dictionaries(
        {},
        optional={"step": st.sampled_from([0.4, 1.0, 3.0, 20.0]), "goal_bias": numbers(0.0, 0.5)},
    ).map(lambda options: tuple(options.items())),
    seed=st.integers(0, 2**64),
    samples=st.integers(100, 400),
)


# Made from a seed


def seeded_case(seed):
    random = np.random.default_rng([2026, seed])
    layers = tuple(
        [
            (random.uniform(-4, 6), random.uniform(0.05, 1.0), *random.uniform(0, SIDE, 2))
            for _ in range(random.integers(1, 5))
        ]
        for _ in range(random.integers(1, 4))
    )
    polygons = [
        star(
            *random.uniform(0, SIDE, 2),
            random.uniform(0.2, 1.6, random.integers(3, 12)),
            random.uniform(0, 6.28),
            random.choice([0.0, 0.0, 0.5]),
        )
        for _ in range(random.integers(0, 9))
    ]
    circles = [
        (*random.uniform(0, SIDE, 2), random.uniform(0.1, 1.2))
        for _ in range(random.integers(0, 4))
    ]
    while True:
        case = Case(
            layers=layers,
            polygons=tuple(polygon for polygon in polygons if polygon.is_valid),
            circles=tuple(circles),
            start=tuple(random.uniform(0, SIDE, 2).tolist()),
            goal=tuple(random.uniform(0, SIDE, 2).tolist()),
            on_spline=seed % 5 == 0,
            planner=oracles.TREE_PLANNERS[seed % len(oracles.TREE_PLANNERS)],
            options=(),
            seed=seed,
            samples=int(random.integers(150, 400)),
        )
        if case.problem() is not None:
            return case


# What holds of all


def check_free(case, points, segments):
    """Segments (m, 2, 2) and their points stay in free space, by shapely alone."""
    assert (points >= 0.0).all()
    assert (points <= SIDE).all()
    lines = shapely.linestrings(segments)
    for polygon in case.polygons:
        shapely.prepare(polygon)
        assert shapely.disjoint(polygon, lines).all()
    for x, y, radius in case.circles:
        assert (shapely.distance(shapely.Point(x, y), lines) > radius).all()


def check_tree(case, problem, solution):
    tree = solution.tree
    size = len(tree.points)
    children = np.arange(1, size)
    assert tree.parents[0] == -1
    assert tree.costs[0] == 0.0
    np.testing.assert_array_equal(tree.points[0], case.start)
    assert ((tree.parents[1:] >= 0) & (tree.parents[1:] < size)).all()
    # Every vertex comes to the root: jump to the parent's parent, log2(size) times.
    ancestors = np.concatenate([[0], tree.parents[1:]])
    for _ in range(size.bit_length()):
        ancestors = ancestors[ancestors]
    assert (ancestors == 0).all()
    if size == 1:
        return
    parents = tree.parents[children]
    edges = tree.costs[children] - tree.costs[parents]
    chords = tp.chord(problem.surface, tree.points[parents], tree.points[children])
    rounding = 1e-12 * tree.costs.max()
    assert (edges >= chords - rounding).all()
    if case.planner == "rrt-star":
        np.testing.assert_allclose(edges, chords, rtol=1e-9, atol=rounding)
    if case.planner == "rrt-star-r":
        line_r = tp.line_r(problem.surface, tree.points[parents], tree.points[children])
        np.testing.assert_allclose(edges, np.maximum(chords, line_r), rtol=1e-9, atol=rounding)
    check_free(case, tree.points, tree.segments)


def check_path(case, problem, solution):
    points = solution.path.points
    np.testing.assert_array_equal(points[0], case.start)
    np.testing.assert_array_equal(points[-1], case.goal)
    check_free(case, points, np.stack([points[:-1], points[1:]], axis=1))
    line = shapely.LineString(points)
    assert all(line.disjoint(polygon) for polygon in case.polygons)
    straight = float(tp.chord(problem.surface, case.start, case.goal))
    assert solution.cost >= straight * (1.0 - 1e-12)
    assert solution.length >= straight * (1.0 - 1e-12)
    assert solution.length == pytest.approx(tp.curve_length(problem.surface, points), rel=1e-9)
    if case.planner == "rrt-star":
        assert solution.cost <= solution.length * (1.0 + 1e-12)
    if not case.on_spline and case.seed % 8 == 0:
        expected = oracles.polyline_length(case.layers, points)
        assert solution.length == pytest.approx(expected, rel=1e-9)


def check_separated(case):
    """Start and goal lie in different parts of what the obstacles leave, by shapely alone.

    A disc is a polygon inside it here, which leaves more.
    """
    discs = [shapely.Point(x, y).buffer(radius, 256) for x, y, radius in case.circles]
    ground = shapely.box(*BOUNDS) - shapely.union_all([*case.polygons, *discs])
    parts = shapely.get_parts(ground)
    of_start, of_goal = (
        shapely.intersects_xy(parts, *point).nonzero()[0] for point in (case.start, case.goal)
    )
    assert len(of_start) == len(of_goal) == 1
    assert of_start[0] != of_goal[0]


def check_no_worse(case, short, long, believed):
    """More samples never make what is returned worse.

    Both informed trees of RRT*-R begin with the same path, which is returned where it is truly
    shorter than the tree's; its cost is then its true length. So it bounds the other's length.
    """
    if case.planner != "rrt-star-r":
        assert (long.cost, short.cost) == (believed[1], believed[0])
        return
    for k, (one, other) in enumerate([(short, long), (long, short)]):
        if one.cost != believed[k]:
            assert one.cost == one.length
            assert other.length <= one.length


def options_of(case):
    """Algorithm 1 to the letter where a planner has the choice, so that edges can be checked."""
    options = dict(case.options)
    return options | ({"panel": math.inf} if case.planner == "rrt-star-r" else {})


def check(case):
    """Solve with n and 2 n samples; return whether a path was found."""
    problem = case.problem()
    options = options_of(case)
    short, long = (
        tp.plan(problem, case.planner, samples=samples, seed=case.seed, **options)
        for samples in (case.samples, 2 * case.samples)
    )
    if problem.is_unreachable:
        assert short.status is long.status is tp.Status.UNREACHABLE
        check_separated(case)
        return False
    for solution in (short, long):
        check_tree(case, problem, solution)
        found = solution.history.best_cost[np.isfinite(solution.history.best_cost)]
        assert (np.diff(found) <= 0.0).all()
        if solution.path is None:
            assert solution.status is tp.Status.NOT_FOUND
            assert solution.cost is solution.length is None
            assert not (solution.tree.points == case.goal).all(axis=1).any()
        else:
            assert solution.status is tp.Status.SOLVED
            check_path(case, problem, solution)
    believed = [solution.history.best_cost[-1] for solution in (short, long)]
    assert believed[1] <= believed[0]
    if short.path is not None:
        assert long.path is not None
        check_no_worse(case, short, long, believed)
    return long.path is not None


BATCHES = 10


@pytest.mark.parametrize("batch", range(BATCHES))
def test_every_seeded_problem_is_solved_in_free_space(batch):
    each = SEEDED // BATCHES
    solved = [check(seeded_case(seed)) for seed in range(batch * each, (batch + 1) * each)]
    assert sum(solved) > 0.6 * len(solved)


@settings(
    max_examples=DRAWN,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow],
)
@given(case=cases)
def test_every_drawn_problem_is_solved_in_free_space_or_not_at_all(case):
    assume(case.start != case.goal)
    assume(case.problem() is not None)
    check(case)


def test_there_are_at_least_five_hundred_problems():
    assert SEEDED % BATCHES == 0
    assert SEEDED + DRAWN >= 500
