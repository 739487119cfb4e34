from . import scenes as scenes
from .path import Path as Path
from .path import Profile as Profile
from .problem import Problem as Problem
from .solution import History as History
from .solution import SearchTree as SearchTree
from .solution import Solution as Solution
from .solution import Status as Status
