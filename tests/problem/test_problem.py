"""Problems: what limits them, in whatever form it comes."""

import geopandas
import numpy as np
import pytest
import shapely

import terrapath as tp
from common import FLAT, REGION

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
