"""The two surface classes, and their values, jets and metric at a point.

A surface s(x1, x2) = (x1, x2, w_3 x_3, ..., w_n x_n) is the graph of n - 2 layers
over the plane. ``Peaks`` is exact; ``Spline`` is for everything else. On a ``Spline`` lengths
may be multiplied by a cost c(x1, x2) > 0: by a smooth one, whose logarithm is a spline, so that it
stays above 0; by one that is constant in cells (``cells.py``); or by both. Here ``speed_at`` and
all that is said of a point, but for ``metric_at``, know the smooth cost only. ``lengths.py``
multiplies by the other, cell by cell.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..dispatch import per_class
from ..vec4 import exp, fused, total
from .bsplines import Cell, basis, basis_curvature, basis_slope, column_sums, tensor_sum
from .cells import (
    CostCells,
    Range,
    Stretch,
    any_cells,
    cost_in_cells,
    mean_in_cells,
    range_in_box,
    stretch,
)


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
    log_cost: np.ndarray  # (0 or 1, ny + 2, nx + 2) float64: log of the smooth c as one more layer
    cells: CostCells  # the c that is constant in cells
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
def peaks_has_cells(surface):
    return False


@inner_kernel
def spline_has_cells(surface):
    return any_cells(surface.cells)


@inner_kernel
def peaks_cell_cost(surface, x, y):
    return 1.0


@inner_kernel
def spline_cell_cost(surface, x, y):
    return cost_in_cells(surface.cells, x, y)


@inner_kernel
def peaks_stretch(surface, ax, ay, dx, dy, share):
    return Stretch(1.0, 1.0)


@inner_kernel
def spline_stretch(surface, ax, ay, dx, dy, share):
    return stretch(surface.cells, ax, ay, dx, dy, share)


@inner_kernel
def peaks_mean_cell_cost(surface, ax, ay, bx, by):
    return 1.0


@inner_kernel
def spline_mean_cell_cost(surface, ax, ay, bx, by):
    return mean_in_cells(surface.cells, ax, ay, bx, by)


@inner_kernel
def peaks_cell_range(surface, x0, x1, y0, y1):
    return Range(1.0, 1.0)


@inner_kernel
def spline_cell_range(surface, x0, x1, y0, y1):
    return range_in_box(surface.cells, x0, x1, y0, y1)


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
    """The square of the smooth cost; 1 without one."""


@per_class({Peaks: peaks_log_cost, Spline: spline_log_cost})
def log_cost_at(surface, x, y):
    """The jet of the logarithm of the smooth cost."""


@per_class({Peaks: peaks_has_cells, Spline: spline_has_cells})
def has_cells(surface):
    """Is there a cost that is constant in cells?"""


@per_class({Peaks: peaks_cell_cost, Spline: spline_cell_cost})
def cell_cost_at(surface, x, y):
    """The cost of the cell at a point, on a side the lowest; 1 without cells."""


@per_class({Peaks: peaks_stretch, Spline: spline_stretch})
def stretch_at(surface, ax, ay, dx, dy, share):
    """The stretch in one cell of the segment from a to a + d that begins at a share of it."""


@per_class({Peaks: peaks_mean_cell_cost, Spline: spline_mean_cell_cost})
def mean_cell_cost(surface, ax, ay, bx, by):
    """The mean of the cells' cost along the segment a-b, by length on the plane."""


@per_class({Peaks: peaks_cell_range, Spline: spline_cell_range})
def cell_range(surface, x0, x1, y0, y1):
    """The lowest and the highest cost of the cells that hold or touch a closed box."""


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
    h = times_cost(surface, spot, h)
    if not has_cells(surface):
        return h
    c = cell_cost_at(surface, x, y)
    return Metric(c * c * h.h11, c * c * h.h12, c * c * h.h22)


@inner_kernel
def put_jet(row, jet):
    """Write a jet into a row (6,)."""
    row[0], row[1], row[2] = jet.f, jet.fx, jet.fy
    row[3], row[4], row[5] = jet.fxx, jet.fxy, jet.fyy
