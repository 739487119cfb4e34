from . import scenes as scenes
from .problem import Problem as Problem
from .solution import (
    History as History,
    Path as Path,
    Profile as Profile,
    SearchTree as SearchTree,
    Solution as Solution,
    Status as Status,
)
