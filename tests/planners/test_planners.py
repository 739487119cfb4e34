"""What every planner offers: options, limits, statuses, progress, interruption."""

from __future__ import annotations

import dataclasses
import math
import os
import signal
import threading

import numpy as np
import pytest
import shapely

import terrapath as tp
from planner_oracles import TREE_PLANNERS, same_tree
from terrapath.planners import (
    PLANNERS,
    Progress,
    candidates,
    fast_marching,
    make_planner,
    rrt_star,
)
from terrapath.problem import scenes

EVERY_PLANNER = pytest.mark.parametrize("name", TREE_PLANNERS)
ROOM = shapely.box(8.0, 8.0, 10.9, 10.9) - shapely.box(9.0, 9.0, 10.5, 10.5)
# A way into the room so narrow that no sample finds it, though it is there.
SLIT = shapely.box(10.0, 10.0, 11.0, 10.0 + 1e-9)
MANY = 200_000


@pytest.fixture
def problem():
    return scenes.load("six-peaks")


@pytest.fixture
def enclosed():
    surface = tp.Surface.from_peaks([scenes.FOUR_PEAKS])
    return tp.Problem(surface, scenes.START, (9.5, 9.5), scenes.REGION, [ROOM - SLIT])


# Every planner


@EVERY_PLANNER
def test_every_planner_goes_from_start_to_goal_and_says_what_it_did(name, problem):
    solution = tp.plan(problem, name, samples=3000, seed=7)
    assert solution.status is tp.Status.SOLVED
    assert solution.planner == name == make_planner(name).name
    assert solution.seed == 7
    assert solution.problem is problem
    np.testing.assert_array_equal(solution.path.points[0], problem.start)
    np.testing.assert_array_equal(solution.path.points[-1], problem.goal)
    assert problem.bounds.contains(solution.path.points).all()
    assert solution.length == tp.curve_length(problem.surface, solution.path.points)
    assert solution.length >= 17.018129404
    assert solution.seconds > 0.0
    assert solution.lower_bound is None
    assert solution.gap is None
    assert name in repr(solution)


@EVERY_PLANNER
def test_where_the_start_is_the_goal_the_path_has_length_zero(name, problem):
    stay = tp.Problem(problem.surface, (2.0, 5.0), (2.0, 5.0), scenes.REGION)
    solution = tp.plan(stay, name)
    assert solution.status is tp.Status.SOLVED
    assert solution.length == 0.0
    assert solution.cost == 0.0
    np.testing.assert_array_equal(solution.path.points, [(2.0, 5.0), (2.0, 5.0)])
    assert solution.path.climb == 0.0


@EVERY_PLANNER
def test_a_goal_that_is_not_found_is_a_result_that_says_what_to_do(name, enclosed):
    solution = tp.plan(enclosed, name, samples=3000)
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.path is None
    assert solution.length is None
    assert solution.cost is None
    assert solution.gap is None
    assert solution.samples == 3000
    assert "samples" in solution.status.message
    assert np.isinf(solution.history.best_cost).all()
    assert "no path" in repr(solution)


@EVERY_PLANNER
def test_two_neighbouring_points_are_joined_by_one_edge(name, problem):
    near = tp.Problem(problem.surface, (0.0, 0.0), (0.3, 0.2), scenes.REGION)
    solution = tp.plan(near, name, samples=2000, goal_bias=1.0)
    np.testing.assert_array_equal(solution.path.points, [(0.0, 0.0), (0.3, 0.2)])


@EVERY_PLANNER
def test_history_and_counters_are_consistent(name, enclosed, problem):
    for scene in (problem, enclosed):
        solution = tp.plan(scene, name, samples=4000, seed=1)
        history, counters = solution.history, solution.counters
        assert len(history.samples) == len(history.seconds) == len(history.best_cost)
        assert (np.diff(history.samples) > 0).all()
        assert history.samples[-1] == solution.samples
        assert (np.diff(history.seconds) >= 0).all()
        assert 0.0 < history.seconds[-1] <= solution.seconds
        finite = history.best_cost[np.isfinite(history.best_cost)]
        assert (np.diff(finite) <= 0.0).all()
        assert np.isinf(history.best_cost[: len(history.best_cost) - len(finite)]).all()
        if solution.path is not None:
            assert history.best_cost[-1] == solution.cost
        assert counters["vertices"] == len(solution.tree.points) <= solution.samples + 2
        assert counters["edges considered"] >= counters["edges pruned"] >= 0
        assert counters["edges tested for obstacles"] >= counters["vertices"] - 1
        assert len(solution.tree.segments) == counters["vertices"] - 1


