"""The global optimum: ``optimal`` and ``alternatives`` against many starts and known routes."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import terrapath as tp
from common import FLAT, REAL_MAPS, REGION, mostly_slow
from planner_oracles import visibility_length
from rough_maps import random_map
from terrapath.errors import UnfinishedWarning
from terrapath.geodesics import alternatives
from terrapath.planners import candidates
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


# On flat ground the corners of obstacles would show the shortest path, too.
BESIDE_A_DISC = tp.Problem(
    tp.Surface.from_peaks([[(0.2, 0.05, 3.0, 7.0)]]),
    (1.0, 5.0),
    (9.0, 5.0),
    (0.0, 0.0, 10.0, 10.0),
    [shapely.Point(5.0, 5.3).buffer(2.0)],
)


@pytest.fixture
def raising(monkeypatch):
    """Makes the refinement of these candidates, counted from 1, raise an error."""

    def patch(error, *numbers):
        refine, calls = alternatives.refine, []

        def refine_or_raise(problem, path, **limits):
            calls.append(path)
            if len(calls) in numbers:
                raise error
            return refine(problem, path, **limits)

        monkeypatch.setattr(alternatives, "refine", refine_or_raise)
        monkeypatch.setattr(candidates, "SURE", np.inf)  # no other search follows

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
    assert solution.length <= problem.straight_length


def test_the_callback_stops_the_search():
    problem = tp.scenes.load("three-peaks")

    def stop_once_there_is_a_short_path(progress):
        return progress.best_cost < 0.9 * problem.straight_length

    solution = tp.Optimal(target_gap=1e-9).solve(problem, callback=stop_once_there_is_a_short_path)
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


# Rough ground, and among obstacles


AXIS = 5.0 + 10.0 * np.arange(40)


def rough_problem(seed, weight=10.0):
    random, f = np.random.default_rng([14, seed]), np.fft.fftfreq(40)
    size = np.hypot(f[:, None], f[None])
    size[0, 0] = 1.0
    heights = np.fft.ifft2(np.fft.fft2(random.normal(size=(40, 40))) * size**-1.8).real
    heights *= 25.0 / heights.std()
    surface = tp.Surface.from_grid(heights, AXIS, AXIS, weights=[weight])
    start, goal = random.uniform(15.0, 385.0, (2, 2))
    return tp.Problem(surface, start, goal)


@pytest.mark.filterwarnings("ignore:the path of fast-marching")
@pytest.mark.parametrize("seed", mostly_slow(range(6), quick=2))
def test_on_rough_ground_it_is_beaten_by_no_planner_and_the_same_back(seed):
    problem = rough_problem(seed)
    best = tp.plan(problem, "optimal", target_gap=10.0)
    back = tp.plan(problem.between(problem.goal, problem.start), "optimal", target_gap=10.0)
    assert back.length == pytest.approx(best.length, rel=1e-9)
    assert np.allclose(back.path.points[::-1], best.path.points, rtol=0.0, atol=1e-9)
    others = [("dijkstra", {"neighbours": n}) for n in (8, 16, 32)]
    others += [("a-star", {"neighbours": 32}), ("fast-marching", {}), ("rrt-star-r", {})]
    for name, options in others:
        found = tp.plan(problem, name, refine=True, **options)
        assert best.length <= found.length * (1.0 + 1e-6), name
    assert best.length <= problem.straight_length


@pytest.mark.parametrize("weight", [10.0, 1e6])
def test_fast_marching_warns_where_its_nodes_do_not_show_the_ground(weight):
    with pytest.warns(tp.GroundWarning, match="longer than its field says.*optimal looks"):
        tp.plan(rough_problem(1, weight), "fast-marching")
    tp.plan(rough_problem(1, 0.1), "fast-marching")  # warnings are errors


def test_finer_fields_hold_both_ends():
    problem = random_map(200_001).problem()  # the nodes around its start are far above it
    solution = tp.plan(problem, "optimal", target_gap=10.0)
    assert solution.status is tp.Status.SOLVED


def test_a_fifth_of_the_time_is_kept_for_the_proof(monkeypatch):
    limits = []
    search = candidates.Candidates.search

    def noted(self):
        limits.append(self.stopper.time_limit)
        search(self)

    monkeypatch.setattr(candidates.Candidates, "search", noted)
    tp.plan(BESIDE_A_DISC, "optimal", spacing=0.2, target_gap=10.0, time_limit=1000.0)
    assert limits == [800.0]


def test_among_boxes_on_flat_ground_it_is_exact():
    random = np.random.default_rng(8)
    corners = random.uniform(0.0, 9.0, (40, 2))
    boxes = [shapely.box(x, y, x + 0.9, y + 0.5) for x, y in corners]
    problem = tp.Problem(FLAT, (-0.5, -0.5), (10.5, 10.5), REGION, boxes)
    solution = tp.plan(problem, "optimal", target_gap=10.0)
    truth = visibility_length(problem.start, problem.goal, boxes, REGION)
    assert solution.length == pytest.approx(truth, rel=1e-6)
    assert solution.path.line.disjoint(shapely.union_all(boxes))


def test_a_route_that_touches_does_not_hide_the_others(monkeypatch):
    wall = shapely.box(4.0, -1.0, 5.0, 6.0)
    problem = tp.Problem(FLAT, (0.0, 0.0), (9.0, 0.0), REGION, [wall])
    through = problem.path([(0.0, 0.0), (9.0, 0.0)])
    monkeypatch.setattr(candidates, "refine", lambda problem, path, **options: through)
    solution = tp.plan(problem, "optimal", target_gap=10.0)
    assert solution.status is tp.Status.SOLVED
    assert solution.path.line.disjoint(wall)


@pytest.mark.slow
@pytest.mark.skipif(not REAL_MAPS.exists(), reason="the real maps are not beside this clone")
def test_the_steep_volcano():
    surface = tp.read_surface(REAL_MAPS / "SainteHelens.dem").with_weights({"height": 10.0})
    problem = tp.Problem(surface, (558798, 5109381), (566622, 5120589))
    assert tp.plan(problem, "optimal", target_gap=10.0).length <= 21_536  # 21,297


@pytest.mark.skipif(not REAL_MAPS.exists(), reason="the real maps are not beside this clone")
def test_a_quarry_in_open_ground_is_passed():
    quarry = REAL_MAPS.parent / "cases" / "quarry.tif"
    surface = tp.read_surface(quarry).with_weights({"height": 10.0})
    problem = tp.Problem(surface, (500155, 4000300), (500505, 4000300))
    for name in ("optimal", "fast-marching", "dijkstra", "rrt-star-r"):
        solution = tp.plan(problem, name, refine=True)
        assert solution.length == pytest.approx(1234.77, rel=1e-4), name
