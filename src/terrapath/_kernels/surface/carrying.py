"""One spline's values at the places of another grid's cells."""

from __future__ import annotations

import math

from ..compiler import kernel
from .surfaces import spot_at, value_at


@kernel
def add_extended(spline, columns, rows, reach, last_column, last_row, out):
    """Add the spline over (column, row) at places (ny, nx) to ``out``.

    Beyond its edge it is extended by odd reflection, and farther out than ``reach`` constant.
    """
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            column, row = columns[j, i], rows[j, i]
            x, y = min(max(column, 0.0), last_column), min(max(row, 0.0), last_row)
            value = value_at(spline, 0, spot_at(spline, x, y))
            if x != column or y != row:
                mirrored_x = min(max(x + min(max(x - column, -reach), reach), 0.0), last_column)
                mirrored_y = min(max(y + min(max(y - row, -reach), reach), 0.0), last_row)
                value = 2.0 * value - value_at(spline, 0, spot_at(spline, mirrored_x, mirrored_y))
            out[j, i] += value


@kernel
def fill_differences(spline, layer, columns, rows, last_column, last_row, values, out):
    """Values (ny, nx) less those of the spline at places in columns and rows of its own knots.

    NaN for places that it does not reach.
    """
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            column, row = columns[j, i], rows[j, i]
            if 0.0 <= column <= last_column and 0.0 <= row <= last_row:
                x, y = spline.x0 + column * spline.dx, spline.y0 + row * spline.dy
                out[j, i] = values[j, i] - value_at(spline, layer, spot_at(spline, x, y))
            else:
                out[j, i] = math.nan
