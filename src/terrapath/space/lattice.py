"""A rectangular lattice of nodes over a region; the vertices of grid planners."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .._kernels.space.free_space import Grid
from ..errors import InputError
from ..surface.bounds import Bounds, Cells
from ..validation import Array, Point, require_positive

# By default the region's longer side has this many nodes. Where the surface has finer features it
# has more, up to the second number.
NODES_PER_SIDE, MOST_NODES_PER_SIDE = 250.0, 1000.0

# This many nodes can be numbered in 32 bits, and fit in the memory of a large machine.
MOST_NODES = 2**30


class Spacing(NamedTuple):
    """The distance of nodes, or the size of cells or features, along x1 and x2, map units."""

    x: float
    y: float


def as_spacing(spacing: float | Spacing) -> Spacing:
    """A spacing along both axes; a number is that of both."""
    return spacing if isinstance(spacing, Spacing) else Spacing(spacing, spacing)


def default_spacing(bounds: Bounds, features: Spacing) -> Spacing:
    """The default spacing of nodes. features : the size of the finest ones.

    Where features are longer along one axis, nodes are as much farther apart there, and no more of
    them are laid than with square features of the same area.
    """
    stretch = 1.0 if features.x == features.y else math.sqrt(features.x / features.y)
    finest, longer = features.x / stretch, max(bounds.width, bounds.height)
    # A side that has a stretch is measured in it: the longer one still has NODES_PER_SIDE.
    side = max(bounds.width / stretch, bounds.height * stretch)
    spacing = min(side / NODES_PER_SIDE, max(finest, longer / MOST_NODES_PER_SIDE))
    return Spacing(spacing * stretch, spacing / stretch)


@dataclass(frozen=True)
class Lattice:
    """nx times ny nodes; the outermost lie on the edge of the bounds.

    bounds : map units. nx, ny : number of nodes along x1 and x2, at least 2.
    """

    bounds: Bounds
    nx: int
    ny: int

    @classmethod
    def spanning(cls, bounds: Bounds, spacing: float | Spacing) -> Lattice:
        """The lattice with the fewest nodes that are at most ``spacing`` map units apart.

        Raises InputError where that is more nodes than can be numbered.
        """
        step = as_spacing(spacing)
        require_positive(spacing=min(step))
        if max(bounds.width / step.x, bounds.height / step.y) > MOST_NODES:
            raise InputError(
                f"spacing={min(step):g} makes more than {MOST_NODES:,} nodes; give a wider one"
            )
        nx = max(math.ceil(bounds.width / step.x - 1e-9), 1) + 1
        ny = max(math.ceil(bounds.height / step.y - 1e-9), 1) + 1
        if nx * ny > MOST_NODES:
            raise InputError(
                f"spacing={min(step):g} makes {nx:,} x {ny:,} nodes, more than {MOST_NODES:,}; "
                "give a wider one"
            )
        return cls(bounds, nx, ny)

    @classmethod
    def at_cells(cls, bounds: Bounds, spacing: float | Spacing, cells: Cells) -> Lattice:
        """The lattice with nodes at the centres of cells, at most ``spacing`` map units apart.

        Where cells are larger than the spacing there are nodes between the centres; where they are
        smaller there is one at every few centres. The outermost nodes lie less than a step inside
        the bounds. Where there is no room for two nodes on each axis, the lattice spans the bounds.
        Raises as ``spanning`` does.
        """
        spanning = cls.spanning(bounds, spacing)
        step = as_spacing(spacing)
        low_x, high_x, nx = _centres(bounds.x1_min, bounds.x1_max, step.x, cells.x, cells.dx)
        low_y, high_y, ny = _centres(bounds.x2_min, bounds.x2_max, step.y, cells.y, cells.dy)
        if min(nx, ny) < 2 or nx * ny > MOST_NODES:
            return spanning
        return cls(Bounds(low_x, low_y, high_x, high_y), nx, ny)

    def around(self, nodes: npt.NDArray[np.bool_]) -> Bounds:
        """The bounds of some nodes (ny, nx), with two rows and columns more on all sides."""
        rows, columns = np.nonzero(nodes)
        west, east = max(columns.min() - 2, 0), min(columns.max() + 2, self.nx - 1)
        south, north = max(rows.min() - 2, 0), min(rows.max() + 2, self.ny - 1)
        x, y = self.x, self.y
        return Bounds(float(x[west]), float(y[south]), float(x[east]), float(y[north]))

    def blocks_around(self, ends: tuple[Point, Point], most: int) -> list[tuple[int, ...]]:
        """Blocks of cells around two places: first and last column of nodes, first and last row.

        They reach at most so many cells from a place; if possible so few that they do not meet.
        """
        places = [np.subtract(end, self.bounds[:2]) / self.spacing for end in ends]
        apart = int(np.abs(places[0] - places[1]).max() / 2.0 - 1.0)
        reach = min(max(apart, 1), most)
        last = np.array([self.nx, self.ny]) - 1
        blocks = []
        for place in np.rint(places).astype(int):
            low, high = np.maximum(place - reach, 0), np.minimum(place + reach, last)
            blocks.append(tuple(int(k) for k in (low[0], high[0], low[1], high[1])))
        return blocks

    @property
    def spacing(self) -> Spacing:
        """Distance of neighbouring nodes, map units."""
        return Spacing(self.dx, self.dy)

    @property
    def dx(self) -> float:
        """Distance of neighbouring nodes along x1, map units."""
        return self.bounds.width / (self.nx - 1)

    @property
    def dy(self) -> float:
        """Distance of neighbouring nodes along x2, map units."""
        return self.bounds.height / (self.ny - 1)

    @cached_property
    def x(self) -> Array:
        """(nx,), x1 of the columns, map units."""
        return np.linspace(self.bounds.x1_min, self.bounds.x1_max, self.nx)

    @cached_property
    def y(self) -> Array:
        """(ny,), x2 of the rows, map units."""
        return np.linspace(self.bounds.x2_min, self.bounds.x2_max, self.ny)

    @property
    def points(self) -> Array:
        """(ny, nx, 2): every node, map units."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)

    @property
    def data(self) -> Grid:
        """The lattice for kernels: node (i, j) lies at (x0 + i dx, y0 + j dy)."""
        return Grid(self.bounds.x1_min, self.bounds.x2_min, self.dx, self.dy, self.nx, self.ny)


def _centres(
    low: float, high: float, spacing: float, centre: float, size: float
) -> tuple[float, float, int]:
    """The first and the last node of one axis, and how many there are."""
    if size > spacing:
        step = size / math.ceil(size / spacing - 1e-9)
    else:
        step = size * math.floor(spacing / size + 1e-9)
    first = math.ceil((low - centre) / step - 1e-9)
    last = math.floor((high - centre) / step + 1e-9)
    # Rounding must not put a node outside the bounds.
    ends = max(centre + first * step, low), min(centre + last * step, high)
    return *ends, last - first + 1
