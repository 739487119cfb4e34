"""The two surface classes, and their values, jets and metric at a point.

A surface s(x1, x2) = (x1, x2, w_3 x_3, ..., w_n x_n) is the graph of n - 2 layers
over the plane. ``Peaks`` is exact; ``Spline`` is for everything else. On a ``Spline`` lengths
may be multiplied by a cost c(x1, x2) > 0. The logarithm of c is a spline, so c stays above 0.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..dispatch import per_class
from ..vec4 import exp, four, fused, sqrt, total
from .bsplines import Cell, basis, basis_curvature, basis_slope, column_sums, tensor_sum


class Peaks(NamedTuple):
    """Layers that are sums of Gaussian peaks a exp(-f r^2)."""

    peaks: np.ndarray  # (p, 4) float64: amplitude a, falloff f, centre x1, centre x2; by layer
    first: np.ndarray  # (layers + 1,) int64: peaks[first[k]:first[k + 1]] make up layer k
    weights: np.ndarray  # (layers,) float64


class Spline(NamedTuple):
    """Layers that are uniform bicubic B-splines."""

    coefficients: np.ndarray  # (layers, ny + 2, nx + 2) float64
    weights: np.ndarray  # (layers,) float64
    x0: float  # the first knot inside the domain
    y0: float
    dx: float  # knot spacing
    dy: float
    log_cost: np.ndarray  # (0 or 1, ny + 2, nx + 2) float64: log c as one more layer
    floor: float  # a lower bound on c; 1 without a cost


class Jet(NamedTuple):
    """Value and derivatives of one layer at a point."""

    f: float
    fx: float
    fy: float
    fxx: float
    fxy: float
    fyy: float


class Slope(NamedTuple):
    """Value and gradient of one layer at a point."""

    f: float
    fx: float
    fy: float


class Metric(NamedTuple):
    """The symmetric tensor h at a point (paper, section 3.2)."""

    h11: float
    h12: float
    h22: float


class Point(NamedTuple):
    """A point over peaks, or four points at once."""

    x: float
    y: float


class Spot(NamedTuple):
    """A point over a spline: its cell, and the weights of the coefficients, for all layers."""

    cell: Cell
    bx: np.ndarray  # the four B-splines along x1; each of these fields has four numbers
    by: np.ndarray
    sx: np.ndarray  # their slopes, 1/map unit
    sy: np.ndarray


# Peaks


@inner_kernel
def peaks_spot(surface, x, y):
    return Point(x, y)


@inner_kernel
def peaks_slope(surface, layer, spot):
    f = 0.0 * spot.x  # a number or four
    fx, fy = f, f
    for p in range(surface.first[layer], surface.first[layer + 1]):
        dx = spot.x - surface.peaks[p, 2]
        dy = spot.y - surface.peaks[p, 3]
        falloff = surface.peaks[p, 1]
        g = surface.peaks[p, 0] * exp(-falloff * (dx * dx + dy * dy))
        # Not in place: in plain Python that would change all three.
        f = f + g
        fx = fx - 2.0 * falloff * dx * g
        fy = fy - 2.0 * falloff * dy * g
    return Slope(f, fx, fy)


@inner_kernel
def peaks_slope_along(surface, layer, spot, vx, vy):
    slope = peaks_slope(surface, layer, spot)
    return slope.fx * vx + slope.fy * vy


@kernel
def peaks_jet(surface, layer, x, y):
    f, fx, fy, fxx, fxy, fyy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(surface.first[layer], surface.first[layer + 1]):
        dx = x - surface.peaks[p, 2]
        dy = y - surface.peaks[p, 3]
        c = -2.0 * surface.peaks[p, 1]
        g = surface.peaks[p, 0] * exp(0.5 * c * (dx * dx + dy * dy))
        f += g
        fx += c * dx * g
        fy += c * dy * g
        fxx += (c + c * c * dx * dx) * g
        fxy += c * c * dx * dy * g
        fyy += (c + c * c * dy * dy) * g
    return Jet(f, fx, fy, fxx, fxy, fyy)


# Spline


@inner_kernel
def spline_cell(surface, x, y):
    """The cell of (x, y), clamped to the outermost cells."""
    s = (x - surface.x0) * (1.0 / surface.dx)
    t = (y - surface.y0) * (1.0 / surface.dy)
    i = min(max(math.floor(s), 0), surface.coefficients.shape[2] - 4)
    j = min(max(math.floor(t), 0), surface.coefficients.shape[1] - 4)
    return Cell(i, j, s - i, t - j)


@inner_kernel
def spline_spot(surface, x, y):
    cell = spline_cell(surface, x, y)
    per_x, per_y = 1.0 / surface.dx, 1.0 / surface.dy
    sx, sy = per_x * basis_slope(cell.u), per_y * basis_slope(cell.v)
    return Spot(cell, basis(cell.u), basis(cell.v), sx, sy)


@inner_kernel
def sums_and_rises(surface, layer, spot):
    """Sums over the columns of a cell: for values, and for derivatives along y."""
    return (
        column_sums(surface.coefficients, layer, spot.cell, spot.by),
        column_sums(surface.coefficients, layer, spot.cell, spot.sy),
    )


@inner_kernel
def spline_slope(surface, layer, spot):
    sums, rises = sums_and_rises(surface, layer, spot)
    return Slope(total(spot.bx * sums), total(spot.sx * sums), total(spot.bx * rises))


@inner_kernel
def spline_slope_along(surface, layer, spot, vx, vy):
    sums, rises = sums_and_rises(surface, layer, spot)
    return total(fused(vx * spot.sx, sums, (vy * spot.bx) * rises))


@inner_kernel
def spline_jet(surface, layer, x, y):
    return jet_of_coefficients(surface, surface.coefficients, layer, x, y)


@kernel
def jet_of_coefficients(surface, c, layer, x, y):
    cell = spline_cell(surface, x, y)
    bx, by = basis(cell.u), basis(cell.v)
    sx, sy = basis_slope(cell.u), basis_slope(cell.v)
    dx, dy = surface.dx, surface.dy
    return Jet(
        tensor_sum(c, layer, cell, bx, by),
        tensor_sum(c, layer, cell, sx, by) / dx,
        tensor_sum(c, layer, cell, bx, sy) / dy,
        tensor_sum(c, layer, cell, basis_curvature(cell.u), by) / (dx * dx),
        tensor_sum(c, layer, cell, sx, sy) / (dx * dy),
        tensor_sum(c, layer, cell, bx, basis_curvature(cell.v)) / (dy * dy),
    )


@inner_kernel
def peaks_squared_cost(surface, spot):
    return 1.0


@inner_kernel
def spline_squared_cost(surface, spot):
    if surface.log_cost.shape[0] == 0:
        return 1.0
    return exp(2.0 * tensor_sum(surface.log_cost, 0, spot.cell, spot.bx, spot.by))


@inner_kernel
def peaks_log_cost(surface, x, y):
    return Jet(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def spline_log_cost(surface, x, y):
    if surface.log_cost.shape[0] == 0:
        return Jet(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return jet_of_coefficients(surface, surface.log_cost, 0, x, y)


@inner_kernel
def peaks_floor(surface):
    return 1.0


@inner_kernel
def spline_floor(surface):
    return surface.floor


# Either class


@per_class({Peaks: peaks_spot, Spline: spline_spot})
def spot_at(surface, x, y):
    """What all layers share at a point; on ``Peaks`` also at four points at once."""


@per_class({Peaks: peaks_slope, Spline: spline_slope})
def slope_at(surface, layer, spot):
    """Value and gradient of one layer (unweighted)."""


@per_class({Peaks: peaks_jet, Spline: spline_jet})
def jet_at(surface, layer, x, y):
    """Value, gradient and Hessian of one layer (unweighted)."""


@per_class({Peaks: peaks_slope_along, Spline: spline_slope_along})
def slope_along(surface, layer, spot, vx, vy):
    """Derivative of one layer along (vx, vy) (unweighted); cheaper than the whole gradient."""


@per_class({Peaks: peaks_squared_cost, Spline: spline_squared_cost})
def squared_cost_at(surface, spot):
    """c^2; 1 without a cost."""


@per_class({Peaks: peaks_log_cost, Spline: spline_log_cost})
def log_cost_at(surface, x, y):
    """The jet of log c."""


@per_class({Peaks: peaks_floor, Spline: spline_floor})
def floor_of(surface):
    """A lower bound on c."""


@inner_kernel
def value_at(surface, layer, spot):
    """Value of one layer, in the layer's unit."""
    return slope_at(surface, layer, spot).f


