"""What tests of certificates share."""

from __future__ import annotations

import pytest

from certificate_cases import certified, hills
from terrapath.problem import scenes


@pytest.fixture(scope="session")
def honest():
    """A certificate of the one-peak scene whose norm is within 1e-3 of 1."""
    problem = hills()
    length = scenes.SCENES["one-peak"].true_length
    made = certified(problem, 100, length * 1.02, repairs=2)
    assert made.norm < 1.001
    assert made.check(problem) == made.value
    return problem, made
