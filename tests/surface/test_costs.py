"""Cost layers: lengths multiplied by c(x) > 0."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar

import terrapath as tp
from terrapath.distance.eikonal import near_distance
from terrapath.errors import CertificateError, InputError
from terrapath.geodesics import refinement
from terrapath.geodesics.rays import (
    christoffel_symbols,
    gaussian_curvature,
    geodesic_acceleration,
    trace_ray,
)
from terrapath.problem import Path
from terrapath.surface import metric

SIDE = 4.0


def random_surface(random, count=41, costs=1, sharp=False, strength=0.6):
    """Ground with two layers under costs."""
    axis = np.linspace(0.0, SIDE, count)
    x, y = np.meshgrid(axis, axis)
    waves = []
    for _ in range(2 + costs):
        a, b, p, q = random.normal(size=4)
        waves.append(np.sin(a * x + b * y + p) * np.cos(b * x - a * y + q))
    cost = np.exp(strength * np.array(waves[2:]))
    if sharp:
        cost = np.where(np.array(waves[2:]) > 0.3, 4.0, 1.0)
    kinds = ["rise"] * 2 + ["cost"] * costs
    return tp.Surface.from_grid(np.concatenate([waves[:2], cost]), axis, axis, kinds=kinds)


def half_plane(count=161):
    """Flat ground with the cost 1 / y, on which distances are hyperbolic."""
    x, y = np.linspace(-2.0, 2.0, count), np.linspace(0.5, 4.5, count)
    cost = 1.0 / np.meshgrid(x, y)[1]
    return tp.Surface.from_grid([np.zeros_like(cost), cost], x, y, kinds=["rise", "cost"])


def hyperbolic(a, b):
    a, b = np.asarray(a), np.asarray(b)
    return np.arccosh(1.0 + np.square(b - a).sum(-1) / (2.0 * a[..., 1] * b[..., 1]))


HALF_PLANE = half_plane()
HALF_PLANE_PROBLEM = tp.Problem(HALF_PLANE, (-1.5, 1.0), (1.5, 1.0))
TRUE_LENGTH = float(hyperbolic((-1.5, 1.0), (1.5, 1.0)))


# The surface


def test_costs_are_as_given_at_the_samples_of_smooth_ground():
    axis = np.linspace(0.0, SIDE, 81)
    x, y = np.meshgrid(axis, axis)
    cost = np.exp(0.3 * x - 0.2 * y)  # nowhere extreme but at the edge
    surface = tp.Surface.from_grid([0.0 * x, cost], axis, axis, kinds=["rise", "cost"])
    points = np.random.default_rng(0).uniform(0.2, SIDE - 0.2, (200, 2))
    expected = np.exp(0.3 * points[:, 0] - 0.2 * points[:, 1])
    np.testing.assert_allclose(surface.cost(points), expected, rtol=1e-12)
    np.testing.assert_allclose(surface.cost_values(points)[:, 0], expected, rtol=1e-12)
    assert [layer.kind for layer in (*surface.layers, *surface.costs)] == ["rise", "cost"]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_a_cost_is_nowhere_beyond_the_samples_around(seed):
    random = np.random.default_rng(seed)
    axis = np.arange(9.0)
    cost = random.choice([0.5, 1.0, 20.0], (9, 9))
    surface = tp.Surface.from_grid([0.0 * cost, cost], axis, axis, kinds=["rise", "cost"])
    found = surface.cost(random.uniform(0.0, 8.0, (2000, 2)))
    assert found.min() >= 0.5 * (1.0 - 1e-12)
    assert found.max() <= 20.0 * (1.0 + 1e-12)
    assert surface.least_cost <= found.min()


steps = st.lists(st.floats(1.0, 4.0), min_size=4, max_size=9)


@settings(max_examples=40, deadline=None)
@given(steps, steps, st.integers(0, 10**6))
def test_on_unequal_steps_a_cost_stays_within_the_samples(across, up, seed):
    x, y = (np.cumsum([0.0, *sizes]) for sizes in (across, up))
    random = np.random.default_rng(seed)
    cost = 10.0 ** random.choice([-3.0, 0.0, random.uniform(-3.0, 3.0)], (len(y), len(x)))
    surface = tp.Surface.from_grid([0.0 * cost, cost], x, y, kinds=["rise", "cost"])
    found = surface.cost(random.uniform((0.0, 0.0), (x[-1], y[-1]), (2000, 2)))
    assert found.min() >= cost.min() * (1.0 - 1e-12)
    assert found.max() <= cost.max() * (1.0 + 1e-12)
    assert cost.min() * (1.0 - 1e-12) <= surface.least_cost <= found.min() * (1.0 + 1e-12)


def test_weights_of_costs_are_exponents_and_costs_multiply():
    surface = random_surface(np.random.default_rng(1), costs=2)
    points = np.random.default_rng(2).uniform(0.0, SIDE, (50, 2))
    single = surface.cost_values(points)
    np.testing.assert_allclose(surface.cost(points), single.prod(axis=1), rtol=1e-12)
    weighted = surface.with_weights({"x5": 2.0, "x6": 0.0})
    np.testing.assert_allclose(weighted.cost(points), single[:, 0] ** 2, rtol=1e-12)
    assert [layer.weight for layer in weighted.costs] == [2.0, 0.0]
    assert "cost x5 ^ 2" in repr(weighted)


@pytest.mark.parametrize("bad", [0.0, -1.0])
def test_a_cost_of_zero_or_less_is_named_with_its_place(bad):
    cost = np.ones((5, 6))
    cost[3, 2] = bad
    with pytest.raises(InputError, match=rf"cost 'mud' is {bad:g} at x1=2, x2=3 .*above 0"):
        tp.Surface.from_grid(
            [0.0 * cost, cost], range(6), range(5), names=["z", "mud"], kinds=["rise", "cost"]
        )


def test_a_surface_needs_ground_below_its_costs():
    with pytest.raises(InputError, match="all layers are of the kind 'cost'"):
        tp.Surface.from_grid([np.ones((5, 5))], range(5), range(5), kinds=["cost"])
    with pytest.raises(InputError, match=r"the kind of height='fall' .* rise, cost"):
        tp.Surface.from_grid([np.ones((5, 5))], range(5), range(5), kinds=["fall"])


# The metric


def test_lengths_are_integrals_of_the_cost():
    surface = random_surface(np.random.default_rng(3), sharp=True)
    a, b = np.array([0.3, 0.5]), np.array([3.6, 2.9])

    def speed(t):
        p, v = a + t * (b - a), b - a
        rises = surface.gradients(p) @ v * surface.data.weights
        return surface.cost(p) * math.sqrt(v @ v + rises @ rises)

    knots = np.linspace(0.0, 1.0, 200)
    expected = sum(quad(speed, low, high, epsabs=1e-12)[0] for low, high in pairwise(knots))
    assert metric.curve_length(surface, [a, b]) == pytest.approx(expected, rel=1e-9)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_the_chord_is_never_above_a_length(seed):
    random = np.random.default_rng(seed)
    surface = random_surface(random, sharp=seed % 2 == 0)
    a, b = random.uniform(0.0, SIDE, (2, 40, 2))
    assert (metric.chord(surface, a, b) <= metric.segment_lengths(surface, a, b)).all()


def test_christoffel_symbols_are_those_of_the_metric():
    surface = random_surface(np.random.default_rng(4), costs=2)
    points = np.random.default_rng(5).uniform(0.5, SIDE - 0.5, (40, 2))
    h = metric.metric_tensor(surface, points)
    step = 1e-5
    slopes = np.stack(
        [
            (
                metric.metric_tensor(surface, points + step * e)
                - metric.metric_tensor(surface, points - step * e)
            )
            / (2.0 * step)
            for e in np.eye(2)
        ],
        axis=1,
    )  # (m, l, i, j): d_l h_ij
    lowered = 0.5 * (
        np.einsum("mijl->mlij", slopes) + np.einsum("mjil->mlij", slopes) - slopes
    )  # (m, l, i, j)
    expected = np.einsum("mkl,mlij->mkij", np.linalg.inv(h), lowered)
    found = christoffel_symbols(surface, points)
    np.testing.assert_allclose(found, expected, atol=2e-6 * np.abs(expected).max())
    v = np.random.default_rng(6).normal(size=(40, 2))
    np.testing.assert_allclose(
        geodesic_acceleration(surface, points, v), -np.einsum("mkij,mi,mj->mk", found, v, v)
    )


def test_the_half_plane_has_curvature_minus_one_and_its_rays_the_right_jacobi_field():
    points = np.random.default_rng(7).uniform((-1.5, 1.0), (1.5, 4.0), (50, 2))
    np.testing.assert_allclose(gaussian_curvature(HALF_PLANE, points), -1.0, atol=2e-3)
    ray = trace_ray(HALF_PLANE, (-1.5, 1.0), 0.9, 2.0)
    assert hyperbolic((-1.5, 1.0), ray.points[-1]) == pytest.approx(2.0, rel=1e-7)
    assert ray.jacobi[-1] == pytest.approx(math.sinh(2.0), rel=1e-5)


def test_rays_follow_the_geodesic_equation_of_the_metric():
    surface = random_surface(np.random.default_rng(8))
    ray = trace_ray(surface, (1.0, 1.0), 0.7, 1.5)

    def slope(_, s):
        return [*s[2:], *geodesic_acceleration(surface, s[:2], s[2:])]

    begin = [*ray.points[0], *ray.velocities[0]]
    end = solve_ivp(slope, (0.0, 1.5), begin, rtol=1e-11, atol=1e-12).y[:2, -1]
    np.testing.assert_allclose(ray.points[-1], end, atol=1e-7)


def test_distances_nearby_are_of_fourth_order():
    source = np.array([0.3, 1.2])
    directions = np.random.default_rng(9).normal(size=(20, 2))
    directions /= np.hypot(*directions.T)[:, None]
    errors = []
    for size in (0.4, 0.2, 0.1):
        points = source + size * directions
        found = near_distance(HALF_PLANE, tuple(source), points)
        errors.append(np.abs(found / hyperbolic(source, points) - 1.0).max())
    assert errors[-1] < 1.1e-6  # 4.3e-7
    order = -np.polyfit(range(3), np.log2(errors), 1)[0]  # 4.42
    assert 3.7 <= order <= 4.8


# Planners


PLANNERS = ("rrt-star-r", "dijkstra", "a-star", "fast-marching", "optimal")


@pytest.mark.parametrize("name", PLANNERS)
def test_planners_find_the_hyperbolic_line(name):
    options = {"samples": 3000} if name.startswith("rrt") else {}
    raw = tp.plan(HALF_PLANE_PROBLEM, name, **options)
    assert TRUE_LENGTH * (1.0 - 1e-7) <= raw.length <= 1.02 * TRUE_LENGTH
    refined = tp.refine(HALF_PLANE_PROBLEM, raw.path)
    assert refined.length == pytest.approx(TRUE_LENGTH, rel=2e-7)


def test_the_distance_field_is_hyperbolic():
    field = tp.distance_field(HALF_PLANE, (-1.5, 1.0))
    points = np.random.default_rng(10).uniform((-2.0, 0.5), (2.0, 4.5), (400, 2))
    error = np.abs(field.at(points) / hyperbolic((-1.5, 1.0), points) - 1.0)
    assert error.mean() < 1e-3
    assert error.max() < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.01, 7.0])
def test_a_constant_cost_scales_every_length(factor):
    axis = np.linspace(0.0, SIDE, 33)
    ground = np.sin(axis)[:, None] * np.cos(1.3 * axis)
    plain = tp.Surface.from_grid(ground, axis, axis)
    costly = tp.Surface.from_grid(
        [ground, np.full_like(ground, factor)], axis, axis, kinds=["rise", "cost"]
    )
    obstacles = [shapely.box(1.5, 1.2, 2.0, 3.9)]
    for name in (*PLANNERS, "rrt-star"):
        options = {"samples": 800} if name.startswith("rrt") else {}
        one, other = (
            tp.plan(tp.Problem(s, (0.5, 2.0), (3.5, 2.2), obstacles=obstacles), name, **options)
            for s in (plain, costly)
        )
        scale = factor if name != "rrt-star" else other.length / one.length
        assert other.length == pytest.approx(factor * one.length, rel=1e-6), name
        np.testing.assert_allclose(other.cost, scale * one.cost, rtol=1e-6)
        bounds = [tp.lower_bound(s.problem, length=s.length) for s in (one, other)]
        assert float(bounds[1]) == pytest.approx(factor * float(bounds[0]), rel=1e-3)


def bumpy(cost, seed=0, count=40):
    """Waves under a cost, a number or a function of x."""
    axis = np.arange(float(count))
    waves = np.random.default_rng(seed).normal(size=(4, 4))
    x, y = np.meshgrid(axis, axis)
    ground = sum(np.sin(0.4 * (a * x + b * y) + p) * np.cos(0.4 * q * x) for a, b, p, q in waves)
    layers = [ground, cost(x) if callable(cost) else np.full_like(ground, cost)]
    return tp.Surface.from_grid(layers, axis, axis, kinds=["rise", "cost"])


@settings(max_examples=20, deadline=None)
@given(st.floats(-5.0, 4.0), st.integers(0, 10**6))
def test_a_constant_cost_scales_the_refined_length(exponent, seed):
    factor = 10.0**exponent
    random = np.random.default_rng(seed)
    points = np.column_stack([np.linspace(2.0, 37.0, 12), random.uniform(10.0, 30.0, 12)])
    one, other = (
        tp.refine(tp.Problem(bumpy(c, seed), points[0], points[-1]), points).length
        for c in (1.0, factor)
    )
    assert other == pytest.approx(factor * one, rel=1e-9)


def test_a_refined_path_is_as_exact_where_the_cost_is_least(monkeypatch):
    """Pieces are equally long under h, so those on cheap ground reach far."""
    surface = bumpy(lambda x: 0.1 * 10.0 ** (1.0 / (1.0 + np.exp(-(x - 20.0) / 2.0))))
    problem = tp.Problem(surface, (2.0, 20.0), (37.0, 14.0))
    path = tp.plan(problem, "fast-marching").path
    refined = tp.refine(problem, path, tolerance=1e-9)
    monkeypatch.setattr(refinement, "FEWEST_PIECES", 2048)
    finer = tp.refine(problem, path, tolerance=1e-9)
    assert refined.length == pytest.approx(finer.length, rel=1e-10)


@pytest.mark.parametrize("informed", [True, False])
def test_pruned_and_unpruned_trees_are_the_same(informed):
    surface = random_surface(np.random.default_rng(11), costs=2)
    problem = tp.Problem(surface, (0.4, 0.4), (3.5, 3.4), obstacles=[shapely.box(1, 2, 2, 3)])
    one, other = (
        tp.RRTStar(samples=1500, prune=prune, informed=informed).solve(problem)
        for prune in (True, False)
    )
    assert one.cost == other.cost
    np.testing.assert_array_equal(one.path.points, other.path.points)


@pytest.mark.parametrize("seed", range(6))
def test_refinement_ends_in_a_geodesic(seed):
    surface = random_surface(np.random.default_rng([12, seed]), count=81, strength=0.3)
    problem = tp.Problem(surface, (0.5, 0.6), (3.4, 3.3))
    path = tp.plan(problem, "fast-marching", refine=True).path
    along = path.points[1] - path.points[0]
    angle = math.atan2(along[1], along[0])

    def miss(turn):
        ray = trace_ray(surface, problem.start, angle + turn, path.length)
        return np.hypot(*(ray.points[-1] - problem.goal))

    # A ray that leaves as the path does and is as long ends where the path does.
    turns = np.linspace(-2e-3, 2e-3, 17)
    nearest = turns[np.argmin([miss(turn) for turn in turns])]
    bounds = (nearest - 2.5e-4, nearest + 2.5e-4)
    assert minimize_scalar(miss, bounds=bounds, options={"xatol": 1e-12}).fun < 1e-6


def test_a_taut_path_round_an_obstacle_is_no_longer_than_any_nearby():
    obstacle = shapely.Point(0.0, 2.0).buffer(0.8)
    problem = tp.Problem(HALF_PLANE, (-1.5, 1.0), (1.5, 1.0), obstacles=[obstacle])
    path = tp.plan(problem, "fast-marching", refine=True).path
    assert path.length > TRUE_LENGTH * 1.001
    assert problem.free_space.segments_are_free(path.points[:-1], path.points[1:]).all()
    random = np.random.default_rng(13)
    for _ in range(200):
        points = path.points.copy()
        points[1:-1] += random.normal(scale=10.0 ** random.uniform(-5, -2), size=(1, 2))
        if problem.free_space.segments_are_free(points[:-1], points[1:]).all():
            assert problem.path(points).length >= path.length * (1.0 - 1e-7)


# Certificates


@pytest.mark.parametrize("seed", range(18))
def test_no_bound_is_above_a_path(seed):
    random = np.random.default_rng([14, seed])
    surface = random_surface(random, costs=1 + seed % 2, sharp=seed % 3 == 0)
    start, goal = random.uniform(0.2, SIDE - 0.2, (2, 2))
    problem = tp.Problem(surface, start, goal)
    solution = tp.plan(problem, "fast-marching", refine=True, bound=True)
    shortest = min(solution.length, *(path.length for path in tp.alternatives(problem, 2)))
    assert solution.certificate.value <= shortest * (1.0 + 1e-9)
    assert solution.certificate.value >= metric.chord(surface, start, goal) * (1.0 - 1e-8)
    assert solution.certificate.check(problem) == solution.certificate.value


def test_the_bound_comes_close_and_another_cost_breaks_it():
    found = tp.lower_bound(HALF_PLANE_PROBLEM, length=TRUE_LENGTH * (1.0 + 1e-6), target_gap=0.01)
    assert 0.99 * TRUE_LENGTH <= float(found) <= TRUE_LENGTH * (1.0 + 1e-6)
    ends = HALF_PLANE_PROBLEM.start, HALF_PLANE_PROBLEM.goal
    cheaper = tp.Problem(HALF_PLANE.with_weights({"x4": 1.01}), *ends)
    with pytest.raises(CertificateError):
        found.check(cheaper)


@pytest.mark.parametrize(
    ("cost", "weight"), [(1e25, 1.0), (1e-19, 1.0), (100.0, 10.0), (1e-100, 1.0)]
)
def test_costs_beyond_single_precision_are_refused(cost, weight):
    axis = np.arange(5.0)
    values = np.stack([np.zeros((5, 5)), np.full((5, 5), cost)])
    with pytest.raises(tp.InputError, match="the costs, to their weights, reach from 1e"):
        tp.Surface.from_grid(
            values, axis, axis, kinds=["rise", "cost"], names=["h", "c"], weights=[1.0, weight]
        )


@pytest.mark.parametrize("cost", [1e-12, 1e12])
def test_costs_as_large_and_as_small_as_they_may_be_are_planned_on(cost):
    axis = np.arange(20.0)
    values = np.stack([np.zeros((20, 20)), np.full((20, 20), cost)])
    surface = tp.Surface.from_grid(values, axis, axis, kinds=["rise", "cost"], names=["h", "c"])
    problem = tp.Problem(surface, (3.0, 3.0), (15.0, 14.0))
    solution = tp.plan(problem, "fast-marching", refine=True, bound=True)
    truth = cost * math.dist(problem.start, problem.goal)
    assert solution.length == pytest.approx(truth, rel=1e-6)
    assert solution.certificate.check(problem) == pytest.approx(truth, rel=1e-6)


# What the layers contribute


def test_contributions_add_up_and_are_the_integrals():
    surface = random_surface(np.random.default_rng(15), costs=2)
    problem = tp.Problem(surface, (0.5, 0.5), (3.5, 3.5))
    path = problem.path([(0.5, 0.5), (3.5, 3.5)])
    shares = path.contributions
    assert list(shares) == ["plane", "height", "x4", "x5", "x6"]
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-12)
    plain = surface.with_weights({"x5": 0.0, "x6": 0.0})
    base = Path(plain, path.points).length
    costs = 1.0 - base / path.length
    assert shares["x5"] + shares["x6"] == pytest.approx(costs, abs=1e-3)
    flat = plain.with_weights({"height": 0.0, "x4": 0.0})
    assert Path(flat, path.points).contributions["plane"] == pytest.approx(1.0)
