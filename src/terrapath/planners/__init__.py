"""Floor 5: planners. One planner, one file; ``PLANNERS`` is the registry."""

from ..errors import UnfinishedWarning
from .base import Planner, Progress
from .fast_marching import FastMarching
from .finishing import Finished, finish
from .geodesic_traversal import Fan, GeodesicTraversal
from .grid_search import AStar, Dijkstra
from .itinerary import GoalAnswer, nearest, plan_goals, plan_tour
from .optimal import Optimal
from .registry import PLANNERS, make_finished, make_planner, plan
from .rrt import RRT
from .rrt_star import RRTStar

__all__ = [
    "PLANNERS",
    "RRT",
    "AStar",
    "Dijkstra",
    "Fan",
    "FastMarching",
    "Finished",
    "GeodesicTraversal",
    "GoalAnswer",
    "Optimal",
    "Planner",
    "Progress",
    "RRTStar",
    "UnfinishedWarning",
    "finish",
    "make_finished",
    "make_planner",
    "nearest",
    "plan",
    "plan_goals",
    "plan_tour",
]