@inner_kernel
def plus_layer(h, weight, slope):
    """The metric with one more layer."""
    fx, fy = weight * slope.fx, weight * slope.fy
    return Metric(h.h11 + fx * fx, h.h12 + fx * fy, h.h22 + fy * fy)


@inner_kernel
def times_cost(surface, spot, h):
    """The metric times c^2."""
    c2 = squared_cost_at(surface, spot)
    return Metric(c2 * h.h11, c2 * h.h12, c2 * h.h22)


@inner_kernel
def metric_at(surface, x, y):
    """H = c^2 (I + sum_k w_k^2 grad x_k grad x_k^T) (paper, section 3.2; c is 1 there)."""
    spot = spot_at(surface, x, y)
    none = 0.0 * x  # a number or four
    h = Metric(none + 1.0, none, none + 1.0)
    for layer in range(surface.weights.shape[0]):
        h = plus_layer(h, surface.weights[layer], slope_at(surface, layer, spot))
    return times_cost(surface, spot, h)


@inner_kernel
def speed_at(surface, x, y, vx, vy):
    """|v|_h for v = (vx, vy): c (|v|^2 + sum_k (w_k dx_k(v))^2)^1/2.

    On ``Peaks`` also at four points at once.
    """
    spot = spot_at(surface, x, y)
    squared = 0.0 * x + (vx * vx + vy * vy)  # a number or four
    for layer in range(surface.weights.shape[0]):
        rise = surface.weights[layer] * slope_along(surface, layer, spot, vx, vy)
        squared = squared + rise * rise
    return sqrt(squared_cost_at(surface, spot) * squared)


