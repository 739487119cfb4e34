"""Paths over lanes, and refinement on rough ground, before judges that share no code with it."""

from __future__ import annotations

import itertools
import math
import warnings

import numpy as np
import pytest

import judges
import terrapath as tp
from common import mostly_slow
from rough_maps import random_map
from terrapath._kernels.geodesics import lanes as kernels
from terrapath.errors import UnfinishedWarning
from terrapath.geodesics.refinement import lanes


def lanes_of(table):
    """Lanes with a table (m - 1, n, n), places unset."""
    points, count = len(table) + 1, table.shape[1]
    empty = np.empty((points, count))
    before = np.zeros((points, count), np.int64)
    return kernels.Lanes(np.empty((points, count, 2)), table, empty, before)


@pytest.mark.parametrize("seed", range(10))
def test_the_lanes_chosen_are_the_best_of_all(seed):
    random = np.random.default_rng(seed)
    table = random.uniform(1.0, 2.0, (4, 3, 3))
    table[random.random(table.shape) < 0.2] = math.inf
    table[:, 0, 0] = 1.9
    chosen = np.empty(5, np.int64)
    length = kernels.choose(lanes_of(table), chosen)
    inner = itertools.product(range(3), repeat=3)
    sums = {(0, *k, 0): sum(table[m, a, b] for m, (a, b) in pairs((0, *k, 0))) for k in inner}
    assert length == min(sums.values())
    assert sums[tuple(chosen.tolist())] == length


def pairs(lanes_chosen):
    return enumerate(itertools.pairwise(lanes_chosen))


def test_newtons_step_is_exact_where_lengths_are_quadratic():
    random, points = np.random.default_rng(0), 12
    roots = random.normal(size=(points - 1, 2, 2))
    forms = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(2)
    slopes = random.normal(size=(points - 1, 2))
    shares = np.array([0.0, 1.0, -1.0])
    pairs_of_shares = np.stack(np.meshgrid(shares, shares, indexing="ij"), axis=-1)
    table = np.einsum("ma,ija->mij", slopes, pairs_of_shares)
    table += 0.5 * np.einsum("ija,mab,ijb->mij", pairs_of_shares, forms, pairs_of_shares)
    hessian, slope = np.zeros((points, points)), np.zeros(points)
    for m in range(points - 1):
        hessian[m : m + 2, m : m + 2] += forms[m]
        slope[m : m + 2] += slopes[m]
    steps = np.empty(points)
    kernels.newton(table, np.empty((2, points)), steps)
    expected = -np.linalg.solve(hessian[1:-1, 1:-1], slope[1:-1])
    np.testing.assert_allclose(steps[1:-1], expected, rtol=1e-9)
    assert steps[0] == steps[-1] == 0.0


def turns(path, place):
    """By how much the direction from a place turns along a path, radians."""
    offsets = path - place
    angles = np.unwrap(np.arctan2(offsets[:, 1], offsets[:, 0]))
    return angles[-1] - angles[0]


@pytest.mark.parametrize("seed", range(20))
def test_it_is_seen_where_two_paths_pass_a_place_on_different_sides(seed):
    random = np.random.default_rng(seed)
    a, b = (np.vstack([(0, 0), random.uniform(0, 4, (5, 2)), (4, 4)]) for _ in range(2))
    places = random.uniform(0, 4, (30, 2))
    differently = [abs(turns(a, place) - turns(b, place)) > 1.0 for place in places]
    seen = [lanes.is_passed_otherwise(place[None], a, b) for place in places]
    assert seen == differently
    assert lanes.is_passed_otherwise(places, a, b) == any(differently)
    assert not lanes.is_passed_otherwise(places, a, a)


def refined(problem, path):
    """What refinement makes of a path, and what it says."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = tp.refine(problem, path)
    return found, [warning for warning in said if warning.category is UnfinishedWarning]


# Maps 7 and 38 have no path.
@pytest.mark.parametrize("seed", mostly_slow(sorted({*range(2, 44)} - {7, 38}), quick=4))
def test_on_rough_ground_a_path_becomes_shorter_and_stays_free(seed):
    made = random_map(seed)
    problem = made.problem()
    path = tp.Dijkstra(neighbours=16).solve(problem).path
    assert path is not None
    found, _ = refined(problem, path)
    ground = made.own_ground(problem.surface)
    assert judges.touches(made.walls(problem.constraints.steep), found.points) is None
    value = judges.value_of(ground, found.points)
    assert value == pytest.approx(found.length, rel=1e-8)
    assert value <= judges.value_of(ground, path.points) * (1.0 + 1e-12)


# What refinement of A*'s path gave on these maps before paths were shortened by true lengths, and
# what it has to give now.
@pytest.mark.parametrize(
    ("seed", "before", "now"), [(2, 5473.0, 4830.0), (4, 38707.5, 38683.0), (11, 43950.0, 36500.0)]
)
def test_the_roughest_maps_gain_what_is_there(seed, before, now):
    problem = random_map(seed).problem()
    found, _ = refined(problem, tp.AStar(neighbours=32).solve(problem).path)
    assert found.length < now < before


def noise(slope):
    heights = np.random.default_rng(1).standard_normal((30, 30))
    heights *= slope / np.sqrt((np.hypot(*np.gradient(heights)) ** 2).mean())
    surface = tp.Surface.from_grid(heights[None], np.arange(30.0), np.arange(30.0))
    return tp.Problem(surface, (2.0, 2.0), (27.0, 27.0))


@pytest.mark.parametrize("slope", [5.0, 25.0, 100.0])
def test_on_noise_much_is_gained_and_what_is_missing_is_said(slope):
    problem = noise(slope)
    field = tp.distance_field(problem.surface, problem.start)
    path = field.path_to(problem.goal)
    found, said = refined(problem, path)
    assert found.length < 0.9 * path.length
    assert bool(said) == (slope > 5.0)
    assert all("smooth the surface" in str(warning.message) for warning in said)


def test_it_is_deterministic():
    problem = random_map(2).problem()
    path = tp.AStar(neighbours=32).solve(problem).path
    first, second = (refined(problem, path)[0] for _ in range(2))
    assert np.array_equal(first.points, second.points)


def test_it_ends_at_once_where_it_must_stop():
    problem = random_map(2).problem()
    path = tp.AStar(neighbours=32).solve(problem).path
    found = tp.refine(problem, path, must_stop=lambda: True)
    assert found.length <= path.length
