"""Travel models: their literature, their relaxation, their lower lines."""

import pickle
import re

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import terrapath as tp
from processes import in_another_process
from terrapath.travel.registry import EXAMPLES, MODELS as REGISTERED
from travel_judges import LOOSE, MODELS, cases, model_of, pace_of, sampled_hull

GRADES = np.linspace(-1.2, 1.2, 2401)

each_model = pytest.mark.parametrize("name", MODELS)


def made(name):
    return MODELS[name][0]()


def test_every_model_is_in_the_registry_and_has_its_literature():
    assert {name for name in dir(tp.travel) if name in REGISTERED} == set(REGISTERED)
    for name in REGISTERED:
        model = tp.travel.by_name(name, **EXAMPLES.get(name, {}))
        assert model.name == name
        assert re.search(r"(18|19|20)\d\d", model.source)
        assert model.unit in ("s", "J", "J/kg")
        assert model.grades[0] < 0 < model.grades[1]


# The literature


@each_model
def test_the_raw_pace_is_that_of_the_literature(name):
    expected, actual = pace_of(name)(GRADES), made(name).raw(GRADES)
    assert np.array_equal(np.isfinite(actual), np.isfinite(expected))
    there = np.isfinite(expected)
    np.testing.assert_allclose(actual[there], expected[there], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "grade", "speed"),
    [
        # Tobler: 6 km/h at most, on a gentle descent; 5 km/h on level ground; 0.6 off paths.
        (tp.travel.tobler(), -0.05, 6.0 / 3.6),
        (tp.travel.tobler(), 0.0, 5.037 / 3.6),
        (tp.travel.tobler(factor=0.6), -0.05, 3.6 / 3.6),
        # Irmischer and Clarke: 1.11 m/s at -5 % on paths, 0.78 m/s at -2 % off them.
        (tp.travel.irmischer_clarke(), -0.05, 1.11),
        (tp.travel.irmischer_clarke(terrain="off-path"), -0.02, 0.78),
        (tp.travel.irmischer_clarke(terrain="off-path", sex="female"), -0.02, 0.95 * 0.78),
        (tp.travel.naismith(), 0.0, 5.0 / 3.6),
        (tp.travel.vehicle(1000, 0.1, speed=3.0, minimise="time"), 0.0, 3.0),
    ],
)
def test_speeds_that_the_literature_names(model, grade, speed):
    assert 1.0 / model.raw(grade) == pytest.approx(speed, rel=1e-3)


def test_naismith_on_his_own_excursion():
    # "10 miles, 6,300 feet: 6 1/2 hours", Scottish Mountaineering Club Journal, 1892.
    length, climb = 10 * 1609.344, 6300 * 0.3048
    hours = (length * tp.travel.naismith().raw(0.0) + 6.0 * climb) / 3600
    assert hours == pytest.approx(6.5, abs=0.1)


def test_minetti_is_within_the_measured_errors_at_the_steepest_grades():
    # Minetti et al. (2002): 17.33 +- 1.11 J/kg/m at 0.45, 3.46 +- 0.95 at -0.45, along the slope.
    model = tp.travel.minetti()
    along = np.hypot(1.0, 0.45)
    assert model.raw(0.45) / along == pytest.approx(17.33, abs=1.11)
    assert model.raw(-0.45) / along == pytest.approx(3.46, abs=0.95)


def test_pandolf_by_hand():
    # 70 kg, 10 kg, 1.34 m/s on the level: 105 + 2 * 80 / 49 + 80 * 1.5 * 1.34^2 watts.
    expected = (105 + 160 / 49 + 120 * 1.34**2) / 1.34
    assert tp.travel.pandolf(70, 10).raw(0.0) == pytest.approx(expected, rel=1e-12)
    assert tp.travel.pandolf(terrain=2.1).raw(0.1) > 1.5 * tp.travel.pandolf().raw(0.1)


