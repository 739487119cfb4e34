"""Plain RRT: the first path it finds, fast; it need not be short."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..problem import Problem, Solution
from ..validation import require_count, require_fraction, require_positive, require_seed
from .base import Callback, TreeOptions, least_limit
from .rrt_star import search_tree


@dataclass(frozen=True, kw_only=True)
class RRT:
    """Plain RRT: RRT* without neighbours (LaValle 1998).

    It ends within 512 samples of the first path, because it looks for a path only after each
    512 samples.

    samples : at most this many are drawn. step : longest edge, map units; by default a twelfth
    of the region's side. seed : of the random generator. goal_bias : share of samples that are
    the goal. time_limit : seconds.
    """

    samples: int = 10_000
    step: float | None = None
    seed: int = 0
    goal_bias: float = 0.05
    time_limit: float | None = None

    def __post_init__(self) -> None:
        require_count(samples=self.samples)
        require_fraction(goal_bias=self.goal_bias)
        require_seed(self.seed)
        for name, value in (("step", self.step), ("time_limit", self.time_limit)):
            if value is not None:
                require_positive(**{name: value})

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "rrt"

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True.

        time_limit : seconds for this call; the lower of it and the option counts.
        """
        options = TreeOptions(
            planner=self.name,
            samples=int(self.samples),
            step=self.step,
            radius_factor=0.0,
            goal_bias=self.goal_bias,
            seed=int(self.seed),
            riemannian=True,
            prune=True,
            informed=False,
            time_limit=least_limit(self.time_limit, time_limit),
            target_length=math.inf,
        )
        return search_tree(problem, options, callback)
