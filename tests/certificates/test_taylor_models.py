"""Taylor models: what they enclose, and how nearly."""

from __future__ import annotations

import itertools
import math

import mpmath
import numpy as np
import pytest

import certificate_oracles as oracles
from certificate_cases import ROUNDING, square
from terrapath._kernels.certificates import surface_models, taylor


def random_model(random, positive):
    c = random.uniform(0.0, 1.0, 10) * 10.0 ** random.integers(-3, 2, 10)
    c = c if positive else c * random.choice([-1.0, 0.0, 1.0], 10)
    return taylor.Model(*c, random.choice([0.0, 0.1, 2.0]))


POWERS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]


def value_of(model, p, q):
    return sum(c * p**i * q**j for c, (i, j) in zip(model, POWERS, strict=False))


@pytest.mark.parametrize("seed", range(40))
def test_a_product_of_models_encloses_all_products(seed):
    random = np.random.default_rng(seed)
    p, q = square(9)
    f, g = random_model(random, positive=False), random_model(random, positive=False)
    product = taylor.times(f, g)
    centre = value_of(product, p, q)
    scale = max(abs(centre).max(), product.r, 1.0)
    for a, b in itertools.product((-1.0, 0.3, 1.0), repeat=2):
        true = (value_of(f, p, q) + a * f.r) * (value_of(g, p, q) + b * g.r)
        assert (abs(true - centre) <= product.r + ROUNDING * scale).all()


@pytest.mark.parametrize("seed", range(20))
def test_a_product_of_positive_models_is_attained_at_a_corner(seed):
    # Nothing is forgotten, and nothing is counted twice.
    random = np.random.default_rng(seed)
    f, g = random_model(random, positive=True), random_model(random, positive=True)
    product = taylor.times(f, g)
    assert sum(product) == pytest.approx(sum(f) * sum(g), rel=1e-13)
    for i in range(10):
        # By one coefficient of each: c_ij is a sum over the pairs that make p^i q^j.
        made = sum(
            f[m] * g[n]
            for m, n in itertools.product(range(10), repeat=2)
            if tuple(np.add(POWERS[m], POWERS[n])) == POWERS[i]
        )
        assert product[i] == pytest.approx(made, rel=1e-13)


def test_sums_and_multiples_of_models_are_taken_coefficient_by_coefficient():
    random = np.random.default_rng(0)
    f, g = random_model(random, positive=False), random_model(random, positive=False)
    np.testing.assert_allclose(taylor.plus(f, g), np.add(f, g), rtol=1e-15)
    difference = taylor.minus(f, g)
    np.testing.assert_allclose(difference[:10], np.subtract(f, g)[:10], rtol=1e-15)
    assert difference.r == f.r + g.r
    assert taylor.times_number(f, -3.0).r == 3.0 * f.r
    p, q = square(9)
    offsets = abs(value_of(f, p, q) - f.c00).max()
    assert offsets <= taylor.spread(f) - f.r + ROUNDING
    np.testing.assert_allclose(
        [taylor.polynomial(f, *place) for place in zip(p, q, strict=True)], value_of(f, p, q)
    )


@pytest.mark.parametrize("seed", range(20))
def test_a_tensor_product_encloses_and_is_attained(seed):
    random = np.random.default_rng(seed)
    s, t = (taylor.Series(*random.uniform(0.0, 1.0, 5)) for _ in range(2))
    factor = random.uniform(0.1, 3.0)
    model = taylor.tensor(s, t, factor)
    assert sum(model) == pytest.approx(factor * sum(s) * sum(t), rel=1e-13)
    assert taylor.tensor(s, t, -factor).r == pytest.approx(model.r, rel=1e-13)
    signs = random.choice([-1.0, 1.0], (2, 4))
    s, t = (taylor.Series(*(c[:4] * sign), c[4]) for c, sign in zip((s, t), signs, strict=True))
    model = taylor.tensor(s, t, -factor)
    p, q = square(9)
    for a, b in itertools.product((-1.0, 1.0), repeat=2):
        left = np.polyval(s[3::-1], p) + a * s.r
        right = np.polyval(t[3::-1], q) + b * t.r
        off = abs(-factor * left * right - value_of(model, p, q))
        assert (off <= model.r + ROUNDING).all()


def gaussian_errors(falloff, offset, a):
    """Largest errors of the two series of a Gaussian over t = offset +- a, beyond rounding."""
    pair = surface_models.gaussian(falloff, offset, a)
    p = np.linspace(-1.0, 1.0, 201)
    t = offset + a * p
    value = np.exp(-falloff * t * t)
    off = abs(np.polyval(pair.value[3::-1], p) - value).max()
    slope = abs(np.polyval(pair.slope[3::-1], p) + 2.0 * falloff * t * value).max()
    return pair, off, slope


