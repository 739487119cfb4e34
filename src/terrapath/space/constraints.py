"""What a vehicle with a width, or with a limit, has to keep away from.

Obstacles are inflated by the vehicle's radius, so that a point that is disjoint from the inflated
ones is at least the radius away from those given. That is never less: a buffer of GEOS lies
inside the true one, so each is made larger, measured, and grown where it is too small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..errors import InputError
from ..surface import Mask
from ..surface.bounds import Bounds
from ..validation import Array
from .free_space import POINTS, Circle, FreeSpace, Geometries, Obstacle, sort_obstacles
from .reachability import merged_masks
from .slope_limit import Steepness

# A quarter of a circle becomes this many edges. GEOS rounds their number along an arc, so each may
# span half as much again, and by that angle the buffer is made wider: 0.5 % at most.
QUARTER_EDGES = 12
WIDEST_EDGE = 1.5 * 0.5 * math.pi / QUARTER_EDGES

# The clearance is larger than the radius by this share of it, and of the largest coordinate:
# far above rounding, far below anything on a map.
EXCESS, ROUNDING = 1e-9, 2.0**-46

# How a buffer that is found too small is grown: by this share, doubled each time.
GROWTH, ATTEMPTS = 0.002, 9

# Inflated obstacles are joined where they have no more corners: it takes 5 microseconds each.
MOST_JOINED = 300_000

# Cells count as nearer than the radius by this share of a cell at the least. Free space widens
# blocked cells by a hundred times that, so a path is never nearer than the radius.
CELL_DOUBT = 1e-9
MOST_CELLS_AT_ONCE = 2**22


@dataclass(frozen=True, eq=False, kw_only=True)
class Constraints:
    """All that keeps a path from going somewhere, as it was given, and the vehicle's radius.

    nodata : cells of the surface without data. steepness : which of its ground is too steep.
    outside : what of the plane is not in the area to keep in. Each None where there is none.
    """

    bounds: Bounds
    obstacles: tuple[Obstacle, ...] = ()
    nodata: Mask | None = None
    steepness: Steepness | None = None
    outside: BaseGeometry | None = None
    radius: float = 0.0

    @property
    def steep(self) -> Mask | None:
        """Cells of too steep ground, None where there is none."""
        return None if self.steepness is None else self.steepness.mask

    def free_space(self) -> FreeSpace:
        """Where the vehicle's centre may go."""
        others = [self.outside, self.nodata, self.steep]
        given = [*self.obstacles, *(other for other in others if other is not None)]
        return FreeSpace(self.bounds, inflated(given, self.radius, self.bounds))

    def blocker(self, point: tuple[float, float], unit: str = "") -> str:
        """What makes a point not free, in words; one of the inflated obstacles holds it."""
        place = shapely.Point(point)
        if blocker := self._blocker_within(point):
            return blocker
        if self.radius > 0.0:
            nearest, name = min(
                (_distance(obstacle, place), name) for name, obstacle in self._named()
            )
            suffix = f" {unit}" if unit else ""
            limit = f"radius={self.radius:.6g}{suffix}"
            distance = f"{_shown(nearest, self.radius)}{suffix}"
            if nearest < self.radius:
                return f"nearer than {limit} to {name}: {distance}"
            return (
                f"in the margin that {limit} makes around {name}, up to a cell or 0.5 % wider: "
                f"it is {distance} away"
            )
        return "on the edge of an obstacle"

    def _blocker_within(self, point: tuple[float, float]) -> str | None:
        """The obstacle that holds the point itself."""
        parts = sort_obstacles(self.obstacles)
        with_width = parts.geometries[~_are_points(parts.geometries)]
        masks = parts.masks if self.nodata is None else [*parts.masks, self.nodata]
        given = FreeSpace(self.bounds, [*with_width, *parts.circles, *masks])
        if blocker := given.blocker(point):
            return blocker
        if self.outside is not None and shapely.intersects_xy(self.outside, *point):
            return "outside the area of keep_in, or on its edge"
        if self.steepness is None or self.steep is None:
            return None
        is_flat = FreeSpace(self.bounds, [self.steep]).blocker(point) is None
        return None if is_flat else self.steepness.describe(point)

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


def _are_points(geometries: Geometries) -> Any:
    return np.isin(shapely.get_type_id(geometries), POINTS)


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


