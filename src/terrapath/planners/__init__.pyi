from .base import Planner as Planner
from .base import Progress as Progress
from .fast_marching import FastMarching as FastMarching
from .finished import Finished as Finished
from .finished import finish as finish
from .geodesic_traversal import Fan as Fan
from .geodesic_traversal import GeodesicTraversal as GeodesicTraversal
from .grid_search import AStar as AStar
from .grid_search import Dijkstra as Dijkstra
from .optimal import Optimal as Optimal
from .registry import (
    PLANNERS as PLANNERS,
)
from .registry import (
    make_finished as make_finished,
)
from .registry import (
    make_planner as make_planner,
)
from .registry import (
    plan as plan,
)
from .rrt import RRT as RRT
from .rrt_star import RRTStar as RRTStar
from .tours import (
    GoalAnswer as GoalAnswer,
)
from .tours import (
    nearest as nearest,
)
from .tours import (
    plan_goals as plan_goals,
)
from .tours import (
    plan_tour as plan_tour,
)
