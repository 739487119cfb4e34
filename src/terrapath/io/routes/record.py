"""Solutions as records, ready for JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ...problem import Path, Solution
from .route import Route


def plain(value: object) -> Any:
    """The value in JSON's types: infinity and NaN become None, arrays become lists."""
    if isinstance(value, float):  # first, for paths have thousands
        return float(value) if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray):
        numbers = value.tolist()
        return numbers if _is_finite(value) else plain(numbers)
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _is_finite(array: NDArray[Any]) -> bool:
    return array.dtype.kind in "fiu" and bool(np.isfinite(array).all())


def dump(record: object) -> str:
    """Strict JSON in ASCII: other characters are escaped, so any encoding can hold them."""
    return json.dumps(plain(record), allow_nan=False) + "\n"


def provenance(solution: Solution) -> dict[str, Any]:
    """What made the route, and from what. No dates: the same seed gives the same bytes."""
    surface = solution.problem.surface
    record: dict[str, Any] = {
        "software": f"terrapath {__version__}",
        "planner": solution.planner,
        "samples": solution.samples,
        "seed": solution.seed,
        "layers": {layer.name: layer.weight for layer in surface.layers},
    }
    optional = {
        "costs": {layer.name: layer.weight for layer in surface.costs},
        "options": solution.options,
        "map": surface.source,
    }
    record |= {key: value for key, value in optional.items() if value}
    if surface.georeference is not None:
        record["planned_in"] = surface.georeference.text
    return record


def _ends_in_degrees(solution: Solution) -> dict[str, Any]:
    """The plane's CRS, and start, goal and path in longitude and latitude."""
    reference = solution.problem.surface.georeference
    if reference is None:
        return {}
    problem, path = solution.problem, solution.path
    ends = reference.to_lonlat(np.array([problem.start, problem.goal]))
    return {
        "crs": reference.text,
        "start_lonlat": ends[0],
        "goal_lonlat": ends[1],
        "path_lonlat": None if path is None else reference.to_lonlat(path.points),
    }


def _corridor(solution: Solution) -> dict[str, Any]:
    """Where the lower bound holds, if not on the whole map."""
    corridor = solution.corridor
    if corridor is None:
        return {}
    return {
        "bound_holds": "in the corridor",
        "corridor_half_width": corridor.half_width,
        "corridor_decimate": corridor.decimate,
        "coarse_length": corridor.coarse_length,
        "lower_bound_everywhere": corridor.least_length(solution),
    }


def _measures(solution: Solution) -> dict[str, Any]:
    """The status, the lengths of the route, and how close it is proven to be to the best."""
    path = solution.path
    return {
        **_corridor(solution),
        "status": solution.status.value,
        "value": solution.value,
        "unit": solution.unit,
        "length": solution.length,
        **_ground(path),
        "unrefined_length": None if solution.unrefined is None else solution.unrefined.length,
        **_travel(solution),
        "cost": solution.cost,
        "lower_bound": solution.lower_bound,
        "gap": solution.gap,
        "straight_length": solution.straight_length,
        "contributions": None if path is None else path.contributions,
    }


def _travel(solution: Solution) -> dict[str, Any]:
    """The travel model, and what it makes of the route."""
    travel, unrefined, path = solution.problem.travel, solution.unrefined, solution.path
    if travel is None:
        return {}
    return {
        "travel": {"model": travel.name, "options": travel.options, "source": travel.source},
        "relaxed_value": solution.relaxed_value,
        "unrefined_value": None if unrefined is None else unrefined.value,
        "in_switchbacks": None if path is None else path.in_switchbacks,
        "straight_value": solution.straight_value,
    }


# The numbers on the ground, and their names in records.
GROUND_NUMBERS = ("ground_length", "ground_unit", "climb", "descent", "steepest", "steepest_side")


def _ground(path: Path | None) -> dict[str, Any]:
    """What people ask of a route, whatever was minimised."""
    return {name: None if path is None else getattr(path, name) for name in GROUND_NUMBERS}


def _legs(solution: Solution) -> list[dict[str, Any]]:
    """One record for each leg that was planned."""
    return [
        {
            "start": leg.problem.start,
            "goal": leg.problem.goal,
            "status": leg.status.value,
            "value": leg.value,
            "unit": leg.unit,
            "length": leg.length,
            **_ground(leg.path),
            "lower_bound": leg.lower_bound,
            "seconds": leg.seconds,
        }
        for leg in solution.legs
    ]


def route_record(solution: Solution) -> dict[str, Any]:
    """All that is known about a solution, ready for JSON.

    ``value`` is what was minimised, in ``unit``. ``ground_length``, ``climb`` and ``descent`` are
    in ``ground_unit``, metres on maps; ``steepest`` is the largest grade in the direction of
    travel and ``steepest_side`` the largest slope across it, rise over horizontal distance.
    ``start``, ``goal``, ``via`` and ``path`` are on the planning plane, map units;
    with a georeference ``crs`` names that plane, and ``start_lonlat``, ``goal_lonlat`` and
    ``path_lonlat`` are longitude and latitude in degrees. Where the path was refined,
    ``unrefined_length`` is the length of the planner's own path. ``contributions`` are the shares
    of the length that come from the plane and from each layer. ``legs`` are those of a tour. With a
    travel model, ``travel`` names it, ``value`` is what it makes of the route, ``in_switchbacks``
    is the share of the route, on the map, that is steeper than its critical grades, and ``length``
    is still the length under h.
    """
    problem, path = solution.problem, solution.path
    record: dict[str, Any] = {
        **_measures(solution),
        "seconds": solution.seconds,
        "start": problem.start,
        "goal": problem.goal,
        "via": solution.via,
        "path": None if path is None else path.points,
        "stopped_by": solution.stopped_by,
        "counters": solution.counters,
        "alternatives": [other.value for other in solution.alternatives],
        **provenance(solution),
        **_ends_in_degrees(solution),
    }
    if solution.legs:
        record["legs"] = _legs(solution)
    return dict(plain(record))


def summary(route: Route) -> dict[str, Any]:
    """All that is known about a route except its points: measures and provenance."""
    solution = route.solution
    return dict(plain({**_measures(solution), **route.facts, **provenance(solution)}))


def write(route: Route, file: FilePath) -> None:
    """Write the record. It holds every point that was planned, so that its value can be checked."""
    file.write_text(dump(route_record(route.solution)), encoding="utf-8")
