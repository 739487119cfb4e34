"""Shared by tests of several packages: places of data, random numbers and points, messages."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

import terrapath as tp

ROOT = Path(__file__).parents[2]
# Maps of the Moon, beside a clone where somebody put them; who needs one skips without it.
REAL_MAPS = ROOT.parent / "shared" / "data"

FLAT = tp.Surface.from_peaks([np.empty((0, 4))])
REGION = (-1.0, -1.0, 11.0, 11.0)


def numbers(low, high):
    return st.floats(low, high, allow_subnormal=False)


def mostly_slow(parameters, quick=1):
    """Parameters of a test: the first few are tried always, the rest with the slow tests."""
    each = list(parameters)
    return each[:quick] + [pytest.param(one, marks=pytest.mark.slow) for one in each[quick:]]


def points_in(bounds, count, seed=0):
    """(count, 2): random points in a box, the same for the same seed."""
    return np.random.default_rng(seed).uniform(bounds[:2], bounds[2:], (count, 2))


def made_up(problem, points, **given):
    """A solution without a planner: the points are the path."""
    path = problem.path(points)
    about = {"planner": "made up", "status": tp.Status.SOLVED, "cost": path.length, "seconds": 0.0}
    return tp.Solution(problem=problem, path=path, **{**about, **given})


def fitted_order(sizes, errors):
    """The power of the sizes with which the errors fall."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def one_line(caught):
    """The message of an error, checked to be one line."""
    text = str(caught.value)
    assert text
    assert "\n" not in text
    return text
