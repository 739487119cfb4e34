"""Proven bounds over boxes, by Taylor models; the checker's own, and nothing of the solver's.

A Taylor model of a function on a box is a polynomial of degree 3 in coordinates (p, q) that
run over [-1, 1]^2, and a bound r on what the function differs from it anywhere in the box.
Sums and products of models are models, so that terms which cancel do so exactly: the bound
on a dual norm that is 1 up to a small smooth error is 1 up to that error, whatever the
slopes (Makino and Berz 2003).
"""

import math
from typing import NamedTuple

import numpy as np

from .compiler import inner_kernel, kernel, per_class
from .surfaces import Peaks, Spline, floor_of


class Box(NamedTuple):
    """A rectangle of the plane: centre and half widths, which may be 0."""

    x: float
    y: float
    a: float
    b: float


class Model(NamedTuple):
    """Sum of c_ij p^i q^j, give or take r."""

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
    """Sum of the sizes of the terms of degree 1."""
    return abs(f.c10) + abs(f.c01)


@inner_kernel
def degree2(f):
    return abs(f.c20) + abs(f.c11) + abs(f.c02)


@inner_kernel
def degree3(f):
    return abs(f.c30) + abs(f.c21) + abs(f.c12) + abs(f.c03)


@inner_kernel
def spread(f):
    """How far f can be from its value at the centre."""
    return degree1(f) + degree2(f) + degree3(f) + f.r


@inner_kernel
def times(f, g):
    """The product: what goes beyond degree 3 adds to the remainder."""
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


# Tensor products of one-dimensional series


class Series(NamedTuple):
    """c0 + c1 p + c2 p^2 + c3 p^3, give or take r."""

    c0: float
    c1: float
    c2: float
    c3: float
    r: float


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


class Layer(NamedTuple):
    """Models of a layer's value and of its slopes, all times its weight."""

    value: Model
    slope_x: Model
    slope_y: Model


@inner_kernel
def plus_layer(f, g):
    return Layer(plus(f.value, g.value), plus(f.slope_x, g.slope_x), plus(f.slope_y, g.slope_y))


# Cramer's inequality: |H_n(t)| exp(-t^2 / 2) <= K 2^(n/2) sqrt(n!).
_CRAMER = 1.0866


class SeriesPair(NamedTuple):
    """Series of a function and of its derivative."""

    value: Series
    slope: Series


@inner_kernel
def gaussian(falloff, offset, a):
    """Series of exp(-falloff t^2) around t = offset over half width a."""
    c0 = math.exp(-falloff * offset * offset)
    c1 = -2.0 * falloff * offset * c0
    c2 = -falloff * (offset * c1 + c0)
    c3 = -2.0 / 3.0 * falloff * (offset * c2 + c1)
    c4 = -0.5 * falloff * (offset * c3 + c2)
    nearest = max(abs(offset) - a, 0.0)
    top = _CRAMER * math.exp(-0.5 * falloff * nearest * nearest) * (a * a) ** 2 / 24.0
    rest4 = top * (2.0 * falloff) ** 2 * math.sqrt(24.0)
    rest5 = top * (2.0 * falloff) ** 2 * math.sqrt(2.0 * falloff * 120.0)
    value = Series(c0, c1 * a, c2 * a * a, c3 * a * a * a, rest4)
    slope = Series(c1, 2.0 * c2 * a, 3.0 * c3 * a * a, 4.0 * c4 * a * a * a, rest5)
    return SeriesPair(value, slope)


@kernel
def peaks_layer(surface, layer, box):
    zero = constant(0.0)
    total = Layer(zero, zero, zero)
    for n in range(surface.first[layer], surface.first[layer + 1]):
        amplitude = surface.weights[layer] * surface.peaks[n, 0]
        falloff = surface.peaks[n, 1]
        s = gaussian(falloff, box.x - surface.peaks[n, 2], box.a)
        t = gaussian(falloff, box.y - surface.peaks[n, 3], box.b)
        peak = Layer(
            tensor(s.value, t.value, amplitude),
            tensor(s.slope, t.value, amplitude),
            tensor(s.value, t.slope, amplitude),
        )
        total = plus_layer(total, peak)
    return total


