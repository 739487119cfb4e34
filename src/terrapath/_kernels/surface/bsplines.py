"""Uniform bicubic B-splines: those that are not 0 in a cell, and sums over its 16 coefficients."""

from typing import NamedTuple

from ..compiler import inner_kernel
from ..vec4 import four, four_in_row, fused, total


class Cell(NamedTuple):
    """Spline cell of a point, and the position inside it, both in [0, 1]."""

    i: int
    j: int
    u: float
    v: float


@inner_kernel
def basis(u):
    """The values of the four uniform cubic B-splines that are not 0 at u in [0, 1]."""
    constant, linear = four(1 / 6, 2 / 3, 1 / 6, 0.0), four(-0.5, 0.0, 0.5, 0.0)
    square, cube = four(0.5, -1.0, 0.5, 0.0), four(-1 / 6, 0.5, -0.5, 1 / 6)
    return fused(fused(fused(cube, u, square), u, linear), u, constant)


@inner_kernel
def basis_slope(u):
    """First derivatives of ``basis``."""
    constant, linear, square = (
        four(-0.5, 0.0, 0.5, 0.0),
        four(1.0, -2.0, 1.0, 0.0),
        four(-0.5, 1.5, -1.5, 0.5),
    )
    return fused(fused(square, u, linear), u, constant)


@inner_kernel
def basis_curvature(u):
    """Second derivatives of ``basis``."""
    return fused(four(-1.0, 3.0, -3.0, 1.0), u, four(1.0, -2.0, 1.0, 0.0))


@inner_kernel
def column_sums(coefficients, layer, cell, by):
    """Sums over the four columns of coefficients of a cell, weighted by ``by``."""
    i, j = cell.i, cell.j
    sums = by[0] * four_in_row(coefficients, layer, j, i)
    sums = fused(by[1], four_in_row(coefficients, layer, j + 1, i), sums)
    sums = fused(by[2], four_in_row(coefficients, layer, j + 2, i), sums)
    return fused(by[3], four_in_row(coefficients, layer, j + 3, i), sums)


@inner_kernel
def tensor_sum(coefficients, layer, cell, bx, by):
    """Sum over the sixteen coefficients of a cell, weighted by bx times by."""
    return total(bx * column_sums(coefficients, layer, cell, by))
