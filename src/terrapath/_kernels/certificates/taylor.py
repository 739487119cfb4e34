"""Taylor models: polynomials on a box, with a proven limit on their error.

A Taylor model of a function on a box is a polynomial of degree 3 in coordinates (p, q), which
run over [-1, 1]^2, and a remainder r: nowhere in the box do the function and the polynomial
differ by more. Sums and products of models are models, so terms that cancel do so exactly.
Where a dual norm is 1 but for a small smooth error, the model proves that, however steep the
slopes are (Makino and Berz 2003). The checker uses this, and no planner does.
"""

import math
from typing import NamedTuple

from ..compiler import inner_kernel, kernel


class Model(NamedTuple):
    """Sum of c_ij p^i q^j, plus or minus at most r."""

    c00: float
    c10: float
    c01: float
    c20: float
    c11: float
    c02: float
    c30: float
    c21: float
    c12: float
    c03: float
    r: float


@inner_kernel
def constant(c):
    return Model(c, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inner_kernel
def plus(f, g):
    return Model(
        f.c00 + g.c00,
        f.c10 + g.c10,
        f.c01 + g.c01,
        f.c20 + g.c20,
        f.c11 + g.c11,
        f.c02 + g.c02,
        f.c30 + g.c30,
        f.c21 + g.c21,
        f.c12 + g.c12,
        f.c03 + g.c03,
        f.r + g.r,
    )


@inner_kernel
def times_number(f, s):
    return Model(
        s * f.c00,
        s * f.c10,
        s * f.c01,
        s * f.c20,
        s * f.c11,
        s * f.c02,
        s * f.c30,
        s * f.c21,
        s * f.c12,
        s * f.c03,
        abs(s) * f.r,
    )


@inner_kernel
def minus(f, g):
    return plus(f, times_number(g, -1.0))


@inner_kernel
def degree1(f):
    """Sum of the absolute values of the coefficients of degree 1."""
    return abs(f.c10) + abs(f.c01)


@inner_kernel
def degree2(f):
    return abs(f.c20) + abs(f.c11) + abs(f.c02)


@inner_kernel
def degree3(f):
    return abs(f.c30) + abs(f.c21) + abs(f.c12) + abs(f.c03)


@inner_kernel
def spread(f):
    """How far f can be from the constant term of its polynomial."""
    return degree1(f) + degree2(f) + degree3(f) + f.r


@inner_kernel
def times(f, g):
    """The product; terms beyond degree 3 are added to the remainder."""
    f1, f2, f3, g1, g2, g3 = degree1(f), degree2(f), degree3(f), degree1(g), degree2(g), degree3(g)
    beyond = f1 * g3 + f2 * g2 + f3 * g1 + f2 * g3 + f3 * g2 + f3 * g3
    size_f, size_g = abs(f.c00) + f1 + f2 + f3, abs(g.c00) + g1 + g2 + g3
    return Model(
        f.c00 * g.c00,
        f.c00 * g.c10 + f.c10 * g.c00,
        f.c00 * g.c01 + f.c01 * g.c00,
        f.c00 * g.c20 + f.c10 * g.c10 + f.c20 * g.c00,
        f.c00 * g.c11 + f.c10 * g.c01 + f.c01 * g.c10 + f.c11 * g.c00,
        f.c00 * g.c02 + f.c01 * g.c01 + f.c02 * g.c00,
        f.c00 * g.c30 + f.c10 * g.c20 + f.c20 * g.c10 + f.c30 * g.c00,
        f.c00 * g.c21
        + f.c10 * g.c11
        + f.c01 * g.c20
        + f.c20 * g.c01
        + f.c11 * g.c10
        + f.c21 * g.c00,
        f.c00 * g.c12
        + f.c01 * g.c11
        + f.c10 * g.c02
        + f.c02 * g.c10
        + f.c11 * g.c01
        + f.c12 * g.c00,
        f.c00 * g.c03 + f.c01 * g.c02 + f.c02 * g.c01 + f.c03 * g.c00,
        beyond + size_f * g.r + size_g * f.r + f.r * g.r,
    )


@inner_kernel
def cross(ax, ay, bx, by):
    """The model of a_x b_y - a_y b_x."""
    return minus(times(ax, by), times(ay, bx))


@kernel
def exponential(f):
    """The model of exp f, by its series around the constant term."""
    t = Model(0.0, f.c10, f.c01, f.c20, f.c11, f.c02, f.c30, f.c21, f.c12, f.c03, f.r)
    squared = times(t, t)
    total = plus(plus(constant(1.0), t), times_number(squared, 0.5))
    total = plus(total, times_number(times(squared, t), 1.0 / 6.0))
    reach = spread(t)
    rest = math.exp(reach) * (reach * reach) ** 2 / 24.0
    total = plus(total, Model(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, rest))
    return times_number(total, math.exp(f.c00))


@inner_kernel
def polynomial(f, p, q):
    """The value of a model's polynomial."""
    return (
        f.c00
        + p * (f.c10 + p * (f.c20 + p * f.c30 + q * f.c21) + q * f.c11)
        + q * (f.c01 + q * (f.c02 + q * f.c03 + p * f.c12))
    )


@inner_kernel
def keep(work, row, f):
    """Write a model's coefficients into a row of the workspace."""
    for k, c in enumerate(f):
        work[row, k] = c


@inner_kernel
def kept(work, row):
    c = work[row]
    return Model(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10])


# Tensor products of one-dimensional series


class Series(NamedTuple):
    """c0 + c1 p + c2 p^2 + c3 p^3, plus or minus at most r."""

    c0: float
    c1: float
    c2: float
    c3: float
    r: float


@inner_kernel
def derivative(s, scale):
    """Series of ds/dp times a scale."""
    return Series(scale * s.c1, 2.0 * scale * s.c2, 3.0 * scale * s.c3, 0.0, 0.0)


@inner_kernel
def tensor(s, t, factor):
    """The model of factor s(p) t(q)."""
    s0, s1, s2, s3 = factor * s.c0, factor * s.c1, factor * s.c2, factor * s.c3
    a1, a2, a3, b1, b2, b3 = abs(s1), abs(s2), abs(s3), abs(t.c1), abs(t.c2), abs(t.c3)
    beyond = a1 * b3 + a2 * (b2 + b3) + a3 * (b1 + b2 + b3)
    size_s, size_t = abs(s0) + a1 + a2 + a3, abs(t.c0) + b1 + b2 + b3
    rest = abs(factor) * s.r
    return Model(
        s0 * t.c0,
        s1 * t.c0,
        s0 * t.c1,
        s2 * t.c0,
        s1 * t.c1,
        s0 * t.c2,
        s3 * t.c0,
        s2 * t.c1,
        s1 * t.c2,
        s0 * t.c3,
        beyond + size_s * t.r + size_t * rest + rest * t.r,
    )
