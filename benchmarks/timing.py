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
    """A stopwatch that runs from when it is made."""

    def __init__(self) -> None:
        self._wall, self._processor = time.perf_counter(), time.process_time()

    def read(self) -> Reading:
        """Seconds since the start."""
        return Reading(time.perf_counter() - self._wall, time.process_time() - self._processor)


def timed(work: Callable[[], Work]) -> tuple[Work, Reading]:
    """The result of some work, and how long it took."""
    watch = Stopwatch()
    result = work()
    return result, watch.read()


@dataclass(frozen=True)
class Timing:
    """How long the same work took, one entry for each repetition. Seconds."""

    wall: tuple[float, ...]
    processor: tuple[float, ...]

    @classmethod
    def of(cls, readings: Iterable[Reading]) -> Timing:
        """The timing with the readings of all repetitions."""
        return cls(*map(tuple, zip(*readings, strict=True)))

    def __add__(self, other: Timing) -> Timing:
        """The timing of two kinds of work together, repetition by repetition."""
        pairs = zip((self.wall, self.processor), (other.wall, other.processor), strict=True)
        return Timing(*(tuple(a + b for a, b in zip(*pair, strict=True)) for pair in pairs))

    @property
    def seconds(self) -> float:
        """The smaller of the two medians, of processor time and of wall time.

        Processor time leaves out waiting while other jobs had the core. Wall time is smaller
        where work is spread over several cores.
        """
        return min(median(self.wall), median(self.processor))

    @property
    def waiting(self) -> float:
        """The ratio of wall time to processor time, by their medians."""
        return median(self.wall) / median(self.processor)


@dataclass(frozen=True)
class Target:
    """A limit for a measure, and what was measured."""

    what: str
    limit: float
    unit: str
    found: float | None  # None where it was never reached
    instead: str = ""  # what the report says then
    at_least: bool = False  # the limit is a lower one

    @property
    def met(self) -> bool:
        """Is what was measured on the right side of the limit?"""
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
