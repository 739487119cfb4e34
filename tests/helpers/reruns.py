"""Results that are computed here and again in another process, to be compared bit by bit."""

import json

import numpy as np
import shapely

import terrapath as tp
from planner_oracles import TREE_PLANNERS
from terrapath._kernels import compiler
from terrapath._support.watching import never
from terrapath.geodesics.rays import christoffel_symbols, gaussian_curvature, trace_ray
from terrapath.geodesics.refinement import lanes
from terrapath.problem import scenes

# Programs that print what a function here finds, and the statistics of the kernel cache.
SEARCHES, SHORT_RAYS = (
    f"import reruns; reruns.tell(reruns.{name})" for name in ("searches", "short_rays")
)
AXIS = np.linspace(-1.0, 11.0, 13)


def tell(rerun):
    print(json.dumps([rerun(), compiler.cache_statistics()]))


def among_obstacles(surface):
    obstacles = [
        shapely.box(4.2, 4.3, 5.9, 6.1),
        shapely.box(0.5, 6.0, 4.0, 9.5) - shapely.box(1.5, 7.0, 3.0, 8.5),
        tp.Circle(7.5, 3.0, 0.9),
    ]
    return tp.Problem(surface, (0, 0), (10, 10), scenes.REGION, obstacles)


def on_spline(values):
    blocked = np.zeros((13, 13), bool)
    blocked[8, 9] = True
    return tp.Surface.from_grid(values, AXIS, AXIS, nodata=tp.Mask(blocked, AXIS, AXIS))


def problems():
    peaks = tp.Surface.from_peaks([scenes.FOUR_PEAKS, scenes.TWO_RESISTANCE_PEAKS])
    x, y = np.meshgrid(AXIS, AXIS)
    hills = on_spline(np.stack([np.sin(0.5 * x) * np.cos(y / 3.0), 0.1 * x * np.sin(0.25 * y)]))
    return {"peaks": among_obstacles(peaks), "spline": among_obstacles(hills)}


def searches():
    """What is found on small problems, as plain lists."""
    return {"trees": trees(), "rough ground": rough_ground()}


def trees(samples=300):
    """Trees and lengths of every planner that grows one."""
    found = {}
    for place, problem in problems().items():
        for name in TREE_PLANNERS:
            solution = tp.plan(problem, name, samples=samples, seed=6)
            assert solution.path is not None
            found[f"{place}, {name}"] = {
                "points": solution.tree.points.tolist(),
                "parents": solution.tree.parents.tolist(),
                "costs": solution.tree.costs.tolist(),
                "path": solution.path.points.tolist(),
                "cost": solution.cost,
                "length": solution.length,
                "counters": solution.counters,
            }
    return found


def rough_ground():
    """What a tree begins with on rough ground, with few nodes: plain Python is slow there."""
    problem = among_obstacles(on_spline(np.random.default_rng(5).normal(size=(2, 13, 13))))
    field = tp.distance_field(
        problem.surface, problem.start, bounds=problem.bounds, obstacles=problem.obstacles,
        spacing=1.0,
    )  # fmt: skip
    path = tp.plan(problem, "a-star", spacing=1.0, neighbours=32, bound=False).path
    moved = lanes.shortened(problem, path.points, never, lanes.COARSE[:1])
    return {
        "field": field.values.tolist(),
        "lattice": path.points.tolist(),
        "moved": problem.path(moved.points).length,
    }


def short_rays():
    """The same short rays on either class of surface, as plain lists."""
    x = np.linspace(0.0, 6.0, 7)
    grid = tp.Surface.from_grid(np.random.default_rng(1).normal(size=(2, 7, 7)), x, x)
    peaks = tp.Surface.from_peaks([scenes.FOUR_PEAKS, scenes.TWO_RESISTANCE_PEAKS])
    found = []
    for surface in (peaks, grid):
        ray = trace_ray(surface, (2.0, 2.0), 0.4, 1.0, tolerance=1e-8)
        found.append([ray.points.tolist(), ray.jacobi.tolist()])
        found.append(christoffel_symbols(surface, (2.0, 2.5)).tolist())
        found.append(float(gaussian_curvature(surface, (2.0, 2.5))))
    return found
