"""The search for the best bicubic potential on one lattice.

u(goal) - u(start) is made as large as it can be where the dual norm of du is at most 1, by the
algorithm of Chambolle and Pock (2011). Its dual is the least costly flow from start to goal.

Steps are preconditioned by the energy of the slopes on the whole lattice, which is diagonal in
cosines. The norm is held at a node, two middles of sides and the centre of each cell; where it is
too large between them, at quarters of the cell, too. Lengths are in units of the mean step.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import fft

from .._kernels.certificates import spline_flow as kernels
from .._kernels.surface.metric_rows import ROWS, columns_of
from .._support.watching import MustStop
from ..problem import Problem
from ..space.lattice import Lattice
from ..validation import Array
from .claims import Claim, Core
from .ends import End

Reals32 = npt.NDArray[np.float32]

# The limit of the norm where no path can be.
FREE = np.float32(1e30)

# Places that are added have rows of this factor. With them steps are shorter. Only those count that
# have so much of their cell's largest excess.
SHARE, SHORTER, LEAST = 0.4, 0.6, 0.5

# At the ends steps have this share of the others' length.
AT_ENDS = 0.3

# The norm is lowered at places where it is above the target by so much, by a little more than
# that, one after another, and so often again where neighbours have changed.
TOLERANCE, REACH, SWEEPS = 1e-4, 1.2, 25

# The horizon of claims, in units: so far away that the chord to the goal exempts nothing.
FAR = 1e6


def _basis() -> kernels.Basis:
    """The four B-splines at the quarters of a cell."""
    t = np.arange(4)[:, None] / 4.0
    s = 1.0 - t
    values = [s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3]
    slopes = [-(s**2), 3 * t**2 - 4 * t, 4 * s - 3 * s**2, t**2]
    return kernels.Basis(np.hstack(values) / 6.0, np.hstack(slopes) / 2.0)


class SplineSearch:
    """The search on one lattice.

    u : (ny + 2, nx + 2), coefficients to begin with, in units. cores : around both ends.
    """

    def __init__(
        self, problem: Problem, lattice: Lattice, cores: tuple[Core, Core], u: Array
    ) -> None:
        self.problem, self.lattice, self.cores = problem, lattice, cores
        nx, ny = lattice.nx, lattice.ny
        self.unit = math.sqrt(lattice.dx * lattice.dy)
        self.basis = _basis()
        self.rows = kernels.Rows(
            np.empty((2, nx + 3)),
            np.empty((2, nx + 3), np.float32),
            np.empty((2, nx), np.float32),
            np.empty((4, 4, nx), np.float32),
        )
        # More coefficients than are needed, in numbers that are quick to transform.
        shape = (fft.next_fast_len(n + 3, real=True) for n in (ny, nx))
        self.c = np.pad(u, [(0, n - k) for n, k in zip(shape, u.shape, strict=True)], mode="edge")
        self.sources = np.empty(self.c.shape, np.float32)
        self.places = self._places()
        self.flow = np.zeros((2, 2, ny, 2, nx), np.float32)
        self.others, self.others_flow = np.zeros((0, 4), np.int32), np.zeros((0, 2))
        self.inverse = self._inverse()
        ends = (problem.start, problem.goal)
        self.ends = [End(problem, lattice, *pair) for pair in zip(cores, ends, strict=True)]
        self.excess = math.inf  # of the largest norm at any place

    def _places(self) -> kernels.Places:
        lattice, surface = self.lattice, self.problem.surface.data
        nx, ny = lattice.nx, lattice.ny
        limits = np.where(self._is_held(), np.float32(1.0), FREE)
        places = kernels.Places(np.zeros((4, 4, 3, ny, nx), np.float32), limits)
        fine = Lattice(lattice.bounds, 4 * nx - 3, 4 * ny - 3).data
        row, costs = np.empty((ROWS, fine.nx)), np.empty(fine.nx)
        steps = (self.unit / lattice.dx, self.unit / lattice.dy)
        kernels.fill_places(surface, fine, columns_of(surface, fine), row, costs, steps, places)
        return places

    def _is_held(self) -> npt.NDArray[np.bool_]:
        """(4, 4, ny, nx): is the norm limited at a place, as one of its cells is not exempt?"""
        held = ~self.problem.free_space.covered_cells(self.lattice)
        for core in self.cores:
            held[core.row0 : core.row1, core.column0 : core.column1] = False
        found = np.zeros((4, 4, self.lattice.ny, self.lattice.nx), bool)
        found[:, :, :-1, :-1] = held
        found[0, :, 1:, :-1] |= held
        found[:, 0, :-1, 1:] |= held
        found[0, 0, 1:, 1:] |= held
        return found

    def _inverse(self) -> Reals32:
        """One over the energy of slopes that each product of cosines has."""
        tables = []
        for n in self.c.shape:
            x = np.pi * np.arange(n) / n
            value = ((4 + 2 * np.cos(x)) / 6) ** 2
            value += ((46 * np.cos(x / 2) + 2 * np.cos(1.5 * x)) / 48) ** 2
            slope = np.sin(x) ** 2 + (1.25 * np.sin(x / 2) + 0.25 * np.sin(1.5 * x)) ** 2
            tables.append((value, slope))
        (value_y, slope_y), (value_x, slope_x) = tables
        east, north = np.square(self.unit / np.array(self.lattice.spacing))
        energy = east * np.outer(value_y, slope_x) + north * np.outer(slope_y, value_x)
        energy[0, 0] = math.inf  # a constant changes nothing
        return np.asarray(1.0 / energy, np.float32)

    def iterate(self, count: int, ratio: float, must_stop: MustStop) -> None:
        """Iterations of the algorithm, with a ratio of its two steps; then places are added."""
        shorter = math.sqrt(SHORTER if len(self.others) else 1.0)
        sigma, tau = ratio * shorter, shorter / ratio
        ahead, (start, goal) = self.c, self.ends
        for _ in range(count):
            if must_stop():
                return
            self._step_flow(ahead, sigma)
            start.move(AT_ENDS * sigma * (start.values(ahead) - start.distances))
            goal.move(-AT_ENDS * sigma * (goal.values(ahead) + goal.distances))
            b: Reals32 = np.negative(self.sources)
            goal.add_shares(1.0, b)
            start.add_shares(-1.0, b)
            change = tau * self._solve(b)
            self.c = self.c + change
            ahead = self.c + change
        self._add_places()

    def _step_flow(self, c: Array, sigma: float) -> None:
        given = c, self.places, self.basis
        step = np.float32(sigma)
        kernels.step_flow(*given, step, self.rows, self.flow, self.sources)
        others = self.others, self.others_flow
        kernels.step_others(*given, sigma, SHARE, *others, self.sources)

    def _solve(self, b: Reals32) -> Reals32:
        cosines = fft.dctn(b, type=2, norm="ortho", overwrite_x=True)
        cosines *= self.inverse
        return np.asarray(fft.idctn(cosines, type=2, norm="ortho", overwrite_x=True))

    def _steep(
        self, c: Array, above: float, least: float, is_dirty: npt.NDArray[np.bool_]
    ) -> tuple[npt.NDArray[np.int32], float]:
        """Places (n, 4) whose norm is above a limit, and the largest norm."""
        found = np.empty((c.size + 16, 4), np.int32)
        given = c, self.places, self.basis
        count, top = kernels.find_steep(*given, above, least, is_dirty, self.rows, found)
        return found[:count], float(top)

    def _add_places(self) -> None:
        """Let flow go through further places, where the norm is too large, and leave idle ones."""
        found, top = self._steep(self.c, 1.0, LEAST, np.ones((self.lattice.ny, 1), bool))
        self.excess = max(top - 1.0, 0.0)
        found = found[(found[:, 2:] % 2 == 1).any(axis=1)]
        used = self.others_flow.any(axis=1)
        places = np.concatenate([self.others[used], found])
        flow = np.concatenate([self.others_flow[used], np.zeros((len(found), 2))])
        j, i, q, p = places.T.astype(np.int64)
        _, first = np.unique(((j * self.lattice.nx + i) * 4 + q) * 4 + p, return_index=True)
        self.others, self.others_flow = np.ascontiguousarray(places[first]), flow[first]

    @property
    def agreement(self) -> float:
        """What the flow costs over what u would prove if its norm were 1: 1 at the optimum."""
        limits = self.places.limits[::2, ::2]
        costs = float((np.hypot(self.flow[:, :, :, 0], self.flow[:, :, :, 1]) * limits).sum())
        j, i, q, p = self.others.T
        others = np.hypot(*self.others_flow.T) * self.places.limits[q, p, j, i]
        costs += SHARE * float(others.sum())
        costs += sum(float((end.shares * end.distances).sum()) for end in self.ends)
        start, goal = self.ends
        proven = float((start.distances - start.values(self.c)).min())
        proven += float((goal.values(self.c) + goal.distances).min())
        return costs / proven if proven > 0.0 else math.inf

    def half_flow(self) -> Reals32:
        """The flow (2 ny - 1, 2 nx - 1, 2) at nodes, middles of sides and centres."""
        flow = np.zeros((2 * self.lattice.ny, 2 * self.lattice.nx, 2), np.float32)
        for n in range(4):
            flow[n // 2 :: 2, n % 2 :: 2] = np.moveaxis(self.flow[n // 2, n % 2], 1, -1)
        j, i, q, p = self.others.T
        np.add.at(flow, (2 * j + (q + 1) // 2, 2 * i + (p + 1) // 2), SHARE * self.others_flow)
        return flow[:-1, :-1]

    def take_flow(self, half: Reals32) -> None:
        """The reverse of ``half_flow``."""
        for q in range(2):
            for p in range(2):
                part = np.moveaxis(half[q::2, p::2], -1, 1)
                self.flow[q, p, : part.shape[0], :, : part.shape[2]] = part
        self.flow *= self.places.limits[::2, ::2, :, None] < FREE

    def project(
        self, c: Array, cells: npt.NDArray[np.int64], parts: int, target: float, must_stop: MustStop
    ) -> None:
        """Change u so that its norm is at most ``target`` at all places.

        In ``cells`` (n, 2) places are 1 / parts of a cell apart.
        """
        surface, grid = self.problem.surface.data, self.lattice.data
        how = parts, target, TOLERANCE, REACH, self.unit
        is_dirty = np.ones((self.lattice.ny, self.lattice.nx), bool)
        for _ in range(SWEEPS):
            found, _ = self._steep(c, target + TOLERANCE, 0.0, is_dirty)
            was_dirty, is_dirty = is_dirty, np.zeros_like(is_dirty)
            kernels.project(c, self.places, self.basis, target, REACH, found, is_dirty)
            kernels.project_cells(surface, grid, c, cells, was_dirty, how, is_dirty)
            if must_stop() or not is_dirty.any():
                return

    def claim(self, c: Array) -> Claim:
        """A claim that is not proven yet."""
        c = c[: self.lattice.ny + 2, : self.lattice.nx + 2] * self.unit
        c -= c.mean()
        return Claim(
            value=0.0,
            norm=math.inf,
            coefficients=np.ascontiguousarray(c),
            bounds=self.lattice.bounds,
            horizon=float(np.abs(c).max()) + FAR * self.unit,
            start_core=self.cores[0],
            goal_core=self.cores[1],
        )
