"""Distinct locally shortest routes; they pass peaks and obstacles on different sides."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np
import shapely

from .._support.watching import MustStop, never
from ..distance.field import DistanceField, march_both
from ..distance.medium import Medium
from ..errors import InputError, tell_unfinished
from ..problem import Path, Problem
from ..space.lattice import Lattice
from ..validation import Array, require_count, require_positive
from .refinement import refine

# A node is a candidate for a route to pass through where the length of that route is least within
# this share of the region's side.
NEIGHBOURHOOD = 1.0 / 40.0

# Routes more than this many times as long as the shortest are left out.
LONGEST = 1.5

# At most this many candidates are tried for each route that is asked for.
TRIES = 6

# Two routes are the same if they are nowhere farther apart than this share of the region's side;
# or if they are equally long, and nowhere farther apart than a neighbourhood.
SAME_PLACE = 1e-3
SAME_LENGTH = 1e-7

# Two values of fields that differ by no more than this share may belong to one route. And this
# is the most by which a field is taken to be wrong, as a share: on the roughest ground every
# candidate could be shorter otherwise.
SAME_VALUE, MOST_DOUBT = 1e-4, 0.01

# Two routes are compared at this many places.
LOOKS = 65


def alternatives(
    problem: Problem, count: int = 5, *, spacing: float | None = None
) -> tuple[Path, ...]:
    """The distinct locally shortest routes from start to goal, each refined, shortest first.

    count : the most routes to return. spacing : of the nodes on which routes are searched, map
    units; by default a 250th of the region's longer side, or a cell of the map where that is less.

    Each further route passes through a node away from the routes found before, where the sum of the
    distances to start and goal is least. The tuple is empty where no route was found. A route that
    cannot be refined is left out, with a warning; where none can be, the error is raised.
    Raises InputError for a count or a spacing that is not above 0.
    """
    require_count(count=count)
    if problem.travel is not None:
        raise InputError("alternatives are looked for by length and take no travel model yet")
    if spacing is not None:
        require_positive(spacing=spacing)
    if problem.start == problem.goal:
        return (problem.path([problem.start, problem.goal]),)
    lattice = Lattice.spanning(problem.bounds, spacing or problem.default_spacing)
    medium = Medium(problem.surface, lattice, problem.free_space)
    fields = march_both(medium, problem.start, problem.goal)
    failures: list[Exception] = []
    direct = fields[0].path_to(problem.goal)
    found = list(routes_of_fields(problem, fields, direct, count, failed=failures.append))
    if failures and not found:
        raise failures[0]
    if failures:
        tell_unfinished("not every route could be refined; the others are given", failures[0])
    return shortest(found, count)


def shortest(routes: Iterable[Path], count: int) -> tuple[Path, ...]:
    """The ``count`` shortest of the routes, shortest first."""
    return tuple(sorted(routes, key=lambda route: route.gauged)[:count])


def routes_of_fields(
    problem: Problem,
    fields: tuple[DistanceField, DistanceField],
    direct: Path | None,
    count: int,
    *,
    only_shorter: bool = False,
    rival: float = math.inf,
    failed: Callable[[Exception], object],
    must_stop: MustStop = never,
    is_late: MustStop = never,
) -> Iterator[Path]:
    """Distinct routes, each as soon as it is refined; the path down the fields comes first.

    fields : from the start and from the goal, on one lattice. direct : the path down the first; no
    routes where it is None. count : routes that are asked for; more are tried, because a later one
    may be shorter. only_shorter : then only those that may be shorter than all before, as far as
    the fields are right about the best. rival : the length of a route that is known; with
    ``only_shorter`` they must be shorter than that, too. failed : is called with the error where a
    route cannot be refined. must_stop : is asked after each candidate whether to end the search.
    is_late : is asked many times a second; when it says True, the route in hand is not refined any
    further.
    """
    if direct is None:
        return
    found: list[Path] = []
    value = float(fields[0].at(problem.goal))
    for tries, candidate in enumerate(_candidates(problem, fields, direct, value), 1):
        if only_shorter and (len(found) >= count or rival < math.inf):
            best = min([rival, *(route.length for route in found)])
            doubt = min(abs(best / value - 1.0), MOST_DOUBT) + SAME_VALUE
            if candidate.value > best * (1.0 + doubt):
                break
            rival = best
        try:
            route = refine(problem, candidate.path, must_stop=is_late, rival=rival)
        except Exception as error:
            failed(error)
        else:
            is_new = not any(is_same(problem, route, other) for other in found)
            if is_new and route.length <= rival:
                found.append(route)
                yield route
        if tries >= TRIES * count or must_stop():
            break


class _Candidate(NamedTuple):
    """A path down two fields, and how long they say it is, map units."""

    path: Path
    value: float


def _candidates(
    problem: Problem, fields: tuple[DistanceField, DistanceField], direct: Path, value: float
) -> Iterator[_Candidate]:
    """Paths down both fields, then routes through the nodes of least detour, away from others.

    direct : down the first field. value : how long that one says it is, map units.
    """
    from_start, from_goal = fields
    yield _Candidate(direct, value)
    lattice = from_start.lattice
    back = from_goal.path_to(problem.start)
    if back is not None and not _stay_together(direct, back, max(lattice.spacing)):
        yield _Candidate(problem.path(back.points[::-1].copy()), value)
    radius = NEIGHBOURHOOD * problem.bounds.side
    detours = from_start.values + from_goal.values
    vias = _away_from(direct, _vias(detours, lattice, radius), radius)
    while len(vias):
        path = _lead_through(problem, from_start, from_goal, vias[0, :2])
        value = float(vias[0, 2])
        vias = vias[1:]
        if path is not None:
            vias = _away_from(path, vias, radius)
            yield _Candidate(path, value)


def _away_from(path: Path, vias: Array, radius: float) -> Array:
    """The places (m, 3) that are farther than a radius from a path."""
    near = np.asarray(shapely.dwithin(path.line, shapely.points(vias[:, :2]), radius))
    return np.asarray(vias[~near])


def _vias(detours: Array, lattice: Lattice, radius: float) -> Array:
    """Nodes where the detour is least in a neighbourhood: (m, 3), x1, x2 and rising detours."""
    from scipy.ndimage import minimum_filter

    size = (2 * math.ceil(radius / lattice.dy) + 1, 2 * math.ceil(radius / lattice.dx) + 1)
    least = minimum_filter(detours, size=size, mode="nearest")
    longest = LONGEST * float(detours.min())
    chosen = np.isfinite(detours) & (detours <= least) & (detours <= longest)
    rows, columns = np.nonzero(chosen)
    order = np.argsort(detours[chosen], kind="stable")
    return np.column_stack([lattice.x[columns], lattice.y[rows], detours[chosen]])[order]


def _lead_through(
    problem: Problem, from_start: DistanceField, from_goal: DistanceField, point: Array
) -> Path | None:
    """The shortest path through a point."""
    first, second = from_start.path_to(point), from_goal.path_to(point)
    if first is None or second is None:
        return None
    return problem.path(np.concatenate([first.points[:-1], second.points[::-1]]))


def is_same(problem: Problem, a: Path, b: Path) -> bool:
    """Are two refined routes the same?"""
    side = problem.bounds.side
    if _stay_together(a, b, SAME_PLACE * side):
        return True
    alike = abs(a.gauged - b.gauged) <= SAME_LENGTH * max(a.gauged, b.gauged)
    return alike and _stay_together(a, b, NEIGHBOURHOOD * side)


def _stay_together(a: Path, b: Path, distance: float) -> bool:
    """Is neither path, at LOOKS places, farther than a distance from the other?"""
    shares = np.linspace(0.0, 1.0, LOOKS)
    return all(
        bool(
            shapely.dwithin(
                other.line,
                shapely.line_interpolate_point(one.line, shares, normalized=True),
                distance,
            ).all()
        )
        for one, other in ((a, b), (b, a))
    )
