"""Ground length, climb, descent and slopes, beside an independent judge that knows only the raster.

The judge is SciPy's spline through the same samples, sampled densely along the route; conversions
are literal numbers.
"""

import math

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

import terrapath as tp
from common import made_up
from terrapath.surface.georeference import Georeference

SURVEY_FOOT = 1200 / 3937
AXIS = np.linspace(0.0, 9000.0, 101)
X, Y = np.meshgrid(AXIS, AXIS)
HEIGHTS = 800 + 350 * np.sin(X / 700) * np.cos(Y / 900) + 60 * np.cos((X + 2 * Y) / 260)
SAND = 3 * np.sin(X / 500) + Y / 1000
COST = 1.5 + np.sin(X / 800) * np.cos(Y / 700)

# name: layers, their names, units, weights and kinds, the EPSG code; which layer is the height,
# and how many metres are one unit of it and of the plane.
CASES = {
    "metres": ([HEIGHTS], ["height"], ["m"], [1.0], None, 32632, (0, 1.0, 1.0)),
    "weighted": ([HEIGHTS], ["height"], ["m"], [10.0], None, 32632, (0, 1.0, 1.0)),
    "without weight": ([HEIGHTS], ["height"], ["m"], [0.0], None, 32632, (0, 1.0, 1.0)),
    "layers": ([HEIGHTS, SAND], ["height", "sand"], ["m", ""], [1.0, 200.0], None, 32632,
               (0, 1.0, 1.0)),
    "height comes second": ([SAND, HEIGHTS], ["sand", "Height"], ["", "m"], [50.0, 2.0], None,
                            32632, (1, 1.0, 1.0)),
    "costs": ([HEIGHTS, COST], ["height", "mud"], ["m", ""], [1.0, 2.0], ["rise", "cost"], 32632,
              (0, 1.0, 1.0)),
    "cost cells": ([HEIGHTS, COST], ["height", "mud"], ["m", ""], [2.0, 1.0], ["rise", "cells"],
                   32632, (0, 1.0, 1.0)),
    "feet over feet": ([HEIGHTS], ["height"], ["ft"], [1.0], None, 2274,
                       (0, SURVEY_FOOT, SURVEY_FOOT)),
    "metres over feet": ([HEIGHTS], ["height"], ["m"], [1.0], None, 2274, (0, 1.0, SURVEY_FOOT)),
    "feet over metres": ([HEIGHTS], ["height"], ["ft"], [1.0], None, 32632, (0, 0.3048, 1.0)),
    "no height": ([SAND], ["temperature"], ["K"], [100.0], None, 32632, (None, 0.0, 1.0)),
    "no CRS": ([HEIGHTS], ["height"], [""], [3.0], None, None, (0, 1.0, 1.0)),
}  # fmt: skip
PLAIN = {"metres", "feet over feet"}


def surface_of(case):
    layers, names, units, weights, kinds, code, _ = CASES[case]
    reference = None if code is None else Georeference.from_projected(f"EPSG:{code}")
    return tp.Surface.from_grid(
        np.stack(layers), AXIS, AXIS, names=names, units=units, weights=weights, kinds=kinds,
        georeference=reference,
    )  # fmt: skip


def wandering(seed, count=12):
    return np.random.default_rng(seed).uniform(900.0, 8100.0, (count, 2))


def judged(case, points):
    """Ground length, climb, descent, steepest and steepest side slope, metres."""
    height, height_metres, plane_metres = CASES[case][-1]
    values = np.zeros_like(X) if height is None else CASES[case][0][height] * height_metres
    metres = AXIS * plane_metres
    spline = RectBivariateSpline(metres, metres, values.T, s=0)
    lengths, rises, along, across = [], [], [], []
    for a, b in zip(points[:-1] * plane_metres, points[1:] * plane_metres, strict=True):
        walk = a + np.linspace(0.0, 1.0, 20001)[:, None] * (b - a)
        z = spline.ev(*walk.T)
        lengths.append(np.linalg.norm(np.diff(np.column_stack([walk, z]), axis=0), axis=1).sum())
        rises.append(np.diff(z))
        (ux, uy), gx, gy = (
            (b - a) / math.dist(a, b),
            *(spline.ev(*walk.T, dx=dx, dy=1 - dx) for dx in (1, 0)),
        )
        along.append(np.abs(ux * gx + uy * gy).max())
        across.append(np.abs(uy * gx - ux * gy).max())
    rise = np.concatenate(rises)
    return sum(lengths), rise[rise > 0].sum(), -rise[rise < 0].sum(), max(along), max(across)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_numbers_on_the_ground_are_those_of_the_raster_whatever_is_minimised(case, seed):
    points = wandering(seed)
    path = tp.Path(surface_of(case), points)
    found = path.ground_length, path.climb, path.descent, path.steepest, path.steepest_side
    expected = judged(case, points)
    assert path.ground_unit == ("" if case == "no CRS" else "m")
    np.testing.assert_allclose(found, expected, rtol=3e-5, atol=1e-9)
    profile = path.profile
    assert profile.distance[-1] == pytest.approx(path.ground_length, rel=1e-9)
    assert profile.value[-1] == pytest.approx(path.length, rel=1e-9)
    assert profile.points[profile.corners].tolist() == points.tolist()


