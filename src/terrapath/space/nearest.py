"""The free place that is nearest to a place that is not free."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt
import shapely

from ..validation import Array, Point
from .free_space import FreeSpace

# Places are tried on squares around the point, each twice as wide as the one before, from this
# share of the bounds on. On a side there are so many, and then more, no farther than the free one.
FIRST, PLACES, CLOSER = 1e-6, 24, 64

# Of places in other parts of the free space than the wanted one so many are tried.
MOST_PARTS = 50


def nearest_free(space: FreeSpace, point: Point) -> tuple[Point, float] | None:
    """A free place within the bounds near a point, and its distance, map units; None without one.

    It is the nearest to a few hundredths of its distance, unless free ground is narrower than that.
    """
    reach = FIRST * math.hypot(space.bounds.width, space.bounds.height)
    farthest = 2.0 * math.hypot(space.bounds.width, space.bounds.height)
    while reach < farthest:
        found = _nearest_on_square(space, point, reach, PLACES)
        if found is not None:
            return _nearest_on_square(space, point, found[1], CLOSER) or found
        reach *= 2.0
    return None


def nearest_joined(
    space: FreeSpace, point: Point, farthest: float, is_joined: Callable[[Point], bool]
) -> tuple[Point, float] | None:
    """As ``nearest_free``, but in a part of the free space where ``is_joined`` says yes.

    None where none was found within ``farthest``, map units. A place that a free segment joins to
    one that was refused is not asked about.
    """
    reach = FIRST * math.hypot(space.bounds.width, space.bounds.height)
    refused: list[Point] = []
    while reach < 2.0 * farthest and len(refused) < MOST_PARTS:
        for place, distance in _free_on_square(space, point, min(reach, farthest), PLACES):
            if distance > farthest or len(refused) == MOST_PARTS:
                break
            others = np.array(refused).reshape(-1, 2)
            if space.segments_are_free(others, np.broadcast_to(place, others.shape)).any():
                continue
            if is_joined(place):
                return place, distance
            refused.append(place)
        reach *= 2.0
    return None


def _nearest_on_square(
    space: FreeSpace, point: Point, reach: float, count: int
) -> tuple[Point, float] | None:
    """The nearest free one among places on a square around a point."""
    return next(_free_on_square(space, point, reach, count), None)


def _free_on_square(
    space: FreeSpace, point: Point, reach: float, count: int
) -> Iterator[tuple[Point, float]]:
    """The free ones among places on a square around a point, and their distances, nearest first."""
    steps = np.linspace(-reach, reach, 2 * count + 1)
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + point
    distances = np.hypot(*(places - point).T)
    places = places[np.argsort(distances, kind="stable")]
    for place in places[_may_be_free(space, places)].tolist():
        # A place with as many digits as messages have, so that what is read there can be given.
        x, y = (float(f"{value:.10g}") for value in place)
        if space.bounds.contains(np.array([x, y])) and space.blocker((x, y)) is None:
            yield (x, y), math.hypot(x - point[0], y - point[1])


def _may_be_free(space: FreeSpace, places: Array) -> npt.NDArray[np.bool_]:
    """(m,), which places are in the bounds, and in no obstacle as far as is quick to tell."""
    maybe = space.bounds.contains(places)
    maybe[maybe] = space.segments_are_free(places[maybe], places[maybe])
    for geometry in space.geometries:
        maybe[maybe] = ~shapely.intersects_xy(geometry, *places[maybe].T)
    return np.asarray(maybe)
