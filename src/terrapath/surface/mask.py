"""Blocked cells of a regular grid: no-data, forbidden ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..validation import Array, as_array


def uniform_spacing(axis: Array) -> float | None:
    """The spacing of a uniform axis, None for another one."""
    spacing = float((axis[-1] - axis[0]) / (len(axis) - 1))
    return spacing if np.allclose(np.diff(axis), spacing, rtol=1e-6, atol=0.0) else None


@dataclass(frozen=True, eq=False)
class Mask:
    """Cells that may not be entered; outside its grid a mask blocks nothing.

    blocked : (ny, nx) bool. x : (nx,), y : (ny,) cell centres, increasing and uniform,
    map units. A cell is closed: touching its border counts as entering it.
    """

    blocked: npt.NDArray[np.bool_]
    x: Array
    y: Array

    def __init__(self, blocked: Any, x: Any, y: Any) -> None:
        cells = np.ascontiguousarray(blocked)
        if cells.dtype != np.bool_ or cells.ndim != 2 or min(cells.shape) < 2:
            raise InputError(
                f"blocked has type {cells.dtype} and shape {cells.shape}; "
                "a (ny, nx) bool array of at least 2 x 2 cells is expected"
            )
        object.__setattr__(self, "blocked", cells)
        for name, values, size in (("x", x, cells.shape[1]), ("y", y, cells.shape[0])):
            axis = as_array(values, name, shape=(size,))
            spacing = uniform_spacing(axis)
            if spacing is None or spacing <= 0.0:
                raise InputError(f"{name} of a mask must increase in equal steps")
            object.__setattr__(self, name, axis)

    @property
    def spacing(self) -> tuple[float, float]:
        """(dx, dy), map units."""
        dx = (self.x[-1] - self.x[0]) / (len(self.x) - 1)
        dy = (self.y[-1] - self.y[0]) / (len(self.y) - 1)
        return float(dx), float(dy)
