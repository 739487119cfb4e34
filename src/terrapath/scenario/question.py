"""Where and what: the problem that a scenario describes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import InputError
from .problem_options import MapSection, Point, Rectangle
from .scenario import Scenario

if TYPE_CHECKING:
    from ..planners.corridor import Corridor, Part
    from ..problem import Problem
    from ..surface import Surface
    from ..surface.bounds import Bounds


def is_scenario(where: str) -> bool:
    """Does the command's WHERE name a scenario file?"""
    return Path(where).suffix.lower() == ".toml"


def scenario_of(where: str, given: Mapping[str, Mapping[str, Any]]) -> Scenario:
    """What the command line asks: a scenario file's values, and over them its own."""
    from ..problem.scenes import SCENES

    if is_scenario(where):
        from .toml import read_scenario

        scenario = read_scenario(where)
    else:
        place = MapSection(scene=where) if where in SCENES else MapSection(path=where)
        scenario = Scenario(map=place)
    asked = scenario.overridden(given)
    for file in asked.files():
        _exists(Path(file))
    return asked


class Place(NamedTuple):
    """The ground that is asked about, and what is known of the way over it."""

    surface: Surface
    bounds: Any
    name: str
    ends: dict[str, Point]  # start and goal of a built-in scene, map units


@dataclass(frozen=True)
class Itinerary:
    """A problem to the first of the goals, the points to pass, and all goals, map units."""

    problem: Problem
    via: tuple[Point, ...]
    goals: tuple[Point, ...]


@dataclass(frozen=True)
class Question:
    """What a scenario asks about."""

    scenario: Scenario

    def itinerary(self, part: Part | None = None) -> Itinerary:
        """From the start through the waypoints to the goals, on a part of the map."""
        place = self.place(part)
        route = self.scenario.route
        start = self._end(place, "start", route.start)
        goals = tuple(self._to_plane(place, goal, "goal") for goal in route.goals)
        goals = goals or (self._end(place, "goal", None),)
        via = tuple(self._to_plane(place, point, "via") for point in route.via)
        corridor = None if part is None else part.corridor
        return Itinerary(self._problem(place, start, goals[0], corridor), via, goals)

    def problem_to_itself(self) -> Problem:
        """The problem that is asked about where there is no goal: from the start to the start."""
        place = self.place()
        start = self._end(place, "start", self.scenario.route.start)
        return self._problem(place, start, start)

    def _problem(
        self, place: Place, start: Point, goal: Point, corridor: Corridor | None = None
    ) -> Problem:
        from ..problem import Problem

        limits = self.scenario.constraints
        surface = place.surface
        obstacles: list[Any] = []
        area = None
        if limits.obstacles or limits.keep_in:
            from ..io import read_area, read_obstacles

            for file in limits.obstacles:
                obstacles.extend(read_obstacles(file, surface))
            area = None if limits.keep_in is None else read_area(limits.keep_in, surface)
        if corridor is not None:
            way = corridor.area_on(surface)
            area = way if area is None else way.intersection(area)
        return Problem(
            surface,
            start,
            goal,
            place.bounds,
            obstacles,
            radius=limits.radius,
            max_slope=limits.max_slope,
            keep_in=area,
            name=place.name,
        )

    def cells(self) -> int:
        """How many cells the map has that is asked about; 0 for a scene."""
        asked = self.scenario.map
        if asked.scene is not None:
            return 0
        from ..io.maps import count_cells

        self._require_map()
        band = 1 if asked.height_band is None else asked.height_band
        window = self.scenario.route.bounds
        return count_cells(asked.path, height_band=band, crs=asked.crs, within=window)

    def place(self, part: Part | None = None) -> Place:
        """The scene or the map, weighted, and the region to plan in."""
        asked = self.scenario.map
        found = self._map(part) if asked.scene is None else self._scene(asked.scene)
        if asked.weights:
            found = found._replace(surface=found.surface.with_weights(asked.weights))
        rectangle = self.scenario.route.bounds
        if rectangle is None:
            return found
        return found._replace(bounds=_region(found.surface, rectangle))

    def _scene(self, name: str) -> Place:
        from ..problem.scenes import load

        scene = load(name)
        asked = self.scenario.map
        if asked != MapSection(scene=name, weights=asked.weights):
            raise InputError(
                "--layer, --cost, --height-band, --fill-holes, --smooth and --crs describe a "
                f"raster, but {name!r} is a built-in scene; leave them out, or name a file"
            )
        ends = {"start": scene.start, "goal": scene.goal}
        return Place(scene.surface, scene.bounds, scene.name, ends)

    def _require_map(self) -> Path:
        """The map's path; InputError where there can be none."""
        from ..problem.scenes import names

        asked = self.scenario.map
        path = Path(asked.path or "")
        if not _exists(path) and not path.suffix and ":" not in str(path):
            raise InputError(
                f"{asked.path!r} is neither a built-in scene ({', '.join(names())}) nor a file"
            )
        return path

    def _map(self, part: Part | None) -> Place:
        from ..io import read_surface

        path, asked = self._require_map(), self.scenario.map
        window, decimate = self.scenario.route.bounds, 1
        if part is not None:
            window, decimate = part.within or window, part.decimate
        surface = read_surface(
            asked.path,
            within=window,
            # What is blocked beyond the bounds keeps the vehicle off, too.
            margin=self.scenario.constraints.radius,
            decimate=decimate,
            **read_options(asked),
        )
        return Place(surface, None, path.stem, {})

    def _end(self, place: Place, name: str, point: Point | None) -> Point:
        """The start or the goal, map units."""
        if point is not None:
            return self._to_plane(place, point, name)
        if name in place.ends:
            return place.ends[name]
        raise InputError(
            f"{name} is missing; give --{name} X,Y in map units, within "
            f"{describe_extent(place.surface)}"
        )

    def _to_plane(self, place: Place, point: Point, name: str) -> Point:
        if self.scenario.route.latlon:
            return _from_latlon(place.surface, point, name)
        return _from_map(place.surface, point, name)


