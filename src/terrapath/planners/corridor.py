"""Maps too large to plan on as a whole: first coarse, then fine around the coarse route.

The lower bound of the fine solution holds only for paths in the corridor around that route, and
the solution says so. For the whole map the chord is a lower bound, unless there are cost layers:
these could make ground elsewhere cheap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import shapely

from ..errors import BlockedError, InputError, OutsideSurfaceError
from ..problem import Problem, Solution, Status
from ..surface import Surface, metric
from ..validation import Array, PointLike, require_positive
from . import FastMarching, Finished, plan_tour
from .base import Callback, Planner, Progress

# The map is read about so coarse at first.
COARSE_CELLS = 1_000_000
# No more cells than this are read of the corridor's surroundings; a larger window is read coarser.
MOST_FINE_CELLS = 120_000_000
# Half the corridor's width, in coarse cells.
HALF_WIDTH = 40.0
# And at least so many.
LEAST_WIDTH = 0.1
# The margin that is read around the corridor, in coarse cells, so that the surface reaches beyond.
MARGIN = 2.0


class Part(NamedTuple):
    """The part of a map that is read, and where on it a path may go."""

    within: tuple[float, float, float, float] | None = None  # the map's own coordinates
    decimate: int = 1  # this many cells, on each side, are read as one
    corridor: Corridor | None = None  # the path must stay in it


@dataclass(frozen=True, eq=False)
class Corridor:
    """The ground near a route that was planned on a coarser map.

    coarse : the solution on the coarser map. half_width : map units, on either side of its path.
    decimate : this many cells of the map, on each side, are one of the coarser map.
    """

    coarse: Solution
    half_width: float
    decimate: int

    def __post_init__(self) -> None:
        require_positive(corridor=self.half_width)

    @property
    def coarse_length(self) -> float:
        """Length of the coarse route, map units."""
        assert self.coarse.path is not None
        return self.coarse.path.length

    @property
    def area(self) -> shapely.Polygon:
        """The corridor on the plane that the coarse route was planned in."""
        assert self.coarse.path is not None
        return self.coarse.path.line.buffer(self.half_width)

    def within(self, margin: float) -> tuple[float, float, float, float]:
        """The rectangle of the map's own coordinates that holds it and a margin, map units."""
        outline = shapely.get_coordinates(self.area.buffer(margin).envelope.segmentize(margin))
        reference = self.coarse.problem.surface.georeference
        points = outline if reference is None else reference.to_map(outline)
        (west, south), (east, north) = points.min(axis=0), points.max(axis=0)
        return float(west), float(south), float(east), float(north)

    def area_on(self, surface: Surface) -> shapely.Polygon:
        """The corridor on the plane of another surface of the same map."""
        theirs, ours = surface.georeference, self.coarse.problem.surface.georeference
        if theirs is None or ours is None or theirs.crs == ours.crs:
            return self.area

        def moved(points: Array) -> Array:
            return theirs.from_map(ours.to_map(points))

        # Each part of a map has a local projection of its own; they differ little.
        return shapely.transform(self.area.segmentize(0.25 * self.half_width), moved)

    @staticmethod
    def least_length(solution: Solution) -> float | None:
        """A lower bound for the whole map: the chords from stop to stop, map units.

        None where there are cost layers: only a part of the map was read, so the least cost on
        the map is not known.
        """
        surface = solution.problem.surface
        return None if surface.costs else metric.chord_through(surface, solution.stops)


# Makes the problem on a part of the map, and the points to pass on the path.
Pose = Callable[[Part], tuple[Problem, Sequence[PointLike]]]