@pytest.mark.parametrize("percentile", [1, 5, 50, 99])
def test_campbell_is_fastest_a_little_downhill_and_faster_for_higher_percentiles(percentile):
    model = tp.travel.campbell(percentile=percentile)
    fastest = GRADES[np.argmin(model.raw(GRADES))]
    assert -0.1 < fastest < 0.0
    faster = tp.travel.campbell(percentile=99)
    assert (faster.raw(GRADES[900:1500]) <= model.raw(GRADES[900:1500])).all()


def test_factors_and_masses_scale():
    for make in (tp.travel.tobler, tp.travel.naismith, tp.travel.langmuir, tp.travel.campbell):
        np.testing.assert_allclose(2.0 * make(factor=2.0)(GRADES), make()(GRADES), rtol=1e-12)
    per_kilogram, whole = tp.travel.minetti(), tp.travel.minetti(mass=80.0)
    assert (per_kilogram.unit, whole.unit) == ("J/kg", "J")
    np.testing.assert_allclose(whole(GRADES), 80.0 * per_kilogram(GRADES), rtol=1e-12)


# Relaxation


def test_critical_grades_of_tobler():
    assert tp.travel.tobler().critical == pytest.approx((-2 / 7, 2 / 7), abs=1e-12)


def test_critical_grades_of_minetti_are_the_roots_nearest_to_level_ground():
    # p = m p' for p = C(m) sqrt(1 + m^2) is (C - m C') (1 + m^2) = m^2 C.
    cost, m = Polynomial((2.5, 19.6, 51.9, -76.8, -58.7, 280.5)), Polynomial((0, 1))
    roots = ((cost - m * cost.deriv()) * (1 + m**2) - m**2 * cost).roots()
    real = roots[np.abs(roots.imag) < 1e-12].real
    expected = max(real[real < 0]), min(real[real > 0])
    assert tp.travel.minetti().critical == pytest.approx(expected, abs=1e-10)


def test_models_without_critical_grades():
    assert tp.travel.naismith().critical == (-np.inf, np.inf)
    assert tp.travel.langmuir().critical == (-0.2125, np.inf)
    assert tp.travel.langmuir().raw(-0.2125) == pytest.approx(0.72 - 1.9998 * 0.2125)


@each_model
@pytest.mark.parametrize("gradient", [0.1, 0.3, 0.7, 2.0])
def test_the_relaxed_pace_is_the_convex_hull_of_the_cost_of_planar_velocities(name, gradient):
    model = made(name)
    marks = MODELS[name][2]
    _, grades, hull = sampled_hull(pace_of(name), gradient, marks, model.gauge)
    excess = hull / (model(grades) - model.gauge * grades) - 1.0
    assert excess.min() > -1e-9
    assert excess.max() < LOOSE.get(name, 1e-5)
    assert bool(model.bridges) == (name in LOOSE)


@pytest.mark.parametrize("name", LOOSE)
def test_where_the_pace_is_not_convex_the_hull_of_ever_steeper_ground_comes_down_to_p(name):
    model, marks = made(name), MODELS[name][2]
    low, high = np.array(model.bridges).min(), np.array(model.bridges).max()
    excesses = []
    for gradient in (0.6, 1.2, 2.4):
        _, grades, hull = sampled_hull(pace_of(name), gradient, marks, count=400_000)
        inside = (grades > 0.9 * low) & (grades < 0.9 * high)
        excesses.append((hull / model(grades) - 1.0)[inside].max())
    assert excesses[0] > 2.5 * excesses[1] > 6.25 * excesses[2] > 0 or name == "pandolf"
    assert excesses[2] < 0.005


