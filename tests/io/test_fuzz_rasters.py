"""Damaged rasters: a surface, or one line, never anything else.

In a process of its own: a crash of GDAL is a failure here too, and what it prints is seen.
"""

import json
import subprocess
import sys

import pytest

import fuzz_rasters

pytestmark = pytest.mark.slow

MUTATIONS = 300  # of each file


def run(seed):
    done = subprocess.run(
        [sys.executable, fuzz_rasters.__file__, str(seed), str(MUTATIONS)],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout), done.stderr


@pytest.fixture(scope="module")
def outcome():
    return run(seed=0)


def test_damaged_rasters_give_a_surface_or_one_line(outcome):
    found, _ = outcome
    assert found["wrong"] == []
    assert found["count"] >= 2000


def test_damage_is_noticed_and_harmless_changes_are_not(outcome):
    found, _ = outcome
    for name, (read, refused) in found["by_file"].items():
        assert read > 0.02 * MUTATIONS, name
        assert refused > 0.05 * MUTATIONS, name


def test_nothing_is_printed(outcome):
    # The TIFF library prints this one itself, before GDAL is asked where to.
    _, printed = outcome
    assert [line for line in printed.splitlines() if not line.startswith("_tiff")] == []


def test_no_mutation_takes_long(outcome):
    # No timing of speed: a mutation that hangs would take minutes.
    found, _ = outcome
    assert found["slowest"] < 60.0
