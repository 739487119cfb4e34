"""Taylor models of a surface's layers and of its cost over boxes."""

import math
from typing import NamedTuple

from ..compiler import inner_kernel, kernel
from ..dispatch import per_class
from ..surface.cells import any_cells, least_inside
from ..surface.surfaces import Peaks, Spline
from .taylor import (
    Model,
    Series,
    constant,
    derivative,
    exponential,
    plus,
    tensor,
    times,
    times_number,
)


class Box(NamedTuple):
    """A rectangle of the plane: centre and half widths, which may be 0."""

    x: float
    y: float
    a: float
    b: float


class Layer(NamedTuple):
    """Taylor models of a layer's value and of its slopes, all times its weight."""

    value: Model
    slope_x: Model
    slope_y: Model


@inner_kernel
def plus_layer(f, g):
    return Layer(plus(f.value, g.value), plus(f.slope_x, g.slope_x), plus(f.slope_y, g.slope_y))


# Layers of Gaussian peaks

# Cramer's inequality: |H_n(t)| exp(-t^2 / 2) <= K 2^(n/2) sqrt(n!).
_CRAMER = 1.0866


class SeriesPair(NamedTuple):
    """Series of a function and of its derivative."""

    value: Series
    slope: Series


@inner_kernel
def gaussian(falloff, offset, a):
    """Series of exp(-falloff t^2) and its derivative around t = offset, over half width a."""
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


# Layers that are splines


@inner_kernel
def bump(k, t, w):
    """Series in p of the k-th cubic B-spline of a knot span, at t + w p in [0, 1]; k < 4."""
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
def bump_slope(k, t, dx):
    """The slope of a B-spline at a point, as a constant series."""
    return Series(bump(k, t, 1.0).c1 / dx, 0.0, 0.0, 0.0, 0.0)


@inner_kernel
def point_slope(coefficients, i, row, t, dx):
    """The slope along a row of coefficients at a point, as a constant series."""
    total = 0.0
    for k in range(4):
        total += coefficients[row, i + k] * bump_slope(k, t, dx).c0
    return Series(total, 0.0, 0.0, 0.0, 0.0)


@kernel
def spline_models(coefficients, i, j, t, s, w, v, dx, dy):
    """Models of value and slopes of a bicubic spline over a box inside one of its cells.

    coefficients (ny + 2, nx + 2). The box has its centre at (t, s) in the cell and half widths
    (w, v), all as shares of the cell, which is dx by dy.
    """
    zero = constant(0.0)
    # One value is subtracted from all coefficients, so that no digits of a slope cancel. It is
    # added to the value alone.
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
def cell_of(x, x0, dx, cells):
    """The knot span that x lies in, clamped to the outermost ones."""
    return min(max(math.floor((x - x0) / dx), 0), cells - 1)


@kernel
def spline_over(surface, coefficients, box):
    """Models over a box of a spline on the surface's knots, and of its slopes."""
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


# Any surface


@per_class({Peaks: peaks_layer, Spline: spline_layer})
def layer_over(surface, layer, box):
    """Models of one layer over a box, which must lie within one knot span of a spline."""


@inner_kernel
def peaks_times_squared_cost(surface, box, f):
    return f


@kernel
def spline_times_squared_cost(surface, box, f):
    if any_cells(surface.cells):
        x0, x1, y0, y1 = box.x - box.a, box.x + box.a, box.y - box.b, box.y + box.b
        f = times_number(f, least_inside(surface.cells, x0, x1, y0, y1) ** 2)
    if surface.log_cost.shape[0] == 0:
        return f
    log_cost = spline_over(surface, surface.log_cost[0], box).value
    return times(f, exponential(times_number(log_cost, 2.0)))


@per_class({Peaks: peaks_times_squared_cost, Spline: spline_times_squared_cost})
def times_squared_cost(surface, box, f):
    """The model of c^2 f over a box, which must lie within one knot span of a spline.

    Where costs are constant in cells, c is the lowest of the cells that hold a part of the box.
    """


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
        # A knot that differs from the last cut by rounding alone would make a piece of no width.
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
