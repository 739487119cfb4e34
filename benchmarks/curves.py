"""How the true length of a planner's path falls with time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrapath.errors import TerrapathError
from terrapath.problem import Problem
from terrapath.surface.metric import curve_length

from .timing import Reading, Timing


@dataclass(frozen=True)
class CurvePoint:
    """A planner at one moment."""

    wall: float  # seconds since it began
    processor: float
    cost: float | None  # what it believes its path's length to be; None before the first path
    length: float | None  # what it is, map units


@dataclass(frozen=True)
class Curve:
    """One run."""

    points: tuple[CurvePoint, ...]


def true_length_of(problem: Problem, path: Any) -> float:
    """Length under h of a path that another program found; its obstacles are looked at again."""
    points = np.asarray(path, np.float64).reshape(-1, 2)
    if not problem.free_space.segments_are_free(points[:-1], points[1:]).all():
        raise TerrapathError(f"{problem.name}: a path that was found meets an obstacle")
    return curve_length(problem.surface, points)


def curve_of_looks(problem: Problem, looks: Iterable[dict[str, Any]]) -> Curve:
    """What another program printed: its paths come only where they are new."""
    points, length = [], None
    for look in looks:
        if look["path"]:
            length = true_length_of(problem, look["path"])
        points.append(CurvePoint(look["wall"], look["processor"], look["cost"], length))
    return Curve(tuple(points))


@dataclass(frozen=True)
class MedianCurve:
    """The runs of all seeds, look by look; lengths are infinite before the first path."""

    timing: tuple[Timing, ...]
    low: tuple[float, ...]  # quartile of the lengths, map units
    middle: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(cls, curves: Sequence[Curve]) -> MedianCurve:
        """Of runs that were looked at after as many samples, or as much time."""
        looks = list(zip(*(curve.points for curve in curves), strict=True))
        timing = [Timing.of(Reading(p.wall, p.processor) for p in look) for look in looks]
        lengths = [[math.inf if p.length is None else p.length for p in look] for look in looks]
        # Of sorted values, not between them: half-way to infinity is infinity.
        quartiles = [np.quantile(row, (0.25, 0.5, 0.75), method="higher") for row in lengths]
        low, middle, high = (tuple(map(float, column)) for column in zip(*quartiles, strict=True))
        return cls(tuple(timing), low, middle, high)

    @property
    def seconds(self) -> tuple[float, ...]:
        """Medians, look by look."""
        return tuple(timing.seconds for timing in self.timing)

    @property
    def best(self) -> float:
        """The shortest median length, map units."""
        return min(self.middle)

    def time_to(self, length: float) -> float | None:
        """Seconds until the median is no longer than that; None where it never is."""
        pairs = zip(self.seconds, self.middle, strict=True)
        return next((seconds for seconds, middle in pairs if middle <= length), None)

    def time_between_looks(self, length: float) -> float | None:
        """The same, but between two looks as the logarithm of the time goes with the length.

        It tells options apart that looks far from one another do not.
        """
        looks = list(zip(self.seconds, self.middle, strict=True))
        k = next((k for k, (_, middle) in enumerate(looks) if middle <= length), None)
        if k is None:
            return None
        (early, longer), (late, shorter) = looks[max(k - 1, 0)], looks[k]
        if k == 0 or math.isinf(longer):
            return late
        return float(early * (late / early) ** ((longer - length) / (longer - shorter)))
