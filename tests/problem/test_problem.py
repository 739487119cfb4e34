"""Problems: what limits them, in whatever form it comes."""

import geopandas
import numpy as np
import pytest
import shapely

import terrapath as tp
from common import FLAT, REGION, made_up

AREAS = [shapely.box(-1, -1, 6, 11), shapely.box(5, -1, 11, 11)]


@pytest.mark.parametrize("form", [list, tuple, np.array, geopandas.GeoSeries, shapely.union_all])
def test_an_area_to_keep_in_may_come_in_any_form(form):
    problem = tp.Problem(FLAT, (0, 0), (10, 10), REGION, keep_in=form(AREAS))
    assert tp.plan(problem, "fast-marching").status is tp.Status.SOLVED
    outside = form([shapely.box(-1, -1, 4, 11), shapely.box(3, -1, 5, 11)])
    with pytest.raises(tp.BlockedError, match="keep_in"):
        tp.Problem(FLAT, (0, 0), (10, 10), REGION, keep_in=outside)


def test_what_nothing_limits_has_all_of_its_bounds_and_says_so():
    problem = tp.Problem(FLAT, (0, 0), (10, 10), REGION, radius=2.0)
    assert not problem.free_space.has_obstacles
    assert problem.constraints.free_space().data._fields == problem.free_space.data._fields
    assert problem.constraints.radius == 2.0


@pytest.mark.parametrize("steepest", [30, 30.0, np.float64(30.0), np.int64(30)])
def test_a_slope_limit_may_be_any_number(steepest):
    assert tp.Problem(FLAT, (0, 0), (10, 10), REGION, max_slope=steepest).constraints.steep is None


@pytest.mark.parametrize("area", [(), []])
def test_no_area_to_keep_in_is_no_free_place(area):
    with pytest.raises(tp.InputError, match="keep_in is empty"):
        tp.Problem(FLAT, (0, 0), (10, 10), REGION, keep_in=area)


# Solutions hold paths that touch nothing


WALL = shapely.box(4, 2, 5, 8)


def solution_along(points, **more):
    problem = tp.Problem(FLAT, points[0], points[-1], (0, 0, 10, 10), [WALL])
    return made_up(problem, points, **more)


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0), (4, 8), (9, 9)],  # a point on a corner
        [(0, 0), (4, 1), (5, 2), (9, 9)],
        [(0, 5), (3, 7), (5, 9), (9, 9)],  # a segment through a corner
        [(0, 0), (4, 2), (4, 8), (9, 9)],  # along a side
    ],
)
def test_a_path_that_touches_by_rounding_is_led_round_the_place(points):
    solution = solution_along(points)
    assert solution.status is tp.Status.SOLVED
    assert solution.path.line.disjoint(WALL)
    assert solution.problem.allows(solution.path)
    assert solution.path.line.hausdorff_distance(shapely.LineString(points)) < 1e-6


def test_a_path_through_an_obstacle_is_not_returned():
    problem = tp.Problem(FLAT, (0, 5), (9, 5), (0, 0, 10, 10), [WALL])
    solution = solution_along([(0, 5), (9, 5)])
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.path is solution.cost is None
    assert "touches an obstacle" in solution.stopped_by
    free = problem.path([(0, 5), (4.5, 9), (9, 5)])
    kept = solution_along([(0, 5), (9, 5)], unrefined=free, alternatives=(free,))
    assert kept.path is kept.unrefined is kept.alternatives[0] is free
    assert kept.status is tp.Status.SOLVED


def test_a_path_that_the_problem_allows_is_the_one_that_was_given():
    points = [(0, 0), (3, 9), (9, 9)]
    solution = solution_along(points)
    np.testing.assert_array_equal(solution.path.points, points)
    assert not solution.problem.allows([(0, 0), (9, 9)])
    assert not solution.problem.allows([(0, 0), (3, 10.5), (9, 9)])  # beyond the bounds
