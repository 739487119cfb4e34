"""Floor 5: planners. One planner, one file; ``PLANNERS`` is the registry."""

from .base import Planner, Progress
from .geodesic_traversal import Fan, GeodesicTraversal
from .registry import PLANNERS, make_planner, plan
from .rrt import RRT
from .rrt_star import RRTStar

__all__ = [
    "PLANNERS",
    "RRT",
    "Fan",
    "GeodesicTraversal",
    "Planner",
    "Progress",
    "RRTStar",
    "make_planner",
    "plan",
]
