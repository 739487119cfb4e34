"""Refinement of paths that graze obstacles, however near: they are pulled taut all the same."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import occupancy
import terrapath as tp
from common import FLAT
from terrapath.errors import UnfinishedWarning

BOUNDS = (0.0, 0.0, 20.0, 20.0)
DISTANCES = [10.0**-k for k in range(3, 16)]
PLACES = st.sampled_from([(0.0, 0.0, 1.0), (-3.0, 7.5, 0.5), (5e5, 4.2e6, 1.0), (5e5, 4.2e6, 0.1)])


def outwards(blocked, path):
    """(m - 2, 2): away from the blocked cell at each corner that a path bends round."""
    found = []
    for x, y in path[1:-1].astype(int):
        quarter = np.argwhere(blocked[y - 1 : y + 1, x - 1 : x + 1])[0]
        found.append(np.where(quarter[::-1] == 0, 1.0, -1.0))
    return np.array(found).reshape(-1, 2)


def with_more_points(points, random):
    """The same path with up to two more points on each segment."""
    parts = [points[:1]]
    for a, b in pairwise(points):
        shares = np.sort(random.uniform(size=random.integers(0, 3)))[:, None]
        parts += [a + shares * (b - a), b[None]]
    return np.concatenate(parts)


@given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(occupancy.KINDS),
    place=PLACES,
    distance=st.sampled_from(DISTANCES),
)
@settings(deadline=None, max_examples=60)
def test_a_path_that_passes_corners_at_any_distance_becomes_the_exact_one(
    seed, kind, place, distance
):
    random = np.random.default_rng(seed)
    *origin, size = place
    blocked = occupancy.grid_of(kind, random, int(random.integers(5, 12)))
    ends = occupancy.far_ends(blocked, random)
    best = None if ends is None else occupancy.shortest(blocked, *ends)
    if best is None:
        return
    exact = size * np.hypot(*np.diff(best, axis=0).T).sum()
    moved = best.copy()
    moved[1:-1] += distance * outwards(blocked, best) * (1.0, random.choice([1.0, 0.3]))
    points = with_more_points(origin + size * moved, random)
    bounds = (*origin, *(np.array(origin) + size * np.array(blocked.shape[::-1])))
    ground = shapely.union_all(occupancy.squares(blocked, origin, size))
    for obstacles in occupancy.obstacles_of(blocked, origin, size).values():
        problem = tp.Problem(FLAT, points[0], points[-1], bounds, obstacles)
        if problem.allows(points):  # free, and farther away than rounding
            refined = tp.refine(problem, points)
            assert refined.line.disjoint(ground)
            assert refined.length == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("distance", DISTANCES)
def test_a_path_along_a_wall_is_pulled_off_it(distance):
    wall = shapely.box(-1, 9.5, 6.5, 10.5)
    problem = tp.Problem(FLAT, (2, 2), (2, 18), BOUNDS, [wall])
    beside = 6.5 + distance
    below = 9.5 - distance
    points = np.array([(2, 2), (2, below), (beside, below), (beside, 11), (14, 14), (2, 18)])
    taut = 2.0 * math.hypot(4.5, 7.5) + 1.0
    refined = tp.refine(problem, points)
    assert refined.line.disjoint(wall)
    assert refined.length == pytest.approx(taut, rel=1e-6)


def test_a_path_over_a_corner_that_the_straight_line_misses_becomes_straight():
    wall = shapely.box(9.5, 87.5, 10.5, 96.5)
    points = np.array([(7.0, 99.0), (10.3, 96.7), (12.3, 94.7), (44.0, 84.0)])
    problem = tp.Problem(FLAT, points[0], points[-1], (0, 0, 100, 100), [wall])
    assert problem.allows(points)
    assert shapely.LineString(points).distance(wall) < 1e-14
    refined = tp.refine(problem, points)
    assert refined.length == pytest.approx(math.dist(points[0], points[-1]), rel=1e-9)


@pytest.mark.parametrize("distance", [1e-7, 1e-9, 1e-12, 0.0])
def test_ends_that_almost_touch_stay_and_the_path_between_is_taut(distance):
    wall = shapely.box(4, 2, 5, 8)
    start = (min(4.0 - distance, np.nextafter(4.0, 0.0)), 5.0)
    goal = (max(5.0 + distance, np.nextafter(5.0, 9.0)), 5.0)
    problem = tp.Problem(FLAT, start, goal, BOUNDS, [wall])
    refined = tp.refine(problem, [start, (3.0, 1.0), (6.0, 1.5), goal])
    assert (tuple(refined.points[0]), tuple(refined.points[-1])) == (start, goal)
    assert refined.line.disjoint(wall)
    assert refined.length == pytest.approx(7.0, rel=1e-6)


@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-10, 1e-12])
def test_where_walls_leave_no_room_refinement_says_so(gap):
    walls = [shapely.box(4, -1, 5, 5), shapely.box(4, 5 + gap, 5, 21)]
    problem = tp.Problem(FLAT, (1, 4), (9, 6), BOUNDS, walls)
    middle = 5 + 0.5 * gap
    points = np.array([(1, 4), (3.9, middle), (5.1, middle), (9, 6)])
    if gap > 5e-10:
        taut = 1.0 + math.hypot(3, 1) + math.hypot(4, 1)
        assert tp.refine(problem, points).length == pytest.approx(taut, rel=1e-6)
        return
    with pytest.warns(UnfinishedWarning, match="no room to pull it taut"):
        refined = tp.refine(problem, points)
    np.testing.assert_array_equal(refined.points, points)


def test_a_path_between_corners_that_it_meets_at_once_is_held_by_all():
    # The path is its own image, turned by half a circle: it meets both corners at the same time.
    blocked = np.ones((9, 9), bool)
    blocked[1, 1:8] = blocked[2, [1, 2, 3, 4, 5, 7]] = blocked[3, [1, 2, 3, 4, 5, 6, 7]] = False
    blocked[4, [1, 2, 3, 4, 5, 7]] = blocked[5, [1, 2, 3, 4, 5, 7]] = False
    corners = np.array([(7.5, 5.5), (7.0, 4.0), (6.0, 3.0), (5.5, 1.5)])
    exact = np.hypot(*np.diff(corners, axis=0).T).sum()
    moved = corners.copy()
    moved[1:-1] += 1e-5 * np.array([(1.0, -0.3), (-1.0, 0.3)])
    mask = occupancy.obstacles_of(blocked)["mask"]
    problem = tp.Problem(FLAT, corners[0], corners[-1], (0, 0, 9, 9), mask)
    assert tp.refine(problem, moved).length == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("distance", [1e-5, 1e-7, 1e-10])
@pytest.mark.parametrize("sides", [2, 16, 3000])
def test_a_path_that_touches_a_disc_almost_along_its_edge_becomes_tangents_and_an_arc(
    sides, distance
):
    radius, half = 3.0, 10.0
    problem = tp.Problem(FLAT, (0, 10), (20, 10), BOUNDS, [tp.Circle(10, 10, radius)])
    angles = np.pi * (1.0 - (np.arange(sides) + 0.5) / sides)
    reach = (radius + distance) / math.cos(0.5 * math.pi / sides)
    arc = half + reach * np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.concatenate([[problem.start], arc, [problem.goal]])
    turn = math.pi - 2.0 * math.acos(radius / half)
    exact = 2.0 * math.sqrt(half**2 - radius**2) + radius * turn
    refined = tp.refine(problem, points)
    assert problem.allows(refined)
    assert refined.length == pytest.approx(exact, rel=1e-6)