def test_the_best_cost_never_rises_from_one_sample_to_the_next(problem, monkeypatch):
    monkeypatch.setattr(rrt_star, "CHUNK", 1)
    for name in ("rrt-star-r", "rrt-star"):
        history = tp.plan(problem, name, samples=1500, seed=2).history
        np.testing.assert_array_equal(history.samples, np.arange(1, 1501))
        costs = history.best_cost
        found = np.flatnonzero(np.isfinite(costs))
        assert len(found) == 1500 - found[0]
        assert (np.diff(costs[found]) <= 0.0).all()
        assert costs[-1] < costs[found[0]]


# RRT and the chord baseline


def test_rrt_stops_at_its_first_path(problem, monkeypatch):
    monkeypatch.setattr(rrt_star, "CHUNK", 1)
    solution = tp.RRT(seed=3).solve(problem)
    assert solution.samples < 10_000
    assert np.isfinite(solution.history.best_cost).sum() == 1
    assert np.isfinite(solution.history.best_cost[-1])
    # Its last vertex is the goal: nothing was added once the path was there.
    np.testing.assert_array_equal(solution.tree.points[-1], problem.goal)
    assert solution.counters["edges rewired"] == 0


def test_rrt_hangs_every_vertex_below_the_one_it_grew_from(problem):
    # Without neighbours a parent is always older than its child, and the nearest then.
    tree = tp.RRT(samples=400, goal_bias=0.0, seed=5).solve(problem).tree
    for child in range(1, len(tree.points)):
        parent = tree.parents[child]
        assert 0 <= parent < child
        distances = np.hypot(*(tree.points[:child] - tree.points[child]).T)
        assert distances[parent] <= distances.min() * (1 + 1e-9) + 1e-12


def test_rrt_star_is_never_beaten_by_rrt_on_average(problem):
    rrt = np.mean([tp.RRT(seed=s).solve(problem).length for s in range(5)])
    star = np.mean([tp.RRTStar(seed=s, samples=3000).solve(problem).length for s in range(5)])
    assert star < rrt


def test_the_chord_baseline_may_believe_less_than_the_geodesic_but_never_travels_less(problem):
    for seed in range(3):
        solution = tp.RRTStar(metric="chord", step=2.0, seed=seed).solve(problem)
        points = solution.path.points
        chords = tp.chord(problem.surface, points[:-1], points[1:])
        assert solution.cost == pytest.approx(chords.sum(), rel=1e-12)
        assert solution.cost < 17.018129404 <= solution.length


# Limits


@EVERY_PLANNER
def test_a_time_limit_ends_the_search_with_the_best_so_far(name, problem):
    # An informed tree's first path takes its time, too: without it both trees begin alike.
    options = {"step": 3.0} if name == "rrt" else {"step": 3.0, "informed": False}
    solution = tp.plan(problem, name, samples=MANY, time_limit=1e-9, **options)
    if name == "rrt":
        assert solution.stopped_by in ("time limit", "first path")
        return
    assert solution.stopped_by == "time limit"
    assert solution.samples == rrt_star.CHUNK
    assert solution.status is tp.Status.SOLVED
    same = tp.plan(problem, name, samples=rrt_star.CHUNK, **options)
    assert same_tree(solution, same)
    np.testing.assert_array_equal(solution.path.points[[0, -1]], [problem.start, problem.goal])


def test_rrt_ends_as_soon_after_the_first_path_as_it_says(problem):
    solution = tp.plan(problem, "rrt", samples=MANY)
    assert solution.stopped_by == "first path"
    assert np.isinf(solution.history.best_cost[:-1]).all()
    assert (np.diff(solution.history.samples) <= rrt_star.CHUNK).all()
    assert f"within {rrt_star.CHUNK} samples of the first path" in tp.RRT.__doc__


