"""Cells and their neighbours: values between cells, and regions grown by one cell.

SciPy's ndimage has both, but importing it takes longer than planning on a map.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..validation import Array


def bilinear(values: Array, row: Array, column: Array) -> Array:
    """Values (ny, nx) at fractional indices of cells; beyond the edge, the values at the edge."""
    upper, lower, down = _between(row, values.shape[0])
    left, right, across = _between(column, values.shape[1])
    result: Array = values[upper, left] * (1.0 - down) * (1.0 - across)
    result += values[upper, right] * (1.0 - down) * across
    result += values[lower, left] * down * (1.0 - across)
    result += values[lower, right] * down * across
    return result


def _between(at: Array, count: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array]:
    """The two cells around each place, and where it lies between them, from 0 to 1."""
    at = np.clip(at, 0.0, count - 1.0)
    first = at.astype(np.intp)
    return first, np.minimum(first + 1, count - 1), at - first


def grown(cells: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """The cells (ny, nx) together with the eight neighbours of each."""
    wider = cells.copy()
    wider[1:] |= cells[:-1]
    wider[:-1] |= cells[1:]
    whole = wider.copy()
    whole[:, 1:] |= wider[:, :-1]
    whole[:, :-1] |= wider[:, 1:]
    return whole
