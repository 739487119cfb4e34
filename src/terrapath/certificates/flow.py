"""The search for a lower bound where costs are constant in cells.

There the slope of a distance leaps at the sides of cells, and no smooth u comes near it. So u is
linear over triangles of a lattice whose nodes lie on these sides. It begins as half the distance
from the start minus half that to the goal. From there u(goal) - u(start) is made as large as it
can be where the dual norm of du is at most 1: by the algorithm of Chambolle and Pock (2011). Its
steps are preconditioned, each cell by its own cost. Where the norm stays above 1, in few cells,
costs are lowered. A finer lattice begins with the u of the one before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .._kernels.certificates import flow as kernels
from .._kernels.surface.surfaces import Spline
from .._support.watching import MustStop, never
from ..problem import Problem
from ..space.lattice import Lattice
from ..surface.bounds import Bounds
from ..surface.metric import inverse_metric_tensor, is_flat
from ..validation import Array, Point
from .certificate import Certificate, certify
from .claims import Claim, Core, Needs, cell_needs
from .multigrid import Multigrid
from .sides import Cells, costs_of, matter_not

# The first lattice has two of its cells on a side of a cell of constant cost, where that makes no
# more nodes than this; else one, or less, for the second number. Finer ones have up to the third.
FEW_NODES, MOST_NODES, MOST_FINER_NODES = 300_000, 5_000_000, 1_500_000
# So often the cells are cut in two along both axes, at most.
FINEST = 3

# Steps of the two sizes' ratio, each with so many iterations, on the first lattice and on finer
# ones. Then cells are tightened so often.
RATIOS, FINER_RATIOS, ITERATIONS = (1.0, 3.0, 10.0, 30.0), (30.0,), 40
TIGHTENINGS = 12

# The search ends where so many of these in a row have raised the bound by less than this share.
PATIENCE, GAIN = 3, 2e-4

# Cells whose norm is above this are tightened.
TOLERATED = 1.0005

# Without a target, the search ends at this gap.
GOOD_GAP = 2e-3

# The cost in the search where no path can be.
FREE = 1e30

# A line this near to a place goes through it, in steps of the lattice.
NEAR = 1e-6

# A norm as low as this needs no closer look.
FLAT_ENOUGH = 0.999

# Fields are continued into obstacles by so many nodes.
AROUND = 3


def first_lattice(problem: Problem, window: Bounds) -> tuple[Lattice, int]:
    """A lattice over a window, with nodes on the sides of cells of constant cost.

    Also how often these cells are cut in two along both axes; below 0 where, instead, so often
    twice as many make one.
    """
    data = problem.surface.data
    assert isinstance(data, Spline)
    cells, axes = data.cells, []
    size = window.width / cells.dx * window.height / cells.dy
    level = 1
    while 4.0**level * size > (FEW_NODES if level == 1 else MOST_NODES):
        level -= 1
    west, south, east, north = problem.bounds
    for low, high, ends, origin, step in (
        (window.x1_min, window.x1_max, (west, east), cells.x0, 0.5**level * cells.dx),
        (window.x2_min, window.x2_max, (south, north), cells.y0, 0.5**level * cells.dy),
    ):
        first = math.floor((low - origin) / step + NEAR)
        last = max(math.ceil((high - origin) / step - NEAR), first + 1)
        # A path may run along a side of the bounds, with the cost of the cells beyond.
        first -= abs(origin + first * step - ends[0]) <= NEAR * step
        last += abs(origin + last * step - ends[1]) <= NEAR * step
        axes.append((origin + first * step, origin + last * step, last - first + 1))
    (x0, x1, nx), (y0, y1, ny) = axes
    return Lattice(Bounds(x0, y0, x1, y1), nx, ny), level


class FlowSearch:
    """The search on one lattice.

    length : of a path that is known, map units, or infinite. target_gap : where it is reached, the
    search ends. Where it must stop, the certificate holds all the same, but may be no more than
    the chord.
    """

    def __init__(
        self,
        problem: Problem,
        lattice: Lattice,
        length: float,
        target_gap: float,
        must_stop: MustStop,
        coarser: FlowSearch | None = None,
    ) -> None:
        self.problem, self.lattice, self.must_stop = problem, lattice, must_stop
        self.length, self.target_gap = length, target_gap
        self.is_flat = is_flat(problem.surface, problem.bounds)
        self.costs, self.roots, self.exempt = self._limits()  # what norms are measured by
        self.tightened = self.costs.copy()  # what the flow is led by
        self.weights = 1.0 / np.minimum(self.costs, self.costs[self.costs < FREE].max())
        self.norms = np.empty_like(self.costs)
        self.rising = np.zeros(self.costs.shape, bool)
        self.flow = np.zeros((*self.costs.shape, 2, 2))
        self.ratios = RATIOS if coarser is None else FINER_RATIOS
        self.best = -math.inf
        self.u = self._between_fields() if coarser is None else self._refined(coarser)
        self._note()

    def finer(self) -> FlowSearch:
        """The search that goes on from here, with the cells of the lattice cut in four."""
        nx, ny = 2 * self.lattice.nx - 1, 2 * self.lattice.ny - 1
        lattice = Lattice(self.lattice.bounds, nx, ny)
        return FlowSearch(self.problem, lattice, self.length, self.target_gap, self.must_stop, self)

    def _refined(self, coarser: FlowSearch) -> Array:
        """The same u and flow as on a coarser lattice; its best u is kept, too."""
        u = np.empty((2, self.lattice.ny, self.lattice.nx))
        kernels.choose_diagonals(coarser.best_u, coarser._ratio, coarser.rising)
        kernels.refine(coarser.best_u, coarser.flow, coarser.rising, u[0], self.flow)
        self.u = u[0]
        self._note()
        kernels.choose_diagonals(coarser.u, coarser._ratio, coarser.rising)
        kernels.refine(coarser.u, coarser.flow, coarser.rising, u[1], self.flow)
        return np.asarray(u[1])

    def _between_fields(self) -> Array:
        """Half the distance from the start minus half that to the goal, at the nodes."""
        from ..distance.field import march_both
        from ..distance.medium import Medium

        problem, bounds = self.problem, self.problem.bounds
        inner, edges = _inside(self.lattice, bounds)
        medium = Medium(problem.surface, inner, problem.free_space, self.must_stop)
        fields = march_both(medium, problem.start, problem.goal, watch=lambda _: self.must_stop())
        length = self.length
        if math.isinf(length):
            known = fields[0].values[np.isfinite(fields[0].values)]
            length = float(known.max(initial=0.0))
        costs = problem.surface.cost(inner.points)
        begin, end = (
            np.minimum(_into_obstacles(field.values, costs, inner), length) for field in fields
        )
        return np.pad(0.5 * (begin - end), edges, mode="edge")

    def _limits(self) -> tuple[Array, Array, Cells]:
        """The cost c of each cell, per cell's side; A without it: (ny, nx, 3), symmetric; and which
        cells matter to no path.
        """
        lattice, surface = self.lattice, self.problem.surface
        assert isinstance(surface.data, Spline)
        assert surface.bounds is not None
        costs = costs_of(surface.data, lattice)
        exempt = matter_not(costs, lattice, self.problem.free_space)
        low, high = np.array(surface.bounds[:2]), np.array(surface.bounds[2:])
        middles = [0.5 * (at[1:] + at[:-1]) for at in (lattice.x, lattice.y)]
        centres = np.clip(np.stack(np.meshgrid(*middles), axis=-1), low, high)
        inverse = inverse_metric_tensor(surface, centres)
        inverse *= np.square(surface.cost(centres))[..., None, None]
        smooth = np.exp(surface.log_cost_jets(centres)[..., 0])
        unit = math.sqrt(lattice.dx * lattice.dy)
        inverse *= unit * unit / np.outer(lattice.spacing, lattice.spacing)
        costs *= smooth * unit
        costs[exempt] = FREE
        return costs, _roots(inverse), exempt

    def _note(self) -> None:
        """Measure u, and keep it where it proves the most so far."""
        kernels.choose_diagonals(self.u, self._ratio, self.rising)
        self._measure()
        self.ends = self._weights(self.problem.goal) - self._weights(self.problem.start)
        value = float((self.ends * self.u).sum()) / max(float(self.norms.max()), 1e-300)
        if value > self.best:
            self.best, self.best_u = value, self.u.copy()

    def _measure(self) -> None:
        """The norms of all cells; on hills, where they vary in a cell, the checker's."""
        if self.is_flat:
            kernels.fill_norms(self.u, self.roots, self.costs, self.rising, self.norms)
        else:
            self.norms = self._needs(self._claim(self.u), 0.0).slope

    @property
    def _ratio(self) -> float:
        """Of a cell's height to its width, squared."""
        return (self.lattice.dy / self.lattice.dx) ** 2

    def _weights(self, point: Point) -> Array:
        """The weights (ny, nx) of the nodes at a point: of the corners of its triangle."""
        lattice = self.lattice
        weights = np.zeros((lattice.ny, lattice.nx))
        s, t = _place(point, lattice)
        i, j = min(int(s), lattice.nx - 2), min(int(t), lattice.ny - 2)
        s, t = s - i, t - j
        if self.rising[j, i]:
            low, high = min(s, t), max(s, t)
            weights[j : j + 2, i : i + 2] = [[1.0 - high, s - low], [t - low, low]]
        else:
            low, high = max(1.0 - s - t, 0.0), max(s + t - 1.0, 0.0)
            weights[j : j + 2, i : i + 2] = [[low, s - high], [t - high, high]]
        return weights

    @property
    def is_done(self) -> bool:
        """Is the bound good enough, or must it stop?"""
        return self.best >= self.length / (1.0 + self.target_gap) or self.must_stop()

    def run(self) -> None:
        """Raise the bound until it is near enough."""
        sides = self.lattice.dx * self.lattice.dy / np.square(self.lattice.spacing)
        inverse = Multigrid(self.weights, *sides)
        for ratio in self.ratios:
            self._step(ratio, inverse)
            if self.is_done:
                return
        known, idle = self.best, 0
        for _ in range(TIGHTENINGS):
            self.tightened /= np.maximum(self.norms / TOLERATED, 1.0)
            self._step(self.ratios[-1], inverse)
            if self.is_done:
                return
            idle = 0 if self.best > known * (1.0 + GAIN) else idle + 1
            known = max(known, self.best)
            if idle == PATIENCE:
                return

    def _step(self, ratio: float, inverse: Multigrid) -> None:
        """Iterations of the algorithm, with a ratio of its two steps."""
        ahead, sigma = self.u, 0.99 * math.sqrt(ratio) * self.weights
        sources = np.empty_like(self.u)
        for _ in range(ITERATIONS):
            if self.must_stop():
                break
            kernels.step_flow(ahead, self.roots, self.tightened, self.rising, sigma, self.flow)
            kernels.fill_sources(self.flow, self.roots, self.rising, sources)
            change = inverse.solve(self.ends - sources) / math.sqrt(ratio)
            ahead, self.u = self.u + 2.0 * change, self.u + change
        self._note()

    def _claim(self, u: Array) -> Claim:
        """A claim that is not proven yet."""
        problem, lattice = self.problem, self.lattice
        return Claim(
            value=0.0,
            norm=math.inf,
            coefficients=np.pad(u, 1, mode="edge"),
            bounds=lattice.bounds,
            horizon=float((self._weights(problem.goal) * u).sum()),
            start_core=_core(problem.start, lattice),
            goal_core=_core(problem.goal, lattice),
        )

    def certify(self, must_end: MustStop = never) -> Certificate:
        """The certificate that the best u makes."""
        kernels.choose_diagonals(self.best_u, self._ratio, self.rising)
        begin = float((self._weights(self.problem.start) * self.best_u).sum())
        claim = self._claim(self.best_u - begin)
        needs = self._needs(claim, FLAT_ENOUGH, must_end)
        return certify(self.problem, claim, needs, must_end)

    def _needs(self, claim: Claim, enough: float, must_stop: MustStop = never) -> Needs:
        return cell_needs(self.problem, claim, enough, must_stop, self.exempt)