@pytest.mark.parametrize(
    ("name", "module"), [("fast-marching", fast_marching), ("optimal", candidates)]
)
def test_where_the_nodes_show_no_way_finer_ones_are_tried(name, module, enclosed, monkeypatch):
    prepare, nodes = module.Medium, []

    def prepare_and_note(surface, lattice, *more):
        nodes.append(lattice.nx)
        return prepare(surface, lattice, *more)

    monkeypatch.setattr(module, "Medium", prepare_and_note)
    solution = tp.plan(enclosed, name, spacing=0.4)
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.stopped_by == "no path between the nodes"
    assert nodes == [31, 61, 121]


def test_a_time_limit_without_a_path_is_not_found(enclosed):
    for name in TREE_PLANNERS:
        solution = tp.plan(enclosed, name, samples=MANY, time_limit=1e-9)
        assert solution.status is tp.Status.NOT_FOUND
        assert solution.stopped_by == "time limit"
        assert solution.path is None


@pytest.mark.parametrize("name", ["rrt-star-r", "rrt-star"])
def test_a_target_length_ends_the_search_as_soon_as_the_cost_is_that_low(name, problem):
    whole = tp.plan(problem, name, samples=6000, seed=1)
    target = 0.5 * (whole.history.best_cost[-1] + np.min(whole.history.best_cost[:4]))
    solution = tp.plan(problem, name, samples=6000, seed=1, target_length=target)
    assert solution.stopped_by == "target length"
    assert solution.status is tp.Status.SOLVED
    assert solution.cost <= target
    assert (solution.history.best_cost[:-1] > target).all()
    assert solution.samples < 6000


def test_a_target_length_below_the_truth_is_never_reached(problem):
    solution = tp.RRTStar(samples=2000, target_length=17.018).solve(problem)
    assert solution.stopped_by == "samples"
    assert solution.samples == 2000


# Callbacks and interruption


@EVERY_PLANNER
def test_a_callback_sees_the_progress(name, problem):
    seen = []
    solution = tp.plan(problem, name, samples=2000, callback=seen.append)
    assert all(isinstance(progress, Progress) for progress in seen)
    np.testing.assert_array_equal([p.samples for p in seen], solution.history.samples)
    np.testing.assert_array_equal([p.best_cost for p in seen], solution.history.best_cost)
    np.testing.assert_array_equal([p.seconds for p in seen], solution.history.seconds)
    assert {p.total for p in seen} == {2000}


@EVERY_PLANNER
def test_a_callback_stops_the_search_by_returning_true(name, problem):
    solution = tp.plan(problem, name, samples=MANY, callback=lambda progress: True, step=3.0)
    assert solution.stopped_by == "callback"
    assert solution.samples == rrt_star.CHUNK
    assert solution.status is tp.Status.SOLVED
    blind = {} if name == "rrt" else {"informed": False}
    unfinished = tp.plan(
        problem, name, samples=MANY, callback=lambda progress: True, step=0.05, **blind
    )
    assert unfinished.status is tp.Status.NOT_FOUND


@EVERY_PLANNER
def test_a_callback_changes_nothing_by_returning_none(name, problem):
    watched = tp.plan(problem, name, samples=2000, callback=lambda progress: None)
    assert same_tree(watched, tp.plan(problem, name, samples=2000))


def test_an_error_in_a_callback_reaches_the_caller(problem):
    def fail(progress):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        tp.RRTStar(samples=1000).solve(problem, callback=fail)


@pytest.mark.parametrize("stage", ["searching", "refining the path", "proving the bound"])
def test_an_error_in_a_callback_of_any_stage_reaches_the_caller(stage, problem):
    def fail(progress):
        if progress.stage == stage:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        tp.plan(problem, samples=1000, refine=True, bound=True, callback=fail)


