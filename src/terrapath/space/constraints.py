"""All that a vehicle has to keep away from, and why a point is not free, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..errors import InputError
from ..surface import Mask, Surface
from ..surface.bounds import Bounds
from ..validation import Point
from .free_space import Circle, FreeSpace, Geometries, Obstacle, are_points, sort_obstacles

if TYPE_CHECKING:
    from .slope_limit import SlopeLimit, SlopeMeasure

# An area to keep in: shapely polygons.
Area: TypeAlias = BaseGeometry | Iterable[BaseGeometry]


@dataclass(frozen=True, eq=False, kw_only=True)
class Constraints:
    """All that limits where a path may go, as it was given, and the vehicle's radius.

    bounds : of the plane, map units. obstacles : as given, not inflated. nodata : the surface's
    cells without data. slope_limit : which ground is too steep. outside : the plane around the
    area to keep in. Each of these three is None where there is none. radius : of the vehicle, map
    units.
    """

    bounds: Bounds
    obstacles: tuple[Obstacle, ...] = ()
    nodata: Mask | None = None
    slope_limit: SlopeLimit | None = None
    outside: BaseGeometry | None = None
    radius: float = 0.0

    @classmethod
    def of(
        cls,
        surface: Surface,
        bounds: Bounds,
        obstacles: tuple[Obstacle, ...],
        *,
        radius: float = 0.0,
        max_slope: float | None = None,
        slope_measure: SlopeMeasure = "horn",
        keep_in: Area | None = None,
    ) -> Constraints:
        """Those on a surface; the arguments are those of ``Problem``."""
        steepest = outside = None
        if max_slope is not None:
            from .slope_limit import SlopeLimit

            # Steep ground just beyond the bounds also keeps the vehicle away.
            steepest = SlopeLimit(surface, max_slope, bounds.widened(radius), slope_measure)
        if keep_in is not None:
            outside = outside_of(keep_in, bounds, radius)
        return cls(
            bounds=bounds,
            obstacles=obstacles,
            nodata=surface.nodata,
            slope_limit=steepest,
            outside=outside,
            radius=radius,
        )

    @property
    def steep(self) -> Mask | None:
        """The cells that are too steep, None where there are none."""
        return None if self.slope_limit is None else self.slope_limit.mask

    def free_space(self) -> FreeSpace:
        """Where the vehicle's centre may go."""
        others = [self.outside, self.nodata, self.steep]
        given = [*self.obstacles, *(other for other in others if other is not None)]
        if self.radius > 0.0:
            from .inflation import inflated

            given = inflated(given, self.radius, self.bounds)
        return FreeSpace(self.bounds, given)

    def separating(self, a: Point, b: Point) -> str:
        """What separates two free places, in words: all that does so by itself, or all together."""
        nothing = replace(self, obstacles=(), nodata=None, slope_limit=None, outside=None)
        alone = [
            (self._steepness, replace(nothing, slope_limit=self.slope_limit)),
            ("cells without data lie", replace(nothing, nodata=self.nodata)),
            ("obstacles lie", replace(nothing, obstacles=self.obstacles)),
            ("the edge of keep_in lies", replace(nothing, outside=self.outside)),
        ]
        found = [what for what, limits in alone if limits.free_space().separates(a, b)]
        if found:
            return " and ".join(found)
        kinds = (self.slope_limit, self.nodata, self.obstacles or None, self.outside)
        given = [what for (what, _), kind in zip(alone, kinds, strict=True) if kind is not None]
        return " and ".join(given) + ", together,"

    @property
    def _steepness(self) -> str:
        """How much ground is too steep, in words."""
        if self.slope_limit is None or self.steep is None:
            return "no too steep ground lies"
        share = 100.0 * float(self.steep.blocked.mean())
        limit = f"max_slope={self.slope_limit.max_slope:g}"
        return f"ground steeper than {limit} degrees ({share:.3g} % of the cells) lies"

    def blocker(self, point: Point, unit: str = "") -> str:
        """Why a point is not free, in words. One of the inflated obstacles must hold it.

        unit : of the map, to show distances in.
        """
        if blocker := self._blocker_within(point):
            return blocker
        return (
            self._blocker_nearby(point, unit) if self.radius > 0.0 else "on the edge of an obstacle"
        )

    def _blocker_nearby(self, point: Point, unit: str) -> str:
        """The obstacle that a point is too near to."""
        place = shapely.Point(point)
        nearest, name = min((_distance(obstacle, place), name) for name, obstacle in self._named())
        suffix = f" {unit}" if unit else ""
        limit = f"radius={self.radius:.6g}{suffix}"
        distance = f"{_shown(nearest, self.radius)}{suffix}"
        if nearest < self.radius:
            return f"nearer than {limit} to {name}: {distance}"
        return (
            f"in the margin that {limit} makes around {name}, up to a cell or 0.5 % wider: "
            f"it is {distance} away"
        )

    def _blocker_within(self, point: Point) -> str | None:
        """The obstacle that holds the point itself."""
        parts = sort_obstacles(self.obstacles)
        with_width = parts.geometries[~are_points(parts.geometries)]
        masks = parts.masks if self.nodata is None else [*parts.masks, self.nodata]
        given = FreeSpace(self.bounds, [*with_width, *parts.circles, *masks])
        if blocker := given.blocker(point):
            return blocker
        if self.outside is not None and shapely.intersects_xy(self.outside, *point):
            return "outside the area of keep_in, or on its edge"
        if self.slope_limit is None or self.steep is None:
            return None
        is_flat = FreeSpace(self.bounds, [self.steep]).blocker(point) is None
        return None if is_flat else self.slope_limit.describe(point)

    def _named(self) -> list[tuple[str, Obstacle]]:
        named: list[tuple[str, Obstacle | None]] = [("an obstacle", o) for o in self.obstacles]
        named += [
            ("a no-data cell", self.nodata),
            ("too steep ground", self.steep),
            ("the edge of keep_in", self.outside),
        ]
        return [(name, obstacle) for name, obstacle in named if obstacle is not None]


