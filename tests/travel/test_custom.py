"""Tables and functions as travel models, any of them, and what cannot be one."""

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

import terrapath as tp
from common import numbers, one_line
from travel_judges import cheapest_mix, sampled_hull

GRADES = np.linspace(-2.0, 2.0, 81)


@st.composite
def tables(draw, lowest=0.05):
    """Grades on both sides of 0, and a pace for each."""
    count = draw(st.integers(1, 5)), draw(st.integers(1, 5))
    steps = [draw(st.lists(numbers(0.01, 0.5), min_size=n, max_size=n)) for n in count]
    level = [0.0] if draw(st.booleans()) else []
    grades = np.concatenate([-np.cumsum(steps[0])[::-1], level, np.cumsum(steps[1])])
    assume(len(grades) > 2)
    paces = draw(st.lists(numbers(lowest, 4.0), min_size=len(grades), max_size=len(grades)))
    return grades, np.array(paces)


@settings(max_examples=60, deadline=None)
@given(tables())
def test_the_relaxed_pace_of_any_table_is_the_cheapest_mix_of_its_rows(table):
    grades, paces = table
    model = tp.travel.from_table(grades, paces, beyond="switchbacks")
    # Level ground is between two rows where it is none itself.
    rows = np.append(grades, 0.0), np.append(paces, np.interp(0.0, grades, paces))
    for grade in (*GRADES[::16], *grades):
        assert model(grade) == pytest.approx(cheapest_mix(*rows, grade), rel=1e-7)
    assert (model(grades) <= paces * (1 + 1e-12)).all()
    low, high = model.critical
    assert low >= grades[0] - 1e-12
    assert high <= grades[-1] + 1e-12
    np.testing.assert_allclose(model(3 * high), 3 * model(high), rtol=1e-11)
    np.testing.assert_allclose(model.reversed()(GRADES), model(-GRADES), rtol=1e-12)
    slopes, intercepts = model.dual()
    least = (intercepts[:, None] + slopes[:, None] * GRADES).max(axis=0)
    np.testing.assert_allclose(least, model(GRADES), rtol=1e-10)


