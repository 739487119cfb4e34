"""Certificates: a function whose slope proves that no path is shorter, and its checker.

Where |du| <= M in the dual norm of h, u / M grows by at most a path's length along it. So a
path from start to goal is at least (u(goal) - u(start)) / M long. Nothing here knows how u
was found: the checker trusts the problem's surface and obstacles, and nothing else.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from functools import cached_property, total_ordering
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import metric
from ._kernels import certificate as kernels
from .errors import CertificateError, MapError
from .files import written_whole
from .lattice import Lattice
from .problem import Problem
from .validation import Array, Bounds, as_array, as_bounds

# Far above the rounding of the checker's own arithmetic, far below any gap.
ROUNDING = 1e-9

# A norm is not proven any closer than this to what samples of it suggest.
CLOSE = 3e-5

Cells = npt.NDArray[np.bool_]


class Core(NamedTuple):
    """Cells around an end, [column0, column1) x [row0, row1), where the chord counts."""

    column0: int
    column1: int
    row0: int
    row1: int


@total_ordering
@dataclass(frozen=True, eq=False)
class Certificate:
    """A lower bound on the length of every path, with all that is needed to check it.

    value : the bound, map units. norm : M, proven of the dual norm of du on all cells that
    matter. horizon : W; cells matter from which the goal could be reached before u / M
    is W / M. coefficients : (ny + 2, nx + 2), of the bicubic B-spline u on the cells of a
    lattice over ``bounds``. start_core, goal_core : the cells around the ends, where the chord
    takes the place of u. Outside ``bounds`` every path is long enough on the plane already.
    fingerprint : of the problem that it speaks of.
    A certificate compares with numbers as its value.
    """

    value: float
    norm: float
    coefficients: Array
    bounds: Bounds
    horizon: float
    start_core: Core
    goal_core: Core
    fingerprint: str

    def __float__(self) -> float:
        return self.value

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, int | float) and self.value == other)

    def __lt__(self, other: Any) -> bool:
        return self.value < float(other)

    __hash__ = object.__hash__

    @cached_property
    def lattice(self) -> Lattice:
        """The lattice whose cells u is given on."""
        rows, columns = self.coefficients.shape
        return Lattice(self.bounds, columns - 2, rows - 2)

    def check(self, problem: Problem) -> float:
        """Prove the claim again from nothing but the problem; returns the bound, map units.

        Raises CertificateError, saying what does not hold.
        """
        if self.fingerprint != fingerprint(problem):
            raise CertificateError(
                f"the certificate speaks of problem {self.fingerprint[:12]}, this is "
                f"{fingerprint(problem)[:12]}: surface, weights, obstacles, start or goal differ"
            )
        if not (math.isfinite(self.value) and math.isfinite(self.norm) and self.norm > 0.0):
            raise CertificateError(f"value={self.value} and norm={self.norm} must be finite")
        found = cell_needs(problem, self, self.norm)
        norm = proven_norm(problem, self, found.proven, self.norm)
        if not norm <= self.norm * (1.0 + 1e-3 * ROUNDING):
            raise CertificateError(
                f"the dual norm is claimed to be at most {self.norm:.12g}, but no less than "
                f"{norm:.12g} can be proven"
            )
        proven = proven_value(problem, self, self.norm)
        if not self.value <= proven:
            raise CertificateError(
                f"the bound is claimed to be {self.value:.12g}, but no more than {proven:.12g} "
                "can be proven"
            )
        return self.value

    def save(self, path: str | FilePath) -> None:
        """Write the certificate into an .npz file, whole or not at all."""
        with written_whole(FilePath(path)) as temporary, temporary.open("wb") as file:
            np.savez_compressed(
                file,
                value=self.value,
                norm=self.norm,
                coefficients=self.coefficients,
                bounds=np.array(self.bounds),
                horizon=self.horizon,
                start_core=np.array(self.start_core),
                goal_core=np.array(self.goal_core),
                fingerprint=self.fingerprint,
            )

    @classmethod
    def load(cls, path: str | FilePath) -> Certificate:
        """Read what ``save`` wrote. Raises MapError where it is something else."""
        try:
            with np.load(FilePath(path), allow_pickle=False) as file:
                return cls(
                    value=float(file["value"]),
                    norm=float(file["norm"]),
                    coefficients=as_array(file["coefficients"], "coefficients", shape=(None, None)),
                    bounds=as_bounds(file["bounds"]),
                    horizon=float(file["horizon"]),
                    start_core=Core(*(int(k) for k in file["start_core"])),
                    goal_core=Core(*(int(k) for k in file["goal_core"])),
                    fingerprint=str(file["fingerprint"]),
                )
        except (OSError, ValueError, KeyError, TypeError, EOFError) as error:
            raise MapError(f"{path} is not a certificate: {error}") from None


def fingerprint(problem: Problem) -> str:
    """A hash of everything that a bound depends on."""
    digest = hashlib.sha256()
    for array in (
        *problem.surface.data,
        problem.bounds,
        problem.start,
        problem.goal,
        *problem.free_space.data,
    ):
        digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
        digest.update(b";")
    return digest.hexdigest()


def _bound(certificate: Certificate) -> kernels.Bound:
    lattice = certificate.lattice
    return kernels.Bound(
        certificate.coefficients,
        lattice.bounds.x1_min,
        lattice.bounds.x2_min,
        lattice.dx,
        lattice.dy,
    )


def _cutting(problem: Problem, lattice: Lattice) -> kernels.Cutting:
    """Room for the pieces that a cell is cut into at the surface's knots."""
    data: Any = problem.surface.data
    step = min(data.dx, data.dy) if hasattr(data, "dx") else math.inf
    return kernels.Cutting(
        np.empty(int(lattice.dx / step) + 4),
        np.empty(int(lattice.dy / step) + 4),
        np.empty((2 * len(data.weights), 11)),
        np.empty((3 * kernels.DEPTH + 1, 5)),
    )