@inner_kernel
def bump(k, t, w):
    """Series of the k-th of the four cubic B-splines of a knot span, t + w p in [0, 1]."""
    if k == 0:
        r = 1.0 - t
        return Series(r * r * r / 6.0, -0.5 * r * r * w, 0.5 * r * w * w, -w * w * w / 6.0, 0.0)
    if k == 3:
        return Series(t * t * t / 6.0, 0.5 * t * t * w, 0.5 * t * w * w, w * w * w / 6.0, 0.0)
    if k == 1:
        return Series(
            (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
            t * (1.5 * t - 2.0) * w,
            0.5 * (3.0 * t - 2.0) * w * w,
            0.5 * w * w * w,
            0.0,
        )
    r = 1.0 - t
    return Series(
        (4.0 - 6.0 * r * r + 3.0 * r * r * r) / 6.0,
        -r * (1.5 * r - 2.0) * w,
        0.5 * (3.0 * r - 2.0) * w * w,
        -0.5 * w * w * w,
        0.0,
    )


@inner_kernel
def derivative(s, scale):
    """Series of ds/dp times a scale."""
    return Series(scale * s.c1, 2.0 * scale * s.c2, 3.0 * scale * s.c3, 0.0, 0.0)


@kernel
def spline_models(coefficients, i, j, t, s, w, v, dx, dy):
    """Value and slopes of a bicubic spline inside one of its cells.

    coefficients (ny + 2, nx + 2); the box is centred at (t, s) in the cell, half widths
    (w, v), all as shares of the cell, which is dx by dy.
    """
    zero = constant(0.0)
    # What all coefficients share adds to the value alone, and no digit of a slope cancels.
    base = coefficients[j + 1, i + 1]
    total = Layer(constant(base), zero, zero)
    for q in range(4):
        # Along a row first: the sum over the columns is a series in p.
        c0, c1, c2, c3 = 0.0, 0.0, 0.0, 0.0
        for k in range(4):
            series = bump(k, t, w)
            c = coefficients[j + q, i + k] - base
            c0 += c * series.c0
            c1 += c * series.c1
            c2 += c * series.c2
            c3 += c * series.c3
        row = Series(c0, c1, c2, c3, 0.0)
        column = bump(q, s, v)
        # With a half width of 0 the slope's series is its value at the centre.
        row_slope = (
            derivative(row, 1.0 / (w * dx))
            if w > 0.0
            else point_slope(coefficients, i, j + q, t, dx)
        )
        column_slope = derivative(column, 1.0 / (v * dy)) if v > 0.0 else bump_slope(q, s, dy)
        total = plus_layer(
            total,
            Layer(
                tensor(row, column, 1.0),
                tensor(row_slope, column, 1.0),
                tensor(row, column_slope, 1.0),
            ),
        )
    return total


@inner_kernel
def bump_slope(k, t, dx):
    """The slope of a B-spline at a point, as a series over no width."""
    return Series(bump(k, t, 1.0).c1 / dx, 0.0, 0.0, 0.0, 0.0)


@inner_kernel
def point_slope(coefficients, i, row, t, dx):
    """The slope along a row of coefficients at a point, as a series over no width."""
    total = 0.0
    for k in range(4):
        total += coefficients[row, i + k] * bump_slope(k, t, dx).c0
    return Series(total, 0.0, 0.0, 0.0, 0.0)


@inner_kernel
def cell_of(x, x0, dx, cells):
    """The knot span that x lies in, clamped to the outermost ones."""
    return min(max(math.floor((x - x0) / dx), 0), cells - 1)


@kernel
def spline_over(surface, coefficients, box):
    """Models of a spline on the surface's knots over a box, and of its slopes."""
    i = cell_of(box.x, surface.x0, surface.dx, coefficients.shape[1] - 3)
    j = cell_of(box.y, surface.y0, surface.dy, coefficients.shape[0] - 3)
    return spline_models(
        coefficients,
        i,
        j,
        (box.x - surface.x0) / surface.dx - i,
        (box.y - surface.y0) / surface.dy - j,
        box.a / surface.dx,
        box.b / surface.dy,
        surface.dx,
        surface.dy,
    )


@inner_kernel
def spline_layer(surface, layer, box):
    f = spline_over(surface, surface.coefficients[layer], box)
    w = surface.weights[layer]
    return Layer(times_number(f.value, w), times_number(f.slope_x, w), times_number(f.slope_y, w))


@per_class({Peaks: peaks_layer, Spline: spline_layer})
def layer_over(surface, layer, box):
    """Models of one layer over a box, which must lie within one knot span of a spline."""


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
def peaks_times_squared_cost(surface, box, f):
    return f


@kernel
def spline_times_squared_cost(surface, box, f):
    if surface.log_cost.shape[0] == 0:
        return f
    log_cost = spline_over(surface, surface.log_cost[0], box).value
    return times(f, exponential(times_number(log_cost, 2.0)))


@per_class({Peaks: peaks_times_squared_cost, Spline: spline_times_squared_cost})
def times_squared_cost(surface, box, f):
    """The model of c^2 f over a box, which must lie within one knot span of a spline."""


# Pieces of a cell on which the surface is smooth


@kernel
def peaks_cuts(surface, axis, low, high, cuts):
    cuts[0], cuts[1] = low, high
    return 1


@kernel
def spline_cuts(surface, axis, low, high, cuts):
    origin, step = (surface.x0, surface.dx) if axis == 0 else (surface.y0, surface.dy)
    cells = surface.coefficients.shape[2 - axis] - 3
    pieces = 0
    cuts[0] = low
    first = max(math.floor((low - origin) / step) + 1, 1)
    for k in range(first, cells):
        knot = origin + k * step
        if knot >= high:
            break
        # A knot within rounding of the end before would leave a piece of no width.
        if knot > cuts[pieces] + 1e-9 * step and knot < high - 1e-9 * step:
            pieces += 1
            cuts[pieces] = knot
    cuts[pieces + 1] = high
    return pieces + 1


@per_class({Peaks: peaks_cuts, Spline: spline_cuts})
def cut_at_knots(surface, axis, low, high, cuts):
    """Cut [low, high] of an axis where the surface's pieces meet; returns how many there are.

    Piece k is [cuts[k], cuts[k + 1]].
    """


# The claim


class Bound(NamedTuple):
    """A function u, bicubic over the cells of a grid."""

    coefficients: np.ndarray  # (ny + 2, nx + 2) float64
    x0: float  # corner of the first cell
    y0: float
    dx: float
    dy: float


@inner_kernel
def bound_over(bound, i, j, box):
    """Models of u and its slopes over a box inside cell (i, j)."""
    return spline_models(
        bound.coefficients,
        i,
        j,
        (box.x - bound.x0) / bound.dx - i,
        (box.y - bound.y0) / bound.dy - j,
        box.a / bound.dx,
        box.b / bound.dy,
        bound.dx,
        bound.dy,
    )


class Facts(NamedTuple):
    """What is proven of one box."""

    norm: float  # at least the square of the dual norm of du anywhere in the box
    sample: float  # its largest value at nine points, but for the remainders
    lowest: float  # at most u anywhere in the box
    chord: float  # at most the chord from anywhere in the box to the goal, times the least cost


@inner_kernel
def cross(ax, ay, bx, by):
    """The model of a_x b_y - a_y b_x."""
    return minus(times(ax, by), times(ay, bx))


@inner_kernel
def outside(low, high, value):
    """Distance of a value from an interval."""
    return max(low - value, value - high, 0.0)


@inner_kernel
def polynomial(f, p, q):
    """The value of a model's polynomial."""
    return (
        f.c00
        + p * (f.c10 + p * (f.c20 + p * f.c30 + q * f.c21) + q * f.c11)
        + q * (f.c01 + q * (f.c02 + q * f.c03 + p * f.c12))
    )


@inner_kernel
def largest_ratio(top, bottom):
    """The largest top / bottom at the corners, the middles of the sides and the centre."""
    largest = 0.0
    for m in range(9):
        p, q = m % 3 - 1.0, m // 3 - 1.0
        largest = max(largest, polynomial(top, p, q) / polynomial(bottom, p, q))
    return largest


@inner_kernel
def planar_distance(box, goal):
    """Distance of a box from the goal on the plane."""
    east = outside(box.x - box.a, box.x + box.a, goal[0])
    north = outside(box.y - box.b, box.y + box.b, goal[1])
    return math.hypot(east, north)


@inner_kernel
def keep(work, row, f):
    """Write a model's coefficients into a row of the workspace."""
    for k, c in enumerate(f):
        work[row, k] = c


@inner_kernel
def kept(work, row):
    c = work[row]
    return Model(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10])


