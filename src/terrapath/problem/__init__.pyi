from . import scenes as scenes
from .problem import (
    History as History,
    Path as Path,
    Problem as Problem,
    Profile as Profile,
    SearchTree as SearchTree,
    Solution as Solution,
    Status as Status,
)
