"""Functions u that lower bounds are proven by, and their Taylor models over boxes.

Where costs are smooth, u is a bicubic spline. Where they are constant in cells, the slope of u must
leap with them, so u is piecewise linear: each cell of its lattice is cut into two triangles along
one of its diagonals, the one along which its slopes are less.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from .surface_models import Box, Layer, spline_models
from .taylor import Model, constant


class Potential(NamedTuple):
    """A function u over the cells of a grid: bicubic, or linear over triangles."""

    coefficients: np.ndarray  # (ny + 2, nx + 2) float64; if linear, values, the outermost unused
    x0: float  # corner of the first cell
    y0: float
    dx: float
    dy: float
    is_linear: bool


class Parts(NamedTuple):
    """The pieces of u over a box: from the first to the last."""

    first: int
    last: int


# A box that reaches over a diagonal by less than this share of a cell does not meet the other side.
ON_DIAGONAL = 1e-9


@inner_kernel
def share_of_cell(share, half):
    """The centre of a box as a share of its cell; exact for a box on a side of the cell.

    There, one of the four coefficients has the factor 0. Rounding would make it count, and it
    can be huge, because it may belong to no cell.
    """
    return math.floor(share + 0.5) if half == 0.0 else share


@inner_kernel
def slope_of(values, i, j, right, upper):
    """The slope, per side, of a triangle of the cell whose lower left node is (i, j).

    Its sides along the axes meet in the corner that is right, upper, both or neither: 1 or 0 each.
    """
    east = values[j + upper, i + 1] - values[j + upper, i]
    return east, values[j + 1, i + right] - values[j, i + right]


@inner_kernel
def steepness(potential, i, j, right, upper):
    """The square of the slope of such a triangle of cell (i, j)."""
    x, y = slope_of(potential.coefficients, i + 1, j + 1, right, upper)
    east, north = x / potential.dx, y / potential.dy
    return east * east + north * north


@inner_kernel
def rises_along_diagonal(potential, i, j):
    """Is cell (i, j) cut from its lower left to its upper right corner?"""
    one = max(steepness(potential, i, j, 1, 0), steepness(potential, i, j, 0, 1))
    other = max(steepness(potential, i, j, 0, 0), steepness(potential, i, j, 1, 1))
    return one < other


@inner_kernel
def parts_over(potential, i, j, box):
    """The pieces of u over a box inside cell (i, j): 0 is the lower triangle, 1 the upper one."""
    if not potential.is_linear:
        return Parts(0, 0)
    s, a = (box.x - potential.x0) / potential.dx - i, box.a / potential.dx
    t, b = (box.y - potential.y0) / potential.dy - j, box.b / potential.dy
    # Above 0 beyond the diagonal.
    beyond = t - s if rises_along_diagonal(potential, i, j) else s + t - 1.0
    first = 1 if beyond - (a + b) >= -ON_DIAGONAL else 0
    last = 0 if beyond + (a + b) <= ON_DIAGONAL else 1
    return Parts(min(first, last), last)


@kernel
def plane_over(potential, i, j, box, part):
    """Models of the plane of one triangle of cell (i, j), and of its slopes, over a box."""
    c = potential.coefficients
    # The corner where both sides of the triangle along the axes meet.
    upper = part
    right = 1 - part if rises_along_diagonal(potential, i, j) else part
    corner = c[j + 1 + upper, i + 1 + right]
    rise_x, rise_y = slope_of(c, i + 1, j + 1, right, upper)
    east, north = rise_x / potential.dx, rise_y / potential.dy
    x = potential.x0 + (i + right) * potential.dx
    y = potential.y0 + (j + upper) * potential.dy
    value = corner + east * (box.x - x) + north * (box.y - y)
    along_x, along_y = east * box.a, north * box.b
    return Layer(
        Model(value, along_x, along_y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        constant(east),
        constant(north),
    )


@kernel
def linear_value(potential, x, y):
    """The value of a piecewise linear u at a point of its grid."""
    s, t = (x - potential.x0) / potential.dx, (y - potential.y0) / potential.dy
    i = min(max(math.floor(s), 0), potential.coefficients.shape[1] - 4)
    j = min(max(math.floor(t), 0), potential.coefficients.shape[0] - 4)
    box = Box(x, y, 0.0, 0.0)
    return plane_over(potential, i, j, box, parts_over(potential, i, j, box).first).value.c00


@inner_kernel
def potential_over(potential, i, j, box, part):
    """Models of a piece of u and of its slopes over a box inside cell (i, j), or on its side."""
    if potential.is_linear:
        return plane_over(potential, i, j, box, part)
    return spline_models(
        potential.coefficients,
        i,
        j,
        share_of_cell((box.x - potential.x0) / potential.dx - i, box.a),
        share_of_cell((box.y - potential.y0) / potential.dy - j, box.b),
        box.a / potential.dx,
        box.b / potential.dy,
        potential.dx,
        potential.dy,
    )
