"""`terrapath check`: certificates that hold and files that do not."""

import numpy as np
import pytest

import terrapath as tp
from commands import FAST, refused
from terrapath.cli.main import run


@pytest.fixture(scope="module")
def proof(tmp_path_factory):
    path = tmp_path_factory.mktemp("proof") / "proof.npz"
    assert run(["plan", "one-peak", *FAST, "--goal", "9,8", "--certificate", str(path), "-q"]) == 0
    return path


def test_a_certificate_is_proven_again(proof, capsys):
    assert run(["check", "one-peak", str(proof), "--goal", "9,8"]) == 0
    table = capsys.readouterr().out
    assert f"{tp.Certificate.load(proof).value:.6f}" in table
    for word in ("holds", "lower bound", "dual norm", "cells", "seconds"):
        assert word in table


def with_member(proof, file, name, change):
    """A copy of a certificate with one member changed."""
    with np.load(proof) as archive:
        members = dict(archive)
    members[name] = change(members[name])
    np.savez(file, **members)


def nudged(array):
    changed = array.copy()
    changed.flat[array.size // 2] += 1e-3
    return changed


def test_what_does_not_hold_gives_one_clear_line(proof, tmp_path, capsys):
    bad_check = ["one-peak", str(proof), "--goal", "9,8"]
    refused(capsys, "check", ["one-peak", str(proof)], "surface, weights, obstacles, start or goal")
    refused(capsys, "check", [*bad_check, "--start", "1,1"], "start or goal differ")
    refused(capsys, "check", [*bad_check, "--weight", "height=2"], "weights")
    changed = tmp_path / "changed.npz"
    for name in ("value", "coefficients", "horizon"):
        with_member(proof, changed, name, nudged)
        refused(capsys, "check", ["one-peak", str(changed), "--goal", "9,8"])


def test_files_that_are_no_certificates_give_one_clear_line(proof, tmp_path, capsys):
    text, half, flipped = (tmp_path / name for name in ("text.npz", "half.npz", "flipped.npz"))
    text.write_text("a proof")
    whole = bytearray(proof.read_bytes())
    half.write_bytes(whole[: len(whole) // 2])
    whole[len(whole) // 2] ^= 255
    flipped.write_bytes(whole)
    np.savez(tmp_path / "other.npz", values=np.zeros(3))
    for name in ("text", "half", "flipped", "other"):
        path = str(tmp_path / f"{name}.npz")
        refused(capsys, "check", ["one-peak", path, "--goal", "9,8"], name, "not a certificate")
    refused(capsys, "check", ["one-peak", str(tmp_path), "--goal", "9,8"], "not a certificate")
    missing = str(tmp_path / "missing.npz")
    refused(capsys, "check", ["one-peak", missing, "--goal", "9,8"], "missing.npz does not exist")
    refused(capsys, "check", ["one-peak"], "CERTIFICATE")
