"""Floor 5: planners. One planner, one file; ``PLANNERS`` is the registry."""

from .base import Planner, Progress
from .registry import PLANNERS, make_planner, plan
from .rrt import RRT
from .rrt_star import RRTStar

__all__ = ["PLANNERS", "RRT", "Planner", "Progress", "RRTStar", "make_planner", "plan"]
