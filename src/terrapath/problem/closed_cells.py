"""Cells of cost rasters that no path can enter."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .._kernels.surface.cells import ON_SIDE
from ..space.free_space import FreeSpace
from ..space.lattice import Lattice
from ..surface import Surface
from ..surface.bounds import Bounds
from ..surface.costs import CellLayers, with_closed_cells


def without_loans(surface: Surface, space: FreeSpace) -> Surface:
    """The surface, where cost cells that no path can enter lend nothing to their sides.

    On a side between two cells the lower cost counts, because a path may run as near to it as it
    likes in the cheaper cell. In a cell that an obstacle covers wholly, or that is outside the
    bounds, it may not.
    """
    if surface.cost_cells is None:
        return surface
    return with_closed_cells(surface, _closed(surface.cost_cells, space))


def _closed(cells: CellLayers, space: FreeSpace) -> npt.NDArray[np.bool_]:
    """(ny, nx), which cells no path can enter."""
    rows, columns = cells.values.shape[1:]
    corner = cells.x0 + columns * cells.dx, cells.y0 + rows * cells.dy
    lattice = Lattice(Bounds(cells.x0, cells.y0, *corner), columns + 1, rows + 1)
    closed = space.covered_cells(lattice, on_sides=True)
    x_min, y_min, x_max, y_max = space.bounds
    # The outermost cells reach on beyond the grid: they are closed only if the bounds do not.
    closed[:, 0] &= x_min >= cells.x0
    closed[0] &= y_min >= cells.y0
    closed[:, -1] &= x_max <= corner[0]
    closed[-1] &= y_max <= corner[1]
    # A strip as narrow as what counts as the side itself is no room.
    x, y, near = lattice.x[1:-1], lattice.y[1:-1, None], ON_SIDE * np.array(lattice.spacing)
    closed[:, 1:] |= x >= x_max - near[0]
    closed[:, :-1] |= x <= x_min + near[0]
    closed[1:] |= y >= y_max - near[1]
    closed[:-1] |= y <= y_min + near[1]
    return closed
