"""The eikonal equation of a smooth metric on a lattice, by fast marching, for certificates.

Between obstacles and on rough ground ``medium`` is the better one. This one's values have smooth
slopes, and its metric can be changed node by node. Near the source, where the lattice alone is
least accurate, the distance is known in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .._kernels.distance import calendar_queue, dependents, eikonal as kernels, stencils
from .._kernels.surface.metric_rows import ROWS, columns_of
from .._support.watching import WatchCount
from ..errors import InputError
from ..space.lattice import Lattice
from ..surface import Surface, metric
from ..validation import Array, as_array

# Nodes within this distance of the source, in nodes, take the source model's value.
SEED_RADIUS = 3.0
# Differences are factored by the source model within this distance of the source, in nodes, or
# within two features of the surface where that is less: the model does not hold beyond.
WINDOW_RADIUS = 16

# Nodes settled between two checks of the callback and of Ctrl-C.
CHUNK = 100_000

# The vectors of stencils are stored in 16 bits.
LONGEST_SIDE = 2**15 - 1
# On average a node has at most 6 + 8 dependents, and all these are numbered in 31 bits.
MOST_NODES = (2**31 - 1) // 14

# The nodes of a lattice as kernels store them, (ny * nx,) of ``stencils.NODE``.
Nodes = npt.NDArray[np.void]


class SourceModel(NamedTuple):
    """The distance from the source in closed form, on a window of nodes around it."""

    row: int  # of the lattice: the window's first
    column: int  # likewise
    values: Array  # (rows, columns), map units, NaN where the model does not hold
    slope_x: Array  # (rows, columns), of the distance along x1, map units per node
    slope_y: Array  # (rows, columns), along x2
    seeds: npt.NDArray[np.int64]  # (k,), numbers of the nodes that take the model's value
    seed_values: Array  # (k,), map units


def near_distance(surface: Surface, source: tuple[float, float], points: Array) -> Array:
    """Distance (...) under h from a source to points (..., 2) nearby, map units.

    The square of a geodesic's length is that of its chord c plus |II(c, c)|^2 / 12. II is the
    second fundamental form, taken in the middle; so the relative error is of fourth order.
    Costs multiply the length by their mean along the chord, minus what a path saves by bending
    to cheaper ground.
    """
    offsets = points - np.asarray(source)
    middle = np.asarray(source) + 0.5 * offsets
    chords = surface.lift(points) - surface.lift(np.asarray(source))
    weights = surface.data.weights
    bends = (
        np.einsum("...i,...kij,...j->...k", offsets, surface.hessians(middle), offsets) * weights
    )
    pull = np.einsum("...k,...ki->...i", bends * weights, surface.gradients(middle))
    inverse = (
        metric.inverse_metric_tensor(surface, middle) * surface.cost(middle)[..., None, None] ** 2
    )
    normal = np.square(bends).sum(-1) - np.einsum("...i,...ij,...j->...", pull, inverse, pull)
    squared = np.square(chords).sum(-1)
    # On rough ground the formula fails beyond the next bump, so what it adds is limited.
    squared += np.minimum(np.maximum(normal, 0.0) / 12.0, 0.05 * squared)
    distance = np.asarray(np.sqrt(squared))
    return distance * _mean_cost(surface, source, points, inverse) if surface.costs else distance


def _mean_cost(
    surface: Surface, source: tuple[float, float], points: Array, inverse: Array
) -> Array:
    """The factor (...) of the cost on distances to points (..., 2) nearby.

    It is Simpson's mean of the cost along the chord, of length d. Where the logarithm of the cost
    has the slope g across the chord, bending to cheaper ground saves the share g^2 d^2 / 24.
    inverse : (..., 2, 2), of h in the middle, without costs.
    """
    offsets = points - np.asarray(source)
    middle = np.asarray(source) + 0.5 * offsets
    mean = (
        surface.cost(np.asarray(source)) + 4.0 * surface.cost(middle) + surface.cost(points)
    ) / 6
    slope = surface.log_cost_jets(middle)[..., 1:3]
    squared = np.einsum("...i,...ij,...j->...", offsets, np.linalg.inv(inverse), offsets)
    squared_slope = np.einsum("...i,...ij,...j->...", slope, inverse, slope)
    saved = (squared_slope * squared - np.square((slope * offsets).sum(-1))) / 24.0
    return np.asarray(mean * (1.0 - np.clip(saved, 0.0, 0.05)))


def model_source(
    lattice: Lattice,
    source: tuple[float, float],
    radius: float,
    distance: Callable[[Array], Array],
    is_visible: Callable[[Array], npt.NDArray[np.bool_]] | None = None,
) -> SourceModel:
    """The model on all nodes at most ``radius`` rows and columns from the source.

    distance : points (..., 2) -> (...), map units. is_visible : points (m, 2) -> (m,) bool.
    """
    column = (source[0] - lattice.bounds.x1_min) / lattice.dx
    row = (source[1] - lattice.bounds.x2_min) / lattice.dy
    columns = np.arange(max(math.floor(column - radius), 0), min(column + radius + 1, lattice.nx))
    rows = np.arange(max(math.floor(row - radius), 0), min(row + radius + 1, lattice.ny))
    columns, rows = columns.astype(np.int64), rows.astype(np.int64)
    points = np.stack(np.meshgrid(lattice.x[columns], lattice.y[rows]), axis=-1)
    values = distance(points)
    if is_visible is not None:
        values[~is_visible(points.reshape(-1, 2)).reshape(values.shape)] = np.nan
    slope_x, slope_y = (_slope(distance, points, lattice, axis) for axis in range(2))
    steps = np.hypot(*np.meshgrid(columns - column, rows - row))
    planted = (steps <= SEED_RADIUS) & ~np.isnan(values)
    seeds = (rows[:, None] * lattice.nx + columns)[planted]
    return SourceModel(
        int(rows[0]), int(columns[0]), values, slope_x, slope_y, seeds, values[planted]
    )


def _slope(distance: Callable[[Array], Array], points: Array, lattice: Lattice, axis: int) -> Array:
    """Derivative of the distance along an axis, per node, by central differences."""
    nodes = 1e-4  # small, and far above rounding
    step = np.zeros(2)
    step[axis] = nodes * (lattice.dx, lattice.dy)[axis]
    bounds = lattice.bounds
    ahead = np.clip(points + step, bounds[:2], bounds[2:])
    behind = np.clip(points - step, bounds[:2], bounds[2:])
    width = (ahead - behind)[..., axis] / (lattice.dx, lattice.dy)[axis]
    return np.asarray((distance(ahead) - distance(behind)) / width)


def window_radius(surface: Surface, lattice: Lattice) -> float:
    """Within how many nodes of the source its model is used."""
    features = 2.0 * surface.resolution / max(lattice.dx, lattice.dy)
    return min(max(features, SEED_RADIUS + 1.0), WINDOW_RADIUS)


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
        u, trial = np.full((2, lattice.nx * lattice.ny), math.inf)
        front = calendar_queue.front_of(u, trial, day, model.seed_values)
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
