"""A few of the random maps of ``python -m tests.fuzz``, always the same ones.

No time is judged here. Faults that are known are marked, and the marks go when they are mended.
"""

import pytest

from trials import FIELD, PLANNERS, try_seed

QUICK = [FIELD, "optimal", "reversed", "rrt-star-r", "a-star 16 refined", "fast-marching refined"]


def faults_of(kind, seed, planners):
    words, faults, _ = try_seed(kind, seed, planners=planners, limit=60.0)
    return [(words, *fault) for fault in faults if fault.what != "time"]


def known(kind, seed):
    """A map on which a fault is known; it takes minutes: run it by ``python -m tests.fuzz``."""
    return pytest.param(kind, seed, marks=pytest.mark.xfail(run=False, reason="issue 14"))


@pytest.mark.parametrize(("kind", "seed"), [("grids", 0), ("grids", 1), ("pathological", 0)])
def test_a_map(kind, seed):
    assert faults_of(kind, seed, QUICK) == []


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [("rough", 1), ("grids", 3), known("rough", 2)])
def test_a_map_with_every_planner(kind, seed):
    assert faults_of(kind, seed, [FIELD, *PLANNERS]) == []
