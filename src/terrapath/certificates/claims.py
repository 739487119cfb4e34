"""Claims: lower bounds, each with a function that proves it; and the proofs.

Let the dual norm of du under h be at most M. Then along a path u / M grows by no more than the
path's length. So a path from start to goal is at least (u(goal) - u(start)) / M long. A proof
uses the problem's surface and obstacles only, and not how u was found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .._kernels.certificates import margins, norms as kernels
from .._kernels.certificates.potentials import Potential
from .._kernels.surface.points import fill_values
from .._kernels.surface.surfaces import Peaks, Spline
from .._support.watching import MustStop, never
from ..errors import CertificateError
from ..problem import Problem
from ..space.lattice import Lattice
from ..surface.bounds import Bounds
from ..surface.layers import span_within
from ..validation import Array, Point
from .sides import Cells, costs_of, margins_at_ends, matter_not, require_fit

# A relative margin, far above the rounding errors of the checker, far below any gap.
ROUNDING = 1e-9

# A margin for the rounding of a layer's value, in units in the last place of its largest value.
EPSILONS = 64.0

# Cells proven between two looks at whether to stop.
CHUNK = 32

# The least norm: a function that is nearly flat proves nothing, and the squares of its slopes would
# be rounded to 0.
FLATTEST = 1e-3


class Core(NamedTuple):
    """The cells [column0, column1) x [row0, row1) around an end, where the chord replaces u."""

    column0: int
    column1: int
    row0: int
    row1: int


@dataclass(frozen=True, eq=False)
class Claim:
    """A lower bound on the length of every path, and the function u that is to prove it.

    value : the bound, map units. norm : M, the largest dual norm of du on all cells that matter.
    coefficients : (ny + 2, nx + 2), of the bicubic B-spline u on the cells of a lattice over
    ``bounds``. Where costs are constant in cells, u is linear over triangles, and these are its
    values at the nodes, the outermost of them unused.
    horizon : W; a cell matters where the goal may be nearer than (W - u) / M.
    start_core, goal_core : the cells around the ends, where the chord replaces u.
    bounds : the rectangle of the lattice, map units. A path that leaves it is already long enough
    on the plane.
    """

    value: float
    norm: float
    coefficients: Array
    bounds: Bounds
    horizon: float
    start_core: Core
    goal_core: Core

    @cached_property
    def lattice(self) -> Lattice:
        """The lattice on whose cells u is given."""
        rows, columns = self.coefficients.shape
        return Lattice(self.bounds, columns - 2, rows - 2)


def is_linear(problem: Problem) -> bool:
    """Is u linear over triangles, of a lattice that may reach beyond the bounds?"""
    return problem.surface.cost_cells is not None


def require_sound(claim: Claim) -> None:
    """Raise CertificateError for numbers that are not finite, or a wrong array of coefficients."""
    value, norm, horizon = claim.value, claim.norm, claim.horizon
    finite = all(map(math.isfinite, (value, norm, horizon)))
    if not (finite and norm >= FLATTEST * (1.0 - ROUNDING)):
        raise CertificateError(
            f"value={value}, norm={norm} and horizon={horizon} must be finite, the norm at least "
            f"{FLATTEST:g}"
        )
    shape, kind = claim.coefficients.shape, claim.coefficients.dtype
    if not (len(shape) == 2 and min(shape) >= 4 and kind == np.float64):
        raise CertificateError(
            f"coefficients of type {kind} and shape {shape} make no spline; (ny + 2, nx + 2) "
            "with 2 x 2 nodes at least is expected"
        )
    if not np.isfinite(claim.coefficients).all():
        raise CertificateError("the coefficients are not all finite")


def _require_fit(problem: Problem, claim: Claim) -> None:
    """Raise CertificateError where the claim does not fit the problem."""
    if is_linear(problem):
        require_fit(problem.surface.data, claim.lattice, problem.bounds)
    elif not problem.bounds.encloses(claim.bounds):
        raise CertificateError(
            f"the certificate covers {claim.bounds}, which is not within {problem.bounds}"
        )
    lattice = claim.lattice
    for name, point in (("start", problem.start), ("goal", problem.goal)):
        core: Core = getattr(claim, f"{name}_core")
        fits = (
            all(isinstance(k, int) for k in core)
            and 0 <= core.column0 < core.column1 < lattice.nx
            and 0 <= core.row0 < core.row1 < lattice.ny
        )
        if not (fits and _extent(lattice, core).contains(np.asarray(point))):
            raise CertificateError(
                f"the {name} core {tuple(core)} does not hold the {name} {point}"
            )


def _extent(lattice: Lattice, core: Core) -> Bounds:
    x, y = lattice.x, lattice.y
    return Bounds(x[core.column0], y[core.row0], x[core.column1], y[core.row1])


def _overlap(a: Core, b: Core) -> bool:
    return a.column0 < b.column1 and b.column0 < a.column1 and a.row0 < b.row1 and b.row0 < a.row1


class Ground(NamedTuple):
    """The surface and the ends for kernels, with the start as the origin of the plane.

    So no digits are lost far from the map's origin, or where the ends lie close together.
    """

    surface: Peaks | Spline
    start: Array  # (2 + layers,), in R^n
    goal: Array  # (2 + layers,), in R^n


def _ground(problem: Problem) -> Ground:
    (x, y), data = problem.start, problem.surface.data
    moved: Peaks | Spline
    if isinstance(data, Spline):
        cells = data.cells._replace(x0=data.cells.x0 - x, y0=data.cells.y0 - y)
        moved = data._replace(x0=data.x0 - x, y0=data.y0 - y, cells=cells)
    else:
        moved = data._replace(peaks=data.peaks - (0.0, 0.0, x, y))
    ends = np.array([problem.start, problem.goal]) - (x, y)
    values = np.empty((2, len(data.weights)))
    fill_values(moved, ends, values)
    return Ground(moved, *np.concatenate([ends, values * data.weights], axis=1))


def _doubt(surface: Peaks | Spline) -> float:
    """How much a chord may be too long because of rounding in the layers' values, map units."""
    if isinstance(surface, Spline):
        sizes = np.abs(surface.coefficients).max(axis=(1, 2))
    else:
        sizes = np.add.reduceat(np.append(np.abs(surface.peaks[:, 0]), 0.0), surface.first[:-1])
        sizes[np.diff(surface.first) == 0] = 0.0
    return EPSILONS * float(np.finfo(np.float64).eps) * math.hypot(*(sizes * surface.weights))


