"""The global optimum: ``optimal`` and ``alternatives`` against many starts and known routes."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import terrapath as tp
from common import FLAT, REGION, mostly_slow
from terrapath.errors import UnfinishedWarning
from terrapath.geodesics import alternatives
from terrapath.problem import scenes

START, GOAL = (0.0, 0.0), (10.0, 10.0)
PAPER = [name for name in scenes.names() if name != "jacksboro"]

SURFACES, BATCH = 200, 10
COARSE = 0.1  # spacing of nodes that is enough to tell the routes apart


def random_problem(seed):
    """One to five layers of peaks and pits, some steep."""
    random = np.random.default_rng([2026, seed])

    def peak():
        sign = random.choice([1.0, 1.0, -1.0])
        return (
            sign * random.uniform(0.5, 6.0),
            random.uniform(0.2, 2.5),
            *random.uniform(0, 10, 2),
        )

    layers = [[peak() for _ in range(random.integers(1, 5))] for _ in range(random.integers(1, 6))]
    return tp.Problem(tp.Surface.from_peaks(layers), START, GOAL, REGION)


def starting_curves():
    """Bows to either side and S-shapes, from the straight line to the region's corners."""
    t = np.linspace(0.0, 1.0, 40)[:, None]
    line, across = t * GOAL, np.array([-1.0, 1.0]) / np.sqrt(2.0)
    for bow in np.linspace(-6.3, 6.3, 5):
        yield line + bow * np.sin(np.pi * t) * across
    for bow in (-3.0, 3.0):
        yield line + bow * np.sin(2.0 * np.pi * t) * across


def shortest_of_many_starts(problem):
    """Length of the best local geodesic that Newton's method finds from all curves."""
    best = np.inf
    for curve in starting_curves():
        points = np.clip(curve, -0.99, 10.99)
        points[0], points[-1] = START, GOAL
        best = min(best, tp.refine(problem, points).length)
    return best


