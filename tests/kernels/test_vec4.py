"""Four numbers at once: compiled, in plain Python, and against NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from terrapath._kernels.compiler import kernel
from terrapath._kernels.vec4 import (
    any_above,
    exp,
    four,
    four_entries,
    four_in_row,
    fused,
    larger,
    sqrt,
    total,
    where_above,
)

numbers = st.floats(-1e6, 1e6)
fours = st.tuples(numbers, numbers, numbers, numbers)


def plain(function):
    """The function as Python runs it."""
    return getattr(function, "py_func", function)


@kernel
def put(v, out):
    out[0], out[1], out[2], out[3] = v[0], v[1], v[2], v[3]


@kernel
def combine(a, b, out):
    v, w = four(a[0], a[1], a[2], a[3]), four(b[0], b[1], b[2], b[3])
    put(v + w, out[0])
    put(v - w, out[1])
    put(v * w, out[2])
    put(2.0 * v + 1.0, out[3])
    put(fused(v, w, 3.0), out[4])
    put(sqrt(v * v), out[5])
    return total(v)


@kernel
def exponentials(x, out):
    for k in range(0, x.shape[0], 4):
        put(exp(four(x[k], x[k + 1], x[k + 2], x[k + 3])), out[k : k + 4])


@kernel
def rows(array, k, j, i, out):
    put(four_in_row(array, k, j, i), out)
    return exp(1.0), sqrt(2.0)


@given(fours, fours)
@settings(deadline=None)
def test_four_numbers_are_counted_with_as_one_by_one(a, b):
    compiled, python = np.empty((6, 4)), np.empty((6, 4))
    v, w = np.array(a), np.array(b)
    expected = [v + w, v - w, v * w, 2.0 * v + 1.0, v * w + 3.0, np.sqrt(v * v)]
    for function, out in ((combine, compiled), (plain(combine), python)):
        assert function(v, w, out) == (v[0] + v[2]) + (v[1] + v[3])
        exact = [0, 1, 2, 3]
        np.testing.assert_array_equal(out[exact], np.array(expected)[exact])
        # Rounded once, not twice: within the rounding of the product.
        rounding = 2.0**-52 * (np.abs(v * w) + 3.0)
        assert (np.abs(out[4] - expected[4]) <= rounding).all()
        np.testing.assert_allclose(out[5], expected[5], rtol=1e-15)


def test_the_exponential_is_within_an_ulp_or_two_of_numpys():
    random = np.random.default_rng(1)
    x = np.concatenate([random.uniform(-708, 709, 20_000), random.uniform(-1, 1, 20_000)])
    out = np.empty_like(x)
    exponentials(x, out)
    np.testing.assert_allclose(out, np.exp(x), rtol=5e-16, atol=0.0)


@pytest.mark.parametrize("x", [0.0, -0.0])
def test_the_exponential_of_nought_is_one(x):
    out = np.empty(4)
    exponentials(np.full(4, x), out)
    assert (out == 1.0).all()


def test_beyond_its_range_the_exponential_stays_at_its_ends_and_is_lost_only_for_nan():
    out = np.empty(4)
    exponentials(np.array([-np.inf, -1e5, 1e5, np.nan]), out)
    assert (out[:2] <= 1e-307).all()
    assert (out[:2] >= 0.0).all()
    assert out[2] >= 8e307
    assert np.isnan(out[3])


def test_four_in_a_row_are_read_and_numbers_stay_numbers():
    array, out = np.arange(60.0).reshape(3, 4, 5), np.empty(4)
    found = rows(array, 2, 3, 1, out)
    np.testing.assert_array_equal(out, array[2, 3, 1:5])
    assert found == pytest.approx((np.e, np.sqrt(2.0)), rel=1e-15)


@kernel
def compare(a, b, out):
    v, w = four(a[0], a[1], a[2], a[3]), four(b[0], b[1], b[2], b[3])
    put(v / w, out[0])
    put(larger(v, w), out[1])
    put(where_above(v, w, 1.0, v), out[2])
    out[3, 0], out[3, 1] = larger(a[0], b[0]), where_above(a[0], b[0], 1.0, a[0])
    return any_above(v, w), any_above(a[0], b[0])


@given(fours, st.tuples(*[st.floats(0.5, 1e6)] * 4))
@settings(max_examples=50, deadline=None)
def test_four_numbers_are_compared_one_by_one(a, b):
    a, b, out = np.array(a), np.array(b), np.zeros((4, 4))
    for function in (compare, plain(compare)):
        assert function(a, b, out) == ((a > b).any(), a[0] > b[0])
        assert (out[:3] == [a / b, np.maximum(a, b), np.where(a > b, 1.0, a)]).all()
        assert (out[3, :2] == out[1:3, 0]).all()


@kernel
def pick(values, k, j, i, steps, out):
    put(four_entries(values, k, j, i, steps[0], steps[1], steps[2]), out)


def test_four_entries_anywhere_are_read():
    values, out = np.arange(60.0).reshape(2, 5, 6), np.zeros(4)
    for function in (pick, plain(pick)):
        function(values, 1, 2, 3, (-7, 5, 0), out)
        assert out.tolist() == [45.0, 38.0, 50.0, 45.0]
