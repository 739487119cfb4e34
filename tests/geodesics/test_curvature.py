"""Christoffel symbols and the curvature."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from scipy.interpolate import RectBivariateSpline

import terrapath as tp
from common import points_in
from geodesic_cases import (
    RADIUS,
    REGION,
    cubic_expressions,
    cubics,
    flat,
    layer_lists,
    peaks_surface,
    seeds,
    weight_lists,
    weighted,
)
from oracles import (
    christoffel_from_sympy,
    curvature_from_brioschi,
    peaks_expressions,
)
from terrapath.geodesics.rays import (
    christoffel_symbols,
    gaussian_curvature,
)
from terrapath.surface import metric

# Christoffel symbols


@given(layer_lists, weight_lists, seeds)
@settings(deadline=None, max_examples=3)
def test_the_christoffel_symbols_of_peaks_are_those_of_the_definition(layers, weights, seed):
    points = points_in(REGION, 12, seed).reshape(3, 4, 2)
    found = christoffel_symbols(peaks_surface(layers, weights), points)
    expressions = weighted(peaks_expressions(layers), weights)
    expected = christoffel_from_sympy(expressions, points[..., 0], points[..., 1])
    assert found.shape == (3, 4, 2, 2, 2)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)
    np.testing.assert_array_equal(found, found.swapaxes(-1, -2))


@given(cubics, weight_lists, seeds)
@settings(deadline=None, max_examples=3)
def test_the_christoffel_symbols_of_expressions_are_those_of_the_definition(
    coefficients, weights, seed
):
    expressions = cubic_expressions(coefficients)
    bounds = (-2.0, -1.0, 2.0, 2.0)
    surface = tp.Surface.from_expression(
        [str(e) for e in expressions], bounds, weights=weights[: len(expressions)]
    )
    points = points_in(bounds, 20, seed)
    expected = christoffel_from_sympy(weighted(expressions, weights), *points.T)
    found = christoffel_symbols(surface, points)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9)
    np.testing.assert_array_equal(found, found.swapaxes(-1, -2))


def test_the_christoffel_symbols_of_a_rough_spline_come_from_its_derivatives():
    """d_j h_il and so on by the product rule, from SciPy's derivatives of the same spline."""
    x, y = np.linspace(0, 6, 13), np.linspace(-2, 3, 11)
    values = np.random.default_rng(3).normal(size=(2, 11, 13))
    splines = [RectBivariateSpline(y, x, v, s=0) for v in values]
    surface = tp.Surface.from_grid(values, x, y, weights=[2.0, 0.5])
    points = points_in(surface.bounds, 50, 4)
    found = christoffel_symbols(surface, points)

    def derived(spline, weight, *variables):
        dx = variables.count(0)
        dy = variables.count(1)
        return weight * spline.ev(points[:, 1], points[:, 0], dx=dy, dy=dx)

    h = np.zeros((2, 2, 50))
    dh = np.zeros((2, 2, 2, 50))  # d_k h_ij as [i, j, k]
    for spline, w in zip(splines, (2.0, 0.5), strict=True):
        g = [derived(spline, w, i) for i in (0, 1)]
        for i, j in np.ndindex(2, 2):
            h[i, j] += g[i] * g[j]
            for k in (0, 1):
                dh[i, j, k] += derived(spline, w, i, k) * g[j] + g[i] * derived(spline, w, j, k)
    h[0, 0] += 1.0
    h[1, 1] += 1.0
    lowered = 0.5 * (
        np.einsum("iljm->lijm", dh) + np.einsum("ljim->lijm", dh) - np.einsum("ijlm->lijm", dh)
    )
    inverse = np.linalg.inv(np.moveaxis(h, -1, 0))
    expected = np.einsum("mkl,lijm->mkij", inverse, lowered)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9)
    assert np.abs(expected).max() > 1.0


