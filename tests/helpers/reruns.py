"""Results that are computed here and again in another process, to be compared bit by bit."""

import json

import numpy as np
import shapely

import terrapath as tp
from planner_oracles import TREE_PLANNERS
from terrapath._kernels import compiler
from terrapath.geodesics.rays import christoffel_symbols, gaussian_curvature, trace_ray
from terrapath.problem import scenes

# Programs that print what a function here finds, and the statistics of the kernel cache.
TREES, SHORT_RAYS = (
    f"import reruns; reruns.tell(reruns.{name})" for name in ("trees", "short_rays")
)


def tell(rerun):
    print(json.dumps([rerun(), compiler.cache_statistics()]))


def problems():
    obstacles = [
        shapely.box(4.2, 4.3, 5.9, 6.1),
        shapely.box(0.5, 6.0, 4.0, 9.5) - shapely.box(1.5, 7.0, 3.0, 8.5),
        tp.Circle(7.5, 3.0, 0.9),
    ]
    x = np.linspace(-1.0, 11.0, 13)
    values = np.random.default_rng(5).normal(size=(2, 13, 13))
    blocked = np.zeros((13, 13), bool)
    blocked[8, 9] = True
    nodata = tp.Mask(blocked, x, x)
    peaks = tp.Surface.from_peaks([scenes.FOUR_PEAKS, scenes.TWO_RESISTANCE_PEAKS])
    spline = tp.Surface.from_grid(values, x, x, nodata=nodata)
    return {
        "peaks": tp.Problem(peaks, (0, 0), (10, 10), scenes.REGION, obstacles),
        "spline": tp.Problem(spline, (0, 0), (10, 10), scenes.REGION, obstacles),
    }


def trees(samples=300):
    """Trees and lengths of every planner on small problems, as plain lists."""
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