def assert_interrupted(solution, problem):
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.stopped_by == "interrupt"
    assert "best so far" in solution.status.message
    assert 0 < solution.samples < MANY
    np.testing.assert_array_equal(solution.path.points[[0, -1]], [problem.start, problem.goal])
    goal = np.flatnonzero((solution.tree.points == problem.goal).all(axis=1))
    assert solution.cost == solution.tree.costs[goal].item()
    # The history tells of the result: its last row is where the search stood.
    assert solution.history.samples[-1] == solution.samples
    assert solution.history.best_cost[-1] == solution.cost
    assert solution.counters["vertices"] == len(solution.tree.points)


@pytest.mark.parametrize("name", ["rrt-star-r", "rrt-star"])
def test_ctrl_c_in_a_callback_gives_the_best_path_so_far(name, problem):
    def interrupt(progress):
        if progress.samples >= 3 * rrt_star.CHUNK:
            raise KeyboardInterrupt

    solution = tp.plan(problem, name, samples=MANY, callback=interrupt)
    assert_interrupted(solution, problem)
    assert solution.samples == 3 * rrt_star.CHUNK


def test_ctrl_c_before_the_first_path_gives_no_path(problem):
    def interrupt(progress):
        raise KeyboardInterrupt

    planner = tp.RRTStar(samples=MANY, step=0.05, informed=False)
    solution = planner.solve(problem, callback=interrupt)
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.path is None
    assert solution.cost is None
    assert solution.length is None


def test_a_signal_raised_while_planning_gives_the_best_path_so_far(problem):
    def interrupt(progress):
        if math.isfinite(progress.best_cost):
            signal.raise_signal(signal.SIGINT)

    assert_interrupted(tp.RRTStar(samples=MANY).solve(problem, callback=interrupt), problem)


def test_a_signal_that_arrives_inside_a_kernel_gives_the_best_path_so_far(problem, monkeypatch):
    # Python handles a signal when the kernel returns: the samples are in the tree by then.
    grow, drawn = rrt_star.kernels.grow, []

    def interrupted_grow(*arguments):
        grow(*arguments)
        drawn.append(len(arguments[-1]))
        if sum(drawn) == 4 * rrt_star.CHUNK:
            raise KeyboardInterrupt

    monkeypatch.setattr(rrt_star.kernels, "grow", interrupted_grow)
    solution = tp.RRTStar(samples=MANY, seed=4).solve(problem)
    assert solution.samples == 4 * rrt_star.CHUNK
    assert_interrupted(solution, problem)


def test_a_signal_from_outside_gives_the_best_path_so_far(problem):
    # Another thread sends the signal, as a terminal does, at some moment after a path is there.
    senders = []

    def send_once(progress):
        if not senders and math.isfinite(progress.best_cost):
            sender = threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT))
            senders.append(sender)
            sender.start()

    try:
        solution = tp.RRTStar(samples=MANY, seed=4).solve(problem, callback=send_once)
    except KeyboardInterrupt:  # pragma: no cover (what the test forbids)
        pytest.fail("the signal escaped the planner")
    senders[0].join()
    assert_interrupted(solution, problem)


# Options


def test_options_are_frozen_and_keyword_only():
    for kind in (tp.RRTStar, tp.RRT):
        with pytest.raises(TypeError):
            kind(10_000)
        with pytest.raises(dataclasses.FrozenInstanceError):
            kind().samples = 5
        assert kind(samples=5) == kind(samples=5) != kind(samples=6)
        assert hash(kind(samples=5)) == hash(kind(samples=5))


BAD = [
    ({"samples": -5}, "samples=-5"),
    ({"samples": 0}, "samples=0"),
    ({"samples": True}, "samples=True"),
    ({"samples": 10.0}, "samples=10"),
    ({"samples": "many"}, "samples='many'"),
    ({"samples": None}, "samples=None"),
    ({"samples": 2**31}, "samples=2147483648"),
    ({"step": 0.0}, "step=0"),
    ({"step": -1.0}, "step=-1"),
    ({"step": math.nan}, "step=nan"),
    ({"step": math.inf}, "step=inf"),
    ({"step": True}, "step=True"),
    ({"step": "far"}, "step='far'"),
    ({"seed": -1}, "seed=-1"),
    ({"seed": 1.5}, "seed=1.5"),
    ({"seed": False}, "seed=False"),
    ({"goal_bias": 2}, "goal_bias=2"),
    ({"goal_bias": -0.1}, "goal_bias=-0.1"),
    ({"goal_bias": math.nan}, "goal_bias=nan"),
    ({"time_limit": 0.0}, "time_limit=0"),
    ({"time_limit": math.nan}, "time_limit=nan"),
]
BAD_OF_RRT_STAR = [
    ({"radius_factor": 0.0}, "radius_factor=0"),
    ({"radius_factor": math.nan}, "radius_factor=nan"),
    ({"target_length": -3.0}, "target_length=-3"),
    ({"panel": 0.0}, "panel=0"),
    ({"panel": math.nan}, "panel=nan"),
    ({"panel": -math.inf}, "panel=-inf"),
    ({"prune": "no"}, "prune='no'"),
    ({"informed": None}, "informed=None"),
]


