"""Certificates: claims about a certain problem, to be stored and checked again.

What is claimed, and how it is proven, is described in ``claims``. Here a claim gets the fingerprint
of its problem and a seal, and is written to a file.
"""

from __future__ import annotations

import hashlib
import numbers
from dataclasses import dataclass, fields, replace
from functools import total_ordering
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import numpy.typing as npt

from .._support.files import written_whole
from .._support.watching import MustStop, never
from ..errors import CertificateError, MapError
from ..problem import Problem
from ..surface.bounds import as_bounds
from ..validation import as_array, require_no_pipe
from .claims import Claim, Core, Needs, proven_claim, require_proven, require_sound


@total_ordering
@dataclass(frozen=True, eq=False)
class Certificate(Claim):
    """A lower bound on the length of every path, with all that is needed to check it.

    value : the bound, map units. norm, coefficients, bounds, horizon, start_core, goal_core : the
    proof of it, as described in ``claims.Claim``. fingerprint : a hash of the problem that it is
    about. seal : a hash of all other fields. A wrong seal shows that the certificate was altered;
    a claim that was wrong from the start has a right one.
    A certificate compares with numbers by its value.
    """

    fingerprint: str
    seal: str = ""

    def __float__(self) -> float:
        return self.value

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, numbers.Real | Certificate):
            return NotImplemented
        return self.value == float(other)

    def __lt__(self, other: Any) -> bool:
        return self.value < float(other)

    def __hash__(self) -> int:
        return hash(self.value)

    def check(self, problem: Problem) -> float:
        """Prove the claim again from the problem alone; returns the bound, map units.

        Raises CertificateError, which says what does not hold.
        """
        if self.fingerprint != fingerprint(problem):
            raise CertificateError(
                f"the certificate is about problem {self.fingerprint[:12]}, this is "
                f"{fingerprint(problem)[:12]}: surface, weights, obstacles, start or goal differ"
            )
        require_sound(self)
        if self.seal != seal_of(self):
            raise CertificateError(
                f"the certificate was altered after it was made: its seal is {self.seal[:12]!r}, "
                f"what it holds makes {seal_of(self)[:12]!r}"
            )
        require_proven(problem, self)
        return self.value

    def save(self, path: str | FilePath) -> None:
        """Write the certificate to an .npz file, completely or not at all.

        Raises MapError where the file cannot be written.
        """
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
                seal=self.seal,
            )

    @classmethod
    def load(cls, path: str | FilePath) -> Certificate:
        """Read what ``save`` wrote.

        Raises MapError for a file that is missing, or of another kind.
        """
        require_no_pipe(FilePath(path))
        try:
            # Opened here, because NumPy does not close a file that it cannot read.
            with FilePath(path).open("rb") as source, np.load(source, allow_pickle=False) as file:
                return cls(
                    value=float(file["value"]),
                    norm=float(file["norm"]),
                    coefficients=as_array(file["coefficients"], "coefficients", shape=(None, None)),
                    bounds=as_bounds(file["bounds"]),
                    horizon=float(file["horizon"]),
                    start_core=Core(*(int(k) for k in file["start_core"])),
                    goal_core=Core(*(int(k) for k in file["goal_core"])),
                    fingerprint=str(file["fingerprint"]),
                    seal=str(file["seal"]),
                )
        except FileNotFoundError:
            raise MapError(f"{path} does not exist; check the path") from None
        except Exception as error:  # for other files zip, zlib and NumPy raise errors of many kinds
            raise MapError(
                f"{path} is not a certificate, or is damaged: {_what_is_wrong(error)}; give a file "
                "that `plan --certificate` wrote"
            ) from None


def _what_is_wrong(error: Exception) -> str:
    """What of a file cannot be read. NumPy's advice to trust a file is none of ours."""
    reason = " ".join(str(error).split())
    if "pickle" in reason:
        return "it holds no plain arrays"
    return f"{reason:.200}" or type(error).__name__


def fingerprint(problem: Problem) -> str:
    """A hash of all that a lower bound depends on."""
    data = problem.surface.data
    ends = (problem.bounds, problem.start, problem.goal)
    parts = data._asdict()
    cells = parts.pop("cells", ()) if problem.surface.cost_cells is not None else ()
    parts.pop("cells", None)
    return _hash(type(data).__name__, *parts.values(), *cells, *ends, *problem.free_space.data)


def seal_of(certificate: Certificate) -> str:
    """A hash of all fields of a certificate except its seal."""
    return _hash(
        certificate.fingerprint,
        certificate.value,
        certificate.norm,
        certificate.horizon,
        certificate.bounds,
        certificate.start_core,
        certificate.goal_core,
        certificate.coefficients,
    )


def _hash(*parts: str | npt.ArrayLike) -> str:
    """SHA-256 of texts and arrays of numbers, their shapes included."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            digest.update(f"{len(part)};{part}".encode())
        else:
            digest.update(f"{np.shape(part)};".encode())
            digest.update(np.ascontiguousarray(part, dtype=np.float64).tobytes())
    return digest.hexdigest()


def certify(
    problem: Problem, proposal: Claim, found: Needs, must_stop: MustStop = never
) -> Certificate:
    """The certificate with the norm and the value that can be proven.

    proposal : whose norm and value are not proven yet. found : what the cells need. Where no norm
    can be proven, the length of the straight line in R^n is the bound. Where it must stop, the
    bound is what is proven so far.
    """
    proven = proven_claim(problem, proposal, found, must_stop)
    claimed = {field.name: getattr(proven, field.name) for field in fields(Claim)}
    made = Certificate(**claimed, fingerprint=fingerprint(problem))
    return replace(made, seal=seal_of(made))
