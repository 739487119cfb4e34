"""Surfaces: exact peaks, splines through grids, splines that follow functions."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.interpolate import CubicSpline, RectBivariateSpline

import terrapath as tp
from common import numbers, one_line, points_in
from oracles import peaks_derivative_from_sympy, peaks_expressions, peaks_function

BOUNDS = (-1.0, -1.0, 11.0, 11.0)
JET = [(), ("x1",), ("x2",), ("x1", "x1"), ("x1", "x2"), ("x2", "x2")]


peak = st.tuples(
    st.one_of(numbers(0.1, 6.0), numbers(-6.0, -0.1)),
    numbers(0.02, 2.0),
    numbers(-1.0, 11.0),
    numbers(-1.0, 11.0),
)
layer_lists = st.lists(st.lists(peak, min_size=1, max_size=4), min_size=1, max_size=4)
seeds = st.integers(0, 2**32 - 1)


def jets(surface, points):
    """(..., layers, 6): f, fx, fy, fxx, fxy, fyy."""
    hessians = surface.hessians(points)
    return np.concatenate(
        [
            surface.values(points)[..., None],
            surface.gradients(points),
            hessians[..., 0, 0, None],
            hessians[..., 0, 1, None],
            hessians[..., 1, 1, None],
        ],
        axis=-1,
    )


# Peaks


@given(layer_lists, seeds)
@settings(deadline=None, max_examples=25)
def test_peaks_have_the_values_and_derivatives_that_sympy_finds(layers, seed):
    points = points_in(BOUNDS, 20, seed)
    found = jets(tp.Surface.from_peaks(layers), points)
    for k, layer in enumerate(layers):
        for d, variables in enumerate(JET):
            expected = peaks_derivative_from_sympy(layer, variables, *points.T)
            np.testing.assert_allclose(found[:, k, d], expected, rtol=1e-12, atol=1e-12)


@given(layer_lists, seeds)
@settings(deadline=None, max_examples=50)
def test_peaks_have_the_values_of_the_plain_formula_everywhere_on_the_plane(layers, seed):
    points = points_in((-50.0, -50.0, 50.0, 50.0), 50, seed)
    expected = peaks_function(layers)(*points.T).T
    found = tp.Surface.from_peaks(layers).values(points)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-300)


def test_hessians_are_symmetric_and_laid_out_by_layer():
    surface = tp.Surface.from_peaks([[(5, 0.1, 5, 5)], [(1, 1, 2, 2)]])
    hessians = surface.hessians(points_in(BOUNDS, 12, 0).reshape(3, 4, 2))
    assert hessians.shape == (3, 4, 2, 2, 2)
    np.testing.assert_array_equal(hessians, hessians.swapaxes(-1, -2))


def test_a_layer_without_peaks_is_flat():
    surface = tp.Surface.from_peaks([np.empty((0, 4)), [(1, 1, 0, 0)]])
    found = jets(surface, [[0.3, 0.4]])
    assert (found[0, 0] == 0.0).all()
    assert found[0, 1, 0] == pytest.approx(np.exp(-0.25), rel=1e-15)


@pytest.mark.parametrize(
    ("layers", "shown"),
    [
        ([], "empty"),
        ([[(5, 0, 5, 5)]], "falloff=0"),
        ([[(5, -0.25, 5, 5)]], "falloff=-0.25"),
        ([[(5, 0.1, 5)]], "(1, 3)"),
        ([[(np.nan, 0.1, 5, 5)]], "nan"),
        ([[(5, np.inf, 5, 5)]], "inf"),
        ([[(5, 0.1, "east", 5)]], "east"),
        ([(5, 0.1, 5, 5)], "(4,)"),
    ],
)
def test_peaks_that_make_no_surface_are_refused_with_the_value(layers, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_peaks(layers)
    assert shown in one_line(caught)


# Grids


def random_grid(seed, layers=2, rows=9, columns=12):
    random = np.random.default_rng(seed)
    x = random.uniform(-100, 100) + random.uniform(0.01, 100) * np.arange(columns)
    y = random.uniform(-100, 100) + random.uniform(0.01, 100) * np.arange(rows)
    return random.normal(size=(layers, rows, columns)), x, y


@given(seeds, st.integers(1, 3), st.integers(4, 15), st.integers(4, 15))
@settings(deadline=None, max_examples=50)
def test_a_grid_surface_passes_through_its_samples(seed, layers, rows, columns):
    values, x, y = random_grid(seed, layers, rows, columns)
    surface = tp.Surface.from_grid(values, x, y)
    points = np.stack(np.meshgrid(x, y), axis=-1)
    np.testing.assert_allclose(surface.values(points), np.moveaxis(values, 0, -1), atol=1e-12)
    assert surface.fit.value_error < 1e-12


@given(seeds, st.integers(4, 15), st.integers(4, 15))
@settings(deadline=None, max_examples=40)
def test_a_grid_surface_is_scipys_not_a_knot_spline_with_its_derivatives(seed, rows, columns):
    values, x, y = random_grid(seed, 2, rows, columns)
    surface = tp.Surface.from_grid(values, x, y)
    points = points_in((x[0], y[0], x[-1], y[-1]), 30, seed)
    points[0], points[1] = (x[0], y[0]), (x[-1], y[-1])
    points[2], points[3] = (x[3], y[-1]), (x[0], y[2])
    found = jets(surface, points)
    for k in range(2):
        spline = RectBivariateSpline(y, x, values[k], s=0)
        for d, variables in enumerate(JET):
            dx, dy = variables.count("x1"), variables.count("x2")
            expected = spline.ev(points[:, 1], points[:, 0], dx=dy, dy=dx)
            scale = (x[1] - x[0]) ** dx * (y[1] - y[0]) ** dy
            np.testing.assert_allclose(found[:, k, d] * scale, expected * scale, atol=2e-11)


@given(seeds)
@settings(deadline=None, max_examples=20)
def test_a_bicubic_polynomial_is_reproduced_exactly_up_to_the_domains_edge(seed):
    random = np.random.default_rng(seed)
    polynomial = random.normal(size=(4, 4))
    x, y = np.linspace(-1, 2, 7), np.linspace(0, 1, 5)
    values = np.polynomial.polynomial.polyval2d(*np.meshgrid(x, y), polynomial)
    surface = tp.Surface.from_grid(values, x, y)
    points = np.concatenate(
        [points_in((-1, 0, 2, 1), 30, seed), [[-1, 0], [2, 1], [2, 0], [-1, 1], [2, 0.3], [1.1, 1]]]
    )
    found = jets(surface, points)[:, 0]
    for d, variables in enumerate(JET):
        derived = np.polynomial.polynomial.polyder(polynomial, variables.count("x1"), axis=0)
        derived = np.polynomial.polynomial.polyder(derived, variables.count("x2"), axis=1)
        expected = np.polynomial.polynomial.polyval2d(*points.T, derived)
        np.testing.assert_allclose(found[:, d], expected, atol=1e-9)


@given(seeds)
@settings(deadline=None, max_examples=20)
def test_a_bicubic_polynomial_is_reproduced_from_unequal_steps_too(seed):
    random = np.random.default_rng(seed)
    polynomial = random.normal(size=(4, 4))
    x = np.concatenate([[0.0], np.cumsum(random.uniform(0.5, 1.5, 8))])
    y = np.concatenate([[-3.0], np.cumsum(random.uniform(0.5, 1.0, 6)) - 3.0])
    values = np.polynomial.polynomial.polyval2d(*np.meshgrid(x, y), polynomial)
    surface = tp.Surface.from_grid(values, x, y)
    points = points_in((x[0], y[0], x[-1], y[-1]), 30, seed)
    points[0], points[1] = (x[0], y[0]), (x[-1], y[-1])
    expected = np.polynomial.polynomial.polyval2d(*points.T, polynomial)
    scale = np.abs(values).max()
    np.testing.assert_allclose(surface.values(points)[:, 0], expected, atol=1e-11 * scale)
    assert surface.bounds == (x[0], y[0], x[-1], y[-1])


@given(seeds)
@settings(deadline=None, max_examples=20)
def test_the_error_that_is_reported_for_unequal_steps_is_the_largest_at_the_samples(seed):
    random = np.random.default_rng(seed)
    x = np.concatenate([[0.0], np.cumsum(random.uniform(0.5, 1.5, 8))])
    y = np.arange(6.0)
    values = random.normal(size=(2, 6, 9))
    surface = tp.Surface.from_grid(values, x, y)
    found = surface.values(np.stack(np.meshgrid(x, y), axis=-1))
    worst = np.abs(found - np.moveaxis(values, 0, -1)).max()
    assert surface.fit.value_error == pytest.approx(worst, rel=1e-12)
    assert 0.0 < worst < 1.0
    # A spline through all the samples differs from it by no more than a resampling can.
    points = points_in((0, 0, x[-1], 5), 50, seed)
    exact = [CubicSpline(x, CubicSpline(y, v, axis=0)(points[:, 1]), axis=1) for v in values]
    for k in range(2):
        expected = [exact[k](p)[m] for m, p in enumerate(points[:, 0])]
        assert np.abs(surface.values(points)[:, k] - expected).max() < 1.5


def test_smooth_data_on_unequal_steps_are_followed_closely():
    x = np.sort(np.linspace(0, 3, 60) + 0.01 * np.sin(7 * np.arange(60)))
    y = np.linspace(-1, 1, 40)
    surface = tp.Surface.from_grid(np.sin(np.add.outer(y, 2 * x)), x, y)
    points = points_in((x[0], -1, x[-1], 1), 500, 1)
    found = jets(surface, points)[:, 0]
    angle = points[:, 1] + 2 * points[:, 0]
    np.testing.assert_allclose(found[:, 0], np.sin(angle), atol=2e-5)
    np.testing.assert_allclose(found[:, 1], 2 * np.cos(angle), atol=2e-3)
    assert surface.fit.value_error < 2e-5


def test_the_splines_value_converges_at_order_4_and_its_gradient_at_order_3():
    points = points_in((0, 0, 3, 3), 4000, 3)
    x, y = points.T
    sizes, errors = [17, 33, 65, 129], []
    for n in sizes:
        axis = np.linspace(0, 3, n)
        gx, gy = np.meshgrid(axis, axis)
        found = jets(tp.Surface.from_grid(np.sin(2 * gx) * np.cos(1.5 * gy), axis, axis), points)
        value = np.abs(found[:, 0, 0] - np.sin(2 * x) * np.cos(1.5 * y)).max()
        slope_x = np.abs(found[:, 0, 1] - 2 * np.cos(2 * x) * np.cos(1.5 * y)).max()
        slope_y = np.abs(found[:, 0, 2] + 1.5 * np.sin(2 * x) * np.sin(1.5 * y)).max()
        errors.append([value, slope_x, slope_y])
    orders = -np.polyfit(np.log(np.array(sizes) - 1.0), np.log(errors), 1)[0]
    assert 3.6 < orders[0] < 4.6
    assert 2.6 < orders[1] < 3.6
    assert 2.6 < orders[2] < 3.6


def grid_with(value=None, shape=(5, 6)):
    values = np.zeros(shape)
    if value is not None:
        values[..., 2, 3] = value
    return values


@pytest.mark.parametrize(
    ("values", "x", "y", "shown"),
    [
        (grid_with(np.nan), np.arange(6), np.arange(5), "nan at index (0, 2, 3)"),
        (grid_with(-np.inf), np.arange(6), np.arange(5), "-inf"),
        (grid_with(shape=(3, 6)), np.arange(6), np.arange(3), "6 x 3"),
        (grid_with(shape=(5, 3)), np.arange(3), np.arange(5), "3 x 5"),
        (grid_with(), np.arange(6)[::-1], np.arange(5), "x does not increase"),
        (grid_with(), np.arange(6), np.arange(5)[::-1], "y does not increase"),
        (grid_with(), [0, 1, 1, 2, 3, 4], np.arange(5), "x does not increase"),
        (grid_with(), np.arange(5), np.arange(6), "(1, 5, 6)"),
        (grid_with(shape=(1, 1, 5, 6)), np.arange(6), np.arange(5), "(1, 1, 5, 6)"),
        (grid_with(), [0, 1, 2, 3, 4, np.nan], np.arange(5), "nan"),
        (grid_with(), [[0, 1, 2, 3, 4, 5]], np.arange(5), "(1, 6)"),
        ([["a"] * 6] * 5, np.arange(6), np.arange(5), "'a'"),
        (grid_with(), [0, 1, 2, 3, 4, 1e6], np.arange(5), "999996"),
    ],
)
def test_grids_that_make_no_surface_are_refused_with_the_value(values, x, y, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_grid(values, x, y)
    assert shown in one_line(caught)


# Functions


def sphere(x, y):
    return np.sqrt(25.0 - x**2 - y**2)


def sphere_gradient(x, y):
    return np.stack([-x / sphere(x, y), -y / sphere(x, y)])[:, None]


def cylinder(x, y):
    return np.sqrt(25.0 - x**2) + 0.0 * y


def cylinder_gradient(x, y):
    return np.stack([-x / cylinder(x, y), 0.0 * y])[:, None]


PEAKS = [[(5, 0.5, 3, 3), (-2, 0.2, 7, 3)], [(3, 0.5, 5, 8)]]


def peaks_gradient(x, y):
    f = [(a, b, x - cx, y - cy, k) for k, layer in enumerate(PEAKS) for a, b, cx, cy in layer]
    result = np.zeros((2, len(PEAKS), *np.shape(x)))
    for a, b, dx, dy, k in f:
        result[:, k] += -2 * a * b * np.exp(-b * (dx**2 + dy**2)) * np.stack([dx, dy])
    return result


FUNCTIONS = {
    "peaks": (peaks_function(PEAKS), peaks_gradient, BOUNDS),
    "sphere": (sphere, sphere_gradient, (-2.5, -2.0, 2.5, 3.0)),
    "cylinder": (cylinder, cylinder_gradient, (-3.0, 0.0, 3.0, 4.0)),
}


@pytest.mark.parametrize("given_gradient", [False, True], ids=["differences", "gradient"])
@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_a_function_is_followed_to_the_tolerance_in_value_and_gradient(
    name, tolerance, given_gradient
):
    f, gradient, bounds = FUNCTIONS[name]
    surface = tp.Surface.from_function(
        f, bounds, tolerance, gradient=gradient if given_gradient else None
    )
    points = points_in(bounds, 20_000, 11)
    points[:2000, 0] = bounds[0]  # along the edges too
    points[2000:4000, 1] = bounds[3]
    points[4000] = bounds[:2]
    points[4001] = bounds[2:]
    x, y = points.T
    values = np.asarray(f(x, y)).reshape(-1, len(x))
    assert np.abs(surface.values(points).T - values).max() <= tolerance
    slopes = np.moveaxis(surface.gradients(points), (0, 1, 2), (2, 1, 0))
    assert np.abs(slopes - gradient(x, y)).max() <= tolerance
    assert 0.0 < surface.fit.value_error <= tolerance
    assert 0.0 < surface.fit.gradient_error <= tolerance


def test_a_function_may_give_one_layer_without_a_layer_axis_and_its_gradient_likewise(monkeypatch):
    monkeypatch.setattr("terrapath.surface.fitting.MOST_SAMPLES", 129)
    surface = tp.Surface.from_function(
        sphere, (-2, -2, 2, 2), 1e-4, gradient=lambda x, y: sphere_gradient(x, y)[:, 0]
    )
    assert surface.fit.gradient_error <= 1e-4


@pytest.mark.parametrize(
    "f",
    [
        lambda x, y: np.abs(x - 0.123),
        lambda x, y: np.where(x + y > 0.1, 1.0, 0.0),
        lambda x, y: np.sqrt(x**2 + y**2),
    ],
    ids=["edge", "step", "cone"],
)
def test_a_function_with_an_edge_is_refused(f, monkeypatch):
    monkeypatch.setattr("terrapath.surface.fitting.MOST_SAMPLES", 129)
    with pytest.raises(tp.FitError) as caught:
        tp.Surface.from_function(f, (-1, -1, 1, 1), 1e-4)
    assert "tolerance=0.0001" in one_line(caught)
    assert "129 x 129" in str(caught.value)


def test_where_a_function_is_not_finite_is_named():
    def f(x, y):
        return np.where((x > 0.9) & (y > 0.95), np.nan, x * y)

    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_function(f, (0, 0, 1, 1))
    text = one_line(caught)
    place = dict(part.split("=") for part in text.split(";")[0].split(" at ")[1].split(", "))
    assert float(place["x1"]) > 0.9
    assert float(place["x2"]) > 0.95


def test_a_gradient_that_is_not_finite_is_refused():
    with pytest.raises(tp.InputError):
        tp.Surface.from_function(
            lambda x, y: x * y,
            (0, 0, 1, 1),
            1e-3,
            gradient=lambda x, y: np.full((2, 1, *x.shape), np.nan),
        )


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        ((lambda x, y: x[:3], (0, 0, 1, 1)), "shape"),
        ((lambda x, y: 1.0, (0, 0, 1, 1)), "()"),
        ((lambda x, y: x, (0, 0, 0, 1)), "empty"),
        ((lambda x, y: x, (1, 0, 0, 1)), "(1.0, 0.0, 0.0, 1.0)"),
        ((lambda x, y: x, (0, 0, 1)), "(0, 0, 1)"),
        ((lambda x, y: x, (0, 0, np.inf, 1)), "inf"),
        ((lambda x, y: x, (0, 0, 1, 1), 0.0), "tolerance=0"),
        ((lambda x, y: x, (0, 0, 1, 1), -1e-3), "tolerance=-0.001"),
        ((lambda x, y: x, (0, 0, 1, 1), np.nan), "tolerance=nan"),
    ],
)
def test_functions_and_bounds_that_make_no_surface_are_refused_with_the_value(arguments, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_function(*arguments)
    assert shown in one_line(caught)


@pytest.mark.parametrize("constant", [0.0, 0.1, 1000.0])
def test_a_constant_layer_leaves_the_resolution_as_it_is(constant):
    def waves(x, y):
        return np.sin(x) * np.cos(y)

    def both(x, y):
        return np.stack([waves(x, y), np.full_like(x, constant)])

    plain, other = (tp.Surface.from_function(f, (0, 0, 10, 10), 1e-4) for f in (waves, both))
    assert other.resolution == plain.resolution == 10.0 / 32.0


# Expressions


@pytest.mark.parametrize(
    "layers",
    [
        [[(5.0, 0.1, 5.0, 5.0)], [(1.0, 0.5, 2.0, 3.0)]],
        [[(2.25, 0.5, 0.0, 0.0)]],
        [[(-4.0, 1.3, 4.1, 9.7), (3.0, 0.05, 11.0, -1.0)]],
    ],
)
def test_an_expression_gives_the_surface_of_the_peaks_that_it_describes(layers):
    texts = [str(expression) for expression in peaks_expressions(layers)]
    surface = tp.Surface.from_expression(texts, BOUNDS, 1e-3)
    exact = tp.Surface.from_peaks(layers)
    points = points_in(BOUNDS, 5000, 5)
    assert np.abs(surface.values(points) - exact.values(points)).max() <= 1e-3
    assert np.abs(surface.gradients(points) - exact.gradients(points)).max() <= 1e-3


def test_a_constant_expression_is_a_flat_layer():
    surface = tp.Surface.from_expression(["2.5", "x1"], (0, 0, 1, 1))
    found = jets(surface, points_in((0, 0, 1, 1), 20, 0))
    np.testing.assert_allclose(found[:, 0], [[2.5, 0, 0, 0, 0, 0]] * 20, atol=1e-9)
    np.testing.assert_allclose(found[:, 1, 1:3], [[1.0, 0.0]] * 20, atol=1e-12)


def test_one_expression_need_not_be_in_a_list():
    surface = tp.Surface.from_expression("x1*x2", (0, 0, 2, 2))
    assert len(surface.layers) == 1
    assert surface.values((1.5, 0.5))[0] == pytest.approx(0.75, abs=1e-9)


@pytest.mark.parametrize(
    ("expressions", "shown"),
    [
        (["x1 + z"], "['z']"),
        (["x + y"], "['x', 'y']"),
        (["x1 +* 2"], "'x1 +* 2'"),
        (["x1 > 2"], "'x1 > 2'"),
        (["hill(x1)"], "hill"),
        ([""], "''"),
        ([], "empty"),
        (["I*x1"], "I*x1"),
        (["sqrt(-1)*x1"], "not a real formula"),
        (["__import__('os').getpid() + x1"], "no number, operator or known function"),
        (["x1.__class__"], "no number, operator or known function"),
        (["[x1][0]"], "no number, operator or known function"),
        (["(lambda: x1)()"], "no number, operator or known function"),
        (["x1 if x2 else 1"], "no number, operator or known function"),
        (["eval('x1')"], "'eval' is none of them"),
        (["factorial(10**9)"], "'factorial' is none of them"),
        (["9**9**9**9*x1"], "digits"),
        (["9" * 5000 + "*x1"], "5000"),
        (["-" * 9000 + "x1"], "nested too deeply"),
        (["x1" + " + x1" * 9000], "letters"),
    ],
)
def test_expressions_that_are_not_formulas_in_x1_and_x2_are_refused(expressions, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_expression(expressions, (0, 0, 1, 1))
    assert shown in one_line(caught)


def test_an_expression_runs_no_code(tmp_path):
    made = tmp_path / "made"
    for text in (f"open({str(made)!r}, 'w')", f"x1 + __import__('pathlib').Path({str(made)!r})"):
        with pytest.raises(tp.InputError):
            tp.Surface.from_expression([text], (0, 0, 1, 1))
    assert not made.exists()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("abs(x1 - 0.5)**3", 0.5**3),
        ("Max(x1, 0.25)/2", 0.5),
        ("-E*x1 + pi/4 - 1e-3", np.pi / 4 - np.e - 1e-3),
        ("2**x1 * atan2(x2, x1) + cos(1/3)", np.cos(1 / 3)),
    ],
)
def test_expressions_have_numbers_operators_and_functions(text, value):
    surface = tp.Surface.from_expression([text], (0.75, 0, 1, 1), 1e-3)
    assert surface.values((1.0, 0.0))[0] == pytest.approx(value, abs=2e-3)


def test_an_expression_that_is_not_defined_everywhere_is_an_error_and_not_a_warning():
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_expression(["log(x1)"], (-1, 0, 1, 1))
    assert "not finite at x1=-1" in one_line(caught)


# Names, weights, points


def test_repr_names_layers_domain_and_fit():
    peaks = tp.Surface.from_peaks(
        [[(5, 0.1, 5, 5)], [(1, 1, 2, 2)]],
        names=["height", "rocks"],
        units=["m", ""],
        weights=[1, 20],
    )
    assert "height [m]" in repr(peaks)
    assert "rocks x 20" in repr(peaks)
    assert "whole plane" in repr(peaks)
    assert "exact" in repr(peaks)
    values, x, y = grid_with(1.0), np.arange(6) * 2.0, np.arange(5) - 1.0
    grid = repr(tp.Surface.from_grid(values, x, y))
    assert "x1 in [0, 10], x2 in [-1, 3]" in grid
    assert "6 x 5 samples" in grid
    fitted = tp.Surface.from_function(sphere, (-1, -1, 1, 1), 1e-4)
    assert f"value error {fitted.fit.value_error:.2g}" in repr(fitted)
    assert f"gradient error {fitted.fit.gradient_error:.2g}" in repr(fitted)


def test_layers_are_named_by_default_as_the_paper_does():
    surface = tp.Surface.from_peaks([[(1, 1, 0, 0)]] * 3)
    assert [layer.name for layer in surface.layers] == ["height", "x4", "x5"]


@given(layer_lists, st.lists(numbers(0.0, 50.0), min_size=4, max_size=4), seeds)
@settings(deadline=None, max_examples=30)
def test_the_lift_is_the_point_with_its_weighted_layers(layers, weights, seed):
    weights = weights[: len(layers)]
    plain = tp.Surface.from_peaks(layers)
    surface = tp.Surface.from_peaks(layers, weights=weights)
    points = points_in(BOUNDS, 6, seed).reshape(2, 3, 2)
    lifted = surface.lift(points)
    assert lifted.shape == (2, 3, 2 + len(layers))
    np.testing.assert_array_equal(lifted[..., :2], points)
    np.testing.assert_allclose(lifted[..., 2:], plain.values(points) * weights, rtol=1e-15)
    np.testing.assert_array_equal(surface.values(points), plain.values(points))
    np.testing.assert_array_equal(surface.gradients(points), plain.gradients(points))
    names = [layer.name for layer in plain.layers]
    again = plain.with_weights(dict(zip(names, weights, strict=True)))
    np.testing.assert_array_equal(again.lift(points), lifted)


def test_with_weights_changes_what_is_named_and_leaves_the_first_surface_alone():
    first = tp.Surface.from_peaks([[(1, 1, 0, 0)], [(2, 1, 0, 0)]], weights=[3, 4])
    second = first.with_weights({"x4": 0.5})
    assert [layer.weight for layer in first.layers] == [3.0, 4.0]
    assert [layer.weight for layer in second.layers] == [3.0, 0.5]
    np.testing.assert_array_equal(first.lift((0, 0)), [0, 0, 3, 8])
    np.testing.assert_array_equal(second.lift((0, 0)), [0, 0, 3, 1])


@pytest.mark.parametrize("build", ["peaks", "grid", "function"])
def test_weights_given_at_the_start_reach_the_lift(build):
    make = {
        "peaks": lambda **k: tp.Surface.from_peaks([[(1, 1, 0, 0)]] * 2, **k),
        "grid": lambda **k: tp.Surface.from_grid(np.ones((2, 5, 5)), range(5), range(5), **k),
        "function": lambda **k: tp.Surface.from_function(
            lambda x, y: np.stack([x + 1, y + 1]), (0, 0, 1, 1), **k
        ),
    }[build]
    for weights in ([2.0, 7.0], (2.0, 7.0), np.array([2.0, 7.0])):
        np.testing.assert_allclose(make(weights=weights).lift((0, 0)), [0, 0, 2, 7], atol=1e-12)


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        ({"names": ["height", "height"]}, "['height', 'height']"),
        ({"names": ["height"]}, "1 entries for 2"),
        ({"units": ["m", "m", "m"]}, "3 entries for 2"),
        ({"weights": [1.0]}, "1 entries for 2"),
        ({"weights": [1.0, -2.5]}, "the weight of x4=-2.5"),
        ({"weights": [np.nan, 1.0]}, "the weight of height=nan"),
        ({"weights": [1.0, "heavy"]}, "heavy"),
    ],
)
def test_names_units_and_weights_that_do_not_fit_are_refused_with_the_value(options, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_peaks([[(1, 1, 0, 0)]] * 2, **options)
    assert shown in one_line(caught)


@pytest.mark.parametrize(
    ("weights", "shown"), [({"rocks": 1.0}, "'rocks'"), ({"height": -1.0}, "-1")]
)
def test_with_weights_refuses_unknown_layers_and_negative_weights(weights, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.Surface.from_peaks([[(1, 1, 0, 0)]]).with_weights(weights)
    assert shown in one_line(caught)


@pytest.mark.parametrize("method", ["values", "gradients", "hessians", "lift"])
def test_a_point_off_the_surface_is_named(method):
    surface = tp.Surface.from_grid(grid_with(1.0), np.arange(6), np.arange(5))
    measure = getattr(surface, method)
    measure([[0, 0], [5, 4]])  # the edge belongs to it
    with pytest.raises(tp.OutsideSurfaceError) as caught:
        measure([[1, 1], [5.25, 3.5], [2, 2]])
    text = one_line(caught)
    assert "(5.25, 3.5)" in text
    assert "x1 in [0, 5], x2 in [0, 4]" in text
    with pytest.raises(tp.OutsideSurfaceError):
        measure([2, np.nextafter(4.0, 5.0)])


@pytest.mark.parametrize("points", [1.0, [1.0], [[1, 2, 3]], [[np.nan, 0]], [["a", "b"]], None])
def test_what_is_no_point_is_refused(points):
    with pytest.raises(tp.InputError):
        tp.Surface.from_peaks([[(1, 1, 0, 0)]]).values(points)


def test_no_points_give_no_values():
    surface = tp.Surface.from_peaks([[(1, 1, 0, 0)]])
    assert surface.values(np.empty((0, 2))).shape == (0, 1)
    assert surface.gradients(np.empty((0, 2))).shape == (0, 1, 2)


@pytest.mark.parametrize("amplitude", [1e200, 3.4e38, np.finfo(float).max])
def test_slopes_that_no_ground_has_are_refused_with_what_to_look_for(amplitude):
    with pytest.raises(tp.InputError, match="no-data") as refused:
        tp.Surface.from_peaks([[(amplitude, 0.5, 5, 5)]])
    assert "\n" not in str(refused.value)
    heights = np.zeros((8, 8))
    heights[3, 4] = amplitude / 100.0
    with pytest.raises(tp.InputError, match="no-data"):
        tp.Surface.from_grid(heights, np.arange(8.0), np.arange(8.0))
    steep = tp.Surface.from_peaks([[(1e6, 0.5, 5, 5)]])
    with pytest.raises(tp.InputError, match="weights"):
        steep.with_weights({"height": 1e20})
