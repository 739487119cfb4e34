"""Certificates: who may check them, on disk, and as numbers."""

from __future__ import annotations

import ast
import math
import os
import pickle
import sys
import zipfile
from dataclasses import replace
from importlib.util import resolve_name
from pathlib import Path

import numpy as np
import pytest

import terrapath as tp
from certificate_cases import BOUNDS, certified
from common import FLAT, one_line
from processes import in_another_process
from terrapath._kernels.certificates import norms as kernels, potentials, surface_models, taylor
from terrapath.certificates import certificate, claims, sides
from terrapath.certificates.certificate import seal_of

# The checker is nobody's child


def imports_of(module):
    """Modules of this package that a source file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(Path(module.__file__).read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = resolve_name("." * node.level + (node.module or ""), module.__package__)
            inside = [f"{base}.{alias.name}" for alias in node.names]
            found.update(name if name in sys.modules else base for name in inside)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names]
            assert not any("terrapath" in name for name in [*names, getattr(node, "module", "")])
    return {name.removeprefix("terrapath.") for name in found}


SOLVERS = (
    "terrapath.certificates.search",
    "terrapath.distance",
    "terrapath.geodesics",
    "terrapath.planners",
    "terrapath._kernels.distance",
    "terrapath._kernels.geodesics",
    "terrapath._kernels.planners",
)


def solvers_loaded_with(module):
    loaded = in_another_process(f"import json, sys, {module}; print(json.dumps([*sys.modules]))")
    assert module in loaded
    return [name for name in loaded if f"{name}.".startswith(tuple(f"{s}." for s in SOLVERS))]


def test_the_checker_shares_nothing_with_the_solver():
    assert imports_of(certificate) == {
        "_support.files",
        "_support.watching",
        "certificates.claims",
        "errors",
        "problem",
        "surface.bounds",
        "validation",
    }
    assert imports_of(claims) == {
        "_kernels.certificates.margins",
        "_kernels.certificates.norms",
        "_kernels.certificates.potentials",
        "_kernels.surface.points",
        "_kernels.surface.surfaces",
        "_support.watching",
        "certificates.sides",
        "errors",
        "problem",
        "space.lattice",
        "surface.bounds",
        "surface.layers",
        "validation",
    }
    assert imports_of(sides) == {
        "_kernels.certificates.potentials",
        "_kernels.surface.cells",
        "_kernels.surface.surfaces",
        "errors",
        "space.free_space",
        "space.lattice",
        "surface.bounds",
        "validation",
    }
    own = {"_kernels.certificates.surface_models", "_kernels.certificates.taylor"}
    shared = {"_kernels.compiler", "_kernels.surface.surfaces"}
    assert imports_of(kernels) == own | shared | {"_kernels.certificates.potentials"}
    assert imports_of(potentials) == own | {"_kernels.compiler"}
    assert imports_of(surface_models) == {
        "_kernels.certificates.taylor",
        "_kernels.dispatch",
        "_kernels.surface.cells",
        *shared,
    }
    assert imports_of(taylor) == {"_kernels.compiler"}
    assert not solvers_loaded_with("terrapath.certificates.certificate")
    assert solvers_loaded_with("terrapath.certificates.search")


# Files


def test_a_certificate_survives_the_disk(honest, tmp_path):
    problem, made = honest
    made.save(tmp_path / "made.npz")
    found = tp.Certificate.load(tmp_path / "made.npz")
    assert found.check(problem) == made.value
    assert found.seal == made.seal
    np.testing.assert_array_equal(found.coefficients, made.coefficients)
    assert [p.name for p in tmp_path.iterdir()] == ["made.npz"]
    for field in ("norm", "bounds", "horizon", "start_core", "goal_core", "fingerprint"):
        assert getattr(found, field) == getattr(made, field)


def refused(path):
    with pytest.raises(tp.MapError) as caught:
        tp.Certificate.load(path)
    message = one_line(caught)
    assert message.startswith(f"{path} is not a certificate, or is damaged: ")
    assert message.endswith("; give a file that `plan --certificate` wrote")
    assert "pickle" not in message  # NumPy's advice to trust a file


@pytest.fixture(scope="module")
def small():
    """A certificate of a few kilobytes."""
    problem = tp.Problem(FLAT, (1.0, 1.0), (9.0, 8.0), BOUNDS)
    return problem, certified(problem, 8)


def test_files_cut_short_are_told_in_one_line(small, tmp_path):
    path = tmp_path / "cut.npz"
    small[1].save(path)
    whole = path.read_bytes()
    for size in sorted({0, 1, 2, 4, 30, 100, *range(0, len(whole) - 1, 97), len(whole) - 1}):
        path.write_bytes(whole[:size])
        refused(path)


def test_files_with_a_flipped_bit_are_not_believed(small, tmp_path):
    problem, made = small
    path = tmp_path / "flipped.npz"
    made.save(path)
    whole = path.read_bytes()
    random = np.random.default_rng(0)
    for place in random.integers(0, len(whole), 150).tolist():
        broken = bytearray(whole)
        broken[place] ^= 1 << int(random.integers(0, 8))
        path.write_bytes(broken)
        try:
            found = tp.Certificate.load(path)
        except tp.MapError as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        try:
            assert found.check(problem) == made.value
        except tp.CertificateError:
            continue
        # Bits that mean nothing: dates and the like in the archive's directory.
        assert seal_of(found) == made.seal


class Payload:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def test_foreign_files_are_told_in_one_line_and_never_run(small, tmp_path):
    _, made = small
    path, trap = tmp_path / "foreign.npz", tmp_path / "trap"
    path.write_text("value = 3\nnorm = 1\n")
    refused(path)
    np.savez(path, surprise=np.arange(3))
    refused(path)
    with path.open("wb") as file:
        np.save(file, np.arange(3.0))
    refused(path)
    path.write_bytes(pickle.dumps(Payload(trap)))
    refused(path)
    fields = {name: getattr(made, name) for name in ("value", "norm", "horizon", "fingerprint")}
    fields |= {"bounds": np.array(made.bounds), "start_core": np.array(made.start_core)}
    fields |= {"goal_core": np.array(made.goal_core), "seal": made.seal}
    fields |= {"coefficients": made.coefficients}
    np.savez(path, **fields)
    assert tp.Certificate.load(path).seal == made.seal
    for name, wrong in (
        ("value", np.array([Payload(trap)], object)),
        ("coefficients", np.array([[Payload(trap)]], object)),
        ("coefficients", np.zeros(3)),
        ("coefficients", np.full((9, 9), math.nan)),
        ("coefficients", np.array([["a", "b"]])),
        ("start_core", np.zeros(3)),
        ("start_core", np.full(4, math.nan)),
        ("goal_core", np.zeros((4, 4))),
        ("bounds", np.zeros(4)),
        ("bounds", np.zeros(3)),
        ("norm", np.zeros(2)),
        ("horizon", "far"),
    ):
        np.savez(path, **{**fields, name: wrong})
        refused(path)
    for name in fields:
        np.savez(path, **{key: value for key, value in fields.items() if key != name})
        refused(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("value.npy", b"\x93NUMPY\x01\x00not a header")
    refused(path)
    assert not trap.exists()
    with pytest.raises(tp.MapError, match=r"missing\.npz does not exist; check the path$"):
        tp.Certificate.load(tmp_path / "missing.npz")
    refused(tmp_path)


def test_a_certificate_cannot_be_saved_where_nothing_can_be(small, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises((tp.MapError, OSError)):
        small[1].save(tmp_path / "file" / "made.npz")


# Numbers


def test_a_certificate_compares_as_its_value(small):
    _, made = small
    twin = replace(made)
    assert made == twin
    assert made <= twin
    assert made >= twin
    assert hash(made) == hash(twin) == hash(made.value)
    assert made == made.value
    assert made == np.float64(made.value)
    assert made < made.value + 1.0
    assert made > 1
    assert made != "much"
    assert float(made) == made.value
    assert sorted([made, replace(made, value=1.0)])[0].value == 1.0
