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
    """The state of a planner at one moment, a *look*."""

    wall: float  # seconds since it began
    processor: float
    cost: float | None  # the planner's own length of its path; None before the first path
    length: float | None  # the path's true length, map units


@dataclass(frozen=True)
class Curve:
    """One run, look by look."""

    points: tuple[CurvePoint, ...]


def true_length_of(problem: Problem, path: Any) -> float:
    """Length under h of a path from another program; it is tested again for obstacles."""
    points = np.asarray(path, np.float64).reshape(-1, 2)
    if not problem.free_space.segments_are_free(points[:-1], points[1:]).all():
        raise TerrapathError(f"{problem.name}: a path of another program meets an obstacle")
    return curve_length(problem.surface, points)


def curve_of_looks(problem: Problem, looks: Iterable[dict[str, Any]]) -> Curve:
    """The curve from the looks that another program printed; it prints a path only where new."""
    points, length = [], None
    for look in looks:
        if look["path"]:
            length = true_length_of(problem, look["path"])
        points.append(CurvePoint(look["wall"], look["processor"], look["cost"], length))
    return Curve(tuple(points))


@dataclass(frozen=True)
class MedianCurve:
    """The medians over all seeds, look by look; lengths are infinite before the first path."""

    timing: tuple[Timing, ...]
    low: tuple[float, ...]  # quartile of the lengths, map units
    middle: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(cls, curves: Sequence[Curve]) -> MedianCurve:
        """The medians of runs whose looks are after the same samples or the same times."""
        looks = list(zip(*(curve.points for curve in curves), strict=True))
        timing = [Timing.of(Reading(p.wall, p.processor) for p in look) for look in looks]
        lengths = [[math.inf if p.length is None else p.length for p in look] for look in looks]
        # One of the sorted values, without interpolation: half-way to infinity is infinity.
        quartiles = [np.quantile(row, (0.25, 0.5, 0.75), method="higher") for row in lengths]
        low, middle, high = (tuple(map(float, column)) for column in zip(*quartiles, strict=True))
        return cls(tuple(timing), low, middle, high)

    @property
    def seconds(self) -> tuple[float, ...]:
        """The median seconds, look by look."""
        return tuple(timing.seconds for timing in self.timing)

    @property
    def best(self) -> float:
        """The shortest median length, map units."""
        return min(self.middle)

    def time_to(self, length: float) -> float | None:
        """Seconds until the median path is at most this long; None where it never is."""
        pairs = zip(self.seconds, self.middle, strict=True)
        return next((seconds for seconds, middle in pairs if middle <= length), None)

    def time_between_looks(self, length: float) -> float | None:
        """The same, but interpolated between two looks: length against the logarithm of time.

        So options can be ranked that reach the length at the same look.
        """
        looks = list(zip(self.seconds, self.middle, strict=True))
        k = next((k for k, (_, middle) in enumerate(looks) if middle <= length), None)
        if k is None:
            return None
        (early, longer), (late, shorter) = looks[max(k - 1, 0)], looks[k]
        if k == 0 or math.isinf(longer):
            return late
        return float(early * (late / early) ** ((longer - length) / (longer - shorter)))
