"""Planners by their names."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable
from functools import partial
from typing import Any

from ..errors import InputError
from ..problem import Problem, Solution
from .base import Callback, Planner
from .geodesic_traversal import GeodesicTraversal
from .rrt import RRT
from .rrt_star import RRTStar

PLANNERS: dict[str, Callable[..., Planner]] = {
    "rrt-star-r": partial(RRTStar, metric="riemannian"),
    "rrt-star": partial(RRTStar, metric="chord"),
    "rrt": RRT,
    "geodesic-traversal": GeodesicTraversal,
}


def _options(factory: Callable[..., Planner]) -> list[str]:
    """Names of the options of a planner that its registered name leaves open."""
    kind: Any = factory
    fixed: dict[str, Any] = {}
    if isinstance(factory, partial):
        kind, fixed = factory.func, factory.keywords
    return [field.name for field in dataclasses.fields(kind) if field.name not in fixed]


def make_planner(name: str, **options: Any) -> Planner:
    """The planner of that name with the given options.

    Raises InputError for a name or an option that is not known, with the nearest known.
    """
    if name not in PLANNERS:
        raise InputError(f"planner={name!r} is not known; choose one of {', '.join(PLANNERS)}")
    known = _options(PLANNERS[name])
    for option in options:
        if option not in known:
            near = difflib.get_close_matches(option, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"its options are {', '.join(known)}"
            raise InputError(f"planner {name} has no option {option!r}; {hint}")
    return PLANNERS[name](**options)


def plan(
    problem: Problem,
    planner: str = "rrt-star-r",
    *,
    callback: Callback | None = None,
    **options: Any,
) -> Solution:
    """Solve a problem with any planner by its name; options as keywords."""
    return make_planner(planner, **options).solve(problem, callback=callback)