def test_the_christoffel_symbols_of_a_bell_are_the_closed_forms_of_the_appendix():
    """Appendix 6.2, for x3 = exp(-(x1^2 + x2^2)); all six are printed right.

    Gamma^k_ij = (d_i d_j x3) (d_k x3) / (1 + |grad x3|^2), which SymPy confirms here too.
    """
    x1, x2 = sympy.symbols("x1 x2", real=True)
    d = sympy.exp(2 * (x1**2 + x2**2)) + 4 * x1**2 + 4 * x2**2
    printed = {
        (0, 0, 0): -8 * x1**3 + 4 * x1,
        (1, 0, 0): -8 * x1**2 * x2 + 4 * x2,
        (0, 0, 1): -8 * x1**2 * x2,
        (1, 0, 1): -8 * x1 * x2**2,
        (0, 1, 1): -8 * x1 * x2**2 + 4 * x1,
        (1, 1, 1): -8 * x2**3 + 4 * x2,
    }
    bell = sympy.exp(-(x1**2 + x2**2))
    slopes = [sympy.diff(bell, v) for v in (x1, x2)]
    surface = peaks_surface([[(1.0, 1.0, 0.0, 0.0)]])
    points = points_in((-2.0, -2.0, 2.0, 2.0), 200, 0)
    found = christoffel_symbols(surface, points)
    for (k, i, j), numerator in printed.items():
        derived = sympy.diff(slopes[i], (x1, x2)[j]) * slopes[k]
        derived /= 1 + slopes[0] ** 2 + slopes[1] ** 2
        assert sympy.simplify(numerator / d - derived) == 0
        expected = sympy.lambdify((x1, x2), numerator / d, "numpy")(*points.T)
        np.testing.assert_allclose(found[:, k, i, j], expected, rtol=1e-11, atol=1e-13)
        np.testing.assert_array_equal(found[:, k, j, i], found[:, k, i, j])


def test_symbols_and_curvatures_are_refused_off_the_surface(cap):
    for measure in (christoffel_symbols, gaussian_curvature):
        with pytest.raises(tp.OutsideSurfaceError, match=r"\(6, 0\)"):
            measure(cap, (6.0, 0.0))


# Curvature


@given(layer_lists, weight_lists, seeds)
@settings(deadline=None, max_examples=3)
def test_the_curvature_is_what_brioschi_finds_from_the_metric_alone(layers, weights, seed):
    points = points_in(REGION, 12, seed).reshape(4, 3, 2)
    found = gaussian_curvature(peaks_surface(layers, weights), points)
    expressions = weighted(peaks_expressions(layers), weights)
    expected = curvature_from_brioschi(expressions, points[..., 0], points[..., 1])
    assert found.shape == (4, 3)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8)


@given(cubics, seeds)
@settings(deadline=None, max_examples=3)
def test_the_curvature_of_expressions_is_what_brioschi_finds(coefficients, seed):
    expressions = cubic_expressions(coefficients)
    bounds = (-2.0, -1.0, 2.0, 2.0)
    surface = tp.Surface.from_expression([str(e) for e in expressions], bounds)
    points = points_in(bounds, 20, seed)
    expected = curvature_from_brioschi(expressions, *points.T)
    np.testing.assert_allclose(gaussian_curvature(surface, points), expected, rtol=1e-7, atol=1e-8)


def test_a_sphere_a_cylinder_and_a_saddle_have_the_curvatures_of_the_textbook(cap, tube):
    points = points_in((-4.9, -4.9, 4.9, 4.9), 200, 0)
    np.testing.assert_allclose(gaussian_curvature(cap, points), 1.0 / RADIUS**2, rtol=1e-4)
    np.testing.assert_allclose(gaussian_curvature(tube, points), 0.0, atol=1e-9)
    saddle = tp.Surface.from_expression("x1*x2", (-5.0, -5.0, 5.0, 5.0))
    expected = -1.0 / (1.0 + (points**2).sum(axis=1)) ** 2
    np.testing.assert_allclose(gaussian_curvature(saddle, points), expected, rtol=1e-8)
    assert (gaussian_curvature(flat(), points) == 0.0).all()


def test_the_total_curvature_of_a_bell_is_zero():
    """Gauss and Bonnet: a plane with a bump has none in all, and the bump's top has much."""
    surface = peaks_surface([[(2.0, 0.5, 0.0, 0.0)], [(1.0, 0.7, 1.0, 0.5)]])
    nodes = np.linspace(-12.0, 12.0, 481)
    points = np.stack(np.meshgrid(nodes, nodes), axis=-1)
    density = gaussian_curvature(surface, points) * np.sqrt(metric.determinant(surface, points))
    cell = (nodes[1] - nodes[0]) ** 2
    assert abs(density.sum() * cell) < 1e-9
    assert np.abs(density).sum() * cell > 3.0
