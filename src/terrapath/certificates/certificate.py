"""Certificates: claims that know which problem they speak of, to be kept and checked again.

What is claimed, and how that is proven, is in ``proofs``. Here a claim gets the fingerprint of its
problem, a seal, and a file.
"""

from __future__ import annotations

import hashlib
import numbers
from dataclasses import dataclass, fields, replace
from functools import total_ordering
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from .._support.files import written_whole
from ..errors import CertificateError, MapError
from ..problem import Problem
from ..surface.bounds import as_bounds
from ..validation import as_array
from .claims import Claim, Core, Needs, proven_claim, require_proven, require_sound


@total_ordering
@dataclass(frozen=True, eq=False)
class Certificate(Claim):
    """A lower bound on the length of every path, with all that is needed to check it.

    value : the bound, map units. norm, coefficients, bounds, horizon, start_core, goal_core : the
    claim's, which proves the bound; what they are is told by ``proofs.Claim``. fingerprint : of
    the problem that it speaks of. seal : a hash of all the others, so that what was altered by
    mistake is told from what is wrong.
    A certificate compares with numbers as its value.
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
        """Prove the claim again from nothing but the problem; returns the bound, map units.

        Raises CertificateError, saying what does not hold.
        """
        if self.fingerprint != fingerprint(problem):
            raise CertificateError(
                f"the certificate speaks of problem {self.fingerprint[:12]}, this is "
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
                seal=self.seal,
            )

    @classmethod
    def load(cls, path: str | FilePath) -> Certificate:
        """Read what ``save`` wrote. Raises MapError where there is nothing, or something else."""
        try:
            # Opened here, for NumPy leaves open what it cannot read.
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
        except Exception as error:  # of a foreign file, zip, zlib and NumPy raise whatever they do
            reason = " ".join(str(error).split()) or type(error).__name__
            raise MapError(f"{path} is not a certificate: {reason:.200}") from None


def fingerprint(problem: Problem) -> str:
    """A hash of everything that a bound depends on."""
    data = problem.surface.data
    ends = (problem.bounds, problem.start, problem.goal)
    return _hash(type(data).__name__, *data, *ends, *problem.free_space.data)


def seal_of(certificate: Certificate) -> str:
    """A hash of all that a certificate holds, but its seal."""
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


def _hash(*parts: Any) -> str:
    """SHA-256 of texts and arrays of numbers, their shapes included."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            digest.update(f"{len(part)};{part}".encode())
        else:
            digest.update(f"{np.shape(part)};".encode())
            digest.update(np.ascontiguousarray(part, dtype=np.float64).tobytes())
    return digest.hexdigest()


def certify(problem: Problem, proposal: Claim, found: Needs) -> Certificate:
    """The certificate of the norm and the value that are proven; found : what the cells need.

    Where no norm can be proven, the straight line's length in R^n is the bound.
    """
    proven = proven_claim(problem, proposal, found)
    claimed = {field.name: getattr(proven, field.name) for field in fields(Claim)}
    made = Certificate(**claimed, fingerprint=fingerprint(problem))
    return replace(made, seal=seal_of(made))
