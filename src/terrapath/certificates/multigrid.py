"""Nearly the inverse of a weighted graph Laplacian on a lattice, by one multigrid cycle."""

from __future__ import annotations

import numpy as np

from .._kernels.certificates import multigrid as kernels
from ..validation import Array


class Multigrid:
    """The energy of slopes on a lattice, each cell with a weight; see ``fill_links``.

    weights : (ny - 1, nx - 1), above 0. east, north : the factors of the slopes' squares.
    """

    def __init__(self, weights: Array, east: float, north: float) -> None:
        rows, columns = weights.shape
        links = np.empty((rows + 3, columns + 3, 4))
        kernels.fill_links(weights, east, north, links)
        self.levels = [_level(links)]
        while max(shape := self.levels[-1].u.shape) > 3:
            finer = self.levels[-1]
            # With the margin; of n nodes every second is kept, from the first on.
            links = np.empty(((shape[0] + 1) // 2 + 1, (shape[1] + 1) // 2 + 1, 4))
            kernels.fill_coarser_links(finer.links, finer.shares, np.empty((2, 2)), links)
            self.levels.append(_level(links))

    def solve(self, b: Array) -> Array:
        """Nearly the u (ny, nx) whose operator is b, which adds up to 0.

        The map from b to u is symmetric, and no eigenvalue of it times the operator is above 1.
        """
        self.levels[0].b[1:-1, 1:-1] = b
        for level, below in zip(self.levels, self.levels[1:], strict=False):
            kernels.relax_forward(level)
            kernels.restrict(level, below.b)
        self.levels[-1].u[:] = 0.0  # one node alone, whose value changes nothing
        for level, below in zip(self.levels[-2::-1], self.levels[:0:-1], strict=True):
            kernels.prolong(level, below.u)
            kernels.relax_backward(level)
        return self.levels[0].u[1:-1, 1:-1]


def _level(links: Array) -> kernels.Level:
    shape = links.shape[:2]
    per_sum, shares = np.empty(shape), np.empty((*shape, 2, 2))
    kernels.fill_sums(links, per_sum)
    kernels.fill_shares(links, shares)
    return kernels.Level(links, per_sum, shares, np.zeros(shape), np.zeros(shape))
