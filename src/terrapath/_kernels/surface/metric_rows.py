"""The metric h at all nodes of a lattice, row by row.

Both surface classes are separable: factors that depend on x1 alone are computed once for all
rows, and those that depend on x2 alone once for each row.
"""

import math

import numpy as np

from ..compiler import allocating_kernel, kernel
from ..dispatch import per_class
from .bsplines import basis, basis_slope
from .cells import any_cells, cost_in_cells
from .surfaces import Peaks, Spline, spline_cell

# Indices into the arrays of a row.
H11, H12, H22, FX, FY = 0, 1, 2, 3, 4
ROWS = 5


@allocating_kernel
def peaks_columns(surface, grid):
    """(2 p, nx): for each peak a f exp(-f d^2), d being the distance along x1, and d times it."""
    columns = np.empty((2 * surface.peaks.shape[0], grid.nx))
    for p in range(surface.peaks.shape[0]):
        amplitude, falloff, centre = surface.peaks[p, 0], surface.peaks[p, 1], surface.peaks[p, 2]
        for i in range(grid.nx):
            d = grid.x0 + i * grid.dx - centre
            share = amplitude * falloff * math.exp(-falloff * d * d)
            columns[2 * p, i] = share
            columns[2 * p + 1, i] = share * d
    return columns


@kernel
def add_peak(fx, fy, along, across, sx, sy):
    """Add a peak's slopes to those of a row."""
    for i in range(fx.shape[0]):
        fx[i] += sx * across[i]
        fy[i] += sy * along[i]


@kernel
def add_layer(row, w):
    """Add a layer's slopes to the metric of a row, weighted."""
    h11, h12, h22, fx, fy = row[H11], row[H12], row[H22], row[FX], row[FY]
    for i in range(fx.shape[0]):
        h11[i] += w * fx[i] * fx[i]
        h12[i] += w * fx[i] * fy[i]
        h22[i] += w * fy[i] * fy[i]


@kernel
def fill_peaks_row(surface, grid, j, columns, row):
    y = grid.y0 + j * grid.dy
    row[H11], row[H12], row[H22] = 1.0, 0.0, 1.0
    for layer in range(surface.weights.shape[0]):
        row[FX], row[FY] = 0.0, 0.0
        for p in range(surface.first[layer], surface.first[layer + 1]):
            d = y - surface.peaks[p, 3]
            share = -2.0 * math.exp(-surface.peaks[p, 1] * d * d)
            add_peak(row[FX], row[FY], columns[2 * p], columns[2 * p + 1], share, share * d)
        add_layer(row, surface.weights[layer] * surface.weights[layer])


@kernel
def fill_peaks_heights(surface, grid, j, columns, layer, heights):
    y = grid.y0 + j * grid.dy
    heights[:] = 0.0
    for p in range(surface.first[layer], surface.first[layer + 1]):
        falloff, d = surface.peaks[p, 1], y - surface.peaks[p, 3]
        share = surface.weights[layer] * math.exp(-falloff * d * d) / falloff
        for i in range(grid.nx):
            heights[i] += share * columns[2 * p, i]


@allocating_kernel
def spline_columns(surface, grid):
    """(11, nx or more): basis, slopes and cell of each column; then space for sums along x2."""
    knots = surface.coefficients.shape[2]
    columns = np.zeros((11, max(grid.nx, knots)))
    for i in range(grid.nx):
        cell = spline_cell(surface, grid.x0 + i * grid.dx, surface.y0)
        b, s = basis(cell.u), basis_slope(cell.u)
        for k in range(4):
            columns[k, i] = b[k]
            columns[4 + k, i] = s[k] / surface.dx
        columns[8, i] = cell.i
    return columns


@kernel
def sum_columns(coefficients, j, by, sums):
    """Sums over the four rows of coefficients from the j-th on, weighted by ``by``."""
    for i in range(coefficients.shape[1]):
        sums[i] = (
            by[0] * coefficients[j, i]
            + by[1] * coefficients[j + 1, i]
            + by[2] * coefficients[j + 2, i]
            + by[3] * coefficients[j + 3, i]
        )


@kernel
def fill_spline_slopes(columns, fx, fy):
    """The slopes of a layer along a row, from the sums along x2."""
    values, slopes = columns[9], columns[10]
    for i in range(fx.shape[0]):
        c = int(columns[8, i])
        fx[i], fy[i] = 0.0, 0.0
        for k in range(4):
            fx[i] += columns[4 + k, i] * values[c + k]
            fy[i] += columns[k, i] * slopes[c + k]


