"""The search for bounds: how near they come, odd problems, bad input, the same bits."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import shapely

import terrapath as tp
from certificate_cases import BOUNDS, ROUNDING, SIDE, certified
from common import FLAT
from processes import in_another_process
from terrapath.certificates import certificate
from terrapath.certificates.certificate import seal_of
from terrapath.certificates.search import Search
from terrapath.problem import scenes
from terrapath.space.lattice import Lattice

# Gaps: not only true, but near


@pytest.mark.parametrize("name", [n for n, scene in scenes.SCENES.items() if scene.true_length])
def test_the_default_bounds_of_the_papers_scenes_are_within_a_hundredth(name):
    problem, truth = scenes.load(name), scenes.SCENES[name].true_length
    found = tp.lower_bound(problem, length=truth * (1.0 + 1e-7))
    assert found.check(problem) == found.value
    assert 0.99 * truth < found.value <= truth * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["one-peak", "four-peaks"])
def test_a_gap_of_a_thousandth_is_met_where_it_is_asked_for(name):
    problem, truth = scenes.load(name), scenes.SCENES[name].true_length
    seen = []
    found = tp.lower_bound(problem, length=truth * (1.0 + 1e-7), target_gap=1e-3, watch=seen.append)
    assert truth * (1.0 - 1e-3) <= found.value <= truth * (1.0 + 1e-9)
    assert found.check(problem) == found.value
    # What was seen on the way was worse, and true.
    assert all(other.value <= found.value for other in seen)


def test_bounds_come_nearer_on_finer_lattices():
    problem, truth = scenes.load("one-peak"), scenes.SCENES["one-peak"].true_length
    sides = np.array([30, 60, 120, 240])
    gaps = [truth / certified(problem, side, truth, repairs=2).value - 1.0 for side in sides]
    slope = np.polyfit(np.log(sides), np.log(gaps), 1)[0]
    assert -3.0 < slope < -1.0


def test_a_search_stops_when_told():
    problem = scenes.load("six-peaks")
    options = {"length": 17.02, "target_gap": 1e-9}
    first = tp.lower_bound(problem, length=17.02)
    assert tp.lower_bound(problem, watch=lambda _: True, **options).seal == first.seal


# Bad input

PEAK = tp.Surface.from_peaks([[(3.0, 0.5, 5.0, 5.0)]])


def check_odd(problem, longest=None, **options):
    """A bound is found without ado, is proven, and true; a path to compare it with may be given."""
    found = tp.lower_bound(problem, **options)
    assert found.check(problem) == found.value
    straight = float(tp.chord(problem.surface, problem.start, problem.goal))
    # Heights of 1e11 leave the thousandths open.
    height = float(np.abs(problem.surface.data[0]).max(initial=1.0))
    assert found.value >= straight * (1.0 - 1e-8) - 1e-13 * height
    if longest is None:
        longest = problem.straight_length
    assert found.value <= longest * (1.0 + ROUNDING)
    return found


def test_no_way_at_all_has_the_bound_0():
    for place in ((3.0, 3.0), (0.0, 0.0), (10.0, 4.0)):
        problem = tp.Problem(PEAK, place, place, BOUNDS)
        for options in ({}, {"length": 0.0}, {"target_gap": 1e-3}, {"length": math.inf}):
            assert check_odd(problem, 0.0, **options) == 0.0


@pytest.mark.parametrize("distance", 10.0 ** -np.arange(0.0, 17.0))
def test_ends_close_together(distance):
    for step in ((1.0, 0.0), (0.0, -1.0), (0.6, 0.8)):
        goal = tuple(4.0 + distance * np.array(step))
        problem = tp.Problem(PEAK, (4.0, 4.0), goal, BOUNDS)
        # Rounding alone makes lengths of less than 1e-12 on ground some units high uncertain.
        true = math.dist((4.0, 4.0), goal)
        for length in (None, problem.straight_length, math.inf):
            found = check_odd(problem, length=length)
            if distance < 1e-6:
                assert found.value >= true * (1.0 - 1e-7) - 1e-13


def test_strips_one_cell_wide():
    for width in (0.01, 1e-6, 1e-9):
        for k in range(2):
            bounds = [4.99, 4.99, 4.99 + width, 4.99 + width]
            start, goal = [4.99 + 0.5 * width] * 2, [4.99 + 0.5 * width] * 2
            bounds[k], bounds[k + 2], start[k], goal[k] = 0.0, SIDE, 0.0, SIDE
            problem = tp.Problem(PEAK, start, goal, bounds)
            found = check_odd(problem, length=problem.straight_length * 1.001)
            if width == 0.01:
                # There is but one way, over the peak.
                assert found.value > 0.95 * problem.straight_length
        flat = tp.Problem(FLAT, start, goal, bounds)
        assert check_odd(flat).value == pytest.approx(SIDE, rel=1e-8)


def mask_of(free, count=10, size=1.0):
    """All cells blocked but those named (row, column)."""
    blocked = np.ones((count, count), bool)
    for cell in free:
        blocked[cell] = False
    centres = (np.arange(count) + 0.5) * size
    return tp.Mask(blocked, centres, centres)


def test_all_free_space_in_one_cell():
    for bounds in (BOUNDS, (0.0, 0.0, 1000.0, 1000.0)):
        problem = tp.Problem(PEAK, (4.3, 4.5), (4.7, 4.6), bounds, [mask_of([(4, 4)])])
        check_odd(problem)
        check_odd(problem, length=1000.0)


@pytest.mark.parametrize(
    "obstacles",
    [
        [mask_of([(4, 4), (8, 8)])],
        [mask_of([(4, 4), (8, 8)]), shapely.box(0, 0, 4.2, 10)],
        [shapely.LineString([(6.0, -1.0), (6.0, 11.0)])],
        [shapely.box(0, 0, 8, 8) - shapely.box(4.4, 4.4, 4.6, 4.6)],
        [
            tp.Circle(6.5, 6.5, 1.0),
            shapely.LineString([(6.5, -1), (6.5, 6)]),
            shapely.box(6, 7, 7, 11),
        ],
    ],
)
def test_an_unreachable_goal_has_a_finite_bound_at_once(obstacles):
    problem = tp.Problem(PEAK, (4.5, 4.5), (8.7, 8.6), BOUNDS, obstacles)
    assert problem.is_unreachable
    for options in ({}, {"target_gap": 1e-6}, {"length": math.inf, "target_gap": 1e-6}):
        found = check_odd(problem, math.inf, **options)
        # A finer lattice is no use.
        assert max(found.lattice.nx, found.lattice.ny) <= 121


def test_ends_on_the_edge_and_in_the_corners():
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0), (10.0, 5.0), (3.3, 0.0)]
    for start, goal in itertools.permutations(corners, 2):
        check_odd(tp.Problem(PEAK, start, goal, BOUNDS))


STEEP = 0.5 * math.e  # falloff of a peak 100 high whose steepest slope is 100


@pytest.mark.parametrize("goal", [(9.0, 9.0), (9.0, 2.0), (5.0, 5.0), (5.3, 5.2)])
def test_slopes_of_a_hundred(goal):
    surface = tp.Surface.from_peaks([[(100.0, STEEP, 5.0, 5.0)]])
    slope = np.abs(surface.gradients(np.column_stack([np.linspace(5, 6, 999)] * 2)))
    assert np.hypot(*slope[:, 0].T).max() == pytest.approx(100.0, rel=1e-3)
    problem = tp.Problem(surface, (1.0, 1.0), goal, BOUNDS)
    path = tp.refine(problem, tp.RRTStar(samples=2_000).solve(problem).path)
    check_odd(problem, path.length, length=path.length)
    check_odd(problem, path.length)


def test_planes_of_slope_a_hundred():
    axis = np.linspace(0.0, SIDE, 7)
    for slope_x, slope_y in ((100.0, 0.0), (60.0, -80.0), (-100.0, 100.0)):
        surface = tp.Surface.from_grid(slope_x * axis + slope_y * axis[:, None], axis, axis)
        for goal in ((9.0, 9.0), (9.0, 1.0), (1.001, 9.0)):
            problem = tp.Problem(surface, (1.0, 1.0), goal)
            truth = problem.straight_length
            assert check_odd(problem, truth, length=truth).value == pytest.approx(truth, rel=1e-8)


@pytest.mark.parametrize(
    "peak",
    [(1.0, 1e12), (1e-100, 1e200), (1e-145, 1e307), (1e11, 0.5), (1e-300, 1e300), (1e5, 1e-9)],
)
def test_peaks_beyond_all_measure(peak):
    problem = tp.Problem(tp.Surface.from_peaks([[(*peak, 5.0, 5.0)]]), (1, 1), (9, 9), BOUNDS)
    check_odd(problem, math.inf)
    check_odd(problem, math.inf, length=20.0)


@pytest.mark.parametrize("on_spline", [False, True])
@pytest.mark.parametrize("size", [8.0, 1.0, 0.125])
def test_places_far_from_the_maps_origin(size, on_spline):
    # Northings of UTM, and features of metres down to centimetres; all numbers are dyadic, so
    # that the problem is the same there.
    def problem_of(offset):
        x, y = 2.0 * offset, offset
        surface = tp.Surface.from_peaks(
            [[(0.3 * size, 50.0 / size**2, x + size / 2, y + size / 2)]]
        )
        if on_spline:
            axis = np.linspace(0.0, size, 33)
            nodes = np.stack(np.meshgrid(x + axis, y + axis), axis=-1)
            values = 1000.0 + surface.values(nodes)[..., 0]
            surface = tp.Surface.from_grid(values, x + axis, y + axis)
        bounds = (x, y, x + size, y + size)
        ends = (x + size / 8, y + size / 8), (x + size * 0.875, y + size * 0.75)
        return tp.Problem(surface, *ends, bounds)

    offset = 2.0**22
    near, far = (problem_of(o) for o in (0.0, offset))
    lattice = Lattice.spanning(near.bounds, size / 40)
    here = Search(near, lattice, 2.0 * size).certify()
    moved = Lattice.spanning(far.bounds, size / 40)
    # The same function u over there proves the same, to nearly the last digit.
    there = replace(here, bounds=moved.bounds, fingerprint=certificate.fingerprint(far))
    there = replace(there, value=here.value * (1.0 - 1e-10), norm=here.norm * (1.0 + 1e-10))
    there = replace(there, seal=seal_of(there))
    assert there.check(far) == there.value
    check_odd(far)
    own = Search(far, moved, 2.0 * size).certify()
    assert own.check(far) == own.value == pytest.approx(here.value, rel=1e-3)
    too_low = replace(there, norm=0.9 * here.norm)
    with pytest.raises(tp.CertificateError, match="the dual norm"):
        replace(too_low, seal=seal_of(too_low)).check(far)


def test_a_height_far_from_zero_changes_nothing():
    random = np.random.default_rng(0)
    axis = np.linspace(0.0, SIDE, 12)
    values = 0.3 * random.normal(size=(12, 12))
    low, high = (
        tp.Problem(tp.Surface.from_grid(h + values, axis, axis), (1, 1), (9, 8))
        for h in (0.0, 2.0**20)
    )
    found = [certified(problem, 40, 14.0) for problem in (low, high)]
    assert found[1].check(high) == pytest.approx(found[0].value, rel=1e-7)


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-9, 1e6, 1e12])
def test_regions_of_any_size_have_the_same_bound(size):
    def problem_of(size):
        peaks = [[(0.3 * size, 50.0 / size**2, size / 2, size / 2)]]
        ends = (0.1 * size, 0.15 * size), (0.9 * size, 0.8 * size)
        return tp.Problem(tp.Surface.from_peaks(peaks), *ends, (0.0, 0.0, size, size))

    unit, scaled = (certified(problem_of(s), 30, 1.2 * s) for s in (1.0, size))
    assert scaled.value == pytest.approx(size * unit.value, rel=1e-6)
    check_odd(problem_of(size))


@pytest.mark.parametrize("length", [5e-324, 1e-300, 1e-9, 1.0, 8.0, 1e20, 1e300, math.inf])
@pytest.mark.parametrize("goal", [(9.0, 8.0), (1.0, 9.0), (9.0, 1.0)])
def test_a_wrong_belief_about_the_length_makes_no_wrong_bound(length, goal):
    problem = tp.Problem(PEAK, (1.0, 1.0), goal, BOUNDS)
    check_odd(problem, length=length)


@pytest.mark.parametrize("name", ["length", "target_gap", "time_limit"])
@pytest.mark.parametrize("value", [math.nan, -1.0, "far", True, -math.inf])
def test_arguments_without_sense_are_told_in_one_line(name, value):
    problem = tp.Problem(PEAK, (1.0, 1.0), (9.0, 8.0), BOUNDS)
    with pytest.raises(tp.InputError, match=re.escape(f"{name}=")) as caught:
        tp.lower_bound(problem, **{name: value})
    assert "\n" not in str(caught.value)


# Determinism

TINY = """
import json
import terrapath as tp
from terrapath.certificates.search import Search
from terrapath.space.lattice import Lattice
surface = tp.Surface.from_peaks([[(3.0, 0.5, 5.0, 5.0)], [(1.0, 0.2, 2.0, 7.0)]])
problem = tp.Problem(surface, (1.0, 1.0), (9.0, 8.0), (0.0, 0.0, 10.0, 10.0), [tp.Circle(5, 2, 1)])
made = Search(problem, Lattice.spanning(problem.bounds, 1.0), 16.0).certify()
assert made.check(problem) == made.value
print(json.dumps([made.value, made.norm, made.horizon, made.seal]))
"""


def test_the_same_problem_has_the_same_certificate_to_the_last_bit():
    first, second = (in_another_process(TINY) for _ in range(2))
    assert first == second
    problem = scenes.load("six-peaks")
    found = [tp.lower_bound(scenes.load("six-peaks"), length=17.1) for _ in range(2)]
    assert found[0].seal == found[1].seal
    assert found[0].check(problem) == found[1].value


def test_plain_python_proves_the_same():
    compiled, plain = (in_another_process(TINY, NUMBA_DISABLE_JIT=flag) for flag in ("0", "1"))
    np.testing.assert_allclose(plain[:3], compiled[:3], rtol=1e-12)
