"""The metric h, and the lengths that it gives to segments and curves."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.interpolate import RectBivariateSpline

import terrapath as tp
from common import numbers, points_in
from oracles import (
    exact_curve_length,
    line_r as line_r_by_algorithm_1,
    metric_from_sympy,
    peaks_expressions,
    peaks_gradients,
)
from terrapath.surface import metric

BOUNDS = (-1.0, -1.0, 11.0, 11.0)


peak = st.tuples(numbers(-6.0, 6.0), numbers(0.02, 2.0), numbers(-1.0, 11.0), numbers(-1.0, 11.0))
layer_lists = st.lists(st.lists(peak, min_size=1, max_size=3), min_size=1, max_size=3)
weight_lists = st.lists(numbers(0.0, 5.0), min_size=3, max_size=3)
point = st.tuples(numbers(-1.0, 11.0), numbers(-1.0, 11.0))
seeds = st.integers(0, 2**32 - 1)

SIX_PEAKS = [
    [(5, 0.5, 3, 3), (5, 0.5, 7, 3), (5, 0.5, 3, 7), (5, 0.5, 7, 7)],
    [(3, 0.5, 5, 8), (3, 0.5, 5, 2)],
]


def weighted(layers, weights):
    return tp.Surface.from_peaks(layers, weights=list(weights[: len(layers)]))


def hilly_grid(seed=0):
    """A spline surface, and the gradients of its layers by SciPy."""
    x, y = np.linspace(0, 6, 13), np.linspace(-2, 3, 11)
    values = np.random.default_rng(seed).normal(size=(2, 11, 13))
    splines = [RectBivariateSpline(y, x, v, s=0) for v in values]

    def gradients(x1, x2):
        return np.array([[s.ev(x2, x1, dy=1), s.ev(x2, x1, dx=1)] for s in splines])

    return tp.Surface.from_grid(values, x, y), gradients


# The tensor


@given(layer_lists, weight_lists, seeds)
@settings(deadline=None, max_examples=6)
def test_the_metric_is_what_sympy_finds_from_the_lift(layers, weights, seed):
    points = points_in(BOUNDS, 12, seed).reshape(3, 4, 2)
    found = metric.metric_tensor(weighted(layers, weights), points)
    expressions = [w * e for w, e in zip(weights, peaks_expressions(layers), strict=False)]
    expected = metric_from_sympy(expressions, points[..., 0], points[..., 1])
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)


@given(layer_lists, weight_lists, seeds)
@settings(deadline=None, max_examples=40)
def test_the_metric_is_symmetric_and_never_shortens_the_plane(layers, weights, seed):
    surface = weighted(layers, weights)
    points = points_in(BOUNDS, 30, seed)
    h = metric.metric_tensor(surface, points)
    np.testing.assert_array_equal(h, h.swapaxes(-1, -2))
    eigenvalues = np.linalg.eigvalsh(h)
    assert (eigenvalues >= 1.0 - 1e-12 * eigenvalues[:, 1:]).all()
    d = metric.determinant(surface, points)
    np.testing.assert_allclose(d, np.linalg.det(h), rtol=1e-9)
    assert (d >= 1.0 - 1e-9).all()
    identity = h @ metric.inverse_metric_tensor(surface, points)
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(2), h.shape), atol=1e-9)


def test_the_metric_of_a_spline_comes_from_its_gradients():
    surface, gradients = hilly_grid()
    surface = surface.with_weights({"height": 2.0, "x4": 0.5})
    points = points_in(surface.bounds, 50, 1)
    for place, h in zip(points, metric.metric_tensor(surface, points), strict=True):
        g = np.array([2.0, 0.5])[:, None] * gradients(*place)
        np.testing.assert_allclose(h, np.eye(2) + g.T @ g, rtol=1e-11, atol=1e-11)


# True lengths


@given(layer_lists, weight_lists, st.lists(point, min_size=2, max_size=4))
@settings(deadline=None, max_examples=40)
def test_the_length_of_a_curve_is_what_quadpack_finds(layers, weights, curve):
    expected = exact_curve_length(peaks_gradients(layers, weights[: len(layers)]), curve)
    found = metric.curve_length(weighted(layers, weights), curve)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_length_of_a_curve_on_a_spline_is_what_quadpack_finds(seed):
    surface, gradients = hilly_grid(seed)
    a, b = points_in(surface.bounds, 2, seed)
    # Cut at the knots, where the spline is smooth only twice.
    cuts = {0.0, 1.0}
    for axis, knots in ((0, np.linspace(0, 6, 13)), (1, np.linspace(-2, 3, 11))):
        cuts |= {float(t) for t in (knots - a[axis]) / (b[axis] - a[axis]) if 0 < t < 1}
    curve = [a + t * (b - a) for t in sorted(cuts)]
    expected = exact_curve_length(gradients, curve, pieces=1)
    assert metric.curve_length(surface, [a, b]) == pytest.approx(expected, rel=1e-9)


@given(layer_lists, weight_lists, st.lists(point, min_size=2, max_size=4))
@settings(deadline=None, max_examples=25)
def test_the_lift_is_an_isometry(layers, weights, curve):
    """Length under h on the plane = length of the lifted curve in R^n, by polylines."""
    surface = weighted(layers, weights)
    curve = np.array(curve)

    def lifted_length(pieces):
        t = np.linspace(0, 1, pieces + 1)[:, None]
        return sum(
            np.linalg.norm(np.diff(surface.lift(a + t * (b - a)), axis=0), axis=1).sum()
            for a, b in itertools.pairwise(curve)
        )

    coarse, middle, fine = (lifted_length(n) for n in (2000, 4000, 8000))
    extrapolated = (64 * fine - 20 * middle + coarse) / 45  # errors in h^2 and h^4 cancelled
    assert metric.curve_length(surface, curve) == pytest.approx(extrapolated, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("centre", np.linspace(3.0, 7.0, 9))
def test_a_narrow_peak_on_a_long_segment_is_not_overlooked(centre):
    layers = [[(5.0, 100.0, centre, 5.0)]]
    curve = [(-1.0, 5.0), (11.0, 5.0)]
    expected = exact_curve_length(peaks_gradients(layers), curve, pieces=400)
    found = metric.curve_length(tp.Surface.from_peaks(layers), curve)
    assert expected > 20.0
    assert found == pytest.approx(expected, rel=1e-9)


def test_one_bump_of_a_wide_spline_is_not_overlooked():
    x = y = np.arange(201.0)
    for column in (40, 71, 97, 131, 163):
        values = np.zeros((201, 201))
        values[100, column] = 10.0
        surface = tp.Surface.from_grid(values, x, y)
        straight = metric.curve_length(surface, [(0, 100), (200, 100)])
        in_steps = metric.curve_length(surface, np.column_stack([x, np.full(201, 100.0)]))
        assert straight == pytest.approx(in_steps, rel=1e-9)
        assert in_steps > 210.0


@given(layer_lists, point, point, numbers(0.01, 0.99))
@settings(deadline=None, max_examples=40)
def test_a_cut_changes_no_length_and_direction_does_not_matter(layers, a, b, t):
    surface = tp.Surface.from_peaks(layers)
    a, b = np.array(a), np.array(b)
    middle = a + t * (b - a)
    whole = metric.curve_length(surface, [a, b])
    assert metric.curve_length(surface, [a, middle, b]) == pytest.approx(whole, rel=1e-9, abs=1e-12)
    assert metric.curve_length(surface, [b, a]) == pytest.approx(whole, rel=1e-9, abs=1e-12)


def test_a_flat_surface_has_the_planes_lengths():
    surface = tp.Surface.from_peaks([np.empty((0, 4))])
    for measure in (metric.line_r, metric.chord, metric.segment_lengths):
        assert measure(surface, (1, 2), (4, 6)) == pytest.approx(5.0, rel=1e-15)
        assert measure(surface, (1, 2), (1, 2)) == 0.0


# Line-R


@given(layer_lists, weight_lists, point, point)
@settings(deadline=None, max_examples=60)
def test_line_r_is_algorithm_1(layers, weights, a, b):
    expected = line_r_by_algorithm_1(peaks_gradients(layers, weights[: len(layers)]), a, b)
    found = metric.line_r(weighted(layers, weights), a, b)
    assert found == pytest.approx(expected, rel=1e-13, abs=1e-300)
    assert found == pytest.approx(metric.line_r(weighted(layers, weights), b, a), rel=1e-13)


def test_line_r_on_a_spline_is_algorithm_1():
    surface, gradients = hilly_grid()
    for a, b in zip(
        points_in(surface.bounds, 20, 1), points_in(surface.bounds, 20, 2), strict=True
    ):
        expected = line_r_by_algorithm_1(gradients, a, b)
        assert metric.line_r(surface, a, b) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("a", "b"), [((3.2, 3.1), (5.0, 4.6)), ((1.0, 1.5), (2.5, 2.0)), ((4.0, 4.0), (5.5, 5.2))]
)
def test_line_r_converges_at_order_6_as_a_segment_is_cut(a, b):
    surface = tp.Surface.from_peaks(SIX_PEAKS)
    a, b = np.array(a, float), np.array(b, float)
    exact = exact_curve_length(peaks_gradients(SIX_PEAKS), [a, b], pieces=16)
    pieces, errors = np.array([8, 12, 16, 24, 32]), []
    for n in pieces:
        cuts = a + np.linspace(0, 1, n + 1)[:, None] * (b - a)
        errors.append(abs(metric.line_r(surface, cuts[:-1], cuts[1:]).sum() - exact))
    order = -np.polyfit(np.log(pieces), np.log(errors), 1)[0]
    assert 5.5 < order < 7.0


def test_line_r_is_exact_for_a_speed_that_is_a_polynomial_of_degree_5():
    # x4' = sqrt(p^2 - 1) has no simple surface; a plane, with its constant speed, does.
    x = y = np.arange(5.0)
    values = 3.0 * x[None, :] - 2.0 * y[:, None]
    surface = tp.Surface.from_grid(values, x, y)
    assert metric.line_r(surface, (0, 0), (4, 1)) == pytest.approx(math.sqrt(17 + 100), rel=1e-13)


# Chords


@given(layer_lists, weight_lists, st.lists(point, min_size=3, max_size=3))
@settings(deadline=None, max_examples=60)
def test_chords_are_a_metric_below_the_true_length(layers, weights, three):
    surface = weighted(layers, weights)
    a, b, c = np.array(three)
    ab, bc, ac = (float(metric.chord(surface, *pair)) for pair in ((a, b), (b, c), (a, c)))
    assert ab == pytest.approx(np.linalg.norm(surface.lift(b) - surface.lift(a)), rel=1e-12)
    assert metric.chord(surface, b, a) == ab
    assert metric.chord(surface, a, a) == 0.0
    tiny = 1e-150  # squares of smaller numbers are 0
    assert ac <= (ab + bc) * (1 + 1e-14) + tiny
    assert np.hypot(*(b - a)) <= ab * (1 + 1e-14) + tiny
    # Of points that nearly coincide, a chord is a difference of coordinates that were rounded.
    rounding = 1e-15 * max(np.abs(surface.lift(np.array(three))).max(), 1.0)
    assert ab <= metric.curve_length(surface, [a, b]) * (1 + 1e-9) + rounding
    assert ac <= metric.curve_length(surface, [a, b, c]) * (1 + 1e-9) + rounding


# Weights and shapes


@given(layer_lists, numbers(0.1, 5.0), point, point)
@settings(deadline=None, max_examples=40)
def test_a_weight_is_a_scale_of_the_layer(layers, weight, a, b):
    by_weight = tp.Surface.from_peaks(layers, weights=[weight] * len(layers))
    by_hand = tp.Surface.from_peaks([[(weight * p[0], *p[1:]) for p in layer] for layer in layers])
    for measure in (metric.line_r, metric.chord, metric.segment_lengths):
        assert measure(by_weight, a, b) == pytest.approx(measure(by_hand, a, b), rel=1e-11)
    np.testing.assert_allclose(
        metric.metric_tensor(by_weight, a), metric.metric_tensor(by_hand, a), rtol=1e-11, atol=1e-12
    )
    gone = tp.Surface.from_peaks(layers, weights=[0.0] * len(layers))
    assert metric.curve_length(gone, [a, b]) == pytest.approx(math.dist(a, b), rel=1e-14)


@given(layer_lists, point, point)
@settings(deadline=None, max_examples=30)
def test_a_heavier_layer_makes_no_way_shorter(layers, a, b):
    surface = tp.Surface.from_peaks(layers)
    heavier = surface.with_weights({"height": 3.0})
    assert metric.curve_length(heavier, [a, b]) >= metric.curve_length(surface, [a, b]) * (1 - 1e-9)


@pytest.mark.parametrize("shape", [(), (5,), (2, 3), (0,), (4, 0, 2)])
@pytest.mark.parametrize("measure", [metric.line_r, metric.chord, metric.segment_lengths])
def test_segments_keep_the_shape_that_they_came_in(measure, shape):
    surface = tp.Surface.from_peaks(SIX_PEAKS)
    random = np.random.default_rng(0)
    a, b = random.uniform(0, 10, (2, *shape, 2))
    found = measure(surface, a, b)
    assert found.shape == shape
    for place in np.ndindex(*shape):
        assert found[place] == measure(surface, a[place], b[place])
    from_one = measure(surface, (5.0, 5.0), b)
    assert from_one.shape == shape
    for place in np.ndindex(*shape):
        assert from_one[place] == measure(surface, (5.0, 5.0), b[place])


@pytest.mark.parametrize("shape", [(), (5,), (2, 3), (0,)])
def test_tensors_keep_the_shape_of_the_points(shape):
    surface = tp.Surface.from_peaks(SIX_PEAKS)
    points = np.random.default_rng(0).uniform(0, 10, (*shape, 2))
    assert metric.metric_tensor(surface, points).shape == (*shape, 2, 2)
    assert metric.inverse_metric_tensor(surface, points).shape == (*shape, 2, 2)
    assert metric.determinant(surface, points).shape == shape


def test_both_ends_of_a_segment_must_lie_on_the_surface():
    surface, _ = hilly_grid()
    for ends in (((1, 1), (7, 1)), ((7, 1), (1, 1))):
        for measure in (metric.line_r, metric.chord, metric.segment_lengths):
            with pytest.raises(tp.OutsideSurfaceError, match=r"\(7, 1\)"):
                measure(surface, *ends)
    with pytest.raises(tp.OutsideSurfaceError, match=r"\(7, 1\)"):
        metric.metric_tensor(surface, (7, 1))


@pytest.mark.parametrize(
    "curve", [[(0, 0)], [], (0, 0), [[(0, 0)], [(1, 1)]], [(0, 0, 0), (1, 1, 1)]]
)
def test_what_is_no_curve_is_refused(curve):
    with pytest.raises(tp.InputError):
        metric.curve_length(tp.Surface.from_peaks(SIX_PEAKS), curve)


@pytest.mark.parametrize(
    "ends",
    [
        (np.zeros((2, 2)), np.zeros((3, 2))),
        ((0, 0, 0), (1, 1, 1)),
        ((0, np.nan), (1, 1)),
        ((0, 0), ("a", "b")),
    ],
)
def test_what_are_no_segments_is_refused(ends):
    for measure in (metric.line_r, metric.chord, metric.segment_lengths):
        with pytest.raises(tp.InputError):
            measure(tp.Surface.from_peaks(SIX_PEAKS), *ends)
