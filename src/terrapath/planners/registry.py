"""Planners by their names."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable
from functools import cache, partial
from typing import Any

from ..errors import InputError
from ..problem import Problem, Solution
from .base import Callback, Planner
from .fast_marching import FastMarching
from .finished import Finished, finish
from .geodesic_traversal import GeodesicTraversal
from .grid_search import AStar, Dijkstra
from .optimal import Optimal
from .rrt import RRT
from .rrt_star import RRTStar

__all__ = ["PLANNERS", "finish", "make_finished", "make_planner", "plan"]

PLANNERS: dict[str, Callable[..., Planner]] = {
    "rrt-star-r": partial(RRTStar, metric="riemannian"),
    "rrt-star": partial(RRTStar, metric="chord"),
    "rrt": RRT,
    "dijkstra": Dijkstra,
    "a-star": AStar,
    "fast-marching": FastMarching,
    "geodesic-traversal": GeodesicTraversal,
    "optimal": Optimal,
}


@cache
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


def make_finished(
    name: str,
    *,
    refine: bool = False,
    bound: bool = False,
    target_gap: float | None = None,
    **options: Any,
) -> Finished:
    """The planner of that name, its answers refined and bounded as asked; see ``Finished``.

    A time limit among the planner's options is the finishing's too, and a planner that knows
    a target gap takes care of it by itself.
    """
    if target_gap is not None and name in PLANNERS and "target_gap" in _options(PLANNERS[name]):
        options["target_gap"], target_gap = target_gap, None
    return Finished(
        planner=make_planner(name, **options),
        refine=refine,
        bound=bound,
        target_gap=target_gap,
        time_limit=options.get("time_limit"),
    )


def plan(
    problem: Problem,
    planner: str = "rrt-star-r",
    *,
    refine: bool = False,
    bound: bool = False,
    target_gap: float | None = None,
    callback: Callback | None = None,
    **options: Any,
) -> Solution:
    """Solve a problem with any planner by its name; options as keywords.

    refine : take the path to the locally shortest one. bound : prove a lower bound on every
    path's length. target_gap : refine the bound until (length - bound) / bound is met, which
    asks for a bound; ``optimal`` does all three by itself. ``callback`` sees the progress of
    each stage, and stops the planner or the bound by returning True.
    """
    chosen = make_finished(planner, refine=refine, bound=bound, target_gap=target_gap, **options)
    return chosen.solve(problem, callback=callback)