@kernel
def facts_of_box(surface, bound, goal, i, j, box, work):
    """Bounds over a box inside cell (i, j) and one piece of the surface.

    With slopes g_k of the weighted layers, h = c^2 H, H = I + sum g_k g_k^T and

        c^2 |du|_h^2 det H = |du|^2 + sum_k (du x g_k)^2,
        det H = 1 + sum_k |g_k|^2 + sum_{k<l} (g_k x g_l)^2.

    goal (2 + layers,) is the goal's lifted point; work (2 layers, 11).
    """
    u = bound_over(bound, i, j, box)
    top = plus(times(u.slope_x, u.slope_x), times(u.slope_y, u.slope_y))
    bottom = constant(1.0)
    chord = planar_distance(box, goal) ** 2
    for k in range(surface.weights.shape[0]):
        f = layer_over(surface, k, box)
        keep(work, 2 * k, f.slope_x)
        keep(work, 2 * k + 1, f.slope_y)
        twist = cross(u.slope_x, u.slope_y, f.slope_x, f.slope_y)
        top = plus(top, times(twist, twist))
        bottom = plus(bottom, times(f.slope_x, f.slope_x))
        bottom = plus(bottom, times(f.slope_y, f.slope_y))
        for m in range(k):
            twist = cross(f.slope_x, f.slope_y, kept(work, 2 * m), kept(work, 2 * m + 1))
            bottom = plus(bottom, times(twist, twist))
        reach = spread(f.value)
        chord += outside(f.value.c00 - reach, f.value.c00 + reach, goal[2 + k]) ** 2
    bottom = times_squared_cost(surface, box, bottom)
    middle = top.c00 / bottom.c00
    excess = minus(top, times_number(bottom, middle))
    floor = floor_of(surface)
    least = max(bottom.c00 - spread(bottom), floor * floor)
    return Facts(
        middle + (abs(excess.c00) + spread(excess)) / least,
        largest_ratio(top, bottom),
        u.value.c00 - spread(u.value),
        floor * math.sqrt(chord),
    )


