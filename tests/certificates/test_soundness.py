"""No bound is above the truth, on 2,000 random problems."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

import certificate_oracles as oracles
import planner_oracles
import terrapath as tp
from certificate_cases import BOUNDS, ROUNDING, SIDE, certified, random_surface
from common import FLAT, REGION, mostly_slow
from layouts import LAYOUTS, star
from oracles import great_circle
from terrapath.geodesics.rays import trace_ray

CYLINDERS, PLANES, RAYS, AMONG_OBSTACLES, ROUND_POLYGONS, CAPS = 640, 300, 520, 230, 150, 160


def check_bound(problem, truth, random, slack=0.0):
    """Bounds from any lattice and any belief about the length are at most the true length.

    Returns the gap of the last one.
    """
    side = int(random.choice([6, 9, 14, 20, 30, 40], p=[0.2, 0.2, 0.2, 0.2, 0.1, 0.1]))
    believed = truth * random.choice([0.3, 0.9, 1.0, 1.0 + 1e-9, 1.001, 1.1, 2.0, math.inf])
    repairs = int(random.random() < 0.2)
    made = certified(problem, side, believed, repairs)
    assert made.value <= truth * (1.0 + ROUNDING) + slack
    straight = float(tp.chord(problem.surface, problem.start, problem.goal))
    assert made.value >= straight * (1.0 - 1e-8) - 1e-10
    if random.random() < 0.2:
        assert made.check(problem) == made.value
    return truth / made.value - 1.0 if believed >= truth else math.nan


def places_near_anything(random, low=0.0, high=SIDE):
    """Two points: anywhere, near one another, near the edge or on it, in a corner."""
    ends = random.uniform(low, high, (2, 2))
    kind = random.integers(0, 8)
    if kind == 0:
        ends[1] = ends[0] + random.uniform(-0.3, 0.3, 2) * 10.0 ** -random.integers(0, 5)
    elif kind == 1:
        ends[0, 0] = random.choice([low, high])
    elif kind == 2:
        ends[1] = random.choice([low, high], 2)
    elif kind == 3:
        ends[1, 1] = ends[0, 1]
    elif kind == 4:
        ends[0] = ends[0].round()
    return np.clip(ends, low, high)


def numbered(total, seed, batches, batch):
    """Generators of random numbers of one batch of cases."""
    assert total % batches == 0
    each = total // batches
    return (np.random.default_rng([seed, n]) for n in range(batch * each, (batch + 1) * each))


def check_gaps(gaps, typical):
    """Half of the gaps where the length was known are typical or better."""
    gaps = np.array(gaps)
    assert (gaps[~np.isnan(gaps)] > -ROUNDING).all()
    assert np.nanmedian(gaps) < typical


@pytest.mark.parametrize("batch", range(10))
def test_no_bound_is_above_the_unrolled_straight_line(batch):
    # Layers that depend on x1 alone, as rough as any: isometric to the plane.
    gaps = []
    for random in numbered(CYLINDERS, 10, 10, batch):
        count = int(random.integers(4, 50))
        layers = int(random.integers(1, 5))
        x = np.linspace(0.0, SIDE, count)
        rough = random.choice([0.05, 0.3, 1.0]) * SIDE / count
        profiles = rough * random.normal(size=(layers, 1, count))
        y = np.linspace(0.0, SIDE, int(random.integers(4, 40)))
        surface = tp.Surface.from_grid(
            np.repeat(profiles, len(y), axis=1),
            x,
            y,
            weights=random.choice([0.0, 0.5, 1.0, 2.0], layers),
        )
        problem = tp.Problem(surface, *places_near_anything(random))
        truth = oracles.unrolled_length(surface.data, problem.start, problem.goal)
        gaps.append(check_bound(problem, truth, random))
    check_gaps(gaps, 0.2)


@pytest.mark.parametrize("batch", range(4))
def test_no_bound_is_above_the_straight_line_on_tilted_planes(batch):
    gaps = []
    for random in numbered(PLANES, 11, 4, batch):
        layers = int(random.integers(1, 5))
        slopes = random.normal(size=(layers, 2)) * random.choice([0.0, 0.1, 1.0, 10.0])
        weights = random.choice([0.0, 0.5, 1.0, 2.0], layers)
        x, y = (np.linspace(0.0, SIDE, int(n)) for n in random.integers(4, 30, 2))
        values = slopes[:, 0, None, None] * x + slopes[:, 1, None, None] * y[:, None]
        surface = tp.Surface.from_grid(values, x, y, weights=weights)
        problem = tp.Problem(surface, *places_near_anything(random))
        step = np.subtract(problem.goal, problem.start)
        truth = math.hypot(*step, *(weights * (slopes @ step)))
        gaps.append(check_bound(problem, truth, random))
    # The straight line in space is the bound already.
    check_gaps(gaps, 2e-9)


@pytest.mark.parametrize("batch", mostly_slow(range(8), quick=2))
def test_no_bound_is_above_a_geodesic(batch):
    # Any geodesic is a path, and a short one is the shortest.
    gaps = []
    for random in numbered(RAYS, 12, 8, batch):
        surface = random_surface(random, int(random.integers(1, 5)), random.random() < 0.4)
        start = tuple(places_near_anything(random)[0])
        length = random.choice([0.05, 1.0, 4.0, 10.0])
        bounds = tp.Problem(surface, start, start, BOUNDS).bounds
        ray = trace_ray(surface, start, random.uniform(0.0, 6.28), length, bounds=bounds)
        goal = np.clip(ray.points[-1], 0.0, SIDE)
        if ray.length < 1e-6:
            continue
        problem = tp.Problem(surface, start, goal, BOUNDS)
        # The ray's own error, and the end's clipping.
        gaps.append(check_bound(problem, ray.length, random, slack=1e-8 * ray.length))
    check_gaps(gaps, 0.1)


def random_obstacles(random):
    """Polygons with holes and without, discs, walls and a mask."""
    obstacles = []
    for _ in range(random.integers(0, 6)):
        radii = random.uniform(0.2, 1.8, random.integers(3, 10))
        hole = random.choice([0.0, 0.0, 0.6])
        shape = star(*random.uniform(0.0, SIDE, 2), radii, random.uniform(0.0, 6.28), hole)
        obstacles += [shape] if shape.is_valid else []
    for _ in range(random.integers(0, 4)):
        obstacles.append(tp.Circle(*random.uniform(0.0, SIDE, 2), random.uniform(0.1, 1.5)))
    for _ in range(random.integers(0, 3)):
        obstacles.append(shapely.LineString(random.uniform(0.0, SIDE, (3, 2))))
    if random.random() < 0.3:
        nx, ny = random.integers(4, 40, 2)
        blocked = random.random((ny, nx)) < random.choice([0.05, 0.3])
        x, y = ((np.arange(n) + 0.5) * SIDE / n for n in (nx, ny))
        obstacles.append(tp.Mask(blocked, x, y))
    if random.random() < 0.3:
        # Boxes whose sides lie on lines of the lattice.
        obstacles.append(shapely.box(*(random.integers(0, 3, 2) * 2.5), 7.5, 7.5))
    return obstacles


def problem_among_obstacles(random):
    while True:
        surface = random_surface(random, int(random.integers(1, 5)), random.random() < 0.4)
        obstacles = random_obstacles(random)
        for _ in range(5):
            try:
                return tp.Problem(surface, *places_near_anything(random), BOUNDS, obstacles)
            except tp.InputError:
                continue


# Some of this ground is so rough that a path can be refined only in part, which is said.
@pytest.mark.filterwarnings("ignore:a path was refined in part")
@pytest.mark.parametrize("batch", mostly_slow(range(10), quick=2))
def test_no_bound_is_above_any_path_among_obstacles(batch):
    gaps, found = [], 0
    for random in numbered(AMONG_OBSTACLES, 13, 10, batch):
        problem = problem_among_obstacles(random)
        # An informed tree answers in mazes, too, where bounds say little.
        tree = tp.RRTStar(samples=1_000, informed=False, seed=int(random.integers(0, 1000)))
        path = tree.solve(problem).path
        if path is None:
            made = certified(problem, 12)
            assert made.check(problem) == made.value
            continue
        found += 1
        if random.random() < 0.5:
            path = tp.refine(problem, path, tolerance=1e-4)
        gaps.append(check_bound(problem, path.length, random))
    assert found > 10
    check_gaps(gaps, 0.4)  # uniform trees of 1,000 samples are long: 0.31 in one batch of ten


def random_polygons(random):
    return [
        shapely.box(
            *(corner := random.uniform(-1.0, 9.0, 2)), *(corner + random.uniform(0.2, 4, 2))
        )
        if random.random() < 0.6
        else star(
            *random.uniform(0.0, SIDE, 2), random.uniform(0.5, 2.0, 3), random.uniform(0, 6), 0
        )
        for _ in range(random.integers(1, 5))
    ]


@pytest.mark.parametrize("batch", range(5))
def test_no_bound_on_flat_ground_is_above_the_visibility_graphs(batch):
    gaps = []
    for random in numbered(ROUND_POLYGONS, 14, 5, batch):
        polygons = random_polygons(random)
        ends = random.uniform(0.0, SIDE, (2, 2))
        while shapely.intersects(shapely.points(ends)[:, None], polygons).any():
            ends = random.uniform(0.0, SIDE, (2, 2))
        problem = tp.Problem(FLAT, *ends, BOUNDS, polygons)
        if problem.is_unreachable:
            continue
        truth = planner_oracles.visibility_length(problem.start, problem.goal, polygons, BOUNDS)
        gaps.append(check_bound(problem, truth, random))
    check_gaps(gaps, 0.02)


def cap_of_a_sphere(x, y):
    return np.sqrt(100.0 - x * x - y * y)


@pytest.mark.parametrize("batch", range(4))
def test_no_bound_is_above_the_great_circle(batch):
    surface = tp.Surface.from_function(cap_of_a_sphere, (-6.0, -6.0, 6.0, 6.0), tolerance=1e-5)
    gaps = []
    for random in numbered(CAPS, 15, 4, batch):
        # A disc of the sphere is convex, the square around it is not: what is straight between
        # points inside stays inside.
        angles, radii = random.uniform(0.0, 6.28, 2), random.uniform(0.0, 5.9, 2)
        ends = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        problem = tp.Problem(surface, *ends)
        truth = great_circle(10.0, *ends)
        # A gradient that is off by 1e-5 changes a length by that share of it at most.
        gaps.append(check_bound(problem, truth, random, slack=2e-5 * truth))
    assert np.nanmedian(gaps) < 0.01


def test_there_are_two_thousand_problems():
    assert CYLINDERS + PLANES + RAYS + AMONG_OBSTACLES + ROUND_POLYGONS + CAPS == 2_000


@pytest.mark.parametrize("name", LAYOUTS)
def test_bounds_on_flat_ground_are_near_the_visibility_graphs(name):
    polygons = LAYOUTS[name]
    problem = tp.Problem(FLAT, (0.0, 0.0), (10.0, 10.0), REGION, polygons)
    truth = planner_oracles.visibility_length((0.0, 0.0), (10.0, 10.0), polygons, REGION)
    found = tp.lower_bound(problem, length=truth)
    assert truth * (1.0 - 0.05) <= found.value <= truth * (1.0 + ROUNDING)
    assert found.check(problem) == found.value
