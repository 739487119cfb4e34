"""What proofs by a piecewise linear u owe to the sides between cells of constant cost.

On the dear side of such a side u may rise steeply, on the cheap one hardly at all. So the lines
where its slope leaps have to lie on the sides. Beside one, u could rise steeply on a strip of cheap
ground, which is cheap to cross.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .._kernels.certificates.potentials import Potential, linear_value
from .._kernels.surface.cells import ON_SIDE, fill_least_costs
from .._kernels.surface.surfaces import Peaks, Spline
from ..errors import CertificateError
from ..space.free_space import FreeSpace
from ..space.lattice import Lattice
from ..surface.bounds import Bounds
from ..validation import Array

# A line lies on a side if it is this near to it, in cells, besides the rounding of coordinates.
NEAR = 1e-9
EPSILONS = 16.0 * float(np.finfo(np.float64).eps)

Cells = npt.NDArray[np.bool_]


def off_sides(surface: Peaks | Spline, lattice: Lattice) -> float:
    """How far from the sides of cells the lattice's lines on them are at most, in cells.

    Raises CertificateError where a line is beside a side. Farther from it than kernels take for the
    side itself, boxes that reach over the side have the lower of both costs.
    """
    assert isinstance(surface, Spline)
    cells = surface.cells
    farthest = max(map(abs, (*lattice.bounds, cells.x0, cells.y0)))
    rounding = EPSILONS * farthest / min(cells.dx, cells.dy)
    x, y = (lattice.x - cells.x0) / cells.dx, (lattice.y - cells.y0) / cells.dy
    lines = np.concatenate([x, y])
    off = np.abs(lines - np.rint(lines))
    off = off[off <= 2.0 * ON_SIDE]
    if (beside := off[off > min(NEAR + rounding, ON_SIDE)]).size:
        raise CertificateError(
            f"a line of the certificate's lattice runs {beside.max():.2g} of a cell beside the "
            "side of a cell of constant cost; it must lie on it"
        )
    return float(off.max(initial=0.0)) + rounding


def require_fit(surface: Peaks | Spline, lattice: Lattice, bounds: Bounds) -> None:
    """Raise CertificateError for a lattice beside sides, or one that ends on a side of the bounds.

    A path along the bounds may have the cost of the cells beyond. So the lattice must hold these,
    too, or end so far inside that a path to its side is a detour.
    """
    off_sides(surface, lattice)
    assert isinstance(surface, Spline)
    room = 2.0 * ON_SIDE * np.tile([surface.cells.dx, surface.cells.dy], 2)
    if (np.abs(np.subtract(lattice.bounds, bounds)) <= room).any():
        raise CertificateError(
            f"the certificate covers {lattice.bounds} and ends on a side of {bounds}; "
            "it must reach beyond"
        )


def costs_of(surface: Peaks | Spline, lattice: Lattice) -> Array:
    """The least costs inside the cells (ny - 1, nx - 1) of a lattice."""
    assert isinstance(surface, Spline)
    costs = np.empty((lattice.ny - 1, lattice.nx - 1))
    fill_least_costs(surface.cells, lattice.data, costs)
    return costs


def matter_not(costs: Array, lattice: Lattice, space: FreeSpace) -> Cells:
    """Which cells of a lattice (ny - 1, nx - 1) no path can enter, nor have the costs of.

    costs : of ``costs_of``. A path may run along the side of a cell that is covered by an obstacle.
    Where that is cheaper than one of the open cells around, the path has its cost.
    """
    covered = space.covered_cells(lattice, on_sides=True)
    rows, columns = covered.shape
    around = np.pad(np.where(covered, 0.0, costs), 1)
    shifts = [around[j : j + rows, i : i + columns] for j in range(3) for i in range(3)]
    return np.asarray(covered & (costs >= np.maximum.reduce(shifts)))


def margins_at_ends(
    surface: Peaks | Spline,
    lattice: Lattice,
    potential: Potential,
    start: Array,
    goal: Array,
    norm: float,
) -> tuple[float, float]:
    """-u / M at the start and u / M at the goal, where the dual norm M of du is ``norm``.

    Where lines are a little off sides, a map that moves them there stretches u by a share, and
    changes it at the ends by its steepest slope times the distance. start, goal : (2,) or more,
    from the potential's origin.
    """
    first, last = (float(linear_value(potential, *end[:2])) for end in (start, goal))
    assert isinstance(surface, Spline)
    u, off = potential.coefficients[1:-1, 1:-1], off_sides(surface, lattice)
    share_x, share_y = off * surface.cells.dx / lattice.dx, off * surface.cells.dy / lattice.dy
    at_ends = 2.0 * (_highest_step(u, 1) * share_x + _highest_step(u, 0) * share_y)
    lost = at_ends + 2.0 * abs(last - first) * max(share_x, share_y)
    return -first / norm, (last - lost) / norm


def _highest_step(u: Array, axis: int) -> float:
    return float(np.abs(np.diff(u, axis=axis)).max())