class Need(NamedTuple):
    """An M that is enough for a box, and what nine points of it need."""

    proven: float
    likely: float
    slope: float  # the dual norm at those points


@inner_kernel
def need_of_box(facts, horizon):
    """The least M for which a box proves nothing wrong.

    Either the dual norm is at most M everywhere in it, or u / M and the chord to the goal
    add up to horizon / M anywhere in it, so that no path through it is shorter.
    """
    # Of what overflowed, and so may be no number, nothing is proven.
    slope = math.sqrt(max(facts.norm, 0.0)) if facts.norm < math.inf else math.inf
    likely = math.sqrt(max(facts.sample, 0.0)) if facts.sample < math.inf else math.inf
    short = horizon - facts.lowest
    way_out = math.inf
    if short <= 0.0:
        way_out = 0.0
    elif short < math.inf and facts.chord > 0.0:
        way_out = short / facts.chord
    return Need(min(slope, way_out), min(likely, way_out), likely)


class Cutting(NamedTuple):
    """Room for the pieces of a cell."""

    x: np.ndarray
    y: np.ndarray
    work: np.ndarray  # (2 layers, 11)
    boxes: np.ndarray  # (3 DEPTH + 1, 5): centre, half widths and depth of boxes that wait


@inner_kernel
def piece(cutting, p, q):
    """The box of one piece of a cell that is cut at the surface's knots."""
    return Box(
        0.5 * (cutting.x[p] + cutting.x[p + 1]),
        0.5 * (cutting.y[q] + cutting.y[q + 1]),
        0.5 * (cutting.x[p + 1] - cutting.x[p]),
        0.5 * (cutting.y[q + 1] - cutting.y[q]),
    )