def _shown(distance: float, radius: float) -> str:
    """A distance with enough digits to be told from the radius."""
    digits = next((n for n in (3, 6, 9) if f"{distance:.{n}g}" != f"{radius:.{n}g}"), 12)
    return f"{distance:.{digits}g}"


def _distance(obstacle: Obstacle, point: shapely.Point) -> float:
    """Distance of a point from an obstacle, map units."""
    if isinstance(obstacle, Circle):
        return max(math.hypot(point.x - obstacle.x1, point.y - obstacle.x2) - obstacle.radius, 0.0)
    if isinstance(obstacle, Mask):
        return _distance_from_mask(obstacle, point)
    return math.inf if obstacle.is_empty else float(shapely.distance(obstacle, point))


def _distance_from_mask(mask: Mask, point: shapely.Point) -> float:
    (j, i), (dx, dy) = np.nonzero(mask.blocked), mask.spacing
    across = np.maximum(np.abs(mask.x[i] - point.x) - 0.5 * dx, 0.0)
    along = np.maximum(np.abs(mask.y[j] - point.y) - 0.5 * dy, 0.0)
    return float(np.hypot(across, along).min(initial=math.inf))


# The area to keep in


def outside_of(area: Area, bounds: Bounds, radius: float) -> BaseGeometry:
    """The plane around an area of polygons, as far as it can matter to a vehicle in the bounds.

    Raises InputError where the area is none.
    """
    shapes = _polygons(area)
    reach = 2.0 * radius + 0.1 * bounds.side
    low = np.minimum(bounds[:2], shapely.total_bounds(shapes)[:2]) - reach
    high = np.maximum(bounds[2:], shapely.total_bounds(shapes)[2:]) + reach
    frame = shapely.box(*low, *high)
    # Cutting moves corners by rounding, so the area's own rings become the outline.
    rings, owners = shapely.get_rings(shapes, return_index=True)
    is_hole = np.concatenate([[False], owners[1:] == owners[:-1]])
    islands = shapely.polygons(rings[is_hole])
    around = shapely.Polygon(frame.exterior, list(rings[~is_hole]))
    together = shapely.MultiPolygon([around, *islands])
    return together if together.is_valid else shapely.difference(frame, shapely.union_all(shapes))


def _require_polygon(shape: object) -> None:
    """Raise InputError for what is no polygon, or not a valid one."""
    kind = shape.geom_type if isinstance(shape, BaseGeometry) else type(shape).__name__
    if not (isinstance(shape, BaseGeometry) and kind in {"Polygon", "MultiPolygon"}):
        raise InputError(f"keep_in holds a {kind}; give shapely polygons, whose inside is free")
    if not shape.is_valid:
        raise InputError(
            f"keep_in is not valid: {shapely.is_valid_reason(shape)}; "
            "repair it with shapely.make_valid"
        )


def _polygons(area: Area) -> Geometries:
    """The polygons of one geometry or several, joined where they overlap."""
    try:
        given = [area] if isinstance(area, BaseGeometry) else list(area)
    except TypeError:
        raise InputError(f"keep_in={area!r} is no area; give shapely polygons") from None
    for shape in given:
        _require_polygon(shape)
    whole = given[0] if len(given) == 1 else shapely.union_all(given)
    parts = shapely.get_parts(whole)
    parts = parts[~shapely.is_empty(parts)]
    if len(parts) == 0:
        raise InputError("keep_in is empty, so no place is free; give polygons that hold the ends")
    return np.asarray(parts)
