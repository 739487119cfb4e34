"""From any planner's path to the exact locally shortest path near it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from ..._kernels.geodesics.paced import PacedStrand
from ..._support.watching import MustStop, never, stop_after
from ...errors import InputError, UnfinishedWarning, tell
from ...problem import Path, Problem
from ...surface import Surface
from ...surface.metric import feature_size, is_rough
from ...validation import Array, as_array, require_positive
from .newton import (
    along,
    correct,
    curve_through,
    lift,
    placed_parameters,
    shortest_polyline,
)
from .paced import chords_of

__all__ = ["refine", "shortest_polyline"]

TOLERANCE = 3e-8  # by which the polyline may be longer than the geodesic, relative

# The number of pieces of the polyline grows in stages: from one for each feature of the surface to
# as many as make the geodesic through its points exact.
FEWEST_PIECES, MOST_PIECES = 32, 4096
PIECES_PER_FEATURE = 8.0
# Under a pace: along a kink the curve has to keep to one grade between its points, too.
PACED_PIECES_PER_FEATURE = 32.0
STAGES = 3

# A path begins at the problem's start if it begins within this share of the region's side of it;
# likewise at the goal.
SAME_PLACE = 1e-9
# The path found may be longer than the one given by this share, which allows for rounding.
ROUNDING = 1e-12

# The energy of a polyline, taken as a length, is at most this many times its length where pieces
# are short enough for a model of smooth ground. On the roughest ground they are not.
SMOOTH = 1.1
# After it was shortened, a path becomes shorter by less than this share.
LITTLE = 0.01
# Under a pace a path that ran zigzag along a kink is pulled again while it gains this share.
WORTH_REPEATING, MOST_REPEATS = 1e-5, 4
# Features this many times as long as wide are too many for a model that takes them as round.
LONG = 4.0

NO_ROOM = "a path could not be refined: obstacles leave no room to pull it taut; it stays as it was"


def refine(
    problem: Problem,
    path: Path | npt.ArrayLike,
    *,
    tolerance: float = TOLERANCE,
    time_limit: float | None = None,
    must_stop: MustStop = never,
    rival: float = math.inf,
) -> Path:
    """The locally shortest path near a path: what it becomes when it is pulled taut.

    path : Path or (m, 2) array, map units, from the problem's start to its goal through free
    space; any planner's will do. tolerance : by which the path returned may be longer than the
    exact geodesic, relative. It holds where the path touches nothing, and as long as 8,192 points
    are enough. The path bends round obstacles at a distance of 1e-8 of the region's side, however
    near to them the path given passes. It is never longer than the path given, stays in free
    space, and passes each obstacle on the same side. Where obstacles leave no room to pull the
    path taut, it is returned as it was, with an UnfinishedWarning. Where costs are constant in
    cells, its bends move along the sides of cells to where it is shortest. On rough ground the path
    is first shortened by true lengths, on 2 to 16 points for each feature of the surface. Where the
    ground is too rough for the exact geodesic, that is the path returned; where even finer points
    would shorten it by a percent or more, an UnfinishedWarning says so. time_limit : seconds.
    must_stop : is asked many times a second whether to stop; from then on it must say True. Where
    time is up, or it says so, the path is the best one so far. rival : the length of a path that
    this one competes with, map units. On rough ground a path that will not become shorter than that
    is returned as it was.
    Raises InputError where the path does not join start and goal, or is not in free space.
    """
    require_positive(tolerance=tolerance)
    if time_limit is not None:
        require_positive(time_limit=time_limit)
        must_stop = stop_after(time_limit, must_stop)
    given = problem.path(_checked(problem, path))
    is_hard = given.gauged > 0.0 and not must_stop() and _is_hard(problem)
    if problem.surface.cost_cells is not None and problem.travel is None:
        from ..cell_routes import polished

        shorter = _shortened(problem, given, must_stop, rival) if is_hard else given
        is_worth_it = not is_hard or shorter.length * (1.0 - LITTLE) <= rival
        return polished(problem, shorter, must_stop) if is_worth_it else shorter
    if is_hard:
        return _refined_on_rough_ground(problem, given, tolerance, must_stop, rival)
    best, is_pulled = _pulled(problem, given, tolerance, must_stop)
    best = _pulled_again(problem, best, tolerance, must_stop) if is_pulled else best
    if not (is_pulled or given.gauged == 0.0 or must_stop()):
        tell(UnfinishedWarning(NO_ROOM))
    return best


def _is_hard(problem: Problem) -> bool:
    """Is the ground rough, or are features much longer along one axis than along the other?"""
    x, y = feature_size(problem.surface)
    return max(x, y) > LONG * min(x, y) or is_rough(problem.priced, problem.bounds)


def _pulled(
    problem: Problem, given: Path, tolerance: float, must_stop: MustStop, is_near: bool = False
) -> tuple[Path, bool]:
    """The path pulled taut on smooth ground, and whether it could be pulled at all.

    is_near : is the path given nearly taut? Then it is not pulled in coarse pieces first.
    """
    best, is_pulled = given, False
    for points in _refined(problem, given, tolerance, must_stop, is_near):
        if not problem.allows(points):
            continue
        found, is_pulled = problem.path(points), True
        # Of two that are equally long, the later one has fewer points.
        longest = min(best.gauged * (1.0 + tolerance), given.gauged * (1.0 + ROUNDING))
        if found.gauged <= longest:
            best = found
        if must_stop():
            break
    return best, is_pulled


def _shortened(problem: Problem, given: Path, must_stop: MustStop, rival: float) -> Path:
    """The path shortened by true lengths; without a pace the same from the goal to the start."""
    from .lanes import shortened

    order = -1 if problem.goal < problem.start and problem.travel is None else 1
    made = shortened(problem, given.points[::order].copy(), must_stop, rival=rival)
    if not (made.is_settled or made.is_hopeless or must_stop()):
        tell(UnfinishedWarning(made.remark))
    found = problem.path(made.points[::order].copy())
    return min(given, found, key=lambda path: path.gauged)


def _refined_on_rough_ground(
    problem: Problem, given: Path, tolerance: float, must_stop: MustStop, rival: float
) -> Path:
    """The path shortened by true lengths, then pulled taut where the ground is smooth enough."""
    best = _shortened(problem, given, must_stop, rival)
    is_worth_it = best.gauged * (1.0 - LITTLE) <= rival
    if is_worth_it and _is_resolved(problem.priced, best):
        best = _pulled(problem, best, tolerance, must_stop, is_near=True)[0]
        return _pulled_again(problem, best, tolerance, must_stop)
    return best


def _pulled_again(problem: Problem, best: Path, tolerance: float, must_stop: MustStop) -> Path:
    """The path, under a pace pulled again while it gains by that."""
    for _ in range(MOST_REPEATS if problem.travel is not None else 0):
        before = best
        best, _ = _pulled(problem, before, tolerance, must_stop, is_near=True)
        if must_stop() or best.gauged >= before.gauged * (1.0 - WORTH_REPEATING):
            break
    return best


def _is_resolved(surface: Surface, path: Path) -> bool:
    """Are the pieces of a polyline short enough for a model of smooth ground?"""
    pieces = _stages(surface, path)[-1]
    if pieces == MOST_PIECES:
        return False
    lifted = lift(surface, along(path.points, pieces))
    if isinstance(lifted.strand, PacedStrand):
        return path.gauged <= SMOOTH * float(chords_of(lifted.strand).sum())
    energy = lifted.energy
    return math.sqrt(energy) <= SMOOTH * path.gauged


def _checked(problem: Problem, path: Path | npt.ArrayLike) -> Array:
    """The points of a path from start to goal through free space, without repeated ones.

    Raises InputError where it is none.
    """
    given = path.points if isinstance(path, Path) else path
    points = as_array(given, "path", shape=(None, 2)).copy()
    _join_ends(problem, points)
    moved = (np.diff(points, axis=0) != 0.0).any(axis=1)
    points = np.concatenate([points[:1], points[1:][moved]])
    if len(points) == 1:
        points = np.repeat(points, 2, axis=0)
    _require_free(problem, points)
    return points


def _join_ends(problem: Problem, points: Array) -> None:
    """Put a path's ends exactly onto the problem's start and goal."""
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


def _require_free(problem: Problem, points: Array) -> None:
    """Raise InputError where a path is not within the bounds and in free space."""
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


def _refined(
    problem: Problem, given: Path, tolerance: float, must_stop: MustStop, is_near: bool
) -> Iterator[Array]:
    """Polylines (m, 2) that may be shorter; the last is most likely the shortest."""
    space = problem.free_space
    if given.gauged == 0.0 or must_stop():
        return
    if not (space.geometries or space.circles or space.masks):
        candidates = _geodesics(problem.priced, given, tolerance, must_stop, is_near)
        if all(problem.bounds.contains(points).all() for points in candidates):
            yield from candidates
            return
    from .taut import taut_paths

    yield from taut_paths(problem, given.points, tolerance, must_stop, is_near)


def _features(surface: Surface, given: Path) -> float:
    """How many features of the surface there are along a path; a piece must not skip one.

    Newton's method makes pieces equally long under h, which includes the cost, but features have
    their size on the plane. So pieces are longest on the plane where the cost is least.
    """
    length = given.length if given.pricing is None else given.line.length
    if surface.costs and given.pricing is None:
        length /= float(surface.cost(along(given.points, MOST_PIECES)).min())
    return length / surface.resolution


def _stages(surface: Surface, given: Path) -> tuple[int, ...]:
    """Numbers of pieces, from coarse to fine."""
    features = _features(surface, given)
    per_feature = PIECES_PER_FEATURE if given.pricing is None else PACED_PIECES_PER_FEATURE
    first = min(max(math.ceil(features), FEWEST_PIECES), MOST_PIECES)
    last = min(max(math.ceil(per_feature * features), 2 * FEWEST_PIECES), MOST_PIECES)
    return tuple(round(count) for count in np.geomspace(first, last, STAGES))


def _geodesics(
    surface: Surface, given: Path, tolerance: float, must_stop: MustStop, is_near: bool
) -> list[Array]:
    """The geodesic near a path, as a polyline (m, 2), as if there were no obstacles.

    Where the surface is too rough for the geodesic to be exact, the polyline of least energy comes
    before it. Where it must stop, only the polyline as far as it is pulled.
    """
    stages = _stages(surface, given)[-1 if is_near else 0 :]
    polyline = shortest_polyline(surface, along(given.points, stages[0]), stages, must_stop)
    if must_stop():
        return [polyline]
    corrected = correct(surface, polyline)
    curve = curve_through(polyline if corrected is None else corrected)
    points = curve(placed_parameters(surface, curve, stages[-1], tolerance))
    points[[0, -1]] = given.points[[0, -1]]
    return [polyline, points] if corrected is None else [points]