@each_model
def test_what_makes_it_a_relaxed_pace(name):
    model = made(name)
    pace, raw = model(GRADES), pace_of(name)(GRADES)
    size = np.abs(pace).max()
    assert (pace <= raw + 1e-12 * size).all()
    value, slope, curvature = model.jets(GRADES).T
    np.testing.assert_allclose(value, pace, rtol=0, atol=1e-14 * size)
    assert (curvature >= -1e-9 * size).all()
    assert (np.diff(slope) >= -1e-9 * size).all()
    # F is convex in the velocity: P - m P' >= 0, and 0 beyond the critical grades.
    intercepts = value - GRADES * slope
    assert (intercepts >= -1e-12 * size).all()
    low, high = model.critical
    straight = (low - 1e-9 <= GRADES) & (high + 1e-9 >= GRADES)
    assert np.abs(intercepts[~straight]).max(initial=0.0) <= 1e-11 * size
    assert (pace - model.gauge * GRADES > 0).all()


@each_model
def test_derivatives_are_those_of_the_values(name):
    model, step = made(name), 1e-5
    marks = (*model.pace.kinks, *model.critical, *np.ravel(model.bridges))
    near = [np.abs(GRADES - m) < 3 * step for m in marks if np.isfinite(m)]
    grades = GRADES[~np.any(near, axis=0)] if near else GRADES
    _, slope, curvature = model.jets(grades).T
    size = np.abs(slope).max()
    differences = (model(grades + step) - model(grades - step)) / (2 * step)
    np.testing.assert_allclose(slope, differences, atol=1e-7 * size)
    differences = (model.jets(grades + step) - model.jets(grades - step))[:, 1] / (2 * step)
    np.testing.assert_allclose(curvature, differences, atol=1e-4 * max(np.abs(curvature).max(), 1))


@each_model
def test_kinks_are_known(name):
    model = made(name)
    fine = np.linspace(-0.9, 0.9, 180_001)
    slope = model.jets(fine)[:, 1]
    jumps = np.diff(slope) > 1e-3 * np.abs(slope).max()
    at = 0.5 * (fine[1:] + fine[:-1])[jumps]
    assert len(at) == len(model.pace.kinks[np.abs(model.pace.kinks) < 0.9])
    assert all(np.abs(model.pace.kinks - m).min() < 2e-5 for m in at)


# Lower lines


@each_model
def test_lower_lines_lie_below_and_come_within_the_tolerance(name):
    model = made(name)
    size = np.abs(model(GRADES)).max()
    for tolerance in (1e-6, 1e-4, 1e-2):
        slopes, intercepts = model.dual(tolerance)
        assert (np.diff(slopes) > 0).all()
        assert (intercepts >= 0).all()
        least = (intercepts[:, None] + slopes[:, None] * GRADES).max(axis=0)
        below = model(GRADES) - least
        assert below.min() >= -1e-12 * size
        assert (below / (model(GRADES) - model.gauge * GRADES)).max() <= 1.001 * tolerance
    assert len(model.dual(1e-4)[0]) < 200


@each_model
def test_intercepts_are_the_least_of_pace_less_line(name):
    model = made(name)
    slopes, intercepts = model.dual()
    asked = np.linspace(slopes[0], slopes[-1], 41)[1:-1]
    fine = np.union1d(np.linspace(-3.0, 3.0, 60_001), model.pace.knots)
    pace, size = model(fine), np.abs(model(GRADES)).max()
    expected = [(pace - slope * fine).min() for slope in asked]
    np.testing.assert_allclose(model.intercepts(asked), expected, rtol=0, atol=1e-8 * size)
    np.testing.assert_allclose(model.intercepts(slopes), intercepts, rtol=0, atol=1e-11 * size)
    beyond = np.array([slopes[0] - 0.01 * size, slopes[-1] + 0.01 * size])
    assert (model.intercepts(beyond) == -np.inf).all()


