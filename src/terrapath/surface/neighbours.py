"""Cells and the ones around them: values between cells, and regions grown by a cell.

Small enough to write down: SciPy's ndimage, which has both, takes longer to import than a plan
on a map takes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..validation import Array


def bilinear(values: Array, row: Array, column: Array) -> Array:
    """Values (ny, nx) between cells, counted from the first; beyond the edge, as at the edge."""
    upper, lower, down = _between(row, values.shape[0])
    left, right, across = _between(column, values.shape[1])
    found: Array = values[upper, left] * (1.0 - down) * (1.0 - across)
    found += values[upper, right] * (1.0 - down) * across
    found += values[lower, left] * down * (1.0 - across)
    found += values[lower, right] * down * across
    return found


def _between(at: Array, count: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array]:
    """The two cells around each place, and how far it is from the first to the second."""
    at = np.clip(at, 0.0, count - 1.0)
    first = at.astype(np.intp)
    return first, np.minimum(first + 1, count - 1), at - first


def grown(cells: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """The cells (ny, nx) and the eight around each."""
    wider = cells.copy()
    wider[1:] |= cells[:-1]
    wider[:-1] |= cells[1:]
    whole = wider.copy()
    whole[:, 1:] |= wider[:, :-1]
    whole[:, :-1] |= wider[:, 1:]
    return whole
