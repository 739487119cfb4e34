"""The profile of a route as columns: distance, value, place, height, slopes, further layers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ...problem import Path
from ...surface.ground import height_layer
from ...validation import Array
from .places import in_degrees
from .route import Route


class Column(NamedTuple):
    """One quantity at each point of the profile."""

    name: str
    unit: str
    values: Array  # (m,)

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def headings(points: Array) -> Array:
    """(m, 2): unit vectors to the next point; between points at one place, as before them."""
    steps = np.diff(points, axis=0)
    lengths = np.hypot(*steps.T)
    moving = np.flatnonzero(lengths > 0.0)
    if len(moving) == 0:
        return np.tile([1.0, 0.0], (len(points), 1))
    units = steps[moving] / lengths[moving, None]
    before = np.searchsorted(moving, np.arange(len(points)), side="right") - 1
    return np.asarray(units[np.maximum(before, 0)])


class Slopes(NamedTuple):
    """Slopes of the ground at the points of a profile, degrees."""

    along: Array  # (m,) in the direction of travel, positive uphill
    ground: Array  # (m,) of the ground in its steepest direction
    side: Array  # (m,) across the direction of travel, positive where the left is higher


def slopes(path: Path) -> Slopes:
    """Slopes along a path. Where a unit is not known, height and plane are taken to share one."""
    points, ground = path.profile.points, path.ground
    gradients = ground.height_scale * ground.surface.gradients(points)[:, 0]
    ahead = headings(points)
    along = (gradients * ahead).sum(axis=1)
    side = ahead[:, 0] * gradients[:, 1] - ahead[:, 1] * gradients[:, 0]
    return Slopes(*np.degrees(np.arctan([along, np.hypot(*gradients.T), side])))


def heights(path: Path, points: Array) -> Array:
    """(m,): heights of points in the path's ground unit; 0 where no layer is the height."""
    ground = path.ground
    scale = ground.metres * ground.height_scale
    return np.asarray(scale * ground.surface.values(points)[:, 0])


def profile_columns(route: Route) -> list[Column]:
    """Distance, value, place, height, slopes and every further layer, at the points written."""
    path, surface, unit = route.path, route.path.surface, route.path.ground_unit
    profile, slope = path.profile, slopes(path)
    columns = [
        Column("distance", unit, profile.distance),
        Column("value", route.solution.unit, profile.value),
        Column("x", "", profile.points[:, 0]),
        Column("y", "", profile.points[:, 1]),
    ]
    if surface.georeference is not None:
        longitude, latitude = in_degrees(surface.georeference, profile.points).T
        columns += [Column("longitude", "", longitude), Column("latitude", "", latitude)]
    if (k := height_layer(surface)) is not None:
        name = surface.layers[k].name
        columns += [
            Column(name, unit, heights(path, profile.points)),
            Column("slope", "degrees", slope.along),
            Column("ground slope", "degrees", slope.ground),
            Column("side slope", "degrees", slope.side),
        ]
    columns += further_layers(path)
    return [column._replace(values=column.values[route.samples]) for column in columns]


def further_layers(path: Path) -> list[Column]:
    """All layers but the height, along the profile: first those whose changes cost, then costs."""
    surface, profile = path.surface, path.profile
    values = [*profile.values.T, *profile.costs.T]
    layers = [*surface.layers, *surface.costs]
    columns = [Column(a.name, a.unit, v) for a, v in zip(layers, values, strict=True)]
    k = height_layer(surface)
    return columns if k is None else columns[:k] + columns[k + 1 :]


def clean(text: str) -> str:
    """The text on one line, without characters that cannot be printed."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def distinct(names: Sequence[str], taken: Iterable[str] = ()) -> list[str]:
    """Clean names; a name that occurs before, in any case of letters, gets a number."""
    result: list[str] = []
    used = {name.casefold() for name in taken}
    for name in map(clean, names):
        candidate, k = name or "layer", 2
        while candidate.casefold() in used:
            candidate, k = f"{name} ({k})", k + 1
        used.add(candidate.casefold())
        result.append(candidate)
    return result
