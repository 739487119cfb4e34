"""The search for lower bounds on the length of every path: functions u that prove them.

A distance field solves |du| = 1, up to small errors. Its values are taken as coefficients of a
B-spline. That averages its slopes, so they never overshoot at the kinks of the cut locus, and u is
smooth, with a dual norm of 1 nearly everywhere. Where the norm is larger, lengths are shrunk a
little and the field is solved again. Most such places are on the cut locus, which no shortest path
crosses, so the value at the goal falls very little.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from .._kernels.surface.surfaces import Spline
from .._support.watching import MustStop, never, stop_after
from ..distance.eikonal import Eikonal, model_source, near_distance, window_radius
from ..errors import InputError
from ..problem import Problem
from ..space.lattice import Lattice
from ..surface.bounds import Bounds
from ..validation import Array, require_count, require_positive
from .certificate import Certificate, certify
from .claims import Claim, Core, Needs, cell_needs

T = TypeVar("T", np.float64, np.bool_)

# Is called with each certificate; returning True stops the search.
Watch = Callable[[Certificate], bool | None]

# The lattices tried, by their nodes on the longer side. Without a target gap only the first one is.
SIDES = (120, 240, 360, 480, 800, 1400)

# At most this many repairs are made on one lattice, before the next finer one is tried.
REPAIRS = 3

# Cells whose norm is above this are repaired. It is below 1 because the norm is measured at nine
# points of a cell, and is larger between them.
TOLERATED = 0.9998

# A repair shrinks lengths at all nodes within this many rows and columns.
REACH = 2

# So much of a time limit is for the search: what it finds has to be proven, too.
SEARCHED = 0.7

# With fewer of its cells along the window's longer side, a surface is smooth enough for fields.
FEWEST_CELLS = 60

# No lattice has more nodes than this. By default a plan's bound is searched for until its gap is
# good, on lattices with up to the second number: seconds of one core, but by no clock.
MOST_NODES, FEW_NODES, GOOD_GAP = 6_000_000, 320_000, 1e-3

# The window of a search is never smaller than this share of the bounds' longer side.
SMALLEST_WINDOW = 1e-6

# A core reaches at most this many cells from its end.
CORE = 4


def mollified(u: Array, cap: float) -> Array:
    """Coefficients (ny + 2, nx + 2) of the spline that averages u (ny, nx), cut off at ``cap``."""
    inner = np.minimum(u, cap)
    return np.pad(inner, 1, mode="reflect", reflect_type="odd")


def _blocked_nodes(problem: Problem, lattice: Lattice) -> npt.NDArray[np.bool_]:
    """(ny, nx), the nodes whose coefficients matter to no cell that a path can meet.

    All cells within two columns and rows of such a node are covered by obstacles.
    """
    if not problem.free_space.has_obstacles:
        return np.zeros((lattice.ny, lattice.nx), bool)
    covered = np.pad(problem.free_space.covered_cells(lattice), 2, constant_values=True)
    # Of the 4 x 4 cells around a node.
    return np.asarray(~_windows(~covered, 4))


def _largest_within(values: Array, reach: int) -> Array:
    """Largest of the values (ny, nx) at most ``reach`` rows and columns away.

    It does the same as SciPy's maximum_filter, whose import would take longer than its work.
    """
    return np.asarray(_windows(np.pad(values, reach, mode="edge"), 2 * reach + 1))


def _windows(values: npt.NDArray[T], size: int) -> npt.NDArray[T]:
    """The largest value in each window of size x size; truth values count as 0 and 1."""
    rows = sliding_window_view(values, size, axis=0).max(axis=-1)
    return np.asarray(sliding_window_view(rows, size, axis=1).max(axis=-1))


def _horizon(problem: Problem, lattice: Lattice, u: Array, core: Core) -> float:
    """The least distance from start to goal through the nodes on the goal core's edge."""
    window = np.s_[core.row0 : core.row1 + 1, core.column0 : core.column1 + 1]
    nodes = np.stack(np.meshgrid(lattice.x, lattice.y), axis=-1)[window]
    through = u[window] + near_distance(problem.surface, problem.goal, nodes)
    through[1:-1, 1:-1] = math.inf
    return float(through.min())


