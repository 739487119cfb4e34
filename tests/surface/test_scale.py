"""How true to scale a projection is: against PROJ's own factors, and where those go wrong."""

import numpy as np
import pytest
from pyproj import CRS, Proj

from terrapath.surface.georeference import transformer, worst_scale

# Projections with a place and half a side, metres: on Earth and the Moon, at a pole, in feet.
REGIONS = {
    "EPSG:32633": (500_000, 4_000_000, 50_000),
    "EPSG:3413": (0, 0, 100_000),
    "EPSG:6933": (0, 0, 1_000_000),
    "EPSG:2274": (2_500_000, 700_000, 100_000),
    "+proj=eqc +lat_ts=27.5 +lon_0=-53 +R=1737400 +units=m": (0, 800_000, 10_000),
}


def points(x, y, side):
    across, up = np.meshgrid(np.linspace(-side, side, 5), np.linspace(-side, side, 5))
    return x + across.ravel(), y + up.ravel()


@pytest.mark.parametrize("name", REGIONS)
def test_the_scale_is_that_of_proj(name):
    crs = CRS(name)
    x, y = points(*REGIONS[name])
    lonlat = transformer(crs, crs.geodetic_crs).transform(x, y)
    factors = Proj(crs).get_factors(*lonlat)
    scales = np.concatenate([factors.tissot_semimajor, factors.tissot_semiminor])
    expected = np.abs(scales - 1.0).max()
    assert worst_scale(crs, x, y) == pytest.approx(expected, rel=1e-4, abs=1e-7)


def test_angles_in_grads_are_no_degrees():
    # Lambert II is true to scale along 52 grads, and within 1.3e-4 of it 100 km around.
    assert worst_scale(CRS("EPSG:27572"), *points(600_000, 2_200_000, 100_000)) < 2e-4


@pytest.mark.parametrize(
    ("name", "side"),
    [("+proj=ortho +lat_0=40 +lon_0=10 +R=6370997", 6.3e6), ("+proj=sinu +R=6371007", 1.9e7)],
)
def test_where_a_projection_does_not_reach_its_scale_is_infinite(name, side):
    assert worst_scale(CRS(name), *points(0, 0, side)) == np.inf