@pytest.mark.parametrize("seed", range(40))
def test_the_series_of_a_gaussian_enclose_it_at_any_width(seed):
    random = np.random.default_rng(seed)
    falloff = np.exp(random.uniform(-7.0, 14.0))
    deviation = 1.0 / math.sqrt(2.0 * falloff)
    offset = deviation * random.choice([0.0, *random.uniform(-4.0, 4.0, 6)])
    for a in deviation * 10.0 ** np.arange(-3.0, 1.5, 0.5):
        pair, value, slope = gaussian_errors(falloff, offset, a)
        assert value <= pair.value.r + 1e-15
        assert slope <= pair.slope.r + 1e-14 * math.sqrt(falloff)


def test_the_remainders_of_a_gaussian_are_of_fourth_order_and_nearly_sharp():
    # Sharp where the fourth derivative is largest, at the centre of the peak: 12 of 13.04.
    widths = 2.0 ** -np.arange(3.0, 7.0)
    pairs = [gaussian_errors(0.5, 0.0, a) for a in widths]
    ratios = [pair.value.r / value for pair, value, _ in pairs]
    assert max(ratios) < 2.0
    # And of the derivative's where the fifth is, at 0.617 deviations.
    pairs = [gaussian_errors(0.5, 0.617, a) for a in widths]
    assert max(pair.slope.r / slope for pair, _, slope in pairs) < 2.0
    orders = np.polyfit(np.log(widths), np.log([pair.slope.r for pair, _, _ in pairs]), 1)
    assert 3.8 < orders[0] < 4.2


def test_the_series_of_a_gaussian_are_its_taylor_polynomials():
    with mpmath.workdps(40):
        for falloff, offset, a in ((0.5, 0.3, 0.2), (40.0, -0.11, 0.03), (1e-3, 5.0, 1.0)):
            pair = surface_models.gaussian(falloff, offset, a)

            def f(t, falloff=falloff):
                return mpmath.exp(-mpmath.mpf(falloff) * t * t)

            series = mpmath.taylor(f, mpmath.mpf(offset), 4)
            value = [float(c * mpmath.mpf(a) ** k) for k, c in enumerate(series[:4])]
            slope = [float((k + 1) * series[k + 1] * mpmath.mpf(a) ** k) for k in range(4)]
            np.testing.assert_allclose(pair.value[:4], value, rtol=1e-12)
            np.testing.assert_allclose(pair.slope[:4], slope, rtol=1e-12)


def test_the_series_of_bumps_are_the_b_splines():
    p = np.linspace(-1.0, 1.0, 11)
    for k, t, w in itertools.product(range(4), (0.5, 0.3, 0.9), (0.1, 0.05, 0.0)):
        expected = oracles.CARDINAL(t + w * p + 3 - k)
        series = surface_models.bump(k, t, w)
        assert series.r == 0.0
        np.testing.assert_allclose(np.polyval(series[3::-1], p), expected, atol=1e-15)


@pytest.mark.parametrize("seed", range(20))
def test_spline_models_enclose_the_spline_and_its_slopes(seed):
    random = np.random.default_rng(seed)
    height = random.choice([0.0, 1.0, 1e6])
    sheet = oracles.Sheet(height + random.normal(size=(7, 8)), 0.0, 0.0, 0.7, 1.3)
    i, j = int(random.integers(0, 5)), int(random.integers(0, 4))
    w, v = random.choice([0.5, 0.2, 0.01, 0.0], 2)
    t, s = random.uniform(w, 1.0 - w), random.uniform(v, 1.0 - v)
    layer = surface_models.spline_models(sheet.coefficients, i, j, t, s, w, v, sheet.dx, sheet.dy)
    p, q = square(9)
    points = np.column_stack([(i + t + w * p) * sheet.dx, (j + s + v * q) * sheet.dy])
    rounding = 1e-14 * max(height, 1.0)
    for model, along in ((layer.value, (0, 0)), (layer.slope_x, (1, 0)), (layer.slope_y, (0, 1))):
        off = abs(value_of(model, p, q) - sheet.at(points, *along)).max()
        assert off <= model.r + 4.0 * rounding
        # Terms beyond degree three are all that is missing.
        assert model.r <= 30.0 * max(w, v) ** 4 * 4.0
    assert abs(layer.value.c00) <= height + 10.0
