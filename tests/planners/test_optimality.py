"""Paths are as short as they should be: the paper's scenes, closed forms, visibility graphs."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
import shapely

import planner_oracles as oracles
import terrapath as tp
from common import FLAT, REGION
from layouts import LAYOUTS
from oracles import great_circle
from terrapath.problem import scenes

# The paper's scenes


# Over these seeds the mean is 17.02999 and 16.14519; with uninformed samples 17.07784 and 16.15578.
@pytest.mark.parametrize(
    ("name", "mean", "truth"),
    [("six-peaks", 17.036, 17.018129404), ("one-peak", 16.150, 16.142532164)],
)
def test_ten_runs_come_close_to_the_true_shortest_length_and_never_below(name, mean, truth):
    problem = scenes.load(name)
    solutions = [tp.RRTStar(seed=seed).solve(problem) for seed in range(10)]
    lengths = [solution.length for solution in solutions]
    assert all(solution.samples == 10_000 for solution in solutions)
    assert min(lengths) >= truth
    assert np.mean(lengths) <= mean


@pytest.mark.parametrize("name", [n for n in scenes.names() if n != "jacksboro"])
def test_paths_lie_low_between_the_peaks(name):
    # Under half of the smallest amplitude of each layer. On one-peak the true geodesic
    # rounds the hill at some two fifths of its height, so the half holds there, too.
    problem = scenes.load(name)
    data = problem.surface.data
    for seed in range(3):
        profile = tp.RRTStar(seed=seed).solve(problem).path.profile
        for layer, values in enumerate(profile.values.T):
            amplitudes = data.peaks[data.first[layer] : data.first[layer + 1], 0]
            assert values.max() < 0.5 * amplitudes.min()


def test_the_one_peak_path_climbs_no_higher_than_its_length_allows():
    # Through a point at height z on the symmetry line the way is at least
    # 2 sqrt(50 + z^2) (two chords from height 0), so z <= sqrt(L^2 / 4 - 50).
    for seed in range(3):
        solution = tp.RRTStar(seed=seed).solve(scenes.load("one-peak"))
        highest = math.sqrt(solution.length**2 / 4.0 - 50.0)
        assert solution.path.profile.values.max() < highest < 4.0


def test_the_chord_baseline_believes_less_than_the_truth_and_travels_more():
    problem = scenes.load("six-peaks")
    chord = tp.RRTStar(metric="chord", step=2.0).solve(problem)
    riemannian = tp.RRTStar(step=2.0).solve(problem)
    assert chord.cost < 17.018129404 < riemannian.length < chord.length


TRUTH = 17.018129404  # six-peaks


def mean_excess(samples, seeds, **options):
    problem = scenes.load("six-peaks")
    planners = [tp.RRTStar(samples=samples, seed=seed, **options) for seed in range(seeds)]
    return np.mean([planner.solve(problem).length for planner in planners]) / TRUTH - 1.0


# Measured: -1.05 and -0.63. An informed tree starts near the optimum, with a path over a lattice,
# so its line is flatter; in return its excess is far less at every count, and that is held as well
# (1.6e-3, 5.7e-4 and 2.7e-4, where uniform samples leave 4.1e-2, 5.2e-3 and 2.3e-3).
@pytest.mark.parametrize(
    ("informed", "steepest", "flattest", "most"),
    [(False, -1.5, -0.4, [6e-2, 1e-2, 4e-3]), (True, -1.2, -0.4, [2.5e-3, 9e-4, 4e-4])],
)
def test_the_excess_length_falls_with_the_number_of_samples(informed, steepest, flattest, most):
    counts = [1250, 5000, 20_000]
    excess = [mean_excess(n, 5, informed=informed) for n in counts]
    assert steepest < np.polyfit(np.log(counts), np.log(excess), 1)[0] < flattest
    assert (np.array(excess) < most).all()


@pytest.mark.slow
def test_an_informed_tree_does_not_stall_where_the_path_is_crowded():
    # Measured 2.7e-4 and 1.35e-4, a slope of -0.25; uniform samples leave 3.9e-4.
    few, many = (mean_excess(n, 3) for n in (20_000, 320_000))
    assert many < 0.7 * few
    assert many < 2e-4


@pytest.mark.parametrize("name", ["one-peak", "six-peaks", "repeat-4d"])
def test_what_the_planner_believes_is_the_true_length_to_a_thousandth(name):
    solution = tp.RRTStar().solve(scenes.load(name))
    assert solution.cost == pytest.approx(solution.length, rel=1e-3)


# Closed forms


def _cap(x, y):
    return np.sqrt(100.0 - x * x - y * y)


_great_circle = functools.partial(great_circle, 10.0)


def _cylinder(x, y):
    return np.sqrt(25.0 - x * x) + 0.0 * y


def _helix(a, b):
    return math.hypot(5.0 * (math.asin(b[0] / 5.0) - math.asin(a[0] / 5.0)), b[1] - a[1])


def _plane(x, y):
    return 0.7 * x - 0.4 * y


def _straight(a, b):
    dx, dy = b[0] - a[0], b[1] - a[1]
    return math.hypot(dx, dy, _plane(dx, dy))


def _coil(x, y):
    """Two layers whose lift is a helix times a line: h = diag(2, 1), flat."""
    return np.stack([np.sin(x), np.cos(x)]) + 0.0 * y


def _coil_length(a, b):
    return math.hypot(math.sqrt(2.0) * (b[0] - a[0]), b[1] - a[1])


@pytest.mark.parametrize(
    ("function", "truth", "bounds", "start", "goal"),
    [
        (_cap, _great_circle, (-6.0, -6.0, 6.0, 6.0), (-4.0, -3.0), (5.0, 2.0)),
        (_cap, _great_circle, (-6.0, -6.0, 6.0, 6.0), (-5.0, 4.0), (4.0, 4.5)),
        (_cylinder, _helix, (-4.0, 0.0, 4.0, 8.0), (-3.5, 1.0), (3.0, 7.0)),
        (_plane, _straight, (0.0, 0.0, 10.0, 10.0), (1.0, 2.0), (9.0, 7.0)),
        (_coil, _coil_length, (0.0, 0.0, 10.0, 10.0), (1.0, 1.0), (9.0, 8.0)),
    ],
    ids=["cap", "cap-off-centre", "cylinder", "plane", "coil"],
)
def test_paths_meet_the_closed_form_from_above(function, truth, bounds, start, goal):
    surface = tp.Surface.from_function(function, bounds, tolerance=1e-6)
    problem = tp.Problem(surface, start, goal)
    shortest = truth(start, goal)
    for seed in range(2):
        solution = tp.RRTStar(seed=seed).solve(problem)
        # |ds| = sqrt(1 + |grad|^2) moves by no more than the gradient's error, so a fit to
        # 1e-6 changes a length by at most 1e-6 a unit of planar way (and layer).
        slack = 1e-6 * solution.path.line.length * len(surface.layers)
        assert solution.length >= shortest - slack
        assert solution.length <= 1.01 * shortest


# Flat ground with obstacles


@pytest.mark.parametrize("name", LAYOUTS)
def test_around_polygons_on_flat_ground_no_path_beats_the_visibility_graph(name):
    polygons = LAYOUTS[name]
    problem = tp.Problem(FLAT, (0.0, 0.0), (10.0, 10.0), REGION, polygons)
    shortest = oracles.visibility_length((0.0, 0.0), (10.0, 10.0), polygons, REGION)
    solution = tp.RRTStar(samples=20_000, seed=1).solve(problem)
    assert shapely.disjoint(solution.path.line, polygons).all()
    assert solution.path.line.length == pytest.approx(solution.length, rel=1e-12)
    assert shortest * (1.0 - 1e-12) <= solution.length <= 1.01 * shortest


def test_the_visibility_graph_agrees_with_a_path_known_by_hand():
    # Round the lower right corner of a box: two straight pieces by symmetry of the box.
    length = oracles.visibility_length((0.0, 0.0), (10.0, 10.0), LAYOUTS["box"], REGION)
    left, right = (3.0, 7.0), (8.0, 2.0)
    ways = [math.dist((0, 0), corner) + math.dist(corner, (10, 10)) for corner in (left, right)]
    assert length == pytest.approx(min(ways), rel=1e-14)
    assert length > math.sqrt(200.0)
