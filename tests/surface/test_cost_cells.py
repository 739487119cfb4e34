"""Costs that are constant in each cell of a raster: values, lengths, planning."""

import math

import numpy as np
import pytest

import terrapath as tp
from cost_rasters import CELL, Walker, cell_surface, random_costs, random_heights
from terrapath.surface import metric


def random_map(seed, count=40, steep=0.0):
    random = np.random.default_rng(seed)
    costs, heights = random_costs(random, count), random_heights(random, count, steep)
    axis = CELL * np.arange(count)
    return cell_surface(costs, heights), Walker(costs, heights, axis, axis)


def test_a_cell_costs_what_the_raster_says():
    costs = np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]] * 2)
    surface = cell_surface(costs)
    inside = [(0.0, 0.0), (14.9, 5.1), (15.1, 14.9), (30.0, 30.0)]
    np.testing.assert_array_equal(surface.cost(inside), [1.0, 6.0, 7.0, 8.0])
    # On a side and at a corner the lowest cost counts.
    np.testing.assert_array_equal(surface.cost([(5.0, 0.0), (5.0, 5.0), (0.0, 15.0)]), [1, 1, 1])
    np.testing.assert_array_equal(surface.cost_values([(5.0, 0.0)]), [[1.0]])
    assert surface.least_cost == 1.0
    assert surface.typical_cost == pytest.approx(math.exp(np.log(costs).mean()))
    assert "in cells" in repr(surface)
    h = metric.metric_tensor(surface, (30.0, 0.0))
    np.testing.assert_allclose(h, 16.0 * np.eye(2), atol=1e-12)


def test_layers_multiply_and_weights_are_exponents():
    random, axis = np.random.default_rng(3), CELL * np.arange(6)
    mud, wind, snow = random.uniform(0.5, 3.0, (3, 6, 6))
    surface = tp.Surface.from_grid(
        [0.0 * mud, mud, wind, snow],
        axis,
        axis,
        kinds=["rise", "cells", "cost", "cells"],
        names=["height", "mud", "wind", "snow"],
        weights=[1.0, 1.0, 2.0, 0.5],
    )
    points = random.uniform(0.0, 50.0, (50, 2))
    values, weights = surface.cost_values(points), np.array([1.0, 2.0, 0.5])
    np.testing.assert_allclose(surface.cost(points), (values**weights).prod(axis=1))
    i, j = np.rint(points / CELL).astype(int).T
    np.testing.assert_array_equal(values[:, [0, 2]], np.stack([mud[j, i], snow[j, i]], axis=1))
    plain = surface.with_weights({"mud": 0.0, "wind": 0.0, "snow": 0.0})
    np.testing.assert_allclose(plain.cost(points), 1.0)
    assert surface.least_cost <= surface.cost(points).min()


def test_unequal_steps_take_the_nearest_sample():
    x = np.array([0.0, 10.0, 20.0, 40.0, 50.0])
    costs = np.tile([1.0, 2.0, 3.0, 4.0, 5.0], (5, 1))
    surface = tp.Surface.from_grid(
        [0.0 * costs, costs], x, 10.0 * np.arange(5), kinds=["rise", "cells"]
    )
    at = [(0.0, 5.0), (13.0, 7.0), (23.0, 0.0), (38.0, 0.0), (50.0, 40.0)]
    np.testing.assert_array_equal(surface.cost(at), [1.0, 2.0, 3.0, 4.0, 5.0])


@pytest.mark.parametrize(("seed", "steep"), [(0, 0.0), (1, 0.0), (2, 0.5), (3, 2.0)])
def test_lengths_are_those_over_the_cells(seed, steep):
    surface, walker = random_map(seed, steep=steep)
    random, top = np.random.default_rng(seed), CELL * 39
    a, b = random.uniform(0.0, top, (2, 60, 2))
    b[:20] = np.clip(a[:20] + random.normal(0.0, 3.0, (20, 2)), 0.0, top)
    b[20:25, 0] = a[20:25, 0]  # parallel to an axis
    a[25:30] = 5.0 + CELL * np.rint(a[25:30] / CELL - 0.5)  # from corner to corner
    b[25:30] = 5.0 + CELL * np.rint(b[25:30] / CELL - 0.5)
    a, b = np.clip(a, 0.0, top), np.clip(b, 0.0, top)
    found = metric.segment_lengths(surface, a, b)
    truth = [walker.segment(p, q) for p, q in zip(a, b, strict=True)]
    np.testing.assert_allclose(found, truth, rtol=1e-9)
    np.testing.assert_allclose(metric.segment_lengths(surface, b, a), found, rtol=1e-9)
    # Three points in each cell: exact on flat ground.
    np.testing.assert_allclose(metric.line_r(surface, a, b), found, rtol=1e-9 + 0.02 * steep)
    assert (found >= metric.chord(surface, a, b) * (1.0 - 1e-12)).all()


def test_along_a_side_the_lower_cost_counts():
    costs = np.ones((6, 6))
    costs[:, 3:] = 100.0
    surface = cell_surface(costs)
    along = metric.segment_lengths(surface, [(25.0, 10.0), (25.001, 10.0)], [(25.0, 40.0)] * 2)
    assert along[0] == pytest.approx(30.0, rel=1e-12)
    assert along[1] > 1000.0
    # Between two dear cells that meet cheap ones at a corner only, the corner is a passage.
    checkered = np.where((np.add.outer(np.arange(6), np.arange(6))) % 2 == 0, 1.0, 100.0)
    diagonal = metric.segment_lengths(cell_surface(checkered), (0.0, 0.0), (50.0, 50.0))
    assert diagonal == pytest.approx(50.0 * math.sqrt(2.0), rel=1e-6)


@pytest.mark.parametrize("planner", ["a-star", "fast-marching", "rrt-star-r"])
@pytest.mark.parametrize("steep", [0.0, 0.5])
def test_planners_take_each_cells_own_cost(planner, steep):
    surface, walker = random_map(7, steep=steep)
    problem = tp.Problem(surface, (30.0, 30.0), (370.0, 350.0))
    options = {"samples": 2000} if planner == "rrt-star-r" else {}
    solution = tp.plan(problem, planner, **options)
    assert solution.status is tp.Status.SOLVED
    assert solution.length == pytest.approx(walker.length(solution.path.points), rel=1e-9)
    # What the planner believes is near to what is true.
    assert solution.cost == pytest.approx(solution.length, rel=0.05)
    finest = tp.plan(problem, "a-star", neighbours=32, spacing=2.5)
    assert solution.length <= 1.06 * finest.length


def test_a_constant_cost_scales_a_field():
    ground = random_heights(np.random.default_rng(5), 30, 0.5)
    plain, dear = (cell_surface(np.full_like(ground, cost), ground) for cost in (1.0, 7.0))
    points = np.random.default_rng(6).uniform(0.0, 290.0, (100, 2))
    one, other = (tp.distance_field(s, (100.0, 120.0)).at(points) for s in (plain, dear))
    np.testing.assert_allclose(other, 7.0 * one, rtol=1e-6)
