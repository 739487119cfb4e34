"""The eikonal equation of a smooth metric on a lattice, by fast marching, for certificates.

Between obstacles and on rough ground ``medium`` is the better one. This one's values have smooth
slopes, and its metric can be changed node by node.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from .._kernels.distance import calendar_queue, dependents, eikonal as kernels, stencils
from .._kernels.surface.metric_rows import ROWS, columns_of
from .._support.watching import WatchCount
from ..errors import InputError
from ..space.lattice import Lattice
from ..surface import Surface
from ..validation import Array, as_array
from .source import SourceModel

# Nodes settled between two checks of the callback and of Ctrl-C.
CHUNK = 100_000

# The vectors of stencils are stored in 16 bits.
LONGEST_SIDE = 2**15 - 1
# On average a node has at most 6 + 8 dependents, and all these are numbered in 31 bits.
MOST_NODES = (2**31 - 1) // 14

# The nodes of a lattice as kernels store them, (ny * nx,) of ``stencils.NODE``.
Nodes = npt.NDArray[np.void]


class Eikonal:
    """A metric on a lattice, prepared for fast marching from any source.

    nodes : the stencil of each node. typical_cost : of the surface, a factor on lengths.
    """

    def __init__(self, lattice: Lattice, nodes: Nodes, typical_cost: float = 1.0) -> None:
        self.lattice = lattice
        self.nodes = nodes
        self.typical_cost = typical_cost
        self.dependents = self._dependents()

    @classmethod
    def around(cls, surface: Surface, lattice: Lattice, blocked: npt.NDArray[np.bool_]) -> Eikonal:
        """The metric h of a surface; links may touch obstacles, but ``blocked`` nodes are left out.

        blocked : (ny, nx).
        """
        nodes = _surface_stencils(surface, lattice)
        if blocked.any():
            stencils.block_nodes(lattice.data, blocked.ravel().astype(np.uint8), nodes)
        return cls(lattice, nodes, surface.typical_cost)

    def shrink(self, factors: Array) -> None:
        """Multiply lengths at the nodes by factors (ny, nx). This changes the medium itself."""
        scale = 1.0 / np.square(np.asarray(factors, np.float64).ravel())
        for rho in ("rho0", "rho1", "rho2"):
            self.nodes[rho] *= scale

    @classmethod
    def of_tensors(cls, tensors: npt.ArrayLike, lattice: Lattice) -> Eikonal:
        """Any Riemannian metric.

        tensors : (ny, nx, 3), h11, h12 and h22 at the nodes. Raises InputError where one is not
        positive definite.
        """
        given = as_array(tensors, "tensors", shape=(lattice.ny, lattice.nx, 3))
        if not (given[..., 0] * given[..., 2] > given[..., 1] ** 2).all():
            raise InputError("tensors hold one that is not positive definite; check their order")
        nodes = _allocate(lattice)
        stencils.lay_tensor_stencils(given, lattice.data, nodes)
        return cls(lattice, nodes)

    def _dependents(self) -> dependents.Dependents:
        nx, first = self.lattice.nx, np.zeros(len(self.nodes) + 1, np.int32)
        # The number of a node's dependents is stored one place after the node, and then summed up.
        dependents.note_dependents(self.nodes, nx, first[1:], np.empty(0, np.uint32))
        np.cumsum(first, dtype=np.int32, out=first)
        entries = np.empty(first[-1], np.uint32)
        dependents.note_dependents(self.nodes, nx, first, entries)
        first[1:] = first[:-1]  # each now points to its end, where the next begins
        first[0] = 0
        return dependents.Dependents(first, entries)

    def march(
        self, model: SourceModel, *, limit: float = math.inf, watch: WatchCount | None = None
    ) -> Array:
        """Distances (ny, nx) from the source, map units; infinite where not reached.

        limit : nodes farther than this are not settled, map units. watch : is called now and then
        with the number of nodes settled; returning True stops the march.
        """
        lattice = self.lattice
        source = kernels.Source(*model[:5])
        day = calendar_queue.typical_day(lattice.data, self.typical_cost)
        front = calendar_queue.front_of(lattice.nx * lattice.ny, day, model.seed_values)
        rows = slice(model.row, model.row + model.values.shape[0])
        columns = slice(model.column, model.column + model.values.shape[1])
        window = self.nodes["links"].reshape(lattice.ny, lattice.nx)[rows, columns]
        window[~np.isnan(model.values)] |= stencils.WINDOW
        try:
            kernels.plant(
                self.nodes, front, self.dependents, lattice.nx, model.seeds, model.seed_values
            )
            self._settle(front, source, limit, watch)
        finally:
            window &= ~np.uint16(stencils.WINDOW)
        return front.u.reshape(lattice.ny, lattice.nx)

    def _settle(
        self,
        front: calendar_queue.Front,
        source: kernels.Source,
        limit: float,
        watch: WatchCount | None,
    ) -> None:
        settled = 0
        while True:
            chunk = kernels.march(
                self.nodes, front, self.dependents, source, self.lattice.nx, CHUNK, float(limit)
            )
            settled += chunk
            stopped = watch is not None and watch(settled)
            if stopped or chunk < CHUNK:
                return


def _surface_stencils(surface: Surface, lattice: Lattice) -> Nodes:
    """Nodes with the stencils of the metric h."""
    nodes, grid = _allocate(lattice), lattice.data
    columns, row = columns_of(surface.data, grid), np.empty((ROWS, lattice.nx))
    stencils.lay_surface_stencils(surface.data, grid, columns, row, nodes)
    return nodes


def _allocate(lattice: Lattice) -> Nodes:
    sides, count = (lattice.nx, lattice.ny), lattice.nx * lattice.ny
    if max(sides) > LONGEST_SIDE or count > MOST_NODES:
        raise InputError(
            f"the lattice has {lattice.nx:,} x {lattice.ny:,} nodes, more than {LONGEST_SIDE:,} "
            f"on a side or {MOST_NODES:,} in all; give a wider spacing"
        )
    return np.zeros(count, stencils.NODE)