class Pieces(NamedTuple):
    """How many pieces a cell is cut into, each way."""

    columns: int
    rows: int


@inner_kernel
def cut_cell(surface, bound, i, j, cutting):
    x, y = bound.x0 + i * bound.dx, bound.y0 + j * bound.dy
    return Pieces(
        cut_at_knots(surface, 0, x, x + bound.dx, cutting.x),
        cut_at_knots(surface, 1, y, y + bound.dy, cutting.y),
    )


@kernel
def need_of_cell(surface, bound, goal, horizon, i, j, cutting):
    """The least M of cell (i, j), as the models over its whole pieces tell."""
    pieces = cut_cell(surface, bound, i, j, cutting)
    proven, likely, slope = 0.0, 0.0, 0.0
    for q in range(pieces.rows):
        for p in range(pieces.columns):
            box = piece(cutting, p, q)
            facts = facts_of_box(surface, bound, goal, i, j, box, cutting.work)
            need = need_of_box(facts, horizon)
            proven, likely = max(proven, need.proven), max(likely, need.likely)
            slope = max(slope, need.slope)
    return Need(proven, likely, slope)


# A box is cut in four where M could be lower for it by this share, and so often at most.
WORTHWHILE = 2e-5
DEPTH = 6


@kernel
def norm_of_box(surface, bound, goal, horizon, i, j, box, norm, cutting):
    """The least M, ``norm`` or above, that is enough for a box; it is cut up where that helps."""
    boxes = cutting.boxes
    boxes[0, 0], boxes[0, 1], boxes[0, 2], boxes[0, 3], boxes[0, 4] = (
        box.x,
        box.y,
        box.a,
        box.b,
        0.0,
    )
    waiting = 1
    while waiting > 0:
        waiting -= 1
        x, y, a, b, depth = boxes[waiting]
        facts = facts_of_box(surface, bound, goal, i, j, Box(x, y, a, b), cutting.work)
        need = need_of_box(facts, horizon)
        if need.proven <= norm:
            continue
        if depth == DEPTH or need.proven <= (1.0 + WORTHWHILE) * need.likely:
            norm = need.proven
            continue
        for m in range(4):
            boxes[waiting, 0] = x + (m % 2 - 0.5) * a
            boxes[waiting, 1] = y + (m // 2 - 0.5) * b
            boxes[waiting, 2], boxes[waiting, 3] = 0.5 * a, 0.5 * b
            boxes[waiting, 4] = depth + 1.0
            waiting += 1
    return norm


@kernel
def cheap_need(floor, bound, goal, horizon, i, j):
    """An M that is enough for cell (i, j), from u's coefficients and the planar distance alone."""
    lowest = math.inf
    for q in range(4):
        for k in range(4):
            lowest = min(lowest, bound.coefficients[j + q, i + k])
    if lowest >= horizon:
        return 0.0
    half_x, half_y = 0.5 * bound.dx, 0.5 * bound.dy
    box = Box(bound.x0 + i * bound.dx + half_x, bound.y0 + j * bound.dy + half_y, half_x, half_y)
    distance = floor * planar_distance(box, goal)
    return (horizon - lowest) / distance if distance > 0.0 else math.inf


@kernel
def fill_needs(surface, bound, goal, horizon, exempt, enough, cutting, proven, likely, slope):
    """An M that is enough for each cell (ny, nx), 0 where exempt; not looked at closely.

    ``enough`` : an M that is fine, so that nothing better is looked for.
    """
    for j in range(proven.shape[0]):
        for i in range(proven.shape[1]):
            proven[j, i] = 0.0
            if not exempt[j, i]:
                proven[j, i] = cheap_need(floor_of(surface), bound, goal, horizon, i, j)
            likely[j, i], slope[j, i] = proven[j, i], 0.0
            if proven[j, i] > enough:
                need = need_of_cell(surface, bound, goal, horizon, i, j, cutting)
                proven[j, i] = min(proven[j, i], need.proven)
                likely[j, i] = min(proven[j, i], need.likely)
                slope[j, i] = need.slope


@kernel
def least_norm(surface, bound, goal, horizon, order, needs, norm, cutting):
    """The least M, ``norm`` or above, that is enough for all cells.

    needs (ny, nx) : what is proven to be enough. order : numbers of the cells, by falling
    need, so that those which settle M are looked at first.
    """
    columns = needs.shape[1]
    for n in order:
        i, j = n % columns, n // columns
        if needs[j, i] <= norm:
            break
        found = norm
        pieces = cut_cell(surface, bound, i, j, cutting)
        for q in range(pieces.rows):
            for p in range(pieces.columns):
                box = piece(cutting, p, q)
                found = norm_of_box(surface, bound, goal, horizon, i, j, box, found, cutting)
        norm = min(found, needs[j, i])
    return norm


class Anchor(NamedTuple):
    """An end of all paths, and how far it is from a point p nearby at least.

    That is the lesser of ``floor`` times the chord and ``far``: as long as a path stays around
    the anchor no cost is below the floor, and when it leaves it is ``far`` long already.
    """

    lifted: np.ndarray  # (2 + layers,)
    floor: float
    far: float


@kernel
def margin_of_box(surface, bound, anchor, factor, i, j, box):
    """At most distance(anchor, p) + factor u(p) for any p of a box inside cell (i, j).

    The chord is convex in R^n, so that it is nowhere below its tangent at the box's centre.
    """
    floor, end = anchor.floor, anchor.lifted
    east, north = box.x - end[0], box.y - end[1]
    squared = east * east + north * north
    for k in range(surface.weights.shape[0]):
        rise = layer_over(surface, k, box).value.c00 - end[2 + k]
        squared += rise * rise
    chord = math.sqrt(squared)
    total = times_number(bound_over(bound, i, j, box).value, factor)
    outside_margin = anchor.far + total.c00 - spread(total)
    if chord > 0.0:
        along_x, along_y = floor * box.a * east / chord, floor * box.b * north / chord
        tangent = Model(floor * chord, along_x, along_y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        total = plus(total, tangent)
        for k in range(surface.weights.shape[0]):
            value = layer_over(surface, k, box).value
            offset = minus(value, constant(value.c00))
            rise = value.c00 - end[2 + k]
            total = plus(total, times_number(offset, floor * rise / chord))
    margin = min(total.c00 - spread(total), outside_margin)
    # No number, where something overflowed.
    return margin if margin > -math.inf else -math.inf


# A cell's side on the core's edge is cut into so many parts.
PARTS = 8


@kernel
def margin_of_side(surface, bound, anchor, factor, i, j, axis, at, cutting):
    """The least margin along a side of cell (i, j): along ``axis``, at ``at`` on the other."""
    low = bound.x0 + i * bound.dx if axis == 0 else bound.y0 + j * bound.dy
    high = low + (bound.dx if axis == 0 else bound.dy)
    cuts = cutting.x if axis == 0 else cutting.y
    margin = math.inf
    for k in range(cut_at_knots(surface, axis, low, high, cuts)):
        half = 0.5 * (cuts[k + 1] - cuts[k]) / PARTS
        for m in range(PARTS):
            middle = cuts[k] + (2 * m + 1) * half
            box = Box(middle, at, half, 0.0) if axis == 0 else Box(at, middle, 0.0, half)
            margin = min(margin, margin_of_box(surface, bound, anchor, factor, i, j, box))
    return margin


@kernel
def margin_of_core(surface, bound, anchor, factor, i0, i1, j0, j1, cutting):
    """The least margin on the edge of the cells [i0, i1) x [j0, j1)."""
    margin = math.inf
    left, right = bound.x0 + i0 * bound.dx, bound.x0 + i1 * bound.dx
    bottom, top = bound.y0 + j0 * bound.dy, bound.y0 + j1 * bound.dy
    for i in range(i0, i1):
        for j, at in ((j0, bottom), (j1 - 1, top)):
            side = margin_of_side(surface, bound, anchor, factor, i, j, 0, at, cutting)
            margin = min(margin, side)
    for j in range(j0, j1):
        for i, at in ((i0, left), (i1 - 1, right)):
            side = margin_of_side(surface, bound, anchor, factor, i, j, 1, at, cutting)
            margin = min(margin, side)
    return margin