def _repair_factors(found: Needs) -> Array:
    """Factors (ny, nx) on lengths at the nodes, to make the norm of cells smaller."""
    excess = np.where(found.likely > TOLERATED, found.slope / TOLERATED, 1.0)
    at_nodes = _windows(np.pad(excess, 1, mode="edge"), 2)
    return np.asarray(1.0 / _largest_within(at_nodes, REACH))


class Search:
    """The search for a lower bound on one lattice.

    cap : larger distances do not matter, map units. Where it must stop, the field and the proof
    are unfinished. The certificate holds all the same, but may be no more than the chord.
    """

    def __init__(
        self, problem: Problem, lattice: Lattice, cap: float, must_stop: MustStop = never
    ) -> None:
        self.problem, self.lattice, self.cap = problem, lattice, cap
        self.must_stop = must_stop
        self.medium = Eikonal.around(problem.surface, lattice, _blocked_nodes(problem, lattice))
        self.model = model_source(
            lattice,
            problem.start,
            window_radius(problem.surface, lattice),
            lambda points: near_distance(problem.surface, problem.start, points),
        )
        blocks = lattice.blocks_around((problem.start, problem.goal), CORE)
        self.start_core, self.goal_core = (Core(*block) for block in blocks)
        self.repairs = 0
        self._solve()

    def _solve(self) -> None:
        u = self.medium.march(self.model, limit=self.cap, watch=lambda _: self.must_stop())
        cap = min(self.cap, float(u[np.isfinite(u)].max(initial=0.0)))
        self.proposal = Claim(
            value=0.0,
            norm=math.inf,
            coefficients=mollified(u, cap),
            bounds=self.lattice.bounds,
            horizon=min(_horizon(self.problem, self.lattice, u, self.goal_core), cap),
            start_core=self.start_core,
            goal_core=self.goal_core,
        )
        self.needs = cell_needs(self.problem, self.proposal, TOLERATED, self.must_stop)

    @property
    def likely_norm(self) -> float:
        """The least dual norm that a proof can reach: the largest at the points measured."""
        return float(self.needs.likely.max())

    def repair(self) -> None:
        """Shrink lengths where the dual norm is too large, and solve again."""
        self.medium.shrink(_repair_factors(self.needs))
        self.repairs += 1
        self._solve()

    def certify(self, must_end: MustStop = never) -> Certificate:
        """The certificate that the present field makes."""
        return certify(self.problem, self.proposal, self.needs, must_end)


def search_window(problem: Problem, length: float) -> Bounds:
    """The part of the bounds that a path no longer than ``length`` can visit."""
    (x0, y0), (x1, y1) = problem.start, problem.goal
    bounds = problem.bounds
    straight = math.hypot(x1 - x0, y1 - y0)
    if not math.isfinite(length) or straight == 0.0:
        return bounds
    # The path stays within an ellipse around both ends, with axes as long as these.
    major = max(length / problem.surface.least_cost, straight) * (1.0 + 1e-6)
    minor = math.sqrt(major - straight) * math.sqrt(major + straight)
    cosine, sine = (x1 - x0) / straight, (y1 - y0) / straight
    least = SMALLEST_WINDOW * max(bounds.width, bounds.height)
    east = max(0.5 * math.hypot(major * cosine, minor * sine), least)
    north = max(0.5 * math.hypot(major * sine, minor * cosine), least)
    middle_x, middle_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    return Bounds(
        max(min(middle_x - east, x0, x1), bounds.x1_min),
        max(min(middle_y - north, y0, y1), bounds.x2_min),
        min(max(middle_x + east, x0, x1), bounds.x1_max),
        min(max(middle_y + north, y0, y1), bounds.x2_max),
    )