def _potential(problem: Problem, claim: Claim) -> Potential:
    """The function u, with the start as the origin."""
    (x, y), lattice = problem.start, claim.lattice
    corner_x, corner_y = lattice.bounds.x1_min - x, lattice.bounds.x2_min - y
    steps = lattice.dx, lattice.dy
    return Potential(claim.coefficients, corner_x, corner_y, *steps, is_linear(problem))


def _cutting(problem: Problem, lattice: Lattice) -> kernels.Cutting:
    """Workspace for the pieces that a cell is cut into at the surface's knots."""
    data = problem.surface.data
    step = min(data.dx, data.dy) if isinstance(data, Spline) else math.inf
    return kernels.Cutting(
        np.empty(int(lattice.dx / step) + 4),
        np.empty(int(lattice.dy / step) + 4),
        np.empty((2 * len(data.weights), 11)),
        np.empty((3 * kernels.DEPTH + 1, 5)),
    )


def exempt_cells(problem: Problem, claim: Claim) -> Cells:
    """Cells (ny, nx) that no path meets between its cores, or at all where u is linear."""
    if is_linear(problem):
        costs = costs_of(problem.surface.data, claim.lattice)
        return matter_not(costs, claim.lattice, problem.free_space)
    exempt = problem.free_space.covered_cells(claim.lattice)
    for core in (claim.start_core, claim.goal_core):
        exempt[core.row0 : core.row1, core.column0 : core.column1] = True
    return exempt


class Needs(NamedTuple):
    """For each cell (ny, nx), how large M must be."""

    proven: Array  # this is proven to be enough
    likely: Array  # this is enough at nine points of the cell
    slope: Array  # the largest dual norm of du at those points


