"""Cubic interpolation between the nodes of a lattice."""

import math
from typing import NamedTuple

from ..compiler import inner_kernel, kernel


class Patch(NamedTuple):
    """The value at a point, and its slope per node."""

    value: float
    x: float
    y: float


@inner_kernel
def cubic(u):
    """Weights of the four nodes around u in [0, 1] by cubic convolution (Keys 1981)."""
    r = 1.0 - u
    return (
        -0.5 * u * r * r,
        1.0 + u * u * (1.5 * u - 2.5),
        1.0 + r * r * (1.5 * r - 2.5),
        -0.5 * r * u * u,
    )


@inner_kernel
def cubic_slope(u):
    """First derivatives of ``cubic``."""
    r = 1.0 - u
    return (
        -0.5 * r * (r - 2.0 * u),
        u * (4.5 * u - 5.0),
        r * (5.0 - 4.5 * r),
        0.5 * u * (u - 2.0 * r),
    )


@inner_kernel
def first_node(s, count):
    """The first of the four nodes that the cubic at s uses, on an axis of ``count`` nodes."""
    return min(max(math.floor(s) - 1, 0), count - 4)


@inner_kernel
def folded(w, cell, count):
    """Weights of the four nodes. In the outermost cells one of them is extrapolated from three."""
    if cell <= 0:
        return w[1] + 3.0 * w[0], w[2] - 3.0 * w[0], w[3] + w[0], 0.0
    if cell >= count - 2:
        return 0.0, w[0] + w[3], w[1] - 3.0 * w[3], w[2] + 3.0 * w[3]
    return w


@kernel
def interpolate(u, s, t):
    """Values u (ny, nx) and their slopes at column s and row t; infinite near infinite values."""
    ny, nx = u.shape
    i = min(max(math.floor(s), 0), nx - 2)
    j = min(max(math.floor(t), 0), ny - 2)
    wx, sx = folded(cubic(s - i), i, nx), folded(cubic_slope(s - i), i, nx)
    wy, sy = folded(cubic(t - j), j, ny), folded(cubic_slope(t - j), j, ny)
    i, j = first_node(s, nx), first_node(t, ny)
    value, slope_x, slope_y = 0.0, 0.0, 0.0
    for q in range(4):
        row, row_slope = 0.0, 0.0
        for p in range(4):
            node = u[j + q, i + p]
            if node == math.inf:
                return Patch(math.inf, 0.0, 0.0)
            row += wx[p] * node
            row_slope += sx[p] * node
        value += wy[q] * row
        slope_x += wy[q] * row_slope
        slope_y += sy[q] * row
    return Patch(value, slope_x, slope_y)