@inner_kernel
def peaks_speeds_along(surface, x, y, vx, vy, shares):
    return speed_at(surface, fused(shares, vx, x), fused(shares, vy, y), vx, vy)


@inner_kernel
def spline_speeds_along(surface, x, y, vx, vy, shares):
    return four(
        speed_at(surface, x + shares[0] * vx, y + shares[0] * vy, vx, vy),
        speed_at(surface, x + shares[1] * vx, y + shares[1] * vy, vx, vy),
        speed_at(surface, x + shares[2] * vx, y + shares[2] * vy, vx, vy),
        speed_at(surface, x + shares[3] * vx, y + shares[3] * vy, vx, vy),
    )


@per_class({Peaks: peaks_speeds_along, Spline: spline_speeds_along})
def speeds_along(surface, x, y, vx, vy, shares):
    """|v|_h at four points of the segment from (x, y) to (x, y) + v, given as shares of it."""


@inner_kernel
def peaks_speeds_inside(surface, x, y, vx, vy):
    return peaks_speeds_along(surface, x, y, vx, vy, four(0.25, 0.5, 0.75, 1.0))


@inner_kernel
def spline_speeds_inside(surface, x, y, vx, vy):
    return four(
        speed_at(surface, x + 0.25 * vx, y + 0.25 * vy, vx, vy),
        speed_at(surface, x + 0.5 * vx, y + 0.5 * vy, vx, vy),
        speed_at(surface, x + 0.75 * vx, y + 0.75 * vy, vx, vy),
        0.0,
    )


@per_class({Peaks: peaks_speeds_inside, Spline: spline_speeds_inside})
def speeds_inside(surface, x, y, vx, vy):
    """|v|_h at a quarter, a half and three quarters of the segment from (x, y) to (x, y) + v.

    Four numbers are returned; ignore the last one.
    """


# Many points at once: points (m, 2); results are filled in


@kernel
def fill_values(surface, points, values):
    """Values (m, layers)."""
    for m in range(points.shape[0]):
        spot = spot_at(surface, points[m, 0], points[m, 1])
        for layer in range(surface.weights.shape[0]):
            values[m, layer] = value_at(surface, layer, spot)


@inner_kernel
def put_jet(row, jet):
    """Write a jet into a row (6,)."""
    row[0], row[1], row[2] = jet.f, jet.fx, jet.fy
    row[3], row[4], row[5] = jet.fxx, jet.fxy, jet.fyy


@kernel
def fill_jets(surface, points, jets):
    """Jets (m, layers, 6)."""
    for m in range(points.shape[0]):
        for layer in range(surface.weights.shape[0]):
            put_jet(jets[m, layer], jet_at(surface, layer, points[m, 0], points[m, 1]))


@kernel
def fill_log_costs(surface, points, jets):
    """Jets (m, 6) of log c."""
    for m in range(points.shape[0]):
        put_jet(jets[m], log_cost_at(surface, points[m, 0], points[m, 1]))


@kernel
def fill_metric(surface, points, tensors):
    """Metric tensors (m, 2, 2)."""
    for m in range(points.shape[0]):
        h = metric_at(surface, points[m, 0], points[m, 1])
        tensors[m, 0, 0] = h.h11
        tensors[m, 0, 1] = h.h12
        tensors[m, 1, 0] = h.h12
        tensors[m, 1, 1] = h.h22
