"""From any planner's path to the exact locally shortest path around it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import InputError
from ...problem import Path, Problem
from ...surface import Surface
from ...validation import Array, as_array, require_positive
from .newton import shortest_polyline
from .smooth import correct, curve_through, laid_shares

__all__ = ["refine", "shortest_polyline"]

TOLERANCE = 3e-8  # relative excess of the polyline's length over the geodesic's

# Pieces of the polyline: at first one a feature of the surface, then by stages as many as
# make the geodesic through its points exact.
FEWEST_PIECES, MOST_PIECES = 32, 4096
PIECES_PER_FEATURE = 8.0
STAGES = 3

# A path whose ends are this near to the problem's, as a share of the region, starts there.
SAME_PLACE = 1e-9
# A path may be found longer by this share before the one given is preferred to it.
ROUNDING = 1e-12


def refine(problem: Problem, path: Any, *, tolerance: float = TOLERANCE) -> Path:
    """The locally shortest path that a path can be pulled taut to, in free space throughout.

    path : Path or (m, 2) array, map units, from the problem's start to its goal through free
    space, such as any planner's. Where it touches nothing, the path returned is longer than
    the exact geodesic by ``tolerance``, relative; 8,192 points are laid at most. Where
    obstacles or the edge of the bounds are in the way, it bends round them at a distance of
    1e-8 of the region's side. It is never longer than the path given, and never passes an
    obstacle on another side.
    Raises InputError where the path does not join start and goal or is not free.
    """
    require_positive(tolerance=tolerance)
    given = problem.path(_checked(problem, path))
    best = given
    for points in _refined(problem, given, tolerance):
        found = problem.path(points)
        # Of two that are as long, the later has no more points than it needs.
        longest = min(best.length * (1.0 + tolerance), given.length * (1.0 + ROUNDING))
        if _is_allowed(problem, points) and found.length <= longest:
            best = found
    return best


def _checked(problem: Problem, path: Any) -> Array:
    """The points of a path from start to goal through free space, repeated ones left out."""
    given = path.points if isinstance(path, Path) else path
    points = as_array(given, "path", shape=(None, 2)).copy()
    if len(points) < 2:
        raise InputError(f"path has {len(points)} points; give at least the start and the goal")
    for index, name, end in ((0, "start", problem.start), (-1, "goal", problem.goal)):
        if math.dist(points[index], end) > SAME_PLACE * problem.bounds.side:
            shown = "({:.10g}, {:.10g})".format(*points[index])
            raise InputError(
                f"the path's {'first' if index == 0 else 'last'} point {shown} is not the "
                f"problem's {name} ({end[0]:.10g}, {end[1]:.10g}); refine it in its own problem"
            )
        points[index] = end
    moved = (np.diff(points, axis=0) != 0.0).any(axis=1)
    points = np.concatenate([points[:1], points[1:][moved]])
    if len(points) == 1:
        points = np.repeat(points, 2, axis=0)
    if not (inside := problem.bounds.contains(points)).all():
        x, y = points[~inside][0]
        raise InputError(
            f"the path's point ({x:.10g}, {y:.10g}) is outside the bounds {problem.bounds}; "
            "refine a path of this problem"
        )
    free = problem.free_space.segments_are_free(points[:-1], points[1:])
    if not free.all():
        k = int(np.argmin(free))
        (ax, ay), (bx, by) = points[k : k + 2]
        raise InputError(
            f"the path's segment ({ax:.10g}, {ay:.10g}) to ({bx:.10g}, {by:.10g}) touches an "
            "obstacle; refine a path through free space"
        )
    return points


def _is_allowed(problem: Problem, points: Array) -> bool:
    """Does the polyline stay within the bounds and in free space?"""
    inside = problem.bounds.contains(points).all()
    return bool(inside and problem.free_space.segments_are_free(points[:-1], points[1:]).all())


def _refined(problem: Problem, given: Path, tolerance: float) -> Iterator[Array]:
    """Polylines (m, 2) that may be shorter, the last of them most likely the shortest."""
    space = problem.free_space
    if given.length == 0.0:
        return
    if not (space.geometries or space.circles or space.masks):
        candidates = _geodesics(problem.surface, given, tolerance)
        if all(problem.bounds.contains(points).all() for points in candidates):
            yield from candidates
            return
    from .taut import taut_paths

    yield from taut_paths(problem, given.points, tolerance)


def _features(surface: Surface, given: Path) -> float:
    """Features of the surface along a path, as many as no piece may pass over unseen.

    Newton's method makes pieces equally long under h, which counts the cost, whereas features
    are as large as they are on the plane: where the cost is least, pieces reach farthest.
    """
    length = given.length
    if surface.costs:
        length /= float(surface.cost(_along(given.points, MOST_PIECES)).min())
    return length / surface.resolution


def _stages(features: float) -> tuple[int, ...]:
    """Numbers of pieces, from coarse to fine."""
    first = min(max(math.ceil(features), FEWEST_PIECES), MOST_PIECES)
    last = min(max(math.ceil(PIECES_PER_FEATURE * features), 2 * FEWEST_PIECES), MOST_PIECES)
    return tuple(round(count) for count in np.geomspace(first, last, STAGES))


def _along(points: Array, pieces: int) -> Array:
    """Points at equal distances along a polyline on the plane."""
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    places = np.linspace(0.0, reached[-1], pieces + 1)
    return np.column_stack([np.interp(places, reached, axis) for axis in points.T])


def _geodesics(surface: Surface, given: Path, tolerance: float) -> list[Array]:
    """The geodesic near a path where nothing is in the way, as points laid along it.

    Where the surface is too rough to be sure of that, the polyline of least energy comes first.
    """
    stages = _stages(_features(surface, given))
    polyline = shortest_polyline(surface, _along(given.points, stages[0]), stages)
    corrected = correct(surface, polyline)
    curve = curve_through(polyline if corrected is None else corrected)
    points = curve(laid_shares(surface, curve, stages[-1], tolerance))
    points[[0, -1]] = given.points[[0, -1]]
    return [polyline, points] if corrected is None else [points]
