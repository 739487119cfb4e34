"""The problem that a scenario describes, on all of its map or on a part of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError
from ..validation import is_there, require_not_negative
from .option import Point, Rectangle
from .scenario import LayerTable, MapSection, Scenario, require_scenario

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from ..io.maps import OpenMap
    from ..io.sources import LayerSource
    from ..planners.corridor import Corridor, Part
    from ..problem import Problem
    from ..surface import Surface
    from ..surface.bounds import Bounds
    from ..surface.georeference import Georeference
    from ..travel import TravelModel


class Place(NamedTuple):
    """The ground that is planned on, and what is known of the route over it."""

    surface: Surface
    bounds: Bounds | None
    name: str
    ends: dict[str, Point]  # start and goal of a built-in scene, map units


@dataclass(frozen=True)
class Itinerary:
    """A problem to the first of the goals, the points to pass, and all goals. Map units."""

    problem: Problem
    via: tuple[Point, ...]
    goals: tuple[Point, ...]


@contextmanager
def open_question(scenario: Scenario) -> Iterator[Question]:
    """A scenario's question. Its map is open as long as the context lasts."""
    require_scenario(scenario)
    place = scenario.map
    if place.scene is not None:
        yield Question(scenario, None)
        return
    from ..io.maps import open_map

    name = place.path or ""
    require_map(name)
    require_not_negative(radius=scenario.constraints.radius)
    with open_map(
        name,
        height_band=1 if place.height_band is None else place.height_band,
        layers=_sources(place.layers),
        costs=_sources(place.costs),
        smooth_costs=place.smooth_costs,
        fill_holes=place.fill_holes,
        smoothing=None if place.smooth == "none" else place.smooth,
        crs=place.crs,
        nodata=place.nodata,
        height_unit=place.height_unit,
        cell_size=place.cell_size,
        height_range=place.height_range,
        allow_external=place.allow_external,
    ) as opened:
        yield Question(scenario, opened)


def _sources(tables: dict[str, LayerTable]) -> dict[str, LayerSource]:
    from ..io.sources import LayerSource

    return {
        name: LayerSource.of_file(table.file, table.band, table.weight)
        for name, table in tables.items()
    }


def require_map(name: str) -> None:
    """Raise InputError for a name that cannot be a map's, and so was meant to be a scene's."""
    path = Path(name)
    if not is_there(path) and not path.suffix and ":" not in name:
        from ..problem.scenes import names

        raise InputError(f"{name!r} is neither a built-in scene ({', '.join(names())}) nor a file")


@dataclass(frozen=True)
class Question:
    """A scenario and its open map. map : None for a built-in scene."""

    scenario: Scenario
    map: OpenMap | None = field(repr=False)

    def cells(self) -> int:
        """How many cells of the map are within the bounds; 0 for a scene."""
        return 0 if self.map is None else self.map.cells(self.scenario.route.bounds)

    def itinerary(self, part: Part | None = None) -> Itinerary:
        """The problem from start to goal, the waypoints and the goals, on a part of the map."""
        place = self._place(part)
        route = self.scenario.route
        start = self._end(place, "start", route.start)
        goals = tuple(self._on_plane(place, goal, "goal") for goal in route.goals)
        goals = goals or (self._end(place, "goal", None),)
        via = tuple(self._on_plane(place, point, "via") for point in route.via)
        corridor = None if part is None else part.corridor
        return Itinerary(self._problem(place, start, goals[0], corridor), via, goals)

    def problem_to_itself(self) -> Problem:
        """A problem for a question without a goal: from the start to the start."""
        place = self._place()
        start = self._end(place, "start", self.scenario.route.start)
        return self._problem(place, start, start)

    def _problem(
        self, place: Place, start: Point, goal: Point, corridor: Corridor | None = None
    ) -> Problem:
        from ..problem import Problem

        limits = self.scenario.constraints
        return Problem(
            place.surface,
            start,
            goal,
            place.bounds,
            self._obstacles(place.surface),
            radius=limits.radius,
            max_slope=limits.max_slope,
            slope_measure=limits.slope_measure,
            travel=self._travel(),
            snap=self.scenario.route.snap,
            show=OwnCoordinates(place.surface.georeference, self.scenario.route.latlon),
            keep_in=self._area(place.surface, corridor),
            name=place.name,
        )

    def _travel(self) -> TravelModel | None:
        wanted = self.scenario.travel
        if wanted.model is None:
            if wanted.options:
                raise InputError(
                    f"--travel-option {next(iter(wanted.options))}: no travel model is chosen; "
                    "give --travel NAME"
                )
            return None
        from ..travel import by_name

        return by_name(wanted.model, **wanted.options)

    def _obstacles(self, surface: Surface) -> list[BaseGeometry]:
        files = self.scenario.constraints.obstacles
        if not files:
            return []
        from ..io import read_obstacles

        allowed = self.scenario.map.allow_external
        return [
            shape
            for file in files
            for shape in read_obstacles(file, surface, allow_external=allowed)
        ]

    def _area(self, surface: Surface, corridor: Corridor | None) -> BaseGeometry | None:
        """The area that the route may not leave; None where there is no such area."""
        file, area = self.scenario.constraints.keep_in, None
        if file is not None:
            from ..io import read_area

            area = read_area(file, surface, allow_external=self.scenario.map.allow_external)
        if corridor is None:
            return area
        around = corridor.area_on(surface)
        return around if area is None else around.intersection(area)

    def _place(self, part: Part | None = None) -> Place:
        """The scene or the map with its weights, and the bounds to plan in."""
        weights = self.scenario.map.weights
        place = self._scene() if self.map is None else self._read(self.map, part)
        if weights:
            place = place._replace(surface=place.surface.with_weights(weights))
        rectangle = self.scenario.route.bounds
        if rectangle is None:
            return place
        return place._replace(bounds=region(place.surface, rectangle))

    def _scene(self) -> Place:
        from ..problem.scenes import load

        place = self.scenario.map
        scene = load(place.scene or "")
        if place != MapSection(scene=place.scene, weights=place.weights):
            raise InputError(
                "--layer, --cost, --height-band, --fill-holes, --smooth, --crs and the like "
                f"describe a raster, but {scene.name!r} is a built-in scene; leave them out, or "
                "name a file"
            )
        ends = {"start": scene.start, "goal": scene.goal}
        return Place(scene.surface, scene.bounds, scene.name, ends)

    def _read(self, opened: OpenMap, part: Part | None) -> Place:
        window, decimate = self.scenario.route.bounds, 1
        if part is not None:
            window, decimate = part.within or window, part.decimate
        # The vehicle's radius keeps it away from blocked cells outside the bounds, too.
        margin = self.scenario.constraints.radius
        surface = opened.surface(within=window, margin=margin, decimate=decimate)
        return Place(surface, None, Path(self.scenario.map.path or "").stem, {})

    def _end(self, place: Place, name: str, point: Point | None) -> Point:
        """The start or the goal, map units."""
        if point is not None:
            return self._on_plane(place, point, name)
        if name in place.ends:
            return place.ends[name]
        raise InputError(
            f"{name} is missing; give --{name} X,Y in map units, within "
            f"{describe_extent(place.surface)}"
        )

    def _on_plane(self, place: Place, point: Point, name: str) -> Point:
        return on_plane(place.surface, point, name, latlon=self.scenario.route.latlon)


