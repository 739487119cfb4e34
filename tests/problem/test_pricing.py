"""Problems with a travel model: what their paths cost, what is refused, and what is said."""

import numpy as np
import pytest

import terrapath as tp
from travel_judges import MODELS, cases, model_of
from travel_problems import BOUNDS, SLOPE, heading, hills, plane, slow_value

each_model = pytest.mark.parametrize("name", MODELS)


def made(name):
    return MODELS[name][0]()


def problem_of(model, degrees=0.0, gradient=0.2, **more):
    return tp.Problem(plane(gradient), *heading(degrees), BOUNDS, travel=model, **more)


def straight(problem):
    return problem.path([problem.start, problem.goal])


# Values


@each_model
@pytest.mark.parametrize("gradient", [0.05, 0.3, 1.0])
def test_on_a_plane_a_straight_path_costs_its_length_times_the_pace_and_nothing_costs_less(
    name, gradient
):
    model = made(name)
    for degrees in range(0, 360, 15):
        problem = problem_of(model, degrees, gradient)
        expected = 400.0 * float(model(gradient * np.cos(np.radians(degrees))))
        size = 400.0 * float(model.gauged()(0.0))
        assert straight(problem).value == pytest.approx(expected, rel=1e-9, abs=1e-9 * size)
        assert problem.chord == pytest.approx(expected, rel=1e-9, abs=1e-9 * size)


@each_model
def test_the_value_is_that_of_a_slow_quadrature(name):
    model, rng = made(name), np.random.default_rng(3)
    for surface in (hills(), hills(3.0)):
        points = rng.uniform(100.0, 900.0, (3, 2))
        problem = tp.Problem(surface, points[0], points[-1], BOUNDS, travel=model)
        expected = slow_value(surface, model, points)
        assert problem.path(points).value == pytest.approx(expected, rel=1e-9)


def test_a_kink_beside_the_end_of_a_segment_is_seen():
    # The grade is 2 x - 0.03 along the line: every rule is exact, and none has a node there.
    axis = np.linspace(-1.0, 2.0, 7)
    x, _ = np.meshgrid(axis, axis)
    surface = tp.Surface.from_grid(x * x - 0.03 * x, axis, axis)
    problem = tp.Problem(surface, (0.0, 0.0), (0.49, 0.0), travel=tp.travel.naismith())
    above = 6.0 * ((0.49**2 - 0.03 * 0.49) - (0.015**2 - 0.03 * 0.015))
    assert straight(problem).value == pytest.approx(0.72 * 0.49 + above, rel=1e-11)


@each_model
def test_the_way_back_costs_what_the_reversed_pace_makes_of_it(name):
    model, rng = made(name), np.random.default_rng(7)
    points = rng.uniform(0.0, 1000.0, (12, 2))
    there = tp.Problem(hills(), points[0], points[-1], BOUNDS, travel=model)
    back = tp.Problem(hills(), points[-1], points[0], BOUNDS, travel=model.reversed())
    size = there.path(points).gauged
    assert there.path(points).value == pytest.approx(back.path(points[::-1]).value, abs=1e-9 * size)
    assert there.chord == pytest.approx(back.chord, abs=1e-9 * size)


@each_model
def test_no_path_costs_less_than_the_chord(name):
    model, rng = made(name), np.random.default_rng(11)
    for _ in range(40):
        points = rng.uniform(0.0, 1000.0, (4, 2))
        problem = tp.Problem(hills(2.0), points[0], points[-1], BOUNDS, travel=model)
        path = problem.path(points)
        assert problem.chord <= path.value + 1e-9 * path.gauged


def test_costs_multiply_the_pace():
    model = tp.travel.tobler()
    dear = tp.Problem(plane(0.2, cost=1.5), *heading(30.0), BOUNDS, travel=model)
    plain = problem_of(model, 30.0)
    assert straight(dear).value == pytest.approx(1.5 * straight(plain).value, rel=1e-9)
    assert dear.chord == pytest.approx(1.5 * plain.chord, rel=1e-9)


def test_energy_that_is_gained_is_mended_by_a_gauge():
    model = tp.travel.vehicle(1000.0, 0.05, regeneration=0.8)
    path = straight(problem_of(model, 180.0, gradient=0.2))
    assert path.value == pytest.approx(-400.0 * 0.8 * 9810.0 * 0.15, rel=1e-9)
    assert path.gauged > 0.0
    assert path.profile.value[-1] == pytest.approx(path.value, rel=1e-9)


