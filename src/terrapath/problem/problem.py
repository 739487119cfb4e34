"""A problem: a surface, free space, a start and a goal."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..errors import BlockedError, InputError, OutsideSurfaceError, SnapWarning, tell
from ..space.free_space import FreeSpace, Obstacle
from ..space.lattice import Spacing, default_spacing
from ..surface import Mask, Surface, metric
from ..surface.bounds import Bounds, Cells, as_bounds
from ..surface.ground import value_unit
from ..validation import Point, PointLike, as_point, require_not_negative
from .path import Path

if TYPE_CHECKING:
    from ..space.constraints import Area, Constraints
    from ..space.slope_limit import SlopeMeasure
    from ..travel import TravelModel
    from .pricing import Pricing


def as_text(point: Point) -> str:
    """A place on the plane, for messages."""
    return f"({point[0]:.10g}, {point[1]:.10g})"


class Problem:
    """Find a short path on a surface from start to goal through free space.

    surface : Surface. start, goal : (x1, x2), map units, in free space.
    bounds : (x1_min, x2_min, x1_max, x2_max), map units; by default the surface's.
    obstacles : shapely polygons and lines, ``Circle`` and ``Mask``, map units. The surface's
    no-data cells are obstacles too. Points are allowed where there is a radius.
    radius : of the vehicle, map units. Obstacles of all kinds are inflated by it, so that no path
    comes nearer to one. max_slope : degrees. Cells are an obstacle where the first layer, without
    its weight, is steeper. slope_measure : "horn", the slope of a cell as GIS tools compute it, or
    "steepest", that of the steepest place in it. keep_in : shapely polygon or polygons that the
    vehicle must not leave.
    travel : what is minimised in place of length: a TravelModel, or the name of one. The grade is
    that of the height at its true scale, cost layers multiply the pace, and no other layer may cost
    by its change.
    snap : map units. Start and goal that are not on free ground are moved to the nearest that is,
    no farther than this, with a ``SnapWarning``; by default they are refused. name : shown in
    reports.
    show : how messages write a place (x1, x2), as in the user's own coordinates.

    ``obstacles`` are those given; ``free_space`` is where the vehicle's centre may be. In
    ``surface`` cells of a cost raster that cannot be entered lend no lower cost to their sides.
    Raises OutsideSurfaceError, BlockedError or InputError, naming the value and the remedy.
    """

    def __init__(
        self,
        surface: Surface,
        start: PointLike,
        goal: PointLike,
        bounds: Sequence[float] | None = None,
        obstacles: Iterable[Obstacle] = (),
        *,
        radius: float = 0.0,
        max_slope: float | None = None,
        slope_measure: SlopeMeasure = "horn",
        keep_in: Area | None = None,
        travel: TravelModel | str | None = None,
        snap: float = 0.0,
        name: str = "",
        show: Callable[[Point], str] = as_text,
    ) -> None:
        self.surface = surface
        self.name = name
        self._show = show
        self.bounds = self._make_bounds(surface, bounds)
        try:
            given = (obstacles,) if isinstance(obstacles, Obstacle) else tuple(obstacles)
        except TypeError:
            raise InputError(
                f"obstacles={obstacles!r} is no list of obstacles; "
                "give shapely geometries, Circle or Mask"
            ) from None
        require_not_negative(radius=radius, snap=snap)
        self.snap = float(snap)
        self.obstacles: tuple[Obstacle, ...] = given
        self.radius = float(radius)
        self.max_slope = max_slope
        self.slope_measure = slope_measure
        self.keep_in = keep_in
        self.pricing = None if travel is None else self._priced(travel)
        self.free_space = self._free_space()
        if surface.cost_cells is not None:
            from .closed_cells import without_loans

            self.surface = without_loans(surface, self.free_space)
        self.start = self.checked(start, "start")
        self.goal = self.start if goal is start else self.checked(goal, "goal")
        if self.snap > 0.0:
            self._leave_pockets(as_point(start, "start"), as_point(goal, "goal"))

    def _priced(self, travel: TravelModel | str) -> Pricing:
        from .pricing import Pricing

        pricing = Pricing.of(self.surface, travel)
        pricing.require_known(self.bounds)
        return pricing

    @property
    def travel(self) -> TravelModel | None:
        """The travel model; None where length is minimised."""
        return None if self.pricing is None else self.pricing.model

    @property
    def priced(self) -> Surface:
        """The surface as planners measure it: under h, or with the pace of the travel model.

        With a pace its lengths are costs of travel, and count in their direction.
        """
        return self.surface if self.pricing is None else self.pricing.surface

    @property
    def relief(self) -> Surface:
        """The surface that says how rough the ground is; kinks of a pace do not count."""
        return self.surface if self.pricing is None else self.pricing.ground.surface

    @property
    def unit(self) -> str:
        """The unit of what is minimised."""
        return value_unit(self.surface) if self.pricing is None else self.pricing.model.unit

    @property
    def taken_off(self) -> float:
        """What the gauge of a travel model takes off every path from start to goal."""
        return 0.0 if self.pricing is None else self.pricing.taken_off(self.start, self.goal)

    @property
    def chord(self) -> float:
        """What no path from start to goal costs less than, without any search, in ``unit``."""
        return float(metric.chord(self.priced, self.start, self.goal)) + self.taken_off

    def _free_space(self) -> FreeSpace:
        limits = (self.surface.nodata, self.max_slope, self.keep_in)
        if self.obstacles or any(limit is not None for limit in limits):
            return self.constraints.free_space()
        return FreeSpace(self.bounds)  # all of the bounds

    @cached_property
    def constraints(self) -> Constraints:
        """All that limits where a path may go, as it was given."""
        from ..space.constraints import Constraints

        return Constraints.of(
            self.surface,
            self.bounds,
            self.obstacles,
            radius=self.radius,
            max_slope=self.max_slope,
            slope_measure=self.slope_measure,
            keep_in=self.keep_in,
        )

    @staticmethod
    def _make_bounds(surface: Surface, bounds: Sequence[float] | None) -> Bounds:
        if bounds is None:
            if surface.bounds is None:
                raise InputError(
                    "bounds=None: the surface has no edge, so the region to plan in must be "
                    "named; give bounds=(x1_min, x2_min, x1_max, x2_max)"
                )
            return surface.bounds
        rectangle = as_bounds(bounds)
        if surface.bounds is not None and not surface.bounds.encloses(rectangle):
            raise OutsideSurfaceError(
                f"bounds={tuple(rectangle)} reach beyond the surface, {surface.bounds}; "
                "shrink them, or check the axis order or the CRS"
            )
        return rectangle

    def checked(self, value: PointLike, name: str) -> Point:
        """A point of free space, (x1, x2), map units. name : what errors call it.

        It is the nearest free one to the point given, where that is no farther than ``snap``.
        Raises InputError for what is no point, OutsideSurfaceError outside the bounds,
        BlockedError on what the vehicle has to keep away from.
        """
        point = as_point(value, name)
        if not self.bounds.contains(np.array(point)):
            shown = f"{name}={self._show(point)} is outside the bounds {self.bounds}"
            raise OutsideSurfaceError(f"{shown}; check the axis order or the CRS")
        if self.free_space.blocker(point) is None:
            return point
        return self._freed(point, name)

    def _freed(self, point: Point, name: str) -> Point:
        """The free place that a blocked one is moved to; BlockedError where that is too far."""
        from ..space.nearest import nearest_free

        unit = self.surface.unit
        blocker = f"{name}={self._show(point)} is {self.constraints.blocker(point, unit)}"
        nearest = nearest_free(self.free_space, point)
        if nearest is None:
            remedy = "; give a smaller radius" if self.radius > 0.0 else ""
            raise BlockedError(f"{blocker}; no place within the bounds is free{remedy}")
        place, distance = nearest
        there = f"{self._show(place)}, {distance:.4g} {unit}".rstrip()
        if distance <= self.snap:
            tell(SnapWarning(f"{blocker}; it is moved to {there} away"))
            return place
        far = f"{_rounded_up(distance):g} {unit}".rstrip()
        remedy = f"move it there, or let it be moved with a snap of {far}"
        raise BlockedError(f"{blocker}; the nearest free place is {there} away: {remedy}")

    def _leave_pockets(self, start: Point, goal: Point) -> None:
        """Move an end that was moved where no path leads to the other on, to where one may."""
        from ..space.nearest import nearest_joined

        for name, given in (("goal", goal), ("start", start)):
            if getattr(self, name) == given or not self.is_unreachable:
                continue

            def is_joined(place: Point, name: str = name) -> bool:
                ends = {"start": self.start, "goal": self.goal, name: place}
                return not self.between_checked(**ends).is_unreachable

            found = nearest_joined(self.free_space, given, self.snap, is_joined)
            if found is not None:
                setattr(self, name, found[0])
                self.__dict__.pop("is_unreachable", None)
                there = f"{self._show(found[0])}, {found[1]:.4g} {self.surface.unit}".rstrip()
                tell(SnapWarning(
                    f"no path leads from there to the other end; {name} is moved on to {there} away"
                ))  # fmt: skip

    def between(self, start: PointLike, goal: PointLike) -> Problem:
        """The same problem with another start and goal, (x1, x2), map units.

        Raises as ``Problem`` does.
        """
        return self.between_checked(self.checked(start, "start"), self.checked(goal, "goal"))

    def between_checked(self, start: Point, goal: Point) -> Problem:
        """The same problem with another start and goal that ``checked`` has returned."""
        other = copy.copy(self)
        for known in ("straight_length", "is_unreachable"):
            other.__dict__.pop(known, None)
        other.start, other.goal = start, goal
        return other

    def path(self, points: npt.ArrayLike) -> Path:
        """The path on this problem's surface through points (m, 2), map units."""
        return Path(self.surface, np.asarray(points, np.float64), self.pricing)

    def allows(self, path: Path | npt.ArrayLike) -> bool:
        """Does a path, given by its points (m, 2), stay in the bounds and touch no obstacle?

        One of its points must be free. It is the same forwards and backwards.
        """
        points = path.points if isinstance(path, Path) else np.asarray(path, np.float64)
        return self.free_space.allows(points)

    @property
    def default_spacing(self) -> Spacing:
        """The default spacing of lattice nodes along x1 and x2, map units."""
        finest = [metric.feature_size(self.surface)]
        finest += [Spacing(cells.dx, cells.dy) for cells in self.mask_cells]
        if (costs := self.surface.cost_cells) is not None:
            finest.append(Spacing(costs.dx, costs.dy))
        return default_spacing(self.bounds, Spacing(*map(min, zip(*finest, strict=True))))

    @property
    def mask_cells(self) -> list[Cells]:
        """The cells of masks. Where steep cells are finer than the map's own, they do not count."""
        masks = self.free_space.masks
        if self.surface.native is not None and self.max_slope is not None:
            given = [obstacle for obstacle in self.obstacles if isinstance(obstacle, Mask)]
            masks = given if self.surface.nodata is None else [*given, self.surface.nodata]
        return [_cells_of(mask) for mask in masks]

    @property
    def cells(self) -> Cells | None:
        """The smallest cells among those of masks and of the surface; None where there are none."""
        grids = list(self.mask_cells)
        if self.surface.cells is not None:
            grids.append(self.surface.cells)
        if (costs := self.surface.cost_cells) is not None:
            centre = costs.x0 + 0.5 * costs.dx, costs.y0 + 0.5 * costs.dy
            grids.append(Cells(*centre, costs.dx, costs.dy))
        return min(grids, key=lambda cells: min(cells.dx, cells.dy), default=None)

    @cached_property
    def straight_length(self) -> float:
        """Length on the surface of the straight line from start to goal, through all obstacles."""
        return metric.curve_length(self.surface, [self.start, self.goal])

    @property
    def straight_value(self) -> float:
        """The value of that line, in ``unit``."""
        if self.pricing is None:
            return self.straight_length
        return self.path([self.start, self.goal]).value

    @cached_property
    def is_unreachable(self) -> bool:
        """Is it proven that no path leads from start to goal? False where that is not known."""
        return self.free_space.separates(self.start, self.goal)

    def __repr__(self) -> str:
        # Debuggers also show a problem that is only half made, where its start or goal is refused.
        known = vars(self)
        name = f"{known['name']}: " if known.get("name") else ""
        start, goal, bounds, surface = (
            known.get(key, "?") for key in ("start", "goal", "bounds", "surface")
        )
        return f"Problem({name}{start} to {goal} within {bounds}; {surface!r})"


def _rounded_up(distance: float) -> float:
    """A distance with two digits that is no shorter."""
    unit = 10.0 ** (math.floor(math.log10(distance)) - 1)
    return math.ceil(distance / unit) * unit


def _cells_of(mask: Mask) -> Cells:
    return Cells(float(mask.x[0]), float(mask.y[0]), *mask.spacing)
