"""The search for the best bicubic potential, from coarse lattices to fine ones.

A distance field is one potential among many, and on rough ground a poor one: the checker asks for
its largest norm. The best one is searched for on lattices whose lines are the surface's knots, or
every second or fourth of them, or between them. Each begins with the u and the flow of the one
before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .._kernels.surface.surfaces import Spline
from .._support.watching import MustStop
from ..problem import Problem
from ..space.lattice import Lattice
from ..surface.bounds import Bounds
from ..validation import Array
from .certificate import Certificate, certify
from .claims import Core, cell_needs, sharper_needs
from .spline_flow import Reals32, SplineSearch

# The first lattice has at most so many nodes, of some 400 bytes. Nothing is proven on those that
# are coarser than the knots, but on the last.
FEW_NODES = 50_000

# The ratios of the two steps and how many iterations each has: until objective and flow agree to
# this share, after that, and before a proof.
BEGIN, AGREED, MOST_BEGINNINGS = (20, 0.03), 0.04, 15
GO_ON, LAST = ((20, 0.1), (20, 0.3)), ((20, 1.0), (20, 3.0), (20, 10.0))

# The norm asked for is above 1 by this share of the largest excess that is left; by no less than
# this share of the gap that is asked for, between two limits; and by no more than the last number.
# Where it is asked to be far lower than the search made it, projections undo one another.
EASE, OF_GAP, LEAST_EASE, MOST_OF_GAP, MOST_EASE = 0.2, 0.5, 1e-4, 5e-4, 1e-2

# Cells that the checker cannot prove to be within so much more of what is asked for are looked at
# in so many parts, from the second round on. Where a gap as this one is asked for, the first few
# rounds will do.
NEARLY, PARTS = 0.6, (4, 16, 32, 32)
QUICK_GAP, QUICK_ROUNDS = 1e-3, 2

# The rounds end where it would be more places than so many a cell of the lattice.
MOST_PLACES = 8

# No core is larger than this, in cells of a lattice finer than knots.
CORE = 4


def spline_certificates(
    problem: Problem,
    window: Bounds,
    target_gap: float,
    most_nodes: int,
    must_stop: MustStop,
    must_end: MustStop,
) -> Iterator[Certificate]:
    """Certificates from ever finer lattices, the last of which has no more than so many nodes.

    Where it must stop, one last proof is begun. Where it must end, that is as good as it is.
    """
    lattices = _lattices(problem, window, most_nodes)
    search: SplineSearch | None = None
    for lattice, reach, is_proven in lattices:
        search = _search(problem, lattice, reach, search)
        _run(search, is_proven, must_stop)
        if is_proven or must_stop():
            yield _certified(search, target_gap, must_end)
        if must_stop():
            return


def _lattices(problem: Problem, window: Bounds, most_nodes: int) -> list[tuple[Lattice, int, bool]]:
    """Lattices, how far their cores reach, and whether something is to be proven on them."""
    bounds, columns, rows = _on_knots(problem, window)
    coarse = 1.0
    while columns * rows / coarse**2 > FEW_NODES:
        coarse *= 2.0
    found: list[tuple[Lattice, int, bool]] = []
    while not found or columns * rows / coarse**2 <= most_nodes:
        nx, ny = (max(round(count / coarse), 3) + 1 for count in (columns, rows))
        reach = 1 if coarse > 1.0 else min(round(2.0 / coarse), CORE)
        found.append((Lattice(bounds, nx, ny), reach, coarse <= 1.0))
        coarse *= 0.5
    found[-1] = (*found[-1][:2], True)
    return found


def _on_knots(problem: Problem, window: Bounds) -> tuple[Bounds, int, int]:
    """The window widened to the next knots inside the bounds, and its columns and rows of cells."""
    data, bounds = problem.surface.data, problem.bounds
    assert isinstance(data, Spline)
    axes = []
    for k, (origin, step) in enumerate(((data.x0, data.dx), (data.y0, data.dy))):
        low, high, least, most = window[k], window[k + 2], bounds[k], bounds[k + 2]
        ends = sorted((problem.start[k], problem.goal[k]))
        first, last = math.floor((low - origin) / step), math.ceil((high - origin) / step)
        first = max(first, math.ceil((least - origin) / step - 1e-9))
        last = min(last, math.floor((most - origin) / step + 1e-9))
        west, east = origin + first * step, origin + last * step
        # Beside the bounds by rounding alone, a path could leave the lattice.
        west = least if west - least < 1e-6 * step else west
        east = most if most - east < 1e-6 * step else east
        # An end may lie between the bounds and the outermost knot.
        if west > ends[0] or east < ends[1] or last <= first:
            west, east = low, high
        axes.append((west, east, max(round((east - west) / step), 1)))
    (x0, x1, columns), (y0, y1, rows) = axes
    return Bounds(x0, y0, x1, y1), columns, rows


def _search(
    problem: Problem, lattice: Lattice, reach: int, coarser: SplineSearch | None
) -> SplineSearch:
    """The search on a lattice, with the u and the flow of a coarser one."""
    start, goal = lattice.blocks_around((problem.start, problem.goal), reach)
    around = Core(*start), Core(*goal)
    if coarser is None:
        return SplineSearch(problem, lattice, around, _between_chords(problem, lattice))
    old, finer = coarser.lattice, coarser.unit / math.sqrt(lattice.dx * lattice.dy)
    u = coarser.c[: old.ny + 2, : old.nx + 2] * finer
    u = _resampled(_resampled(u, lattice.ny).T, lattice.nx).T
    search = SplineSearch(problem, lattice, around, u)
    flow = coarser.half_flow() / np.float32(finer)
    flow = _stretched(flow, 2 * lattice.ny - 1).swapaxes(0, 1)
    search.take_flow(_stretched(flow, 2 * lattice.nx - 1).swapaxes(0, 1))
    for end, known in zip(search.ends, coarser.ends, strict=True):
        end.take(known)
    return search


def _between_chords(problem: Problem, lattice: Lattice) -> Array:
    """Half the chord from the start minus half that to the goal."""
    surface, bounds = problem.surface, problem.bounds
    points = np.clip(lattice.points, bounds[:2], bounds[2:])
    lifted = surface.lift(points)
    ends = (surface.lift(np.asarray(end)) for end in (problem.start, problem.goal))
    from_start, to_goal = (np.linalg.norm(lifted - end, axis=-1) for end in ends)
    unit = math.sqrt(lattice.dx * lattice.dy)
    u = 0.5 * surface.least_cost / unit * (from_start - to_goal)
    return np.pad(u, 1, mode="reflect", reflect_type="odd")


def _resampled(c: Array, nodes: int) -> Array:
    """Coefficients (n, ...) of a spline on another number of nodes; exact where cells are cut."""
    old = len(c) - 2
    ratio = (old - 1) / (nodes - 1)
    place = np.arange(-1, nodes + 1) * ratio
    cell = np.clip(np.floor(place).astype(int), 0, old - 2)
    t = place - cell
    s = 1.0 - t
    values = s**3 / 6, (3 * t**3 - 6 * t**2 + 4) / 6, (3 * s**3 - 6 * s**2 + 4) / 6, t**3 / 6
    bends = s, 3 * t - 2, 3 * s - 2, t
    # A coefficient is the value less a sixth of the second derivative.
    shares = (v - ratio**2 / 6 * b for v, b in zip(values, bends, strict=True))
    return np.asarray(sum(share[:, None] * c[cell + k] for k, share in enumerate(shares)))


def _stretched(flow: Reals32, count: int) -> Reals32:
    """A flow (n, m, 2) at so many rows instead, between those that there are."""
    place = np.linspace(0.0, len(flow) - 1.0, count)
    row = np.minimum(place.astype(int), len(flow) - 2)
    share = (place - row).astype(np.float32)[:, None, None]
    return np.asarray((1 - share) * flow[row] + share * flow[row + 1])


def _run(search: SplineSearch, is_last: bool, must_stop: MustStop) -> None:
    """Iterations on one lattice."""
    for _ in range(MOST_BEGINNINGS):
        search.iterate(*BEGIN, must_stop)
        if must_stop() or abs(search.agreement - 1.0) < AGREED:
            break
    for count, ratio in GO_ON + (LAST if is_last else ()):
        search.iterate(count, ratio, must_stop)


def _ease(excess: float, target_gap: float) -> float:
    """How far above 1 the norm that is asked for is."""
    wanted = min(max(OF_GAP * target_gap, LEAST_EASE), MOST_OF_GAP)
    return min(max(EASE * excess, wanted), MOST_EASE)


def _certified(search: SplineSearch, target_gap: float, must_end: MustStop) -> Certificate:
    """The certificate of u, once its norm is lowered where the checker cannot prove enough."""
    problem, c = search.problem, search.c.copy()
    cells = np.zeros((0, 2), np.int64)
    ease = _ease(search.excess, target_gap)
    target, enough, best = 1.0 + ease, 1.0 + (1.0 + NEARLY) * ease, None
    for parts in PARTS[: QUICK_ROUNDS if target_gap >= QUICK_GAP else None]:
        search.project(c, cells, parts, target, must_end)
        claim = search.claim(c)
        needs = cell_needs(problem, claim, enough, must_end)
        needs = sharper_needs(problem, claim, needs, enough, must_end)
        found = certify(problem, claim, needs, must_end)
        best = found if best is None or found.value > best.value else best
        above = np.argwhere(needs.proven > enough)
        cells = np.unique(np.concatenate([cells, above]), axis=0)
        if not len(above) or parts**2 * len(cells) > MOST_PLACES * c.size or must_end():
            break
    assert best is not None
    return best
