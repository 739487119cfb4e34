"""Geodesics of h: Christoffel symbols, curvature, rays, their Jacobi fields, exact lengths."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import brentq

import terrapath as tp
from common import mostly_slow, numbers
from geodesic_cases import (
    ONE_PEAK,
    RADIUS,
    REGION,
    SIX_PEAKS,
    WIDE,
    angles,
    cylinder,
    flat,
    heading,
    layer_lists,
    many_layers,
    peaks_surface,
    planar_factor,
    point,
    seeds,
    sphere_cap,
    weight_lists,
)
from oracles import (
    geodesic_by_collocation,
    geodesic_by_hamilton,
    metric_of,
    peaks_jets,
    planar_speed,
)
from processes import in_another_process
from reruns import SHORT_RAYS, short_rays
from terrapath.geodesics import rays
from terrapath.geodesics.rays import (
    christoffel_symbols,
    closest_approach,
    exponential_map,
    gaussian_curvature,
    geodesic_acceleration,
    trace_ray,
)
from terrapath.problem import scenes
from terrapath.surface.bounds import Bounds

# The geodesic equation


@given(many_layers, weight_lists, seeds)
@settings(deadline=None, max_examples=60)
def test_the_acceleration_is_minus_gamma_of_the_velocity(layers, weights, seed):
    surface = peaks_surface(layers, weights)
    random = np.random.default_rng(seed)
    points, v = random.uniform(-1, 11, (3, 5, 2)), random.normal(size=(3, 5, 2))
    symbols = christoffel_symbols(surface, points)
    expected = -np.einsum("...kij,...i,...j->...k", symbols, v, v)
    found = geodesic_acceleration(surface, points, v)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(
        geodesic_acceleration(surface, points, -2.0 * v), 4.0 * found, rtol=1e-12, atol=1e-300
    )


@given(many_layers, weight_lists, point, angles)
@settings(deadline=None, max_examples=25)
def test_a_ray_is_the_solution_of_hamiltons_equations(layers, weights, start, angle):
    surface = peaks_surface(layers, weights)
    ray = trace_ray(surface, start, angle, 8.0, bounds=WIDE)
    expected = geodesic_by_hamilton(peaks_jets(layers, weights[: len(layers)]), start, angle, [8.0])
    # DOP853 is as exact as its own tolerance, times what the field makes of it.
    growth = 1.0 + np.abs(ray.jacobi).max()
    assert np.abs(ray.points[-1] - expected[-1]).max() <= 1e-9 * growth


@given(many_layers, weight_lists, point, angles)
@settings(deadline=None, max_examples=40)
def test_a_ray_starts_at_the_start_at_its_angle_and_its_length_is_kept(
    layers, weights, start, angle
):
    ray = trace_ray(peaks_surface(layers, weights), start, angle, 6.0, bounds=WIDE)
    np.testing.assert_array_equal(ray.points[0], start)
    direction = np.array([math.cos(angle), math.sin(angle)])
    np.testing.assert_allclose(ray.velocities[0] / np.hypot(*ray.velocities[0]), direction)
    assert (ray.angle, ray.length, ray.left_surface) == (angle, 6.0, False)
    assert ray.arc_length[0] == ray.jacobi[0] == 0.0
    assert (np.diff(ray.arc_length) > 0.0).all()


# Unit speed, and the edge


@pytest.mark.parametrize("start", [(0.0, 0.0), (5.0, 5.0), (-1.0, 11.0)])
def test_unit_speed_is_kept_along_rays_over_the_six_peaks(start):
    surface, jets = peaks_surface(SIX_PEAKS), peaks_jets(SIX_PEAKS)
    left = []
    for angle in np.linspace(-math.pi, math.pi, 121)[:-1] + 0.01:
        ray = trace_ray(surface, start, angle, 27.0, bounds=REGION)
        speeds = planar_speed(jets, ray.points, ray.velocities)
        assert np.abs(speeds - 1.0).max() <= 1e-9
        left.append(ray.left_surface)
        assert REGION.contains(ray.points).all()
        on_edge = np.abs(np.append(ray.points[-1] + 1.0, ray.points[-1] - 11.0)).min() <= 1e-12
        assert ray.left_surface == on_edge
        assert ray.left_surface == (ray.length < 27.0)
    assert sum(left) > 0
    unbounded = trace_ray(surface, start, 0.3, 27.0)
    assert (unbounded.length, unbounded.left_surface) == (27.0, False)


@pytest.mark.parametrize("angle", [-3.0, -1.9833, -1.475, 0.05, 1.575, 2.0833, 3.1])
def test_a_ray_ends_where_the_unbounded_ray_crosses_the_edge(angle):
    surface = peaks_surface(SIX_PEAKS)
    ray = trace_ray(surface, (5.0, 5.0), angle, 40.0, bounds=REGION)
    assert ray.left_surface
    further = trace_ray(surface, (5.0, 5.0), angle, ray.length)
    growth = 1.0 + np.abs(further.jacobi).max()
    np.testing.assert_allclose(ray.points[-1], further.points[-1], rtol=0, atol=1e-9 * growth)
    assert ray.jacobi[-1] == pytest.approx(further.jacobi[-1], rel=1e-7, abs=1e-7 * growth)


@pytest.mark.parametrize("angle", [0.4828, 0.6038, 0.6441, 0.9259, 0.9662, 1.0869])
def test_a_ray_that_bulges_over_the_edge_between_two_steps_ends_there(angle):
    surface = peaks_surface(ONE_PEAK)
    fine = trace_ray(surface, (0, 0), angle, 20.0, bounds=WIDE, longest_step=0.01)
    axis = 0 if angle < 0.25 * math.pi else 1
    highest = int(np.argmax(fine.points[:, axis]))
    assert 5 < highest < len(fine.points) - 5
    edges = [100.0, 100.0]
    edges[axis] = float(fine.points[highest, axis]) - 1e-3
    ray = trace_ray(surface, (0, 0), angle, 20.0, bounds=Bounds(-100.0, -100.0, *edges))
    assert ray.left_surface
    assert ray.points[-1][axis] == pytest.approx(edges[axis], abs=1e-12)
    assert ray.length < fine.arc_length[highest]


def test_a_ray_on_a_spline_ends_at_the_edge_of_the_surface(cap):
    ray = trace_ray(cap, (0.0, 0.0), 0.2, 100.0)
    assert ray.left_surface
    assert ray.points[-1][0] == pytest.approx(5.0, abs=1e-12)
    straight_up = 5.0 / math.cos(0.2)
    assert ray.length == pytest.approx(RADIUS * math.asin(straight_up / RADIUS), rel=1e-8)


@given(layer_lists, weight_lists, point, angles)
@settings(deadline=None, max_examples=40)
def test_a_ray_traced_back_comes_home(layers, weights, start, angle):
    surface = peaks_surface(layers, weights)
    there = trace_ray(surface, start, angle, 9.0, bounds=WIDE)
    back = trace_ray(surface, there.points[-1], heading(-there.velocities[-1]), 9.0, bounds=WIDE)
    growth = 1.0 + np.abs(there.jacobi).max() + np.abs(back.jacobi).max()
    assert np.hypot(*(back.points[-1] - start)) <= 1e-9 * growth
    # Both ways the same field: |j| over the factor of the angle at either end (Clairaut).
    here, away = (planar_factor(surface, r.points[0], r.angle) for r in (there, back))
    assert abs(there.jacobi[-1] / here - back.jacobi[-1] / away) <= 1e-7 * growth


EDGES = [(x, y) for x in (0.0, 4.0, 10.0) for y in (0.0, 6.0, 10.0) if (x, y) != (4.0, 6.0)]


@pytest.mark.parametrize("start", EDGES)
def test_a_ray_from_the_edge_outwards_is_its_start_alone(start):
    surface, bounds, target = peaks_surface(ONE_PEAK), Bounds(0.0, 0.0, 10.0, 10.0), (4.0, 6.0)
    alone = 0
    for angle in np.append(np.linspace(-math.pi, math.pi, 17), [0.1, 1.57, 1.571, -3.0]):
        ray = trace_ray(surface, start, angle, 30.0, bounds=bounds)
        way = np.array([math.cos(angle), math.sin(angle)])
        miss = closest_approach(ray, target)
        assert (np.diff(ray.arc_length) > 0.0).all()
        assert ray.left_surface
        assert ray.leaves_at_once == (len(ray.points) == 1)
        assert (ray.conjugate_points <= ray.length).all()
        if not bounds.contains(np.array(start) + 1e-3 * way):
            alone += ray.leaves_at_once
            assert ray.length < 0.1  # one along the edge may bend back before it leaves
        if ray.leaves_at_once:
            offset = np.subtract(target, start)
            assert (miss.arc_length, ray.conjugate_points.size) == (0.0, 0)
            assert miss.distance == math.dist(start, target)
            assert miss.side * (way[0] * offset[1] - way[1] * offset[0]) >= 0.0
            assert tuple(ray.position(0.0)) == start
    assert alone >= 7


# Surfaces whose geodesics are known


@given(numbers(-1.0, 1.0), numbers(-1.0, 1.0), point, angles, numbers(0.1, 100.0))
@settings(deadline=None, max_examples=40)
def test_geodesics_of_a_plane_are_straight(a, b, start, angle, length):
    bounds = (-500.0, -500.0, 500.0, 500.0)
    x = np.linspace(-500.0, 500.0, 5)
    surface = tp.Surface.from_grid(a * x[None, :] + b * x[:, None], x, x)
    ray = trace_ray(surface, start, angle, length, bounds=Bounds(*bounds))
    u = np.array([math.cos(angle), math.sin(angle)])
    speed = math.sqrt(1.0 + (a * u[0] + b * u[1]) ** 2)
    expected = np.array(start) + ray.arc_length[:, None] * u / speed
    np.testing.assert_allclose(ray.points, expected, rtol=1e-11, atol=1e-10)
    factor = planar_factor(surface, start, angle)
    np.testing.assert_allclose(ray.jacobi, factor * ray.arc_length, rtol=1e-9, atol=1e-9)
    assert len(ray.conjugate_points) == 0


def test_on_flat_ground_the_field_is_the_arc_length():
    ray = trace_ray(flat(), (3.0, 4.0), 1.0, 50.0)
    np.testing.assert_allclose(ray.jacobi, ray.arc_length, rtol=1e-14)
    np.testing.assert_allclose(ray.jacobi_slope, 1.0, rtol=1e-14)


@given(numbers(-3.0, 3.0), numbers(-3.0, 3.0), angles)
@settings(deadline=None, max_examples=40)
def test_geodesics_of_a_sphere_are_great_circles(x, y, angle):
    surface = sphere_cap()
    ray = trace_ray(surface, (x, y), angle, 4.0)
    z = math.sqrt(RADIUS**2 - x * x - y * y)
    base = np.array([x, y, z])
    u = np.array([math.cos(angle), math.sin(angle)])
    tangent = np.array([*u, -(u @ (x, y)) / z])
    tangent /= np.linalg.norm(tangent)
    turned = ray.arc_length / RADIUS
    circle = np.cos(turned)[:, None] * base + RADIUS * np.sin(turned)[:, None] * tangent
    np.testing.assert_allclose(ray.points, circle[:, :2], rtol=0, atol=1e-7)
    expected = planar_factor(surface, (x, y), angle) * RADIUS * np.sin(turned)
    np.testing.assert_allclose(ray.jacobi, expected, rtol=1e-5, atol=1e-7)


@given(numbers(-4.0, 4.0), numbers(-3.0, 3.0), angles)
@settings(deadline=None, max_examples=40)
def test_geodesics_of_a_cylinder_are_helices(x, y, angle):
    surface = cylinder()
    ray = trace_ray(surface, (x, y), angle, 9.0)
    # Unrolled, the cylinder is the plane of (R phi, x2), x1 = R sin phi.
    phi = math.asin(x / RADIUS)
    across, along = math.cos(angle) / math.cos(phi), math.sin(angle)
    speed = math.hypot(across, along)
    rolled = RADIUS * np.sin(phi + ray.arc_length * across / speed / RADIUS)
    expected = np.stack([rolled, y + ray.arc_length * along / speed], axis=1)
    np.testing.assert_allclose(ray.points, expected, rtol=0, atol=1e-7)
    factor = planar_factor(surface, (x, y), angle)
    np.testing.assert_allclose(ray.jacobi, factor * ray.arc_length, rtol=1e-6, atol=1e-7)


# The exponential map


@given(many_layers, weight_lists, point, angles, numbers(0.5, 8.0))
@settings(deadline=None, max_examples=25)
def test_the_exponential_map_of_t_v_lies_on_the_ray(layers, weights, start, angle, length):
    surface = peaks_surface(layers, weights)
    ray = trace_ray(surface, start, angle, length)
    vectors = ray.arc_length[::3, None] * ray.velocities[0]
    found = exponential_map(surface, start, vectors)
    growth = 1.0 + np.abs(ray.jacobi).max()
    np.testing.assert_allclose(found, ray.points[::3], rtol=0, atol=1e-9 * growth)
    np.testing.assert_array_equal(found[0], start)  # the zero vector


@given(layer_lists, point, angles, numbers(0.5, 4.0), numbers(0.5, 4.0))
@settings(deadline=None, max_examples=25)
def test_to_go_on_from_a_point_of_a_ray_is_to_go_further(layers, start, angle, first, second):
    surface = peaks_surface(layers)
    whole = trace_ray(surface, start, angle, first + second)
    half = trace_ray(surface, start, angle, first)
    (end,) = exponential_map(surface, half.points[-1], [second * half.velocities[-1]])
    rest = trace_ray(surface, half.points[-1], heading(half.velocities[-1]), second)
    growth = 1.0 + np.abs(whole.jacobi).max() + np.abs(rest.jacobi).max()
    assert np.hypot(*(end - whole.points[-1])) <= 1e-9 * growth


def test_the_exponential_map_over_the_edge_is_refused_with_the_vector(cap):
    vectors = [(1.0, 0.0), (0.0, 0.0), (0.0, 40.0)]
    with pytest.raises(tp.InputError, match=r"vectors\[2\].*edge of the surface.*of 40; shorten"):
        exponential_map(cap, (0.0, 0.0), vectors)
    ends = exponential_map(cap, (0.0, 0.0), vectors[:2])
    np.testing.assert_allclose(ends[0], [RADIUS * math.sin(1.0 / RADIUS), 0.0], atol=1e-8)
    np.testing.assert_array_equal(ends[1], [0.0, 0.0])


@pytest.mark.parametrize(
    "vectors", [(1.0, 0.0), [[1.0, 2.0, 3.0]], [["a", "b"]], [[math.nan, 0.0]]]
)
def test_what_are_no_vectors_is_refused(vectors):
    with pytest.raises(tp.InputError, match="vectors"):
        exponential_map(flat(), (0.0, 0.0), vectors)


@pytest.mark.parametrize(
    "options",
    [
        {"length": 0.0},
        {"length": -1.0},
        {"length": math.nan},
        {"tolerance": 0.0},
        {"angle": math.inf},
        {"start": (math.nan, 0.0)},
        {"longest_step": 0.0},
        {"longest_step": -1.0},
        {"longest_step": math.nan},
    ],
    ids=str,
)
def test_a_ray_refuses_what_it_cannot_follow_and_names_it(options):
    ((name, _),) = options.items()
    arguments = {"start": (0.0, 0.0), "angle": 0.5, "length": 5.0, **options}
    with pytest.raises(tp.InputError, match=name):
        trace_ray(peaks_surface(ONE_PEAK), **arguments)


def test_a_ray_that_no_step_follows_is_refused_with_the_remedy():
    with pytest.raises(tp.InputError, match=r"tolerance=1e-30; raise the tolerance, or smooth"):
        trace_ray(peaks_surface(ONE_PEAK), (0.0, 0.0), 0.5, 5.0, tolerance=1e-30)


# The Jacobi field


def end_per_radian(surface, start, angle, length, delta=1e-3, **options):
    """The end's derivative in the angle, by central differences of order 6."""

    def end(k):
        return trace_ray(
            surface, start, angle + k * delta, length, tolerance=1e-13, **options
        ).points[-1]

    pairs = [(end(k) - end(-k)) / (2.0 * k * delta) for k in (1, 2, 3)]
    return 1.5 * pairs[0] - 0.6 * pairs[1] + 0.1 * pairs[2]