def _into_obstacles(values: Array, costs: Array, lattice: Lattice) -> Array:
    """Distances (ny, nx), continued to nodes in obstacles, where cells may be partly free."""
    for _ in range(AROUND):
        missing = ~np.isfinite(values)
        if not missing.any():
            break
        around = np.pad(values, 1, constant_values=math.inf)
        ny, nx = values.shape
        least = np.full_like(values, math.inf)
        for j in range(3):
            for i in range(3):
                step = math.hypot((i - 1) * lattice.dx, (j - 1) * lattice.dy)
                least = np.minimum(least, around[j : j + ny, i : i + nx] + step * costs)
        values = np.where(missing, least, values)
    return values


def _inside(lattice: Lattice, bounds: Bounds) -> tuple[Lattice, list[tuple[int, int]]]:
    """The part of a lattice inside bounds, and how many rows and columns lie outside."""
    ranges = []
    for at, low, high, step in (
        (lattice.y, bounds.x2_min, bounds.x2_max, lattice.dy),
        (lattice.x, bounds.x1_min, bounds.x1_max, lattice.dx),
    ):
        known = np.flatnonzero((at >= low - 1e-9 * step) & (at <= high + 1e-9 * step))
        ranges.append((known[0], known[-1], len(at)))
    (j0, j1, rows), (i0, i1, columns) = ranges
    x, y = np.clip(lattice.x, *bounds[::2]), np.clip(lattice.y, *bounds[1::2])
    inner = Lattice(Bounds(x[i0], y[j0], x[i1], y[j1]), int(i1 - i0) + 1, int(j1 - j0) + 1)
    return inner, [(int(j0), int(rows - 1 - j1)), (int(i0), int(columns - 1 - i1))]


