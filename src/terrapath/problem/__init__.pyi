from . import scenes as scenes
from .path import Path as Path, Profile as Profile
from .problem import Problem as Problem
from .solution import (
    History as History,
    SearchTree as SearchTree,
    Solution as Solution,
    Status as Status,
)
