"""RRT*-R, and the original RRT* as its baseline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..problem import Problem, Solution
from ..validation import (
    require_bool,
    require_choice,
    require_count,
    require_fraction,
    require_positive,
    require_seed,
)
from .base import Callback, least_limit
from .tree_search import TreeOptions, search_tree


@dataclass(frozen=True, kw_only=True)
class RRTStar:
    """RRT*-R: RRT* with edges measured under h (paper, Algorithms 1 to 3).

    samples : how many are drawn.
    step : longest edge, map units; by default a twelfth of the region's side.
    metric : "riemannian" measures edges by Line-R; "chord" by the Euclidean distance in
        R^n; with ``informed=False`` that is the original RRT*, the paper's baseline.
    seed : of the random generator; the same seed gives the same tree, to the last bit.
    radius_factor : the search radius, as a multiple of the least one that optimality needs.
    goal_bias : share of samples that are the goal, until it is reached.
    informed : begin with the straight line to the goal. Then leave out samples that cannot
        improve the best path, by their chords (Gammell et al. 2014), and draw 0.3 of them near
        it (Akgun and Stilman 2011). Hang vertices below their parents' parents where that is
        shorter (Jeong et al. 2019). With ``False`` all of the region is sampled, as in the paper.
    prune : do not measure edges whose chord is already too long; the tree stays the same.
    panel : longest piece of an edge that one application of Line-R measures, map units; by
        default as long as the surface's features allow; ``math.inf`` is exactly Algorithm 1.
    time_limit : seconds. target_length : stop when the cost is this low, map units.

    Source: the paper. What it leaves open is described in ``_kernels/planners/rrt_star.py``.
    """

    samples: int = 10_000
    step: float | None = None
    metric: Literal["riemannian", "chord"] = "riemannian"
    seed: int = 0
    radius_factor: float = 1.5
    goal_bias: float = 0.05
    informed: bool = True
    prune: bool = True
    panel: float | None = None
    time_limit: float | None = None
    target_length: float | None = None

    def __post_init__(self) -> None:
        require_count(samples=self.samples)
        require_positive(radius_factor=self.radius_factor)
        require_fraction(goal_bias=self.goal_bias)
        require_seed(self.seed)
        require_bool(informed=self.informed, prune=self.prune)
        require_choice(("riemannian", "chord"), metric=self.metric)
        optional = {
            "step": self.step,
            "time_limit": self.time_limit,
            "target_length": self.target_length,
        }
        require_positive(**{name: value for name, value in optional.items() if value is not None})
        if self.panel is not None and self.panel != float("inf"):
            require_positive(panel=self.panel)

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "rrt-star-r" if self.metric == "riemannian" else "rrt-star"

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True.

        time_limit : seconds for this call; the lower of it and the option counts.
        Ctrl-C, too, ends the search with the best path so far.
        """
        return search_tree(problem, self._tree_options(time_limit), callback)

    def _tree_options(self, time_limit: float | None = None) -> TreeOptions:
        return TreeOptions(
            planner=self.name,
            samples=int(self.samples),
            step=self.step,
            radius_factor=self.radius_factor,
            goal_bias=self.goal_bias,
            seed=int(self.seed),
            riemannian=self.metric == "riemannian",
            prune=self.prune,
            informed=self.informed,
            panel=self.panel,
            time_limit=least_limit(self.time_limit, time_limit),
            target_length=self.target_length or 0.0,
        )