def normal_part(jets, position, velocity, vector):
    """sqrt(det h) (v x w): the component of w to the left of the unit vector v, under h."""
    h = metric_of(jets(*position)[0])
    cross = velocity[0] * vector[1] - velocity[1] * vector[0]
    return math.sqrt(h[0, 0] * h[1, 1] - h[0, 1] ** 2) * cross


FIELDS = {
    "one peak": ONE_PEAK,
    "three peaks": [scenes.THREE_PEAKS],
    "six peaks": SIX_PEAKS,
    "repeat-4d": [scenes.REPEAT_HEIGHT, scenes.REPEAT_RESISTANCE],
    "gentle": [[(1.0, 0.05, 4.0, 3.0)], [(-2.0, 0.1, 7.0, 6.0)], [(0.5, 0.3, 2.0, 2.0)]],
}


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("angle", [0.1, 0.5, 0.78, 1.2, 2.9])
def test_the_jacobi_field_is_the_derivative_of_the_end_in_the_angle(name, angle):
    surface, jets = peaks_surface(FIELDS[name]), peaks_jets(FIELDS[name])
    for length in (1.0, 4.0, 7.0):
        ray = trace_ray(surface, (0.5, 0.2), angle, length)
        most = np.abs(ray.jacobi).max()
        delta = 2e-3 / (1.0 + most)
        moved = end_per_radian(surface, (0.5, 0.2), angle, length, delta)
        v, place = ray.velocities[-1], ray.points[-1]
        found = normal_part(jets, place, v, moved)
        assert abs(found - ray.jacobi[-1]) <= 1e-6 * most
        # Gauss's lemma: the end moves across the ray alone.
        assert abs(v @ metric_of(jets(*place)[0]) @ moved) <= 1e-6 * most


