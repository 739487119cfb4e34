"""Compiling beforehand: small problems that use every kernel, on both classes of surface."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from .._kernels import compiler
from .._support.files import written_whole
from .._support.watching import Watch, watch_nothing
from ..certificates.search import lower_bound
from ..distance.field import distance_field
from ..errors import InputError
from ..geodesics.alternatives import alternatives
from ..geodesics.rays import christoffel_symbols, gaussian_curvature
from ..geodesics.refinement import refine
from ..problem import Problem
from ..space.free_space import Circle
from ..surface import Mask, Surface
from ..surface.metric import chord, line_r
from . import plan

# What was compiled for which kernels; it lies beside them.
LIST_FILE = "terrapath-warm.json"

SIDE = 12.0  # map units
START, GOAL = (1.0, 1.0), (11.0, 10.0)


class Rehearsal(NamedTuple):
    """Work that has some kernels compiled."""

    name: str
    run: Callable[[], object]


class Warmth(NamedTuple):
    """What is in the cache after warming up."""

    compiled: int  # kernels that were compiled now
    files: int  # that hold machine code, of all kernels
    size: int  # bytes
    directory: Path


def peaks() -> Surface:
    """Of the exact class: a hill, and a second layer."""
    return Surface.from_peaks([[(2.0, 0.3, 5.0, 6.0)], [(1.0, 0.5, 8.0, 3.0)]])


def spline() -> Surface:
    """Of the class that everything else is of, with costs."""
    axis = np.linspace(0.0, SIDE, 25)
    x, y = np.meshgrid(axis, axis)
    hill = np.exp(-0.1 * ((x - 5.0) ** 2 + (y - 6.0) ** 2))
    values = np.stack([hill, 1.0 + 0.5 * hill])
    return Surface.from_grid(values, axis, axis, kinds=["rise", "cost"])


SURFACES: dict[str, Callable[[], Surface]] = {"peaks": peaks, "splines": spline}


def _open_ground(surface: Surface) -> Problem:
    return Problem(surface, START, GOAL, (0.0, 0.0, SIDE, SIDE))


def _with_obstacles(surface: Surface) -> Problem:
    corner = np.arange(4.0)
    mask = Mask(np.eye(4, dtype=bool)[::-1], corner, corner + SIDE - 3.0)
    obstacles = [shapely.box(3.0, 3.0, 4.0, 8.0), Circle(8.0, 7.0, 1.0), mask]
    return Problem(surface, START, GOAL, (0.0, 0.0, SIDE, SIDE), obstacles)


def _grow(surface: Surface) -> None:
    plan(_with_obstacles(surface), "rrt-star-r", samples=600)


def _march(surface: Surface) -> None:
    problem = _with_obstacles(surface)
    distance_field(surface, START, bounds=problem.bounds, spacing=0.5).at([GOAL, START])
    path = plan(problem, "fast-marching", spacing=0.5).path
    if path is not None:
        refine(problem, path)


def _prove(surface: Surface) -> None:
    problem = _open_ground(surface)
    path = plan(problem, "fast-marching", spacing=0.5, refine=True).path
    assert path is not None
    lower_bound(problem, length=path.length).check(problem)


def _search_grid(surface: Surface) -> None:
    plan(_with_obstacles(surface), "a-star", spacing=1.0)


def _measure(surface: Surface) -> None:
    line_r(surface, START, GOAL)
    chord(surface, START, GOAL)


def _shoot(surface: Surface) -> None:
    christoffel_symbols(surface, START)
    gaussian_curvature(surface, START)
    plan(_open_ground(surface), "geodesic-traversal", directions=8)


def _find_routes(surface: Surface) -> None:
    alternatives(_with_obstacles(surface), count=2)


# The longest first.
KINDS: dict[str, Callable[[Surface], None]] = {
    "lower bounds": _prove,
    "trees": _grow,
    "fast marching": _march,
    "geodesics": _shoot,
    "lengths": _measure,
    "grids": _search_grid,
    "distinct routes": _find_routes,
}


def rehearsals() -> list[Rehearsal]:
    """All that `plan`, `field`, `check` and `reproduce` compile."""
    return [
        Rehearsal(f"{kind} on {name}", partial(_rehearse, work, surface))
        for kind, work in KINDS.items()
        for name, surface in SURFACES.items()
    ]


def _rehearse(work: Callable[[Surface], None], surface: Callable[[], Surface]) -> None:
    with np.errstate(all="ignore"):
        work(surface())


def _listed(directory: Path) -> list[str] | None:
    """Files of these very kernels, if every one is still there."""
    try:
        record = json.loads((directory / LIST_FILE).read_text(encoding="utf-8"))
        names: list[str] = record["files"]
        if record["key"] != compiler.cache_key():
            return None
        return names if all((directory / name).is_file() for name in names) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write_list(directory: Path, names: list[str]) -> None:
    record = {"key": compiler.cache_key(), "files": names}
    with written_whole(directory / LIST_FILE) as temporary:
        temporary.write_text(json.dumps(record) + "\n", encoding="utf-8")


def _warmth(directory: Path, names: list[str], compiled: int) -> Warmth:
    size = sum((directory / name).stat().st_size for name in names)
    return Warmth(compiled, sum(name.endswith(".nbc") for name in names), size, directory)


def warm_up(watch: Watch = watch_nothing) -> Warmth:
    """Compile what is not in the cache yet.

    Raises InputError where kernels are not compiled at all, MapError where the cache cannot be
    written.
    """
    directory = compiler.cache_directory()
    if directory is None:
        raise InputError("NUMBA_DISABLE_JIT is set, so no kernel is compiled; unset it")
    names = _listed(directory)
    if names is not None:
        return _warmth(directory, names, 0)
    compiled = _rehearse_all(rehearsals(), watch)
    names = compiler.cached_files()
    _write_list(directory, names)
    return _warmth(directory, names, compiled)


def _rehearse_all(work: list[Rehearsal], watch: Watch) -> int:
    """How many kernels had to be compiled."""
    before = compiler.cache_statistics()["compiled"]
    for done, rehearsal in enumerate(work):
        watch(rehearsal.name, done, len(work))
        rehearsal.run()
    watch("compiled", len(work), len(work))
    return compiler.cache_statistics()["compiled"] - before