@pytest.mark.parametrize("name", [name for name in MODELS if name not in LOOSE])
@pytest.mark.parametrize("gradient", [0.15, 0.9])
def test_the_dual_ball_is_the_union_of_discs(name, gradient):
    model = made(name)
    directions, _, hull = sampled_hull(pace_of(name), gradient, MODELS[name][2], model.gauge)
    # Between two lines that meet at a kink all slopes have discs of their own.
    slopes = model.dual(1e-5)[0]
    slopes = np.union1d(slopes, np.linspace(slopes[0], slopes[-1], 800))
    radii, centres = model.intercepts(slopes), (slopes - model.gauge) * gradient
    # Its support in each direction is the cost of that direction.
    support = (directions[:, :1] * centres + radii).max(axis=1)
    np.testing.assert_allclose(support, hull, rtol=2e-5)
    # It is convex: what no direction rules out lies in one of the discs.
    random = np.random.default_rng(1)
    size = np.abs(support).max()
    points = random.uniform(-size, size, (1000, 2))
    outside = (np.hypot(points[:, :1] - centres, points[:, 1:]) - radii).min(axis=1)
    ruled_out = (points @ directions.T - hull).max(axis=1)
    assert (ruled_out[outside <= 0] <= 2e-5 * size).all()
    assert (outside[ruled_out <= 0] <= 1e-3 * size).all()


# Reversal, gauge


@each_model
def test_the_way_back_has_the_opposite_grades(name):
    model = made(name)
    back = model.reversed()
    np.testing.assert_allclose(back(GRADES), model(-GRADES), rtol=1e-13, atol=1e-9)
    np.testing.assert_array_equal(back.raw(GRADES), model.raw(-GRADES))
    assert back.critical == (-model.critical[1], -model.critical[0])
    assert back.reversed().name == model.name
    np.testing.assert_array_equal(back.reversed()(GRADES), model(GRADES))
    for mine, theirs in zip(
        back.dual(), (-model.dual()[0][::-1], model.dual()[1][::-1]), strict=True
    ):
        np.testing.assert_array_equal(mine, theirs)


@each_model
def test_the_gauged_pace_is_positive_and_differs_by_a_multiple_of_the_grade(name):
    model = made(name)
    gauged = model.gauged()
    assert (gauged is model) == (model.gauge == 0.0)
    assert (gauged(GRADES) > 0).all()
    size = np.abs(model(GRADES)).max()
    expected = model(GRADES) - model.gauge * GRADES
    np.testing.assert_allclose(gauged(GRADES), expected, atol=1e-12 * size)
    below = gauged.raw(GRADES) - gauged(GRADES)
    assert below.min() > -1e-12 * size
    slopes, intercepts = gauged.dual()
    least = (intercepts[:, None] + slopes[:, None] * GRADES).max(axis=0)
    np.testing.assert_allclose(least, gauged(GRADES), rtol=1.1e-6)


def test_regeneration_makes_paces_below_zero_and_a_gauge_mends_it():
    model = tp.travel.vehicle(1000.0, 0.1, regeneration=0.7)
    assert model(-0.3) == pytest.approx(-0.7 * 9810 * 0.2)
    assert model.gauge == pytest.approx(9810.0)
    assert model.critical == (-np.inf, np.inf)


def test_full_regeneration_is_an_affine_pace():
    model = tp.travel.vehicle(1000.0, 0.1, regeneration=1.0)
    np.testing.assert_allclose(model(GRADES), 9810 * (0.1 + GRADES), atol=1e-8)
    np.testing.assert_allclose(model.gauged()(GRADES), 981.0)
    assert len(model.dual()[0]) == 1


# Vehicles


def test_power_slows_a_vehicle_on_climbs_or_limits_them():
    quick = tp.travel.vehicle(1000.0, 0.1, power=6000.0, speed=4.0, minimise="time")
    assert quick.unit == "s"
    assert 1.0 / quick(0.0) == pytest.approx(4.0)
    climb = 0.3
    along = np.hypot(1.0, climb)
    assert along / quick(climb) == pytest.approx(6000.0 / (9810 * (0.1 + climb) / along))
    steady = tp.travel.vehicle(1000.0, 0.1, power=6000.0, speed=4.0)
    limit = steady.grades[1]
    assert 9810 * (0.1 + limit) / np.hypot(1, limit) * 4.0 == pytest.approx(6000.0)
    assert steady.critical[1] == limit
    assert steady(2 * limit) == pytest.approx(2 * steady(limit))