def test_the_jacobi_slope_is_the_derivative_of_the_field():
    surface = peaks_surface(SIX_PEAKS)
    ray = trace_ray(surface, (0.5, 0.2), 0.7, 9.0, longest_step=0.01)
    s, j, dj = ray.arc_length, ray.jacobi, ray.jacobi_slope
    # Simpson's rule of the cubic Hermite kind: j is the integral of its slope.
    bend = -gaussian_curvature(surface, ray.points) * j
    h = np.diff(s)
    expected = j[:-1] + 0.5 * h * (dj[:-1] + dj[1:]) + h**2 / 12.0 * (bend[:-1] - bend[1:])
    np.testing.assert_allclose(j[1:], expected, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("angle", [0.7, 0.75, 0.25 * math.pi, 0.83])
def test_at_a_conjugate_point_neighbouring_rays_cross(angle):
    surface, jets = peaks_surface(ONE_PEAK), peaks_jets(ONE_PEAK)
    ray = trace_ray(surface, (0.0, 0.0), angle, 24.0, longest_step=0.05)
    assert len(ray.conjugate_points) >= 1

    def moved(length):
        end = trace_ray(surface, (0.0, 0.0), angle, length)
        shift = end_per_radian(surface, (0.0, 0.0), angle, length, 1e-5)
        return normal_part(jets, end.points[-1], end.velocities[-1], shift)

    for s in ray.conjugate_points:
        crossing = brentq(moved, s - 0.3, s + 0.3, xtol=1e-9)
        assert crossing == pytest.approx(s, abs=2e-5)


def test_there_is_no_conjugate_point_where_nothing_focuses():
    assert len(trace_ray(peaks_surface(ONE_PEAK), (0, 0), -0.5, 20.0).conjugate_points) == 0
    short = trace_ray(peaks_surface(ONE_PEAK), (0, 0), 0.25 * math.pi, 5.0)
    assert len(short.conjugate_points) == 0
    saddle = tp.Surface.from_expression("x1*x2/5", (-5.0, -5.0, 5.0, 5.0))
    for angle in np.linspace(-3.0, 3.0, 13):
        ray = trace_ray(saddle, (0.3, 0.2), angle, 30.0)
        assert len(ray.conjugate_points) == 0
        # Negative curvature spreads rays faster than flat ground does.
        least = planar_factor(saddle, (0.3, 0.2), angle) * ray.arc_length
        assert (ray.jacobi >= least * (1.0 - 1e-9)).all()


# Convergence


def test_the_integrator_is_of_order_8():
    """Steps of one length; the geometric mean over directions smooths the error's zeros."""
    surface, length = peaks_surface(ONE_PEAK), 12.0
    steps = length / np.array([16.0, 20.0, 24.0, 28.0, 32.0])
    logs = np.zeros((2, len(steps)))
    directions = np.linspace(0.5, 1.0, 21)
    for angle in directions:
        exact = trace_ray(surface, (0, 0), angle, length, longest_step=0.02, tolerance=1e-13)
        for k, step in enumerate(steps):
            ray = trace_ray(surface, (0, 0), angle, length, longest_step=step, tolerance=1e9)
            np.testing.assert_allclose(np.diff(ray.arc_length), step, rtol=1e-9)
            logs[0, k] += math.log(np.hypot(*(ray.points[-1] - exact.points[-1])))
            logs[1, k] += math.log(abs(ray.jacobi[-1] - exact.jacobi[-1]))
    logs /= len(directions)
    assert logs.min() > math.log(1e-11)  # well above rounding
    for each in logs:
        assert 7.5 <= np.polyfit(np.log(steps), each, 1)[0] <= 9.5


@pytest.mark.parametrize("angle", [0.2, 0.6, 0.75])
def test_the_error_of_a_ray_falls_with_the_tolerance(angle):
    surface, jets = peaks_surface(SIX_PEAKS), peaks_jets(SIX_PEAKS)
    (exact,) = geodesic_by_hamilton(jets, (0.0, 0.0), angle, [10.0])
    tolerances = [1e-4, 1e-6, 1e-8, 1e-10]
    rays = [trace_ray(surface, (0, 0), angle, 10.0, tolerance=t) for t in tolerances]
    errors = np.array([np.hypot(*(ray.points[-1] - exact)) for ray in rays])
    growth = 1.0 + np.abs(rays[-1].jacobi).max()
    assert (errors <= 100.0 * growth * np.array(tolerances)).all()
    assert (errors[1:] < 0.2 * errors[:-1]).all()
    assert (np.diff([len(ray.points) for ray in rays]) > 0).all()


def test_a_longest_step_is_never_exceeded_and_moves_the_end_by_no_more_than_the_tolerance():
    surface = peaks_surface(SIX_PEAKS)
    plain = trace_ray(surface, (0, 0), 0.3, 10.0)
    fine = trace_ray(surface, (0, 0), 0.3, 10.0, longest_step=0.01)
    assert np.diff(fine.arc_length).max() <= 0.01 * (1.0 + 1e-9)
    growth = 1.0 + np.abs(plain.jacobi).max()
    assert np.hypot(*(fine.points[-1] - plain.points[-1])) <= 1e-9 * growth
    between = plain.position(fine.arc_length)
    assert np.abs(between - fine.points).max() <= 1e-3  # cubic between steps


# Exact lengths. solve_bvp at tol = 1e-8 has lengths exact to 1e-13, because the length is
# stationary in the curve; at 1e-10 it refines for ever, against its own rounding.


def perturbed(points, size, seed):
    """About 250 of a curve's points, its ends kept, moved smoothly."""
    keep = np.unique(np.linspace(0, len(points) - 1, 257).astype(int))
    t = np.linspace(0.0, 1.0, len(keep))[:, None]
    waves = np.sin(math.pi * t * np.array([1.0, 2.0, 3.0]))
    return points[keep] + size * waves @ np.random.default_rng(seed).normal(size=(3, 2))


def random_layers(seed):
    """1 to 6 layers, gentle to steep, and a start and a goal."""
    random = np.random.default_rng(seed)
    steepness = (0.3, 1.0, 2.5)[seed % 3]
    layers = [
        [
            (
                steepness * random.uniform(-2.0, 2.0),
                random.uniform(0.03, 0.6),
                *random.uniform(0.0, 10.0, 2),
            )
            for _ in range(random.integers(1, 4))
        ]
        for _ in range(1 + seed % 6)
    ]
    angle = random.uniform(-math.pi, math.pi)
    reach = 4.5 * np.array([math.cos(angle), math.sin(angle)])
    return layers, tuple(5.0 - reach), tuple(5.0 + reach)


@pytest.mark.parametrize("seed", mostly_slow(range(50), quick=10))
def test_the_shortest_geodesic_of_a_random_surface_is_as_long_as_solve_bvp_says(seed):
    layers, start, goal = random_layers(seed)
    surface = peaks_surface(layers)
    problem = tp.Problem(surface, start, goal, (-30.0, -30.0, 40.0, 40.0))
    towards = math.atan2(goal[1] - start[1], goal[0] - start[0])
    sector = (towards - 0.6 * math.pi, towards + 0.6 * math.pi)
    fan = tp.GeodesicTraversal(directions=120, sector=sector).fan(problem)
    assert fan.geodesics
    best = fan.geodesics[0]
    assert tp.chord(surface, start, goal) <= best.length * (1.0 + 1e-12)
    assert best.length <= problem.straight_length * (1.0 + 1e-9)
    jets = peaks_jets(layers)
    found = geodesic_by_collocation(jets, perturbed(best.points, 0.01, seed), 1e-8)
    assert found is not None
    length, position = found
    assert length == pytest.approx(best.length, rel=1e-10)
    middle = position(np.linspace(0.0, 1.0, 9))
    away = np.hypot(*(best.points[:, None] - middle[None]).transpose(2, 0, 1)).min(axis=0)
    assert away.max() <= 1e-2  # the same curve, up to its samples
    # No guess leads to a shorter one.
    t = np.linspace(0.0, 1.0, 129)[:, None]
    straight = np.array(start) + t * (np.array(goal) - np.array(start))
    other = geodesic_by_collocation(jets, straight, 1e-6, 20_000)
    if other is not None:
        assert other[0] >= best.length * (1.0 - 1e-9)


# Other processes


def flattened(nested):
    return [x for part in nested for x in flattened(part)] if isinstance(nested, list) else [nested]


def test_a_second_process_compiles_nothing_and_finds_the_same_bits():
    here = json.loads(json.dumps(short_rays()))  # which leaves the kernels in the cache
    found, statistics = in_another_process(SHORT_RAYS)
    assert found == here
    assert statistics["compiled"] == 0
    assert statistics["loaded"] > 0


def test_plain_python_agrees_with_the_compiled_kernels():
    found, statistics = in_another_process(SHORT_RAYS, NUMBA_DISABLE_JIT="1")
    assert statistics == {"loaded": 0, "compiled": 0}
    np.testing.assert_allclose(flattened(found), flattened(short_rays()), rtol=1e-9, atol=1e-9)


def test_what_is_public_is_exported():
    for name in ("christoffel_symbols", "exponential_map", "gaussian_curvature", "trace_ray"):
        assert callable(getattr(rays, name))
