"""What tests of geodesics share."""

from __future__ import annotations

import pytest

from geodesic_cases import cylinder, sphere_cap


@pytest.fixture(scope="session")
def cap():
    return sphere_cap()


@pytest.fixture(scope="session")
def tube():
    return cylinder()