@pytest.mark.parametrize("batch", mostly_slow(range(SURFACES // BATCH), quick=3))
def test_the_best_route_is_no_longer_than_from_many_starts(batch):
    for seed in range(batch * BATCH, (batch + 1) * BATCH):
        problem = random_problem(seed)
        best = tp.alternatives(problem, 1, spacing=COARSE)[0]
        assert best.length <= shortest_of_many_starts(problem) * (1.0 + 1e-7), seed


@pytest.mark.parametrize("name", PAPER)
def test_optimal_finds_the_true_length_and_proves_it(name):
    solution = tp.plan(tp.scenes.load(name), "optimal", target_gap=0.01)
    assert solution.status is tp.Status.SOLVED
    truth = scenes.SCENES[name].true_length
    assert solution.length == pytest.approx(truth, rel=1e-7)
    assert solution.lower_bound <= truth
    assert solution.gap <= 0.01
    assert solution.certificate.check(solution.problem) == solution.lower_bound
    lengths = [solution.length, *(path.length for path in solution.alternatives)]
    assert lengths == sorted(lengths)


def test_routes_that_differ_by_a_thousandth_come_in_the_right_order():
    first, second, *_ = tp.alternatives(tp.scenes.load("repeat-3d"), spacing=COARSE)
    assert first.length == pytest.approx(15.734152898, rel=1e-7)
    assert second.length == pytest.approx(15.745526535, rel=1e-7)


def test_the_second_and_third_best_of_six_peaks():
    lengths = [path.length for path in tp.alternatives(tp.scenes.load("six-peaks"), 5)]
    # Each has its mirror image.
    expected = [17.018129404, 17.018129404, 17.330039313, 17.330039313, 17.647767424]
    assert lengths == pytest.approx(expected, rel=1e-7)


def test_both_sides_of_an_obstacle():
    block = shapely.box(4.0, 1.0, 6.0, 6.0)
    problem = tp.Problem(FLAT, (0.0, 4.0), (10.0, 4.0), (0.0, 0.0, 10.0, 10.0), [block])
    below_or_above = tp.alternatives(problem, 4)
    above = 2.0 * np.hypot(4.0, 2.0) + 2.0
    below = 2.0 * np.hypot(4.0, 3.0) + 2.0
    assert [path.length for path in below_or_above] == pytest.approx([above, below], rel=1e-6)
    for path in below_or_above:
        assert path.line.disjoint(block)


# What ends the refinement of one route, and what is left of the others


BESIDE_A_DISC = tp.Problem(
    FLAT, (1.0, 5.0), (9.0, 5.0), (0.0, 0.0, 10.0, 10.0), [shapely.Point(5.0, 5.3).buffer(2.0)]
)


@pytest.fixture
def raising(monkeypatch):
    """Makes the refinement of these candidates, counted from 1, raise an error."""

    def patch(error, *candidates):
        refine, calls = alternatives.refine, []

        def refine_or_raise(problem, path, **limits):
            calls.append(path)
            if len(calls) in candidates:
                raise error
            return refine(problem, path, **limits)

        monkeypatch.setattr(alternatives, "refine", refine_or_raise)

    return patch


def lengths_beside_a_disc():
    return [path.length for path in tp.alternatives(BESIDE_A_DISC, 3, spacing=0.2)]


def test_ctrl_c_keeps_the_routes_that_are_refined(raising):
    below, _ = lengths_beside_a_disc()
    raising(KeyboardInterrupt, 2)
    solution = tp.Optimal(spacing=0.2).solve(BESIDE_A_DISC)
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.length == below
    assert solution.unrefined.length > below


def test_a_route_that_cannot_be_refined_does_not_lose_those_before(raising):
    below, _ = lengths_beside_a_disc()
    raising(ArithmeticError("by zero"), 2)
    with pytest.warns(UnfinishedWarning, match="not every route could be refined.*by zero") as told:
        solution = tp.Optimal(target_gap=1.0, spacing=0.2).solve(BESIDE_A_DISC)
    assert len(told) == 1
    assert solution.status is tp.Status.SOLVED
    assert solution.length == below
    assert solution.unrefined is not None


def test_a_route_that_cannot_be_refined_does_not_lose_those_after(raising):
    below, above = lengths_beside_a_disc()
    raising(ArithmeticError("by zero"), 1)
    with pytest.warns(UnfinishedWarning, match="not every route could be refined"):
        solution = tp.Optimal(target_gap=1.0, spacing=0.2).solve(BESIDE_A_DISC)
    assert below < solution.length < above  # fast marching's path is shorter than the other way
    assert solution.unrefined is None
    assert [path.length for path in solution.alternatives] == [above]


def test_where_no_route_can_be_refined_the_path_is_fast_marchings(raising):
    raising(ArithmeticError("by zero"), *range(1, 100))
    with pytest.warns(UnfinishedWarning, match="no route could be refined; the path is") as told:
        solution = tp.Optimal(target_gap=1.0, spacing=0.2).solve(BESIDE_A_DISC)
    assert len(told) == 1
    assert solution.status is tp.Status.SOLVED
    assert solution.alternatives == ()


def test_alternatives_leave_out_what_cannot_be_refined(raising):
    _, above = lengths_beside_a_disc()
    raising(ArithmeticError("by zero"), 1)
    with pytest.warns(UnfinishedWarning, match="the others are given: ArithmeticError: by zero"):
        assert lengths_beside_a_disc() == [above]


def test_alternatives_raise_where_nothing_can_be_refined(raising):
    raising(ArithmeticError("by zero"), *range(1, 100))
    with pytest.raises(ArithmeticError, match="by zero"):
        tp.alternatives(BESIDE_A_DISC, spacing=0.2)


def test_flat_ground_has_one_route_and_no_gap():
    problem = tp.Problem(FLAT, (1.0, 1.0), (9.0, 7.0), (0.0, 0.0, 10.0, 10.0))
    assert [path.length for path in tp.alternatives(problem)] == pytest.approx([10.0])
    solution = tp.Optimal().solve(problem)
    assert solution.length == pytest.approx(10.0, rel=1e-12)
    assert solution.gap <= 1e-8  # the chord is the truth here


def test_count_limits_the_routes():
    problem = tp.scenes.load("six-peaks")
    assert len(tp.alternatives(problem, 2, spacing=COARSE)) == 2
    solution = tp.Optimal(routes=2, target_gap=1.0, spacing=COARSE).solve(problem)
    assert len(solution.alternatives) == 1


def test_start_is_goal():
    problem = tp.Problem(FLAT, START, START, REGION)
    assert [path.length for path in tp.alternatives(problem)] == [0.0]
    assert tp.Optimal().solve(problem).length == 0.0


def test_an_enclosed_goal_is_proven_unreachable():
    moat = shapely.Point(GOAL).buffer(0.6).exterior
    solution = tp.Optimal().solve(tp.Problem(FLAT, START, GOAL, REGION, [moat]))
    assert solution.status is tp.Status.UNREACHABLE
    assert solution.path is None
    assert solution.lower_bound is None


def test_a_time_limit_ends_it_with_the_best_so_far():
    problem = tp.scenes.load("three-peaks")
    solution = tp.Optimal(target_gap=1e-9, time_limit=1e-3).solve(problem)
    assert solution.status is tp.Status.SOLVED
    assert solution.stopped_by == "time limit"
    assert solution.length == pytest.approx(15.368572424, rel=1e-3)


def test_the_callback_stops_the_search():
    def stop_once_there_is_a_path(progress):
        return progress.best_cost < np.inf

    problem = tp.scenes.load("three-peaks")
    solution = tp.Optimal(target_gap=1e-9).solve(problem, callback=stop_once_there_is_a_path)
    assert solution.stopped_by == "callback"
    assert solution.length == pytest.approx(15.368572424, rel=1e-3)


@pytest.mark.parametrize(
    "options", [{"target_gap": 0.0}, {"target_gap": np.nan}, {"routes": 0}, {"spacing": -1.0}]
)
def test_options_that_make_no_sense(options):
    with pytest.raises(tp.InputError, match=next(iter(options))):
        tp.Optimal(**options)


def test_a_gap_finer_than_the_default_nodes_is_found():
    wall = shapely.box(5.0, -1.0, 5.2, 4.0).union(shapely.box(5.0, 4.03, 5.2, 11.0))
    problem = tp.Problem(FLAT, (2.0, 2.0), (8.0, 2.0), REGION, [wall])
    solution = tp.Optimal(target_gap=1.0).solve(problem)
    assert solution.status is tp.Status.SOLVED
    over = np.hypot(3.0, 2.0) + 0.2 + np.hypot(2.8, 2.0)
    assert solution.length == pytest.approx(over, rel=1e-5)