def test_the_pace_of_slope_distance_is_the_metric():
    rng = np.random.default_rng(5)
    points = rng.uniform(0.0, 1000.0, (6, 2))
    plain = tp.Problem(hills(), points[0], points[-1], BOUNDS)
    priced = tp.Problem(hills(), points[0], points[-1], BOUNDS, travel=SLOPE)
    assert priced.path(points).value == pytest.approx(plain.path(points).length, rel=1e-9)
    assert priced.chord == pytest.approx(plain.chord, rel=1e-9)
    assert priced.path(points).length == plain.path(points).length
    assert plain.path(points).value == plain.path(points).length


def test_the_grade_is_that_of_the_ground_whatever_the_weight_of_the_height():
    axis = np.linspace(0.0, 1000.0, 6)
    x, _ = np.meshgrid(axis, axis)
    steep = tp.Surface.from_grid(0.2 * x, axis, axis, weights=[7.0])
    path = straight(tp.Problem(steep, *heading(0.0), travel="tobler"))
    assert path.value == pytest.approx(400.0 * float(tp.travel.tobler()(0.2)), rel=1e-9)


def test_switchbacks_are_told_by_their_share():
    assert straight(problem_of(tp.travel.tobler(), 0.0, 0.5)).in_switchbacks == 1.0
    assert straight(problem_of(tp.travel.tobler(), 0.0, 0.2)).in_switchbacks == 0.0
    assert straight(tp.Problem(plane(0.5), *heading(0.0), BOUNDS)).in_switchbacks == 0.0


def test_planes_beside_the_clone():
    for case in cases("plane"):
        gradient, model = case["surface"]["gradient"][0], model_of(case["pace"])
        middle, scale = np.array([500.0, 500.0]), 0.4
        move = scale * np.subtract(case["B"], case["A"])
        for sign, expected in ((1.0, case["A_to_B"]), (-1.0, case["B_to_A"])):
            goal = middle + sign * move
            path = straight(tp.Problem(plane(gradient), middle, goal, BOUNDS, travel=model))
            size = 1e-9 * path.gauged
            assert path.value == pytest.approx(scale * expected, rel=1e-9, abs=size)


# What is refused


def refused(message, *surface, **more):
    with pytest.raises(tp.InputError, match=message):
        tp.Problem(*(surface or (plane(0.2),)), *heading(0.0), BOUNDS, **more)


def test_what_is_no_travel_model_is_refused():
    refused("did you mean tobler", travel="toblr")
    refused("is no travel model", travel=3.5)


def test_layers_that_cost_by_change_are_refused_with_the_remedy():
    axis = np.linspace(0.0, 1000.0, 6)
    x, y = np.meshgrid(axis, axis)
    values, names = np.array([0.1 * x, y]), ["height", "wind"]
    both = tp.Surface.from_grid(values, axis, axis, names=names)
    refused("'wind' cost.*make it a cost layer.*weight 0", both, travel="tobler")
    calm = both.with_weights({"wind": 0.0})
    assert tp.Problem(calm, *heading(0.0), travel="tobler").travel.name == "tobler"


def test_a_map_without_heights_is_refused():
    axis = np.linspace(0.0, 1000.0, 6)
    warm = tp.Surface.from_grid(np.zeros((6, 6)), axis, axis, names=["heat"], units=["K"])
    refused("no heights, but heat", warm, travel="tobler")


def test_ground_steeper_than_the_model_knows_names_the_range():
    table = tp.travel.from_table([-0.3, 0.0, 0.3], [1.0, 0.8, 1.0])
    refused("0.5; it was given for -0.3 to 0.3", plane(0.5), travel=table)
    assert tp.Problem(plane(0.2), *heading(0.0), travel=table).travel is table


def test_a_pace_below_zero_is_not_multiplied():
    gains = tp.travel.vehicle(1000.0, 0.05, regeneration=0.8)
    refused("cost layer must not multiply", plane(0.2, cost=2.0), travel=gains)
    free = tp.travel.vehicle(1000.0, 0.05)
    assert tp.Problem(plane(0.2, cost=2.0), *heading(0.0), travel=free).travel is free