def assert_one_line(raised, start):
    message = str(raised.value)
    assert message.startswith(start)
    assert "\n" not in message
    assert "must" in message or "choose" in message
    assert isinstance(raised.value, ValueError)


@EVERY_PLANNER
@pytest.mark.parametrize(("options", "start"), BAD, ids=[start for _, start in BAD])
def test_a_bad_option_is_named_with_its_value_and_what_it_must_be(name, options, start):
    with pytest.raises(tp.InputError) as raised:
        make_planner(name, **options)
    assert_one_line(raised, start)


@pytest.mark.parametrize(
    ("options", "start"), BAD_OF_RRT_STAR, ids=[start for _, start in BAD_OF_RRT_STAR]
)
def test_a_bad_option_of_rrt_star_is_named_with_its_value(options, start):
    with pytest.raises(tp.InputError) as raised:
        tp.RRTStar(**options)
    assert_one_line(raised, start)


def test_an_unknown_metric_names_the_known_ones():
    with pytest.raises(tp.InputError, match=r"metric='euclid'.*riemannian, chord"):
        tp.RRTStar(metric="euclid")


def test_an_unknown_planner_names_the_known_ones(problem):
    with pytest.raises(tp.InputError) as raised:
        tp.plan(problem, "rrt*")
    message = str(raised.value)
    assert "planner='rrt*'" in message
    assert all(name in message for name in PLANNERS)


@EVERY_PLANNER
def test_a_misspelt_option_gets_a_hint(name, problem):
    with pytest.raises(tp.InputError, match=r"'sampels'; did you mean samples\?"):
        tp.plan(problem, name, sampels=100)
    with pytest.raises(tp.InputError, match=r"'zzz'; its options are samples"):
        tp.plan(problem, name, zzz=100)


def test_a_planner_named_by_its_metric_does_not_take_another(problem):
    for name in ("rrt-star-r", "rrt-star"):
        with pytest.raises(tp.InputError, match="no option 'metric'"):
            tp.plan(problem, name, metric="chord")


def test_numbers_of_numpy_are_numbers(problem):
    mine = tp.RRTStar(samples=np.int64(700), step=np.float32(1.0), seed=np.uint8(3))
    assert same_tree(mine.solve(problem), tp.RRTStar(samples=700, step=1, seed=3).solve(problem))


def test_the_default_step_is_a_twelfth_of_the_side_of_the_region(problem):
    assert same_tree(
        tp.RRTStar(samples=900).solve(problem), tp.RRTStar(samples=900, step=1.0).solve(problem)
    )
    # The same problem at another scale: all points scale along, powers of two exactly.
    surface = tp.Surface.from_peaks(
        [
            [(4 * a, f / 16, 4 * x, 4 * y) for a, f, x, y in layer]
            for layer in (scenes.FOUR_PEAKS, scenes.TWO_RESISTANCE_PEAKS)
        ]
    )
    larger = tp.Problem(surface, (0, 0), (40, 40), (-4, -4, 44, 44))
    scaled = tp.RRTStar(samples=900).solve(larger)
    plain = tp.RRTStar(samples=900).solve(problem)
    np.testing.assert_allclose(scaled.tree.points, 4 * plain.tree.points, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(scaled.tree.parents, plain.tree.parents)
    assert scaled.length == pytest.approx(4 * plain.length, rel=1e-9)