@settings(max_examples=60, deadline=None)
@given(tables(lowest=-2.0))
def test_a_table_is_refused_exactly_where_travelling_for_ever_pays(table):
    grades, paces = table
    rows = np.append(grades, 0.0), np.append(paces, np.interp(0.0, grades, paces))
    stay = cheapest_mix(*rows, 0.0)
    assume(stay is None or abs(stay) > 1e-6)
    if stay is None or stay < 0:
        with pytest.raises(tp.InputError, match=r"gauge|level ground"):
            tp.travel.from_table(grades, paces, beyond="switchbacks")
        return
    model = tp.travel.from_table(grades, paces, beyond="switchbacks")
    assert model(0.0) == pytest.approx(stay, rel=1e-7)
    assert (model.gauged()(GRADES) > 0).all()
    for grade in GRADES[::16]:
        assert model(grade) == pytest.approx(cheapest_mix(*rows, grade), rel=1e-7, abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(numbers(0.2, 3.0), numbers(-1.5, 1.5), numbers(0.2, 3.0), numbers(0.0, 2.0))
def test_the_relaxed_pace_of_any_smooth_function_is_the_hull(level, tilt, bend, wave):
    def pace(m):
        return level * np.exp(tilt * m + bend * m * m) + 0.1 * level * wave * (1 - np.cos(3 * m))

    model = tp.travel.from_function(pace, beyond="switchbacks")
    value, slope, curvature = model.jets(GRADES).T
    assert (value <= pace(GRADES) * (1 + 1e-12)).all()
    assert (curvature >= -1e-7 * value.max()).all()
    assert (value - GRADES * slope >= -1e-10 * value.max()).all()
    gradient = 0.8
    _, grades, hull = sampled_hull(pace, gradient, count=8000)
    excess = hull / model(grades) - 1.0
    assert excess.min() > -1e-9
    if not model.bridges:
        assert excess.max() < 1e-4


def test_the_metric_of_a_height_layer_is_one_of_them():
    model = tp.travel.from_function(
        lambda m: np.sqrt(1 + m * m), grades=(-50.0, 50.0), unit="m", name="height"
    )
    grades = np.linspace(-49.0, 49.0, 5001)
    value, slope, curvature = model.jets(grades).T
    root = np.hypot(1.0, grades)
    np.testing.assert_allclose(value, root, rtol=1e-12)
    np.testing.assert_allclose(slope, grades / root, atol=1e-9)
    np.testing.assert_allclose(curvature, root**-3, atol=1e-6)
    assert model.critical == (-50.0, 50.0)
    assert not model.bridges
    slopes = np.linspace(-0.99, 0.99, 21)
    np.testing.assert_allclose(model.intercepts(slopes), np.sqrt(1 - slopes**2), rtol=1e-9)


@pytest.mark.parametrize("kinks", [(), (-0.05,)])
def test_kinks_of_a_function_are_found_where_nobody_names_them(kinks):
    model = tp.travel.from_function(lambda m: 0.6 * np.exp(3.5 * np.abs(m + 0.05)), kinks=kinks)
    assert model.pace.kinks == pytest.approx([-0.05], abs=1e-9)
    np.testing.assert_allclose(model(GRADES), tp.travel.tobler()(GRADES), rtol=1e-10)
    assert len(model.pace.coefficients) < 10


@settings(max_examples=25, deadline=None)
@given(
    st.lists(numbers(-1.5, 1.5), min_size=3, max_size=3, unique=True),
    st.lists(numbers(-1.5, 2.5), min_size=3, max_size=3),
    numbers(-1.0, 1.0),
)
def test_kinks_and_jumps_of_a_function_are_found_wherever_they_are(places, bends, jump):
    assume(np.diff(np.sort(places)).min() > 1e-3)
    assume(np.abs(places).min() > 1e-3)

    def pace(m):
        bent = sum(bend * np.abs(m - place) for bend, place in zip(bends, places, strict=True))
        return 12.0 + bent + np.where(m > places[0], jump, 0.0)

    model = tp.travel.from_function(pace, beyond="switchbacks")
    above = np.nextafter(places[0], 9.0)
    rows = np.array([-2.0, 2.0, 0.0, *places, above])
    for grade in (*GRADES[::8], *places):
        assert model(grade) == pytest.approx(cheapest_mix(rows, pace(rows), grade), rel=1e-7)


def test_a_jump_of_a_function_is_found():
    def pace(m):
        rates = np.select([m >= 0, m >= -0.2125], [6, 1.9998], -1.9998)
        return 0.72 + rates * m

    model = tp.travel.from_function(pace)
    np.testing.assert_allclose(model(GRADES), tp.travel.langmuir()(GRADES), rtol=1e-9)


def test_a_table_per_slope_distance():
    table = [-0.5, 0.0, 0.5], [1.0, 0.7, 2.0]
    model = tp.travel.from_table(*table, distance="slope")
    assert model.raw(0.25) == pytest.approx(np.hypot(1, 0.25) * 1.35)
    assert tp.travel.from_table(*table).raw(0.25) == pytest.approx(1.35)


def test_what_is_steeper_than_a_table_is_refused_unless_its_critical_grade_is_inside():
    table = [-0.4, 0.0, 0.4], [1.0, 0.7, 2.0]
    model = tp.travel.from_table(*table, unit="s")
    for ask in (model, model.raw, model.require_known):
        with pytest.raises(
            tp.InputError, match=r"grade 0\.5; it was given for -0\.4 to 0\.4"
        ) as caught:
            ask(0.5)
        assert "switchbacks" in one_line(caught)
    model.require_known(0.4)
    with pytest.raises(tp.InputError, match=r"grade 0\.6"):
        model.reversed()(0.6)
    steep = tp.travel.from_table(*table, beyond="switchbacks")
    assert steep(0.8) == pytest.approx(4.0)
    assert steep.raw(0.8) == np.inf
    steep.require_known(9.0)
    known = tp.travel.from_table([-0.5, -0.2, 0.0, 0.3, 0.5], [3.0, 0.9, 0.7, 2.0, 5.0])
    assert known.critical == pytest.approx((-0.2, 0.3))
    assert known(1.0) == pytest.approx(1.0 / 0.3 * 2.0)
    known.require_known(9.0)
    with pytest.raises(tp.InputError, match="no pace for the grade 1"):
        known.raw(1.0)


# Bad input

SQUARE = ([-1.0, 0.0, 1.0], [1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tp.travel.from_table([0.0, 0.1], [1.0, 2.0]), "has 2 rows; a table needs three"),
        (lambda: tp.travel.from_table([-0.1, 0.2, 0.1], [1, 2, 3]), "row 2 is 0.2 and row 3 0.1"),
        (lambda: tp.travel.from_table([-0.1, 0.1, 0.1], [1, 2, 3]), "must increase"),
        (lambda: tp.travel.from_table([0.0, 0.1, 0.2], [1, 2, 3]), "below 0 to above 0"),
        (lambda: tp.travel.from_table([-0.1, 0.0, 0.1], [1, np.nan, 3]), "not finite"),
        (lambda: tp.travel.from_table([-0.1, 0.0, np.inf], [1, 2, 3]), "not finite"),
        (lambda: tp.travel.from_table([-0.1, 0.0, 0.1], [1, 2]), "3 rows and paces 2"),
        (lambda: tp.travel.from_table("steep", [1, 2]), "not an array"),
        (lambda: tp.travel.from_table([-0.1, 0.0, 0.1], [1, 0, 1]), "must be above 0"),
        (lambda: tp.travel.from_table([-0.1, 0.0, 0.1], [1, -1, 1]), "must be above 0"),
        (lambda: tp.travel.from_table([-0.1, 0.0, 0.1], [-1, 1, 0.5]), "no gauge mends it"),
        (lambda: tp.travel.from_table(*SQUARE, unit=""), "not a unit"),
        (lambda: tp.travel.from_table(*SQUARE, distance="flat"), "horizontal, slope"),
        (lambda: tp.travel.from_table(*SQUARE, beyond="stop"), "switchbacks, refuse"),
        (lambda: tp.travel.from_function(3.0), "not a function"),
        (lambda: tp.travel.from_function(lambda m: 1 / m), "must be above 0"),
        (lambda: tp.travel.from_function(np.sqrt), "nan at the grade -"),
        (lambda: tp.travel.from_function(lambda m: -1.0 - m * m), "must be above 0"),
        (
            lambda: tp.travel.from_function(lambda m: 1.0 + m if m > 0 else 1.0),
            "an array of grades",
        ),
        (lambda: tp.travel.from_function(lambda m: m[:3]), "one pace for each grade"),
        (lambda: tp.travel.from_function(lambda m: 1 + np.sin(1e6 * m)), "too rough"),
        (lambda: tp.travel.from_function(np.exp, grades=(0.1, 0.5)), "below 0 to above 0"),
        (lambda: tp.travel.from_function(np.exp, grades=0.5), "not a range"),
        (lambda: tp.travel.tobler(factor=0.0), "factor=0 must be a finite number above 0"),
        (lambda: tp.travel.naismith(factor=-1), "factor=-1 must be"),
        (lambda: tp.travel.langmuir(factor=np.inf), "factor=inf must be"),
        (lambda: tp.travel.campbell(percentile=51), "51 is not in the table"),
        (lambda: tp.travel.irmischer_clarke(terrain="road"), "path, off-path"),
        (lambda: tp.travel.minetti(mass=0), "mass=0 must be"),
        (lambda: tp.travel.pandolf(load=-1), "load=-1 must be"),
        (lambda: tp.travel.vehicle(1000, 0), "rolling_resistance=0 must be"),
        (lambda: tp.travel.vehicle(1000, 0.1, largest_climb=0), "largest_climb=0 must be"),
        (lambda: tp.travel.vehicle(1000, 0.1, largest_descent=-0.2), "largest_descent=-0.2 must"),
        (lambda: tp.travel.vehicle(1000, 0.1, regeneration=1.2), "between 0 and 1"),
        (lambda: tp.travel.vehicle(1000, 0.1, power=5000), "needs a speed"),
        (lambda: tp.travel.vehicle(1000, 0.1, minimise="time"), "needs a speed"),
        (lambda: tp.travel.vehicle(1000, 0.1, power=900, speed=1), "too little for speed=1"),
        (lambda: tp.travel.by_name("tobbler"), "did you mean tobler?"),
        (lambda: tp.travel.by_name("irmischer"), "did you mean irmischer_clarke?"),
        (lambda: tp.travel.by_name("car"), "choose one of tobler, naismith"),
        (lambda: tp.travel.by_name("tobler", fraction=1), "did you mean factor?"),
        (lambda: tp.travel.by_name("vehicle", mass=10), "needs rolling_resistance"),
        (lambda: tp.travel.tobler()([0.0, np.nan]), "not finite"),
        (lambda: tp.travel.tobler()("steep"), "not an array"),
        (lambda: tp.travel.tobler().dual(0.0), "tolerance=0 must be"),
    ],
)
def test_what_cannot_be_a_model_is_refused_in_one_line(make, message):
    with pytest.raises(tp.InputError, match=message) as caught:
        make()
    one_line(caught)
