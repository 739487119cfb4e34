"""Planners by their names; each is loaded when it is first asked for."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from ..errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from ..problem import Problem, Solution
    from .base import Callback, Planner
    from .finished import Finished

__all__ = ["PLANNERS", "make_finished", "make_planner", "plan"]

# For each name the module and its class, and the options that the name stands for.
_REGISTERED: dict[str, tuple[str, str, dict[str, Any]]] = {
    "rrt-star-r": ("rrt_star", "RRTStar", {"metric": "riemannian"}),
    "rrt-star": ("rrt_star", "RRTStar", {"metric": "chord"}),
    "rrt": ("rrt", "RRT", {}),
    "dijkstra": ("grid_search", "Dijkstra", {}),
    "a-star": ("grid_search", "AStar", {}),
    "fast-marching": ("fast_marching", "FastMarching", {}),
    "geodesic-traversal": ("geodesic_traversal", "GeodesicTraversal", {}),
    "optimal": ("optimal", "Optimal", {}),
}


# Where installed packages announce planners of their own: a name, and a class like ``Planner``.
PLUG_INS = "terrapath.planners"


def _plug_ins() -> dict[str, EntryPoint]:
    """The planners of other packages by their names; none takes the name of one of ours."""
    from .._support.plug_ins import announced

    return {entry.name: entry for entry in announced(PLUG_INS) if entry.name not in _REGISTERED}


def _of_plug_in(entry: EntryPoint) -> type[Planner]:
    """The class that an entry point names. Raises InputError where it cannot be used."""
    from .._support.plug_ins import loaded

    kind = loaded(entry, f"planner {entry.name!r}")
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind) and hasattr(kind, "solve")):
        raise InputError(
            f"planner {entry.name!r} of {entry.value} is no planner: it must be a frozen dataclass "
            "of options with solve(problem, *, callback=None), as terrapath.planners.base.Planner"
        )
    return cast("type[Planner]", kind)


class _Planners(Mapping[str, Callable[..., "Planner"]]):
    """What makes a planner from its options, by the planner's name; ours first."""

    def __getitem__(self, name: str) -> Callable[..., Planner]:
        if name not in _REGISTERED:
            return partial(_of_plug_in(_plug_ins()[name]))
        module, kind, fixed = _REGISTERED[name]
        return partial(getattr(import_module(f".{module}", __package__), kind), **fixed)

    def __contains__(self, name: object) -> bool:
        return name in _REGISTERED or name in _plug_ins()

    def __iter__(self) -> Iterator[str]:
        return iter([*_REGISTERED, *_plug_ins()])

    def __len__(self) -> int:
        return len(_REGISTERED) + len(_plug_ins())


PLANNERS: Mapping[str, Callable[..., Planner]] = _Planners()


def _options(name: str) -> list[str]:
    """The names of the options that may be given to the planner of that name."""
    factory: Any = PLANNERS[name]
    fields = dataclasses.fields(factory.func)
    return [field.name for field in fields if field.name not in factory.keywords]


def make_planner(name: str, **options: Any) -> Planner:
    """The planner of that name with the given options.

    Raises InputError for a name or an option that is not known, and names the nearest known.
    """
    if name not in PLANNERS:
        raise InputError(f"planner={name!r} is not known; choose one of {', '.join(PLANNERS)}")
    known = _options(name)
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
    """The planner of that name, its solutions refined and bounded as asked; see ``Finished``.

    A time limit among the options holds for the planner and the finishing together. A planner
    that has an option ``target_gap`` meets the gap itself.
    """
    from .finished import Finished

    if target_gap is not None and name in PLANNERS and "target_gap" in _options(name):
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
    """Solve a problem with any planner by its name; its options as keywords.

    refine : take the path to the locally shortest one. bound : prove a lower bound on the
    length of every path. target_gap : improve the bound until (length - bound) / bound is no
    more than this; it implies ``bound``. ``optimal`` does all three by itself.
    ``callback`` sees the progress of each stage, and stops the planner or the search for a
    bound by returning True.
    Raises InputError for a name, an option or a value that is not known.
    """
    chosen = make_finished(planner, refine=refine, bound=bound, target_gap=target_gap, **options)
    return chosen.solve(problem, callback=callback)