@pytest.mark.parametrize("case", CASES)
def test_a_value_has_a_unit_of_its_own_where_it_is_no_length_on_the_ground(case):
    surface, points = surface_of(case), wandering(3)
    problem = tp.Problem(surface, points[0], points[-1])
    path = problem.path(points)
    solution = made_up(problem, points, lower_bound=0.5 * path.length)
    plain = surface.unit or "units"
    assert solution.unit == (surface.unit if case in PLAIN else f"weighted {plain}")
    assert solution.value == solution.length == tp.curve_length(surface, points)
    verb = "is shorter" if case in PLAIN else "costs less"
    assert solution.bound_in_words == f"no path {verb}"
    assert solution.gap_in_words.startswith("100 %, which proves little: the best path may")
    assert "50 %" in solution.gap_in_words
    if case == "metres":
        assert path.ground_length == path.length
    if case == "feet over feet":
        assert path.ground_length == pytest.approx(SURVEY_FOOT * path.length, rel=1e-12)


def test_a_small_gap_is_a_number_and_a_bound_of_zero_proves_nothing():
    surface, points = surface_of("metres"), wandering(4)
    problem = tp.Problem(surface, points[0], points[-1])
    words = {}
    for share in (1.0, 1 / 1.05, 0.0):
        lower_bound = share * problem.path(points).length
        words[share] = made_up(problem, points, lower_bound=lower_bound).gap_in_words
    assert words[1.0] == "0 %"
    assert words[1 / 1.05] == "5 %"
    assert "nothing is proven" in words[0.0]


def test_flat_ground_has_no_climb_and_a_tilted_plane_its_slope():
    axis = np.linspace(0.0, 100.0, 11)
    flat = tp.Path(
        tp.Surface.from_grid(np.zeros((11, 11)), axis, axis), np.array([(1, 2), (9, 50)])
    )
    assert (flat.climb, flat.descent, flat.steepest, flat.steepest_side) == (0, 0, 0, 0)
    assert flat.ground_length == pytest.approx(math.hypot(8, 48))
    heights = np.tile(0.5 * axis, (11, 1))
    tilted = tp.Surface.from_grid(heights, axis, axis, weights=[7.0])
    east = tp.Path(tilted, np.array([(10.0, 50.0), (90.0, 50.0), (90.0, 20.0), (50.0, 20.0)]))
    assert east.climb == pytest.approx(40.0)
    assert east.descent == pytest.approx(20.0)
    assert east.steepest == pytest.approx(0.5)
    assert east.steepest_side == pytest.approx(0.5)
    assert east.ground_length == pytest.approx(120.0 * math.hypot(1, 0.5) + 30.0)
    still = tp.Path(tilted, np.array([(10.0, 50.0), (10.0, 50.0)]))
    assert (still.ground_length, still.climb, still.steepest) == (0, 0, 0)


def test_a_path_is_tested_once_whatever_else_of_a_solution_changes(monkeypatch):
    from dataclasses import replace

    problem = tp.scenes.load("one-peak")
    tested = []
    allows = tp.Problem.allows
    monkeypatch.setattr(tp.Problem, "allows", lambda self, p: tested.append(p) or allows(self, p))
    solution = made_up(problem, [problem.start, (2, 8), problem.goal])
    path = solution.path
    for seconds in range(5):
        solution = replace(solution, seconds=float(seconds))
    assert tested == [path]
    other = tp.Problem(problem.surface, problem.start, problem.goal, problem.bounds,
                       [tp.Circle(2, 8, 0.1)])  # fmt: skip
    assert replace(solution, problem=other).path is not path
