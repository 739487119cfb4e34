"""Problems in the format that the programs in C++ read: a file of 64-bit floats."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from terrapath._kernels.surface.surfaces import Peaks, Spline
from terrapath.errors import InputError
from terrapath.planners.rrt_star import FEATURES_PER_PANEL
from terrapath.problem import Problem
from terrapath.space.free_space import Circle
from terrapath.surface.bounds import Bounds, Mask
from terrapath.validation import Array

PEAKS, SPLINE = 0.0, 1.0


def panel_of(problem: Problem) -> float:
    """The longest piece that one application of Line-R measures in a tree, map units."""
    return FEATURES_PER_PANEL * problem.surface.resolution


def _blocks(mask: Mask, bounds: Bounds) -> bool:
    """Is a cell without data within the bounds, or less than one cell away from them?"""
    dx, dy = mask.x[1] - mask.x[0], mask.y[1] - mask.y[0]
    columns = (mask.x > bounds.x1_min - dx) & (mask.x < bounds.x1_max + dx)
    rows = (mask.y > bounds.x2_min - dy) & (mask.y < bounds.x2_max + dy)
    return bool(mask.blocked[np.ix_(rows, columns)].any())


def discs_of(problem: Problem) -> Array:
    """Discs (m, 3): centre and radius, map units. Raises InputError for any other obstacle."""
    others = [o for o in problem.obstacles if not isinstance(o, Circle)]
    nodata = problem.surface.nodata is not None and _blocks(problem.surface.nodata, problem.bounds)
    if others or nodata or problem.max_slope is not None or problem.keep_in is not None:
        raise InputError(f"{problem.name}: programs in C++ take no obstacles but discs")
    discs = [(o.x1, o.x2, o.radius + problem.radius) for o in problem.obstacles]  # type: ignore[union-attr]
    return np.array(discs, np.float64).reshape(-1, 3)


def _surface_parts(data: Peaks | Spline) -> Iterator[Array | list[float]]:
    weights = [float(len(data.weights)), *data.weights]
    if isinstance(data, Peaks):
        yield [PEAKS, *weights]
        for first, end in zip(data.first[:-1], data.first[1:], strict=True):
            yield [float(end - first)]
            yield data.peaks[first:end].ravel()
        return
    if len(data.log_cost) > 0:
        raise InputError("programs in C++ take no cost layers")
    yield [SPLINE, *weights, *map(float, data.coefficients.shape[1:])]
    yield [data.x0, data.y0, data.dx, data.dy]
    yield data.coefficients.ravel()


def write_problem(path: Path, problem: Problem) -> None:
    """Write a file that ``Problem`` in ``benchmarks/cpp/surface.hpp`` reads.

    Raises InputError where the problem has something that the programs do not support.
    """
    bounds, discs = problem.bounds, discs_of(problem)
    parts = [
        [*bounds, *problem.start, *problem.goal, panel_of(problem)],
        *_surface_parts(problem.surface.data),
        [float(len(discs))],
        discs.ravel(),
    ]
    np.concatenate([np.asarray(part, np.float64) for part in parts]).tofile(path)