def _place(point: Point, lattice: Lattice) -> Array:
    """Column and row of a point, in nodes."""
    return np.subtract(point, lattice.bounds[:2]) / lattice.spacing


def _core(point: Point, lattice: Lattice) -> Core:
    """The cells that hold or touch a point."""
    (low_x, low_y), (high_x, high_y) = (
        (np.floor(_place(point, lattice) + shift).astype(int)).tolist() for shift in (-1e-9, 1e-9)
    )
    return Core(
        min(max(low_x, 0), lattice.nx - 2),
        min(high_x + 1, lattice.nx - 1),
        min(max(low_y, 0), lattice.ny - 2),
        min(high_y + 1, lattice.ny - 1),
    )


def _roots(tensors: Array) -> Array:
    """The square roots of tensors (..., 2, 2), as (..., 3): a11, a12 and a22."""
    a, b, d = tensors[..., 0, 0], tensors[..., 0, 1], tensors[..., 1, 1]
    root = np.sqrt(np.maximum(a * d - b * b, 0.0))
    per = np.sqrt(a + d + 2.0 * root)
    return np.ascontiguousarray(np.stack([a + root, b, d + root], axis=-1) / per[..., None])


def cell_certificates(
    problem: Problem,
    window: Bounds,
    length: float,
    target_gap: float,
    must_stop: MustStop,
    must_end: MustStop,
) -> Iterator[Certificate]:
    """Certificates from ever finer lattices, where costs are constant in cells."""
    lattice, level = first_lattice(problem, window)
    gap = target_gap or GOOD_GAP
    search = FlowSearch(problem, lattice, length, gap, must_stop)
    while True:
        search.run()
        yield search.certify(must_end)
        level += 1
        if must_stop() or level > FINEST or 4 * search.u.size > MOST_FINER_NODES:
            return
        search = search.finer()
