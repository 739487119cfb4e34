"""Maps too large to plan on as a whole: first coarse, then fine around the coarse route.

The bound of the fine answer holds for paths in the corridor alone, and is said to; for the
whole map the chord is a bound, where no cost layer can make ground cheap elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import shapely

from .._kernels.surface.surfaces import Spline
from ..errors import BlockedError, InputError, OutsideSurfaceError
from ..problem import Problem, Solution, Status
from ..surface import Surface, metric
from ..validation import Array, require_positive
from . import FastMarching, Finished, plan_tour
from .base import Callback, Planner, Progress

# It is read about so coarse at first.
COARSE_CELLS = 1_000_000
# Of the corridor's window no more cells are read; a larger one is read coarser.
MOST_FINE_CELLS = 120_000_000
# Half the corridor's width, in coarse cells.
HALF_WIDTH = 40.0
# What is read around the corridor, in coarse cells, so that the surface does not end with it.
MARGIN = 2.0


class Part(NamedTuple):
    """What is read of a map, and where on it a path may go."""

    within: tuple[float, float, float, float] | None = None  # the map's own coordinates
    decimate: int = 1  # cells a side that one is read of
    corridor: Corridor | None = None


@dataclass(frozen=True, eq=False)
class Corridor:
    """The ground within ``half_width`` of a route planned on a coarser map, map units.

    decimate : how many cells of the map, a side, one was planned on.
    """

    coarse: Solution
    half_width: float
    decimate: int

    def __post_init__(self) -> None:
        require_positive(corridor=self.half_width)

    @property
    def area(self) -> shapely.Polygon:
        """On the plane that the coarse route was planned in."""
        assert self.coarse.path is not None
        return self.coarse.path.line.buffer(self.half_width)

    def within(self, margin: float) -> tuple[float, float, float, float]:
        """The rectangle of the map's own coordinates that holds it and a margin, map units."""
        outline = shapely.get_coordinates(self.area.buffer(margin).envelope.segmentize(margin))
        reference = self.coarse.problem.surface.georeference
        points = outline if reference is None else reference.to_map(outline)
        (west, south), (east, north) = points.min(axis=0), points.max(axis=0)
        return float(west), float(south), float(east), float(north)

    def area_on(self, surface: Surface) -> Any:
        """On the plane of another surface of the same map."""
        theirs, ours = surface.georeference, self.coarse.problem.surface.georeference
        if theirs is None or ours is None or theirs.crs == ours.crs:
            return self.area

        def moved(points: Array) -> Array:
            return theirs.from_map(ours.to_map(points))

        # A local projection depends on the part of the map: between two nothing bends much.
        return shapely.transform(self.area.segmentize(0.25 * self.half_width), moved)

    @staticmethod
    def least_length(solution: Solution) -> float | None:
        """No path on the whole map is shorter: the chords from stop to stop, map units.

        None with cost layers: their least on the map is not known, for only a part was read.
        """
        surface = solution.problem.surface
        return None if surface.costs else metric.chord_through(surface, solution.stops)


# The problem on a part of the map, and the points that are to be passed.
Pose = Callable[[Part], tuple[Problem, Sequence[Any]]]


def plan_in_corridor(
    pose: Pose,
    planner: Planner,
    cells: int,
    *,
    half_width: float | None = None,
    callback: Callback | None = None,
) -> Solution:
    """Plan on a coarser map, and on the map itself around the route found there.

    cells : of the map, which tell how coarse. half_width : of the corridor, map units; by
    default 40 coarse cells. The answer has its ``corridor``; its bound holds for paths in
    there. Without a way on the coarse map the answer is that none was found.
    Raises what ``pose`` does, with a remedy where only the coarse map is in the way.
    """
    decimate = factor(cells, COARSE_CELLS)
    rough = _coarse(pose, decimate, callback)
    if rough.path is None:
        return _without_corridor(rough, decimate)
    cell = _cell(rough.problem)
    corridor = Corridor(rough, HALF_WIDTH * cell if half_width is None else half_width, decimate)
    window = corridor.within(MARGIN * cell)
    seen = min(_share(window, rough.problem.surface), 1.0) * cells
    problem, via = pose(Part(window, factor(seen, MOST_FINE_CELLS), corridor))
    solution = plan_tour(problem, planner, via, callback=_told(callback, "corridor"))
    if solution.path is None and solution.status is not Status.INTERRUPTED:
        # Whatever was proven is proven of the corridor, not of the map.
        hint = "fast-marching looks everywhere in the corridor, and --corridor WIDTH widens it"
        reason = f"{solution.stopped_by}; {hint}"
        solution = replace(solution, status=Status.NOT_FOUND, stopped_by=reason)
    return replace(solution, corridor=corridor, seconds=solution.seconds + rough.seconds)


def factor(cells: float, most: int) -> int:
    """How many cells a side become one, so that no more than about ``most`` are left."""
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
    return plan_tour(problem, planner, via, callback=_told(callback, "coarse map"))


def _without_corridor(rough: Solution, decimate: int) -> Solution:
    reason = f"no way on the map read {decimate} times coarser"
    if rough.status is Status.INTERRUPTED:
        return rough
    return replace(rough, status=Status.NOT_FOUND, stopped_by=reason)


def _cell(problem: Problem) -> float:
    """Of the coarse map, map units."""
    data = problem.surface.data
    assert isinstance(data, Spline)  # as all maps are
    return float(max(data.dx, data.dy))


def _share(window: tuple[float, float, float, float], surface: Surface) -> float:
    """Of the map's area, the share that lies in a window of its own coordinates."""
    assert surface.bounds is not None
    box, reference = shapely.box(*surface.bounds), surface.georeference
    if reference is not None:
        box = shapely.transform(box.segmentize(0.1 * surface.bounds.side), reference.to_map)
    return float(shapely.box(*window).intersection(box).area / box.area)


def _told(callback: Callback | None, where: str) -> Callback | None:
    """The callback, told on which map it is."""
    if callback is None:
        return None

    def see(progress: Progress) -> bool | None:
        words = f"{where}, {progress.leg}" if progress.leg else where
        return callback(progress._replace(leg=words))

    return see
