"""Vehicle radius, steep ground and areas to keep in: what a path keeps away from."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.cbook import get_sample_data
from scipy import ndimage

import terrapath as tp
from oracles import boxes_of_mask
from terrapath.clearance import inflated
from terrapath.steepness import Steepness
from terrapath.validation import Bounds

SIDE = 10.0
BOUNDS = (0.0, 0.0, SIDE, SIDE)
FLAT = tp.Surface.from_peaks([np.empty((0, 4))])
HILLS = tp.Surface.from_peaks([[(2.0, 0.3, 3.0, 4.0), (-1.5, 0.2, 7.0, 6.0)]])
SCENES = 500

# What shapely itself may err by, as a share of the radius.
ROUNDING = 1e-12


def shape_of(obstacle):
    """An obstacle as a shapely geometry and what to subtract from distances to it."""
    if isinstance(obstacle, tp.Circle):
        return shapely.Point(obstacle.x1, obstacle.x2), obstacle.radius
    if isinstance(obstacle, tp.Mask):
        return shapely.MultiPolygon(list(boxes_of_mask(obstacle))), 0.0
    return obstacle, 0.0


def clearance(path, obstacles):
    """Distance of a path from the nearest obstacle, by shapely."""
    distances = []
    for obstacle in obstacles:
        shape, size = shape_of(obstacle)
        if not shape.is_empty:
            distances.append(shapely.distance(path.line, shape) - size)
    return min(distances, default=math.inf)


# The radius, on random scenes


def random_star(random):
    count = int(random.integers(3, 12))
    angles = np.sort(random.uniform(0, 2 * math.pi, count))
    radii = random.uniform(0.1, 1.5, count)
    centre = random.uniform(0, SIDE, 2)
    return shapely.Polygon(
        centre + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    )


def random_wall(random):
    steps = random.normal(scale=0.8, size=(int(random.integers(2, 9)), 2))
    return shapely.LineString(random.uniform(0, SIDE, 2) + np.cumsum(steps, axis=0))


def random_bay(random):
    """A room with a gap: the sort of concave outline that a buffer simplifies."""
    x, y = random.uniform(0, 7, 2)
    outer = shapely.box(x, y, x + 3, y + 3)
    gap = shapely.box(x + random.uniform(0.3, 2), y - 1, x + 2.5, y + 1)
    return shapely.difference(
        outer, shapely.union(shapely.box(x + 0.2, y + 0.2, x + 2.8, y + 2.8), gap)
    )


def random_mask(random):
    rows, columns = random.integers(2, 9, 2)
    x0, y0 = random.uniform(-1, 8, 2)
    dx, dy = random.uniform(0.1, 0.7, 2)
    blocked = random.random((rows, columns)) < 0.3
    return tp.Mask(blocked, x0 + dx * np.arange(columns), y0 + dy * np.arange(rows))


def random_obstacle(random):
    kind = int(random.integers(6))
    if kind == 4:
        return tp.Circle(*random.uniform(0, SIDE, 2), random.uniform(0.1, 1.0))
    if kind == 5:
        return shapely.Point(random.uniform(0, SIDE, 2))
    return (random_star, random_wall, random_bay, random_mask)[kind](random)


def random_scene(seed):
    """Obstacles, a radius, and a problem among them: None where the ends are not free."""
    random = np.random.default_rng([5, seed])
    drawn = [random_obstacle(random) for _ in range(int(random.integers(1, 7)))]
    obstacles = [o for o in drawn if not isinstance(o, shapely.Polygon) or o.is_valid]
    radius = float(10.0 ** random.uniform(-2, 0.0))
    for _ in range(40):
        start, goal = random.uniform(0, SIDE, (2, 2))
        try:
            return obstacles, tp.Problem(
                HILLS, start, goal, BOUNDS, obstacles, radius=radius, name=str(seed)
            )
        except tp.InputError as error:
            assert "radius=" in str(error) or "obstacle" in str(error) or "cell" in str(error)
    return obstacles, None


def solved(problem, seed):
    planner = ("fast-marching", "dijkstra", "rrt")[seed % 3]
    options = {"samples": 300, "seed": seed} if planner == "rrt" else {"spacing": SIDE / 30}
    return tp.plan(problem, planner, **options)


def test_no_route_is_nearer_to_an_obstacle_than_the_radius_on_500_scenes():
    routes = refined = nearest = 0
    for seed in range(SCENES):
        obstacles, problem = random_scene(seed)
        if problem is None:
            continue
        solution = solved(problem, seed)
        if solution.path is None:
            continue
        paths = [solution.path]
        if seed % 5 == 0:
            paths.append(tp.refine(problem, solution.path))
            refined += 1
        for path in paths:
            found = clearance(path, obstacles)
            assert found >= problem.radius * (1.0 - ROUNDING), (seed, found, problem.radius)
            routes += 1
            nearest += found < 1.02 * problem.radius
    assert routes > 400
    assert refined > 60
    assert nearest > 30  # the radius is used up, not far exceeded