def outside_of(area: Any, bounds: Bounds, radius: float) -> BaseGeometry:
    """The plane around an area of polygons, as far as a vehicle within the bounds can feel it.

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


def _polygons(area: Any) -> Geometries:
    """The polygons of one geometry or several, joined where they overlap."""
    try:
        given = [area] if isinstance(area, BaseGeometry) else list(area)
    except TypeError:
        raise InputError(f"keep_in={area!r} is no area; give shapely polygons") from None
    for shape in given:
        if not isinstance(shape, BaseGeometry) or shape.geom_type not in {
            "Polygon",
            "MultiPolygon",
        }:
            kind = getattr(shape, "geom_type", type(shape).__name__)
            raise InputError(f"keep_in holds a {kind}; give shapely polygons, whose inside is free")
        if not shape.is_valid:
            raise InputError(
                f"keep_in is not valid: {shapely.is_valid_reason(shape)}; "
                "repair it with shapely.make_valid"
            )
    whole = given[0] if len(given) == 1 else shapely.union_all(given)
    parts = shapely.get_parts(whole)
    parts = parts[~shapely.is_empty(parts)]
    if len(parts) == 0:
        raise InputError("keep_in is empty, so no place is free; give polygons that hold the ends")
    return np.asarray(parts)


# Inflation


def inflated(obstacles: Sequence[Obstacle], radius: float, bounds: Bounds) -> list[Obstacle]:
    """Obstacles that keep what is disjoint from them a radius away from those given.

    Discs and points become discs. A mask's cells are those whose rectangle is nearer than the
    radius to a blocked one's. What is too far off to be felt within the bounds is left out.
    """
    if radius == 0.0:
        return list(obstacles)
    parts = sort_obstacles(obstacles)
    extents = shapely.bounds(parts.geometries).reshape(-1, 4)
    largest = float(np.abs(np.concatenate([extents.ravel(), bounds])).max())
    reach = radius * (1.0 + EXCESS) + ROUNDING * largest
    near = _are_near(extents, bounds, 2.0 * reach)
    geometries = parts.geometries[near]
    is_point = _are_points(geometries)
    corners = shapely.get_coordinates(geometries[is_point])
    discs = [Circle(float(x), float(y), reach) for x, y in corners]
    discs += [Circle(disc.x1, disc.x2, disc.radius + reach) for disc in parts.circles]
    masks = [_inflated_mask(mask, radius, bounds) for mask in merged_masks(parts.masks)]
    return [*_joined(geometries[~is_point], radius, reach), *discs, *masks]


def _are_near(extents: Array, bounds: Bounds, reach: float) -> Any:
    west, south, east, north = extents.T
    in_x = (east >= bounds.x1_min - reach) & (west <= bounds.x1_max + reach)
    return in_x & (north >= bounds.x2_min - reach) & (south <= bounds.x2_max + reach)


def _joined(given: Geometries, radius: float, reach: float) -> Geometries:
    """Lines and polygons inflated, and made one where they overlap."""
    if len(given) == 0:
        return given
    grown = _grown(given, radius, reach)
    if shapely.get_num_coordinates(grown).sum() > MOST_JOINED:
        return grown
    merged = shapely.get_parts(shapely.union_all(grown))
    # Joining moves the corners where outlines cross by rounding: it has to be looked at, too.
    return merged if _is_clear(given, merged, reach) else grown


def _grown(given: Geometries, radius: float, reach: float) -> Geometries:
    """Each geometry inflated, until its outline is ``reach`` away from what was given."""
    shapely.prepare(given)
    inside = shapely.point_on_surface(given)
    grown = np.empty(len(given), np.object_)
    todo = np.arange(len(given))
    distance = reach / math.cos(0.5 * WIDEST_EDGE)
    for attempt in range(ATTEMPTS):
        grown[todo] = shapely.buffer(given[todo], distance, quad_segs=QUARTER_EDGES)
        clear = shapely.covers(grown[todo], inside[todo])
        clear &= ~shapely.dwithin(given[todo], shapely.boundary(grown[todo]), reach)
        todo = todo[~clear]
        if len(todo) == 0:
            return grown
        distance *= 1.0 + GROWTH * 2.0**attempt
    raise InputError(
        f"radius={radius:g} is too small or too large to inflate obstacles near "
        f"{given[todo[0]].centroid.coords[0]} by; give coordinates nearer to the origin"
    )


def _is_clear(given: Geometries, grown: Geometries, reach: float) -> bool:
    """Are all outlines at least ``reach`` away from all that was given, which they hold?"""
    held, _ = shapely.STRtree(grown).query(shapely.point_on_surface(given), predicate="within")
    if len(np.unique(held)) < len(given):
        return False
    near = shapely.STRtree(given).query(
        shapely.boundary(grown), predicate="dwithin", distance=reach
    )
    return bool(near.shape[1] == 0)


# Masks


def _inflated_mask(mask: Mask, radius: float, bounds: Bounds) -> Mask:
    """The cells whose rectangle is nearer than the radius to that of a blocked cell."""
    if not mask.blocked.any():
        return mask
    dx, dy = mask.spacing
    from scipy import ndimage

    x, (left, right) = _widened(mask.x, dx, radius, bounds.x1_min, bounds.x1_max)
    y, (below, above) = _widened(mask.y, dy, radius, bounds.x2_min, bounds.x2_max)
    blocked = np.pad(mask.blocked, ((below, above), (left, right)))
    largest = float(np.abs([*bounds, x[0], x[-1], y[0], y[-1]]).max())
    limit = radius - CELL_DOUBT * min(dx, dy) + ROUNDING * largest
    # With its neighbours blocked, too, the distance between centres is that of rectangles.
    touching = ndimage.binary_dilation(blocked, np.ones((3, 3), np.bool_))
    halo = math.ceil(min(radius / dy, len(y))) + 1
    rows = max(MOST_CELLS_AT_ONCE // len(x), 2 * halo, 1)
    for first in range(0, len(y), rows):
        low, high = max(first - halo, 0), min(first + rows + halo, len(y))
        if not touching[low:high].any():
            continue
        gaps = ndimage.distance_transform_edt(~touching[low:high], sampling=(dy, dx))
        blocked[first : first + rows] = gaps[first - low :][:rows] < limit
    return Mask(blocked | np.pad(mask.blocked, ((below, above), (left, right))), x, y)


def _widened(
    axis: Array, step: float, radius: float, low: float, high: float
) -> tuple[Array, tuple[int, int]]:
    """Cell centres with as many more at both ends as the bounds and the radius ask for."""
    most = math.ceil(radius / step) + 1
    before = min(max(math.ceil((axis[0] - low) / step), 0), most)
    after = min(max(math.ceil((high - axis[-1]) / step), 0), most)
    first = axis[0] - step * np.arange(before, 0, -1)
    last = axis[-1] + step * np.arange(1, after + 1)
    return np.concatenate([first, axis, last]), (before, after)