def cell_needs(
    problem: Problem,
    claim: Claim,
    enough: float,
    must_stop: MustStop = never,
    exempt: Cells | None = None,
) -> Needs:
    """For each cell an M that is enough.

    That is: in the cell the dual norm of du is at most M, or every path through it is long enough,
    by the chord from there to the goal. enough : where an M as low as this is proven, no lower one
    is looked for; nor for the cells that are left where it must stop. exempt : of exempt_cells.
    """
    _require_fit(problem, claim)
    lattice, ground, potential = claim.lattice, _ground(problem), _potential(problem, claim)
    exempt = exempt_cells(problem, claim) if exempt is None else exempt
    cutting = _cutting(problem, lattice)
    found, likely, slope = needs = np.empty((3, lattice.ny - 1, lattice.nx - 1))
    given = (ground.surface, potential, ground.goal, float(claim.horizon))
    for j in range(len(found)):
        satisfied = math.inf if must_stop() else float(enough) / (1.0 + ROUNDING)
        kernels.fill_needs(*given, j, exempt, satisfied, cutting, *needs)
    return Needs(found * (1.0 + ROUNDING), likely, slope)


def proven_norm(
    problem: Problem,
    claim: Claim,
    found: Array,
    enough: float = 0.0,
    must_stop: MustStop = never,
) -> float:
    """The least M that is proven to be enough for all cells, or ``enough`` where that is more.

    found : (ny, nx), an M that is proven for each cell; the largest ones are improved first.
    Where it must stop, the largest of those that are left is enough, too.
    """
    ground, cutting = _ground(problem), _cutting(problem, claim.lattice)
    given = (ground.surface, _potential(problem, claim), ground.goal, float(claim.horizon))
    order, norm = np.argsort(found, axis=None)[::-1], float(enough) / (1.0 + ROUNDING)
    for first in range(0, len(order), CHUNK):
        largest = float(found.flat[order[first]])
        if largest <= norm:
            break
        if must_stop():
            norm = largest
            break
        cells = order[first : first + CHUNK]
        norm = float(kernels.least_norm(*given, cells, found, norm, cutting))
    return norm * (1.0 + ROUNDING)


def sharper_needs(
    problem: Problem, claim: Claim, found: Needs, enough: float, must_stop: MustStop = never
) -> Needs:
    """The needs of which each one above ``enough`` is proven roughly as low as it can be.

    Those of cells that are left where it must stop stay as they are.
    """
    ground, cutting = _ground(problem), _cutting(problem, claim.lattice)
    given = (ground.surface, _potential(problem, claim), ground.goal, float(claim.horizon))
    proven, norm = found.proven.copy(), float(enough) / (1.0 + ROUNDING)
    for j, row in enumerate(proven):
        if must_stop():
            break
        if row.max() > norm:
            kernels.sharpen_needs(*given, j, norm, cutting, row)
            row[:] = np.where(row < found.proven[j], row * (1.0 + ROUNDING), row)
    return found._replace(proven=proven)


class End(NamedTuple):
    """The start or the goal."""

    core: Core  # the cells around it
    place: Point  # map units
    lifted: Array  # (2 + layers,), in R^n, with the start as the origin of the plane
    doubt: float  # how much a chord may be too long because of rounding, map units


def _anchor(problem: Problem, claim: Claim, end: End) -> margins.Anchor:
    """An end, and the least cost of the ground around its core.

    The ground is the core, widened by half its size on all sides. Let c be the cost at the end and
    G the steepest slope of the cost there. A path of length s, without costs, has met no cost below
    c - G s. So at a distance of d it is at least (c - G d / 2) d long.
    """
    surface, data = problem.surface, problem.surface.data
    if not (surface.costs and isinstance(data, Spline)):
        return margins.Anchor(end.lifted, 1.0, math.inf)
    x0, y0, x1, y1 = _extent(claim.lattice, end.core)
    width, height = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    around = Bounds(x0 - width, y0 - height, x1 + width, y1 + height)
    (x, y), bounds = end.place, problem.bounds
    # Beyond the bounds no path can go.
    sides = (
        (x - around.x1_min, around.x1_min > bounds.x1_min),
        (y - around.x2_min, around.x2_min > bounds.x2_min),
        (around.x1_max - x, around.x1_max < bounds.x1_max),
        (around.x2_max - y, around.x2_max < bounds.x2_max),
    )
    far = min((distance for distance, is_inside in sides if is_inside), default=math.inf)
    found, cost = span_within(data, around), float(surface.cost((x, y)))
    farthest = math.hypot(max(x - x0, x1 - x), max(y - y0, y1 - y), found.rise)
    floor = max(found.least, cost - 0.5 * found.steepest * farthest) * (1.0 - ROUNDING)
    return margins.Anchor(end.lifted, floor, found.least * (1.0 - ROUNDING) * float(far))