def certificates(
    problem: Problem,
    length: float = math.inf,
    *,
    target_gap: float = 0.0,
    most_nodes: int = MOST_NODES,
    must_stop: MustStop = never,
    must_end: MustStop = never,
) -> Iterator[Certificate]:
    """Certificates from ever finer lattices.

    length : of a path that is known, map units. target_gap : of the lower bound. The search goes
    on to the next finer lattice when the norm is too large by at most a quarter of the target
    gap, or when a repair gains little. Where the surface has many knots, the best potential is
    searched for after the first lattice. most_nodes : no lattice but the first has more; where
    costs are constant in cells, the search has limits of its own instead. Where it must stop, one
    last certificate comes, proven as far as that goes before it must end.
    """
    window = search_window(problem, length)
    if problem.surface.cost_cells is not None:
        from .flow import cell_certificates

        yield from cell_certificates(problem, window, length, target_gap, must_stop, must_end)
        return
    cap = length * (1.0 + 1e-6)
    for side in SIDES:
        lattice = Lattice.spanning(window, max(window.width, window.height) / side)
        if side > SIDES[0] and lattice.nx * lattice.ny > most_nodes:
            return
        search = Search(problem, lattice, cap, must_stop)
        tolerable = 1.0 + max(0.25 * target_gap, 5e-5)
        for _ in range(REPAIRS):
            before = search.likely_norm
            if before <= tolerable or must_stop():
                break
            search.repair()
            if search.likely_norm - 1.0 > 0.7 * (before - 1.0):
                break
        yield search.certify(must_end)
        if must_stop():
            return
        if has_many_knots(problem, window):
            gap = target_gap or GOOD_GAP
            from .spline_levels import spline_certificates

            yield from spline_certificates(problem, window, gap, most_nodes, must_stop, must_end)
            return


def has_many_knots(problem: Problem, window: Bounds) -> bool:
    """Is the surface a spline of at least FEWEST_CELLS cells along a side of the window?

    Then the best potential is searched for on the spline's own cells.
    """
    data = problem.surface.data
    if not isinstance(data, Spline):
        return False
    return max(window.width / data.dx, window.height / data.dy) >= FEWEST_CELLS


def lower_bound(
    problem: Problem,
    *,
    length: float | None = None,
    target_gap: float | None = None,
    most_nodes: int = MOST_NODES,
    time_limit: float | None = None,
    watch: Watch | None = None,
) -> Certificate:
    """A proven lower bound on the length of every path from start to goal.

    length : of a path that is known, map units. With it the search leaves out ground that no
    shorter path can visit. target_gap : the search stops when (length - bound) / bound is no more
    than this; by default, and where no path is known, it stops after the first, coarsest lattice.
    most_nodes : of any lattice but the first; it does not limit a search where costs are constant
    in cells. time_limit : seconds. watch : is called with each certificate; returning True stops
    the search.
    Returns the best certificate found, which compares with numbers by its value. Where time was up
    before the first one was proven, its bound may be no more than the chord.
    Raises InputError for numbers that are not above 0, and for a problem with a travel model.
    """
    _check(length, target_gap, time_limit)
    if problem.travel is not None:
        raise InputError(
            "no certificates are made with a travel model yet; problem.chord is a lower bound"
        )
    require_count(most_nodes=most_nodes)
    must_stop = must_end = never
    if time_limit is not None:
        must_stop, must_end = stop_after(SEARCHED * time_limit), stop_after(time_limit)
    # Overflow makes NaN, which proves nothing; so it needs no warning.
    with np.errstate(all="ignore"):
        known = known_length(problem, must_stop) if length is None else length
        found = certificates(
            problem,
            known,
            target_gap=target_gap or 0.0,
            most_nodes=most_nodes,
            must_stop=must_stop,
            must_end=must_end,
        )
        return _best(found, known, target_gap, watch)


def _best(
    certificates: Iterator[Certificate],
    length: float,
    target_gap: float | None,
    watch: Watch | None,
) -> Certificate:
    """The best certificate until there is a reason to stop."""
    best: Certificate | None = None
    for found in certificates:
        if best is None or found.value > best.value:
            best = found
        # Without a known length there is no gap to reach.
        if target_gap is None or math.isinf(length):
            break
        if length - best.value <= target_gap * best.value:
            break
        if watch is not None and watch(best):
            break
    assert best is not None
    return best


def _check(length: float | None, target_gap: float | None, time_limit: float | None) -> None:
    given = {"length": length, "target_gap": target_gap, "time_limit": time_limit}
    for name, value in given.items():
        if value is not None and not (name == "length" and value in (0.0, math.inf)):
            require_positive(**{name: value})


def known_length(problem: Problem, must_stop: MustStop = never) -> float:
    """The length of some path, map units; infinite where none is found on a coarse lattice."""
    from ..distance.field import march_from
    from ..distance.medium import Medium

    spacing = max(problem.bounds.width, problem.bounds.height) / SIDES[0]
    lattice = Lattice.spanning(problem.bounds, spacing)
    medium = Medium(problem.surface, lattice, problem.free_space)

    def watch(settled: int) -> bool:
        return must_stop()

    path = march_from(medium, problem.start, watch=watch).path_to(problem.goal)
    return math.inf if path is None else path.length