@kernel
def multiply_by_cost(columns, row):
    """Multiply the metric of a row by c^2, from the sums along x2 of log c."""
    values = columns[9]
    for i in range(row.shape[1]):
        c, log_cost = int(columns[8, i]), 0.0
        for k in range(4):
            log_cost += columns[k, i] * values[c + k]
        c2 = math.exp(2.0 * log_cost)
        row[H11, i] *= c2
        row[H12, i] *= c2
        row[H22, i] *= c2


@kernel
def multiply_by_cells(surface, grid, j, row):
    """Multiply the metric of a row by c^2 of the cells."""
    y = grid.y0 + j * grid.dy
    for i in range(row.shape[1]):
        c = cost_in_cells(surface.cells, grid.x0 + i * grid.dx, y)
        row[H11, i] *= c * c
        row[H12, i] *= c * c
        row[H22, i] *= c * c


@kernel
def fill_spline_row(surface, grid, j, columns, row):
    cell = spline_cell(surface, surface.x0, grid.y0 + j * grid.dy)
    by, sy = basis(cell.v), basis_slope(cell.v)
    sy = (sy[0] / surface.dy, sy[1] / surface.dy, sy[2] / surface.dy, sy[3] / surface.dy)
    row[H11], row[H12], row[H22] = 1.0, 0.0, 1.0
    for layer in range(surface.weights.shape[0]):
        sum_columns(surface.coefficients[layer], cell.j, by, columns[9])
        sum_columns(surface.coefficients[layer], cell.j, sy, columns[10])
        fill_spline_slopes(columns, row[FX], row[FY])
        add_layer(row, surface.weights[layer] * surface.weights[layer])
    if surface.log_cost.shape[0] > 0:
        sum_columns(surface.log_cost[0], cell.j, by, columns[9])
        multiply_by_cost(columns, row)
    if any_cells(surface.cells):
        multiply_by_cells(surface, grid, j, row)


@kernel
def fill_spline_heights(surface, grid, j, columns, layer, heights):
    cell, weight = spline_cell(surface, surface.x0, grid.y0 + j * grid.dy), surface.weights[layer]
    sum_columns(surface.coefficients[layer], cell.j, basis(cell.v), columns[9])
    values = columns[9]
    for i in range(grid.nx):
        c, height = int(columns[8, i]), 0.0
        for k in range(4):
            height += columns[k, i] * values[c + k]
        heights[i] = weight * height


@kernel
def fill_peaks_costs(surface, grid, j, columns, costs):
    costs[:] = 1.0


@kernel
def fill_spline_costs(surface, grid, j, columns, costs):
    costs[:] = 1.0
    if surface.log_cost.shape[0] == 0:
        return
    cell = spline_cell(surface, surface.x0, grid.y0 + j * grid.dy)
    sum_columns(surface.log_cost[0], cell.j, basis(cell.v), columns[9])
    values = columns[9]
    for i in range(grid.nx):
        c, log_cost = int(columns[8, i]), 0.0
        for k in range(4):
            log_cost += columns[k, i] * values[c + k]
        costs[i] = math.exp(log_cost)


@per_class({Peaks: peaks_columns, Spline: spline_columns})
def columns_of(surface, grid):
    """The values that depend on x1 alone, which all rows of a lattice share."""


@per_class({Peaks: fill_peaks_row, Spline: fill_spline_row})
def fill_row(surface, grid, j, columns, row):
    """The metric at the nodes of row j: row (ROWS, nx)."""


@per_class({Peaks: fill_peaks_heights, Spline: fill_spline_heights})
def fill_height_row(surface, grid, j, columns, layer, heights):
    """The weighted heights of a layer at the nodes of row j: heights (nx,)."""


@per_class({Peaks: fill_peaks_costs, Spline: fill_spline_costs})
def fill_cost_row(surface, grid, j, columns, costs):
    """The smooth costs at the nodes of row j: costs (nx,)."""


@kernel
def fill_samples(surface, grid, columns, heights, costs):
    """Weighted heights (layers, ny, nx) and costs (0 or 1, ny, nx) at all nodes of a lattice."""
    for j in range(grid.ny):
        for layer in range(heights.shape[0]):
            fill_height_row(surface, grid, j, columns, layer, heights[layer, j])
        for layer in range(costs.shape[0]):
            fill_cost_row(surface, grid, j, columns, costs[layer, j])