def exempt_cells(problem: Problem, certificate: Certificate) -> Cells:
    """Cells (ny, nx) that no path meets between its start core and its goal core."""
    exempt = problem.free_space.covered_cells(certificate.lattice)
    for core in (certificate.start_core, certificate.goal_core):
        exempt[core.row0 : core.row1, core.column0 : core.column1] = True
    return exempt


class Needs(NamedTuple):
    """For each cell (ny, nx), the dual norm's bound M that it needs."""

    proven: Array  # enough, by proof
    likely: Array  # what nine points of the cell need
    slope: Array  # the dual norm of du at those points


def cell_needs(problem: Problem, certificate: Certificate, enough: float) -> Needs:
    """For each cell an M that is enough.

    In each cell the dual norm of du is at most M, or every path through it is long enough by
    the chord from there to the goal. Cells for which ``enough`` is proven are not looked at
    any closer.
    """
    _require_fit(problem, certificate)
    lattice = certificate.lattice
    found, likely, slope = np.empty((3, lattice.ny - 1, lattice.nx - 1))
    kernels.fill_needs(
        problem.surface.data,
        _bound(certificate),
        problem.surface.lift(np.asarray(problem.goal)),
        float(certificate.horizon),
        exempt_cells(problem, certificate),
        float(enough) / (1.0 + ROUNDING),
        _cutting(problem, lattice),
        found,
        likely,
        slope,
    )
    return Needs(found * (1.0 + ROUNDING), likely, slope)


def proven_norm(
    problem: Problem, certificate: Certificate, found: Array, enough: float = 0.0
) -> float:
    """The least M that is proven to be enough for all cells, or ``enough`` where that is more.

    found : what they need, proven; the largest are looked at closely.
    """
    norm = kernels.least_norm(
        problem.surface.data,
        _bound(certificate),
        problem.surface.lift(np.asarray(problem.goal)),
        float(certificate.horizon),
        np.argsort(found, axis=None)[::-1],
        found,
        float(enough) / (1.0 + ROUNDING),
        _cutting(problem, certificate.lattice),
    )
    return float(norm) * (1.0 + ROUNDING)


def _require_fit(problem: Problem, certificate: Certificate) -> None:
    """Raise CertificateError where the parts do not belong together."""
    if not problem.bounds.encloses(certificate.bounds):
        raise CertificateError(
            f"the certificate covers {certificate.bounds}, which is not within {problem.bounds}"
        )
    lattice = certificate.lattice
    for name, point in (("start", problem.start), ("goal", problem.goal)):
        core: Core = getattr(certificate, f"{name}_core")
        fits = (
            0 <= core.column0 < core.column1 < lattice.nx
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


def edge_margin(
    problem: Problem,
    certificate: Certificate,
    core: Core,
    anchor: tuple[float, float],
    factor: float,
) -> float:
    """At most chord(anchor, p) + factor u(p) for all p on the edge of a core, map units."""
    lattice = certificate.lattice
    return float(
        kernels.margin_of_core(
            problem.surface.data,
            _bound(certificate),
            problem.surface.lift(np.asarray(anchor)),
            float(factor),
            core.column0,
            core.column1,
            core.row0,
            core.row1,
            _cutting(problem, lattice),
        )
    )


def proven_value(problem: Problem, certificate: Certificate, norm: float) -> float:
    """The bound that follows where the dual norm is at most ``norm``, map units.

    Let a path leave the start core for the last time at p, and enter the goal core after
    that for the first time at q. It is at least chord(start, p) + (u(q) - u(p)) / M +
    chord(q, goal) long, or meets a cell from where it is at least (W - u(p)) / M to the goal.
    """
    straight = float(np.ravel(metric.chord(problem.surface, problem.start, problem.goal))[0])
    straight *= 1.0 - ROUNDING
    if _overlap(certificate.start_core, certificate.goal_core):
        return straight
    detour = least_detour(problem, certificate.bounds) * (1.0 - ROUNDING)
    first = edge_margin(problem, certificate, certificate.start_core, problem.start, -1.0 / norm)
    last = edge_margin(problem, certificate, certificate.goal_core, problem.goal, 1.0 / norm)
    rest = min(last, certificate.horizon / norm)
    return max(min(first + rest - ROUNDING * (abs(first) + abs(rest)), detour), straight)


def least_detour(problem: Problem, window: Bounds) -> float:
    """The least length of a path that leaves a window of the problem's bounds, map units.

    It is at least as long as the planar way by a side of the window: to the goal's mirror
    image there.
    """
    (x0, y0), (x1, y1) = problem.start, problem.goal
    outer, found = problem.bounds, math.inf
    for side, edge in ((window.x1_min, outer.x1_min), (window.x1_max, outer.x1_max)):
        if side != edge:
            found = min(found, math.hypot(x0 + x1 - 2.0 * side, y1 - y0))
    for side, edge in ((window.x2_min, outer.x2_min), (window.x2_max, outer.x2_max)):
        if side != edge:
            found = min(found, math.hypot(x1 - x0, y0 + y1 - 2.0 * side))
    return found


def certify(problem: Problem, proposal: Certificate, found: Needs) -> Certificate:
    """The proposal with the norm and the value that are proven; found : what its cells need."""
    enough = max(float(found.likely.max()) * (1.0 + CLOSE), float(np.finfo(np.float64).tiny))
    norm = proven_norm(problem, proposal, found.proven, enough)
    return replace(proposal, norm=norm, value=proven_value(problem, proposal, norm))