def plan_in_corridor(
    pose: Pose,
    planner: Planner,
    cells: int,
    *,
    half_width: float | None = None,
    callback: Callback | None = None,
) -> Solution:
    """Plan on a coarser map, and on the map itself around the route found there.

    cells : how many the map has. half_width : of the corridor, map units; by default 40 coarse
    cells. The solution has its ``corridor``, and its lower bound holds for paths in there. Where
    there is no path on the coarse map, the solution is that none was found.
    Raises what ``pose`` does. Where only the coarse map is the reason, the error says so.
    """
    decimate = factor(cells, COARSE_CELLS)
    rough = _coarse(pose, decimate, callback)
    if rough.path is None:
        return _without_corridor(rough, decimate)
    cell = _cell(rough.problem)
    width = HALF_WIDTH * cell if half_width is None else _require_width(half_width, rough.problem)
    corridor = Corridor(rough, width, decimate)
    window = corridor.within(MARGIN * cell)
    seen = min(_share(window, rough.problem.surface), 1.0) * cells
    problem, via = pose(Part(window, factor(seen, MOST_FINE_CELLS), corridor))
    solution = plan_tour(problem, planner, via, callback=_named(callback, "corridor"))
    if solution.path is None and solution.status is not Status.INTERRUPTED:
        # A proof holds for the corridor, not for the map.
        hint = "fast-marching looks everywhere in the corridor, and --corridor WIDTH widens it"
        reason = f"{solution.stopped_by}; {hint}"
        solution = replace(solution, status=Status.NOT_FOUND, stopped_by=reason)
    return replace(solution, corridor=corridor, seconds=solution.seconds + rough.seconds)


def _require_width(half_width: float, coarse: Problem) -> float:
    """The half width that was asked for, no wider than the map; InputError where it is no width."""
    cell, unit = _cell(coarse), coarse.surface.unit
    if not half_width >= LEAST_WIDTH * cell:
        raise InputError(
            f"corridor={half_width:g} is too narrow for a map whose coarse cells are "
            f"{cell:g} {unit}".rstrip()
            + f"; give at least {LEAST_WIDTH * cell:.3g}"
        )
    return min(half_width, coarse.bounds.width + coarse.bounds.height)


def factor(cells: float, most: int) -> int:
    """How many cells, on each side, to read as one, so that about ``most`` are left at most."""
    return max(math.ceil(math.sqrt(cells / most)), 1)


def _coarse(pose: Pose, decimate: int, callback: Callback | None) -> Solution:
    try:
        problem, via = pose(Part(decimate=decimate))
    except (BlockedError, OutsideSurfaceError) as error:
        raise InputError(
            f"on the map read {decimate} times coarser: {error}; or plan on all of it at once "
            "with --corridor none"
        ) from None
    planner = Finished(planner=FastMarching(spacing=_cell(problem)), refine=True)
    return plan_tour(problem, planner, via, callback=_named(callback, "coarse map"))


def _without_corridor(rough: Solution, decimate: int) -> Solution:
    reason = f"no path on the map read {decimate} times coarser"
    if rough.status is Status.INTERRUPTED:
        return rough
    return replace(rough, status=Status.NOT_FOUND, stopped_by=reason)


def _cell(problem: Problem) -> float:
    """The larger side of a cell of the coarse map, map units."""
    cells = problem.surface.cells
    assert cells is not None  # every map has them
    return float(max(cells.dx, cells.dy))


def _share(window: tuple[float, float, float, float], surface: Surface) -> float:
    """The share of a surface's area that lies in a window of the map's own coordinates."""
    assert surface.bounds is not None
    box, reference = shapely.box(*surface.bounds), surface.georeference
    if reference is not None:
        box = shapely.transform(box.segmentize(0.1 * surface.bounds.side), reference.to_map)
    return float(shapely.box(*window).intersection(box).area / box.area)


def _named(callback: Callback | None, where: str) -> Callback | None:
    """The callback, with the map named in each progress that it sees."""
    if callback is None:
        return None

    def see(progress: Progress) -> bool | None:
        words = f"{where}, {progress.leg}" if progress.leg else where
        return callback(progress._replace(leg=words))

    return see
