"""Clocks and targets."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple, TypeVar

Work = TypeVar("Work")


class Reading(NamedTuple):
    """Seconds since a stopwatch was started, by two clocks."""

    wall: float
    processor: float


class Stopwatch:
    """Runs from when it is made."""

    def __init__(self) -> None:
        self._wall, self._processor = time.perf_counter(), time.process_time()

    def read(self) -> Reading:
        """Seconds since the start."""
        return Reading(time.perf_counter() - self._wall, time.process_time() - self._processor)


def timed(work: Callable[[], Work]) -> tuple[Work, Reading]:
    """What some work returns, and how long it took."""
    watch = Stopwatch()
    result = work()
    return result, watch.read()


@dataclass(frozen=True)
class Timing:
    """How long the same work took, an entry a repetition. Seconds."""

    wall: tuple[float, ...]
    processor: tuple[float, ...]

    @classmethod
    def of(cls, readings: Iterable[Reading]) -> Timing:
        """The readings of all repetitions."""
        return cls(*map(tuple, zip(*readings, strict=True)))

    def __add__(self, other: Timing) -> Timing:
        """Of two kinds of work together, repetition by repetition."""
        pairs = zip((self.wall, self.processor), (other.wall, other.processor), strict=True)
        return Timing(*(tuple(a + b for a, b in zip(*pair, strict=True)) for pair in pairs))

    @property
    def seconds(self) -> float:
        """The median, by the clock that shows less.

        Processor time leaves out waiting while other jobs had the core; wall time is the less
        where work is spread over several cores.
        """
        return min(median(self.wall), median(self.processor))

    @property
    def waiting(self) -> float:
        """Wall time over processor time, by their medians."""
        return median(self.wall) / median(self.processor)


@dataclass(frozen=True)
class Target:
    """A figure that is to be reached, and what was measured."""

    what: str
    limit: float
    unit: str
    found: float | None  # None where it was never reached
    instead: str = ""  # said then
    at_least: bool = False  # the limit is one from below

    @property
    def met(self) -> bool:
        """Is what was found on the right side of the limit?"""
        if self.found is None:
            return False
        return self.found >= self.limit if self.at_least else self.found <= self.limit

    @property
    def verdict(self) -> str:
        """Met or not, and by how much."""
        if self.found is None:
            return f"**not met**: {self.instead}"
        share = f"{self.found / self.limit:.2g} times the limit"
        return f"met, {share}" if self.met else f"**not met**, {share}"


def percent(share: float) -> str:
    """A share in percent, to three digits."""
    return f"{100.0 * share:.3g} %"