def edge_margin(problem: Problem, claim: Claim, end: End, factor: float) -> float:
    """A lower bound on distance(end, p) + factor u(p) for all p on its core's edge, map units.

    The distance is at least the chord times the least cost around.
    """
    anchor = _anchor(problem, claim, end)
    margin = margins.margin_of_core(
        _ground(problem).surface,
        _potential(problem, claim),
        anchor,
        float(factor),
        *end.core,
        _cutting(problem, claim.lattice),
    )
    return float(margin) - anchor.floor * end.doubt


def proven_value(problem: Problem, claim: Claim, norm: float) -> float:
    """The lower bound that follows where the dual norm is at most ``norm``, map units.

    Let a path leave the start core for the last time at p, and after that enter the goal core for
    the first time at q. Its length is at least distance(start, p) + (u(q) - u(p)) / M +
    distance(q, goal); or else it meets a cell that is at least (W - u(p)) / M from the goal. A
    piecewise linear u needs no cores: p is the start and q the goal.
    """
    surface, start, goal = _ground(problem)
    doubt, least = _doubt(surface), problem.surface.least_cost
    straight = max(least * (math.dist(start, goal) * (1.0 - ROUNDING) - doubt), 0.0)
    if is_linear(problem):
        u = _potential(problem, claim)
        first, last = margins_at_ends(problem.surface.data, claim.lattice, u, start, goal, norm)
    elif _overlap(claim.start_core, claim.goal_core):
        return straight
    else:
        begin = End(claim.start_core, problem.start, start, doubt)
        end = End(claim.goal_core, problem.goal, goal, doubt)
        first = edge_margin(problem, claim, begin, -1.0 / norm)
        last = edge_margin(problem, claim, end, 1.0 / norm)
    around = problem.bounds.least_detour(claim.bounds, problem.start, problem.goal)
    detour = least * around * (1.0 - ROUNDING)
    rest = min(last, claim.horizon / norm - least * doubt)
    within = first + rest - ROUNDING * (abs(first) + abs(rest))
    # ``within`` is NaN where something overflowed; then the comparison is False.
    return max(min(within, detour), straight) if within > straight else straight


def require_proven(problem: Problem, claim: Claim) -> None:
    """Prove a claim from the problem alone.

    Raises CertificateError, which says what cannot be proven.
    """
    found = cell_needs(problem, claim, claim.norm)
    norm = proven_norm(problem, claim, found.proven, claim.norm)
    # On another machine exponentials may differ in the last digit.
    alike = 1.0 + 1e-3 * ROUNDING
    if not norm <= claim.norm * alike:
        raise CertificateError(
            f"the dual norm is claimed to be at most {claim.norm:.12g}, but no less than "
            f"{norm:.12g} can be proven"
        )
    proven = proven_value(problem, claim, claim.norm)
    if not claim.value <= proven * alike:
        raise CertificateError(
            f"the bound is claimed to be {claim.value:.12g}, but no more than {proven:.12g} "
            "can be proven"
        )


def proven_claim(
    problem: Problem, claim: Claim, found: Needs, must_stop: MustStop = never
) -> Claim:
    """The claim with the norm and the value that can be proven.

    found : what its cells need. Where no norm can be proven, the length of the straight line in
    R^n is the bound. Where it must stop, the value is what is proven so far.
    """
    norm = proven_norm(problem, claim, found.proven, FLATTEST, must_stop)
    if not math.isfinite(norm):
        nothing = np.zeros_like(claim.coefficients)
        claim, norm = replace(claim, coefficients=nothing, horizon=0.0), 1.0
    return replace(claim, norm=norm, value=proven_value(problem, claim, norm))
