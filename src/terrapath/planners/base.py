"""What every planner offers."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from ..problem import Problem, Solution


class Progress(NamedTuple):
    """Where a running planner stands."""

    samples: int
    total: int
    seconds: float
    best_cost: float  # map units, infinite before the first path


# Called now and then while a planner runs; returning True stops it.
Callback = Callable[[Progress], bool | None]


class Planner(Protocol):
    """A frozen set of options that turns problems into solutions."""

    @property
    def name(self) -> str:
        """The planner's name on the command line."""

    def solve(self, problem: Problem, *, callback: Callback | None = None) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True."""
