"""Refinement with a travel model: closed forms, kinks, obstacles, and ground of switchbacks."""

import numpy as np
import pytest

import terrapath as tp
from terrapath.geodesics.refinement import newton
from terrapath.geodesics.refinement.paced import with_width
from travel_judges import MODELS, cases, model_of
from travel_problems import BOUNDS, ENDS, SLOPE, WALL, heading, hills, plane, ways_round_the_wall


def refined(problem, spacing=25.0):
    rough = tp.plan(problem, "dijkstra", spacing=spacing).path
    path = tp.refine(problem, rough)
    assert path.gauged <= rough.gauged * (1.0 + 1e-12)
    assert problem.allows(path)
    return path


@pytest.mark.parametrize("name", MODELS)
def test_on_planes_the_refined_value_is_the_closed_form(name):
    model = MODELS[name][0]()
    for gradient in (0.05, 0.3, 1.0):
        for degrees in (0.0, 40.0, 95.0, 170.0, 250.0, 330.0):
            problem = tp.Problem(plane(gradient), *heading(degrees), BOUNDS, travel=model)
            gauged = problem.chord - problem.taken_off
            assert refined(problem, 60.0).value == pytest.approx(problem.chord, abs=1e-9 * gauged)


@pytest.mark.parametrize("gradient", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("name", ["tobler", "langmuir", "minetti", "regeneration"])
def test_on_a_plane_with_a_wall_the_path_bends_at_its_corners(name, gradient):
    model = MODELS[name][0]()
    for start, goal in (((300.0, 450.0), (700.0, 520.0)), ((700.0, 520.0), (300.0, 450.0))):
        problem = tp.Problem(plane(gradient, 0.1), start, goal, BOUNDS, [WALL], travel=model)
        size = problem.path([start, goal]).gauged
        best = min(ways_round_the_wall(problem))
        assert refined(problem).value == pytest.approx(best, abs=1e-7 * size)


def test_an_affine_pace_is_cheapest_straight_over_all_hills():
    line = np.array([-1.0, 0.0, 1.0])
    model = tp.travel.from_table(line, 0.8 + 0.5 * line, beyond="switchbacks")
    problem = tp.Problem(hills(), *ENDS, BOUNDS, travel=model)
    # Curved paths have bends; the straight one has none.
    assert refined(problem).value == pytest.approx(problem.chord, rel=1e-9)


def test_the_pace_of_slope_distance_is_refined_as_the_metric():
    for obstacles in ((), [WALL]):
        plain = refined(tp.Problem(hills(), *ENDS, BOUNDS, obstacles))
        paced = refined(tp.Problem(hills(), *ENDS, BOUNDS, obstacles, travel=SLOPE))
        assert paced.value == pytest.approx(plain.length, rel=1e-6)


@pytest.mark.parametrize("name", ["tobler", "naismith", "irmischer_clarke", "vehicle"])
def test_the_way_back_has_the_value_of_the_reversed_pace(name):
    model = MODELS[name][0]()
    there = tp.Problem(hills(), *ENDS, BOUNDS, travel=model)
    path = refined(there)
    back = tp.Problem(hills(), *ENDS[::-1], BOUNDS, travel=model.reversed())
    again = tp.refine(back, path.points[::-1])
    # Naismith's path follows a contour line for long, where zigzags go away slowly.
    share = 3e-4 if name == "naismith" else 5e-5
    assert again.value == pytest.approx(path.value, abs=share * path.gauged)


def test_no_small_move_makes_a_refined_path_much_cheaper():
    rng = np.random.default_rng(1)
    for model in ("tobler", "langmuir"):
        problem = tp.Problem(hills(), *ENDS, BOUNDS, travel=model)
        path = refined(problem)
        t = np.linspace(0.0, 1.0, len(path.points))[:, None]
        for _ in range(30):
            k, side = rng.integers(1, 6), rng.normal(size=2)
            moved = path.points + rng.uniform(0.01, 5.0) * np.sin(np.pi * k * t) * side
            assert problem.path(moved).gauged >= path.gauged * (1.0 - 2e-5)


def test_steps_are_those_of_newton():
    axis = np.linspace(0.0, 1000.0, 41)
    x, y = np.meshgrid(axis, axis)
    z = 120.0 * np.exp(-4e-5 * ((x - 350.0) ** 2 + (y - 400.0) ** 2))
    cost = 1.0 + 0.5 * np.exp(-1e-5 * ((x - 600.0) ** 2 + (y - 500.0) ** 2))
    surface = tp.Surface.from_grid(np.array([z, cost]), axis, axis, kinds=["rise", "cost"])
    problem = tp.Problem(surface, (100.0, 150.0), (900.0, 250.0), travel="tobler")
    soft = with_width(problem.priced, 0.1)
    moves = np.random.default_rng(0).normal(0.0, 4.0, (7, 2))
    points = np.linspace(problem.start, problem.goal, 9)
    points[1:-1] += moves

    def derivative(moved):
        return newton.newton_step(newton.lift(soft, moved).strand, newton.all_free(moved))

    step, h = derivative(points), 1e-3
    assert step.definite
    columns, slopes = [], []
    for k in range(14):
        nudge = np.zeros_like(points)
        nudge[1 + k // 2, k % 2] = h
        ahead, behind = points + nudge, points - nudge
        slopes.append((newton.lift(soft, ahead).energy - newton.lift(soft, behind).energy) / 2 / h)
        difference = derivative(ahead).derivative - derivative(behind).derivative
        columns.append(difference.ravel() / 2 / h)
    np.testing.assert_allclose(step.derivative.ravel(), slopes, atol=1e-6 * np.abs(slopes).max())
    expected = np.linalg.solve(np.array(columns), -np.array(slopes))
    np.testing.assert_allclose(step.move.ravel(), expected, atol=1e-5 * np.abs(expected).max())


def test_ground_of_switchbacks_does_not_stall_it():
    # Most of the way is steeper than the vehicle climbs: many paths cost the same.
    model = tp.travel.vehicle(1000.0, 0.1, largest_climb=0.1, largest_descent=0.1)
    problem = tp.Problem(hills(2.0), (60.0, 60.0), (350.0, 400.0), BOUNDS, travel=model)
    path = refined(problem)
    assert path.in_switchbacks > 0.5
    assert problem.chord <= path.value * (1.0 + 1e-9)
    assert path.value < 1.03 * problem.chord
    finer = refined(problem, 10.0)
    assert path.value == pytest.approx(finer.value, rel=1e-5)


@pytest.mark.slow
def test_hills_with_known_values_beside_the_clone():
    for case in cases("peaks", "climb", "gauge"):
        surface = tp.Surface.from_peaks([case["surface"]["peaks"]])
        a, b = case["A"], case["B"]
        side = np.hypot(*np.subtract(a, b))
        around = (*(np.minimum(a, b) - 0.3 * side), *(np.maximum(a, b) + 0.3 * side))
        bounds, model = case.get("region") or around, model_of(case["pace"])
        for start, goal, expected in ((a, b, case["A_to_B"]), (b, a, case["B_to_A"])):
            problem = tp.Problem(surface, start, goal, bounds, travel=model)
            rough = tp.AStar(neighbours=32).solve(problem).path
            value = tp.refine(problem, rough).value
            assert value == pytest.approx(expected, rel=2e-5)
