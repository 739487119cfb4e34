"""The profile of a route as columns: distance, place, height, slopes and further layers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ...problem import Path, Solution
from ...validation import Array
from .places import in_degrees
from .units import height_scale


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
    """Slopes of the first layer at the points of a profile, degrees."""

    along: Array  # (m,) in the direction of travel, positive uphill
    ground: Array  # (m,) of the ground in its steepest direction


def slopes(path: Path) -> Slopes:
    """Slopes along a path. Where a unit is not known, height and plane are taken to share one."""
    points = path.profile.points
    gradients = height_scale(path.surface) * path.surface.gradients(points)[:, 0]
    along = (gradients * headings(points)).sum(axis=1)
    return Slopes(*np.degrees(np.arctan([along, np.hypot(*gradients.T)])))


def profile_columns(solution: Solution) -> list[Column]:
    """Distance, place, height, slopes and every further layer."""
    path, surface = solution.path, solution.problem.surface
    assert path is not None
    profile, slope = path.profile, slopes(path)
    columns = [
        Column("distance", "", profile.distance),
        Column("x", "", profile.points[:, 0]),
        Column("y", "", profile.points[:, 1]),
    ]
    if surface.georeference is not None:
        longitude, latitude = in_degrees(surface.georeference, profile.points).T
        columns += [Column("longitude", "", longitude), Column("latitude", "", latitude)]
    height = Column(surface.layers[0].name, surface.layers[0].unit, profile.values[:, 0])
    steepness = [
        Column("slope", "degrees", slope.along),
        Column("ground slope", "degrees", slope.ground),
    ]
    return [*columns, height, *steepness, *further_layers(path)]


def further_layers(path: Path) -> list[Column]:
    """All layers but the height, along the profile: first those whose changes cost, then costs."""
    surface, profile = path.surface, path.profile
    values = [*profile.values.T[1:], *profile.costs.T]
    layers = [*surface.layers[1:], *surface.costs]
    return [Column(a.name, a.unit, v) for a, v in zip(layers, values, strict=True)]


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