def on_plane(surface: Surface, point: Point, name: str, *, latlon: bool) -> Point:
    """A point of the map, or a latitude and a longitude in degrees, on the plane.

    name : of the point, for messages. Raises InputError where the point is off the map.
    """
    return _from_latlon(surface, point, name) if latlon else _from_map(surface, point, name)


@dataclass(frozen=True)
class OwnCoordinates:
    """Writes a place on the plane as the user gave places: of the map, or latitude, longitude."""

    reference: Georeference | None
    latlon: bool

    def __call__(self, point: Point) -> str:
        """As (X, Y), or (latitude, longitude) to a centimetre."""
        from ..problem.problem import as_text

        reference, place = self.reference, np.array(point)
        if reference is not None and self.latlon:
            longitude, latitude = reference.to_lonlat(place)
            return f"({latitude:.7f}, {longitude:.7f})"
        if reference is not None and not reference.is_map_crs:
            place = reference.to_map(place)
        return as_text((float(place[0]), float(place[1])))


def _shown(name: str, point: Point) -> str:
    from ..problem.problem import as_text

    return f"{name}={as_text(point)}"


def _from_latlon(surface: Surface, point: Point, name: str) -> Point:
    reference = surface.georeference
    if reference is None:
        raise InputError(
            f"--latlon: the map has no CRS, so {_shown(name, point)} has no place on it; give "
            "--crs, or coordinates of the map without --latlon"
        )
    latitude, longitude = point
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0):
        raise InputError(
            f"{_shown(name, point)} is not a latitude and a longitude in degrees; the order is "
            "lat,lon: latitude (-90 to 90) first"
        )
    x, y = reference.from_lonlat(np.array([longitude, latitude]))
    return _inside(surface, (float(x), float(y)), point, name, "the order is lat,lon")


def _from_map(surface: Surface, point: Point, name: str) -> Point:
    reference = surface.georeference
    if reference is None or reference.is_map_crs:
        return point
    x, y = reference.from_map(np.array(point))
    remedy = "check the axis order: X is the longitude"
    return _inside(surface, (float(x), float(y)), point, name, remedy)


def _inside(surface: Surface, place: Point, point: Point, name: str, remedy: str) -> Point:
    inside = surface.bounds is None or surface.bounds.contains(np.array(place))
    if not (all(map(math.isfinite, place)) and inside):
        raise InputError(
            f"{_shown(name, point)} is outside the map, {describe_extent(surface)}; {remedy}"
        )
    return place


def region(surface: Surface, rectangle: Rectangle) -> Bounds:
    """The bounds on the plane of a rectangle in the map's own coordinates, clipped to the map."""
    from ..surface.bounds import Bounds, as_bounds

    given, whole, reference = as_bounds(rectangle), surface.bounds, surface.georeference
    around = given
    if reference is not None and not reference.is_map_crs:
        around = reference.rectangle_from_map(given)
    if whole is None:
        return around
    low = [max(a, b) for a, b in zip(around[:2], whole[:2], strict=True)]
    high = [min(a, b) for a, b in zip(around[2:], whole[2:], strict=True)]
    if not (low[0] < high[0] and low[1] < high[1]):
        raise InputError(
            f"bounds={tuple(given)} are off the map, {describe_extent(surface)}; "
            "check the axis order and the CRS"
        )
    return Bounds(*low, *high)


def describe_extent(surface: Surface) -> str:
    """The surface's extent in the map's own coordinates."""
    reference, bounds = surface.georeference, surface.bounds
    if reference is None or reference.is_map_crs or bounds is None:
        return str(bounds)
    (west, south), (east, north) = reference.to_map(np.array([bounds[:2], bounds[2:]]))
    if not reference.map_crs.is_geographic:
        return f"x from {west:.10g} to {east:.10g}, y from {south:.10g} to {north:.10g}"
    return f"longitude {west:.5f} to {east:.5f}, latitude {south:.5f} to {north:.5f}"
