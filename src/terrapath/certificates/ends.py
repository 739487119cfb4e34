"""The ends of the search for the best bicubic potential: the edges of the cores around them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..distance.eikonal import near_distance
from ..problem import Problem
from ..space.lattice import Lattice
from ..validation import Array, Point
from .claims import Core

# The weights of the coefficients around a node, along one axis.
AT_NODE = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)


class End:
    """The edge of the core around an end, and where on it the flow begins or ends.

    Lengths are in units of the lattice's mean step, c are the coefficients of u.
    """

    def __init__(self, problem: Problem, lattice: Lattice, core: Core, place: Point) -> None:
        columns, rows = np.meshgrid(
            np.arange(core.column0, core.column1 + 1), np.arange(core.row0, core.row1 + 1)
        )
        on_edge = np.ones(columns.shape, bool)
        on_edge[1:-1, 1:-1] = False
        j, i = rows[on_edge], columns[on_edge]
        # The coefficients around each node, and their weights.
        self.around = [
            (a * b, (j + q, i + p)) for q, a in enumerate(AT_NODE) for p, b in enumerate(AT_NODE)
        ]
        self.points = np.stack([lattice.x[i], lattice.y[j]], axis=-1)
        unit = math.sqrt(lattice.dx * lattice.dy)
        self.distances = near_distance(problem.surface, place, self.points) / unit
        self.shares = np.full(len(self.distances), 1.0 / len(self.distances))

    def values(self, c: Array) -> Array:
        """u at the nodes of the edge."""
        return np.asarray(sum(weight * c[spots] for weight, spots in self.around))

    def add_shares(self, factor: float, b: npt.NDArray[np.float32]) -> None:
        """Add the shares to the right side b, like c."""
        for weight, spots in self.around:
            np.add.at(b, spots, factor * weight * self.shares)

    def take(self, other: End) -> None:
        """Take the shares of another lattice, each at the nearest node."""
        apart = np.linalg.norm(self.points[:, None] - other.points, axis=-1)
        self.shares[:] = 0.0
        np.add.at(self.shares, apart.argmin(axis=0), other.shares)

    def move(self, step: Array) -> None:
        """Change the shares; they stay at least 0 and add up to 1."""
        wanted = self.shares + step
        falling = np.sort(wanted)[::-1]
        excess = (np.cumsum(falling) - 1.0) / np.arange(1, len(falling) + 1)
        self.shares = np.maximum(wanted - excess[np.flatnonzero(falling > excess)[-1]], 0.0)