def test_beyond_a_largest_climb_switchbacks_at_it_are_taken():
    model = tp.travel.vehicle(1000.0, 0.15, largest_climb=0.25, largest_descent=0.3)
    assert model.raw(0.26) == np.inf
    assert model.raw(-0.31) == np.inf
    assert model(1.0) == pytest.approx(4 * model(0.25))
    # From -0.15 on it rolls for nothing.
    assert model.critical == pytest.approx((-0.15, 0.25), abs=1e-15)


# The file of cases


def test_planes_and_gauges_of_the_file():
    for case in cases("plane"):
        model = model_of(case["pace"])
        start, goal = np.array(case["A"]), np.array(case["B"])
        step = goal - start
        length = np.hypot(*step)
        grade = step @ case["surface"]["gradient"] / length
        for asked, raw, m in (("A_to_B", 0, grade), ("B_to_A", 1, -grade)):
            tolerance = max(1e-9 * abs(case[asked]), 1e-8)
            assert length * model(m) == pytest.approx(case[asked], abs=tolerance), case["name"]
            straight = case["straight_line_raw"][raw]
            if straight is not None and np.isfinite(model.raw(m)):
                assert length * model.raw(m) == pytest.approx(straight, rel=1e-9), case["name"]


def test_values_that_need_the_ends_alone():
    # An affine pace, and grades above -mu: the planar length and the height decide.
    for case in cases("gauge"):
        model = model_of(case["pace"])
        start, goal = np.array(case["A"]), np.array(case["B"])
        heights = [
            sum(a * np.exp(-f * ((p[0] - x) ** 2 + (p[1] - y) ** 2)) for a, f, x, y in peaks)
            for p in (start, goal)
            for peaks in [case["surface"]["peaks"]]
        ]
        length, rise = np.hypot(*(goal - start)), heights[1] - heights[0]
        assert length * model(rise / length) == pytest.approx(case["A_to_B"], rel=1e-9)
        assert length * model(-rise / length) == pytest.approx(case["B_to_A"], rel=1e-9)


# As data


@pytest.mark.parametrize("name", REGISTERED)
def test_a_model_can_be_sent_to_a_process(name):
    model = tp.travel.by_name(name, **EXAMPLES.get(name, {}))
    sent = pickle.loads(pickle.dumps(model.reversed().gauged()))
    np.testing.assert_array_equal(sent(GRADES), model.reversed().gauged()(GRADES))
    np.testing.assert_array_equal(sent.raw(0.1), model.reversed().gauged().raw(0.1))


def test_kernels_run_as_plain_python():
    program = (
        "import json, numpy as np, terrapath as tp\n"
        "model = tp.travel.tobler()\n"
        "grades = np.linspace(-1, 1, 41)\n"
        "print(json.dumps([model(grades).tolist(), model.intercepts([0.5, 2.0]).tolist()]))\n"
    )
    values, intercepts = in_another_process(program, NUMBA_DISABLE_JIT="1")
    model = tp.travel.tobler()
    np.testing.assert_allclose(values, model(np.linspace(-1, 1, 41)), rtol=1e-14)
    np.testing.assert_allclose(intercepts, model.intercepts([0.5, 2.0]), rtol=1e-14)


def test_shapes_are_kept():
    model = tp.travel.tobler()
    assert np.ndim(model(0.1)) == 0
    assert model([]).shape == (0,)
    assert model(np.zeros((2, 3))).shape == (2, 3)
    assert model.jets(np.zeros((2, 3))).shape == (2, 3, 3)
    assert repr(tp.travel.tobler(factor=0.6)) == "tobler(factor=0.6)"
