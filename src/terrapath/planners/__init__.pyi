from .base import Planner as Planner, Progress as Progress
from .fast_marching import FastMarching as FastMarching
from .finished import Finished as Finished, finish as finish
from .geodesic_traversal import Fan as Fan, GeodesicTraversal as GeodesicTraversal
from .grid_search import AStar as AStar, Dijkstra as Dijkstra
from .optimal import Optimal as Optimal
from .registry import (
    PLANNERS as PLANNERS,
    make_finished as make_finished,
    make_planner as make_planner,
    plan as plan,
)
from .rrt import RRT as RRT
from .rrt_star import RRTStar as RRTStar
from .tours import (
    GoalAnswer as GoalAnswer,
    nearest as nearest,
    plan_goals as plan_goals,
    plan_tour as plan_tour,
)