def read_options(asked: MapSection) -> dict[str, Any]:
    """What ``read_surface`` is told."""
    band = 1 if asked.height_band is None else asked.height_band
    options: dict[str, Any] = {"height_band": band}
    for kind in ("layers", "costs"):
        from ..io import LayerSource

        sources = {
            name: LayerSource.of_file(table.file, table.band, table.weight)
            for name, table in getattr(asked, kind).items()
        }
        if sources:
            options[kind] = sources
    if asked.fill_holes:
        options["fill_holes"] = asked.fill_holes
    if asked.smooth != "auto":
        options["smoothing"] = None if asked.smooth == "none" else asked.smooth
    if asked.crs is not None:
        options["crs"] = asked.crs
    return options


def _exists(path: Path) -> bool:
    """Raises InputError for a name that no file can have."""
    try:
        return path.exists()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{str(path)[:60]!r} cannot be a file: {reason}; check the path") from None


# Coordinates


def _shown(name: str, point: Point) -> str:
    return f"{name}=({point[0]:.10g}, {point[1]:.10g})"


def _from_latlon(surface: Surface, point: Point, name: str) -> Point:
    """Latitude and longitude in degrees, on the plane."""
    import numpy as np

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
    """The map's own coordinates, on the plane that is planned in."""
    import numpy as np

    reference = surface.georeference
    if reference is None or reference.is_map_crs:
        return point
    x, y = reference.from_map(np.array(point))
    remedy = "check the axis order: X is the longitude"
    return _inside(surface, (float(x), float(y)), point, name, remedy)


def _inside(surface: Surface, place: Point, point: Point, name: str, remedy: str) -> Point:
    import numpy as np

    inside = surface.bounds is None or surface.bounds.contains(np.array(place))
    if not (all(map(math.isfinite, place)) and inside):
        raise InputError(
            f"{_shown(name, point)} is outside the map, {describe_extent(surface)}; {remedy}"
        )
    return place


def _region(surface: Surface, rectangle: Rectangle) -> Bounds:
    """A rectangle of the map's own coordinates on the plane; what is off the map is cut off."""
    from ..surface.bounds import Bounds, as_bounds

    asked, whole, reference = as_bounds(rectangle), surface.bounds, surface.georeference
    around = asked
    if reference is not None and not reference.is_map_crs:
        around = reference.rectangle_from_map(asked)
    if whole is None:
        return around
    low = [max(a, b) for a, b in zip(around[:2], whole[:2], strict=True)]
    high = [min(a, b) for a, b in zip(around[2:], whole[2:], strict=True)]
    if not (low[0] < high[0] and low[1] < high[1]):
        raise InputError(
            f"bounds={tuple(asked)} are off the map, {describe_extent(surface)}; "
            "check the axis order and the CRS"
        )
    return Bounds(*low, *high)


def describe_extent(surface: Surface) -> str:
    """The surface's extent in the map's own coordinates."""
    import numpy as np

    reference, bounds = surface.georeference, surface.bounds
    if reference is None or reference.is_map_crs or bounds is None:
        return str(bounds)
    (west, south), (east, north) = reference.to_map(np.array([bounds[:2], bounds[2:]]))
    if not reference.map_crs.is_geographic:
        return f"x from {west:.10g} to {east:.10g}, y from {south:.10g} to {north:.10g}"
    return f"longitude {west:.5f} to {east:.5f}, latitude {south:.5f} to {north:.5f}"
