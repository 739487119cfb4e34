"""Warm-up: small problems that use, and so compile, every kernel on both classes of surface."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from .._kernels import cache, compiler
from .._kernels.second_core import SecondCore, rehearsal_name, serve_first_core
from .._support.files import written_whole
from .._support.watching import Watch, watch_nothing
from ..certificates.search import lower_bound
from ..distance.field import distance_field
from ..errors import InputError, MapError, told_to
from ..geodesics import christoffel_symbols, gaussian_curvature
from ..geodesics.alternatives import alternatives
from ..geodesics.refinement import refine
from ..problem import Problem
from ..space.free_space import Circle
from ..surface import Mask, Surface
from ..surface.metric import chord, line_r
from .registry import plan

# The list of the files of a complete cache, beside them: a later warm-up only checks these files.
LIST_FILE = "terrapath-warm.json"

SIDE = 12.0  # map units
START, GOAL = (1.0, 1.0), (11.0, 10.0)


class Rehearsal(NamedTuple):
    """Small work that compiles some kernels."""

    name: str
    run: Callable[[], object]


class Warmth(NamedTuple):
    """What is in the cache after warming up."""

    compiled: int  # kernels that were compiled now
    files: int  # that hold machine code, of all kernels
    size: int  # bytes
    directory: Path


def peaks() -> Surface:
    """A surface of exact peaks: a hill, and a second layer."""
    return Surface.from_peaks([[(2.0, 0.3, 5.0, 6.0)], [(1.0, 0.5, 8.0, 3.0)]])


def spline() -> Surface:
    """A spline surface, as maps are, with a cost layer."""
    axis = np.linspace(0.0, SIDE, 25)
    x, y = np.meshgrid(axis, axis)
    hill = np.exp(-0.1 * ((x - 5.0) ** 2 + (y - 6.0) ** 2))
    values = np.stack([hill, 1.0 + 0.5 * hill])
    return Surface.from_grid(values, axis, axis, kinds=["rise", "cost"])


# By the name of the surface's class.
SURFACES: dict[str, Callable[[], Surface]] = {"peaks": peaks, "spline": spline}


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
    plan(_open_ground(surface), "fast-marching", spacing=0.5, refine=True)
    problem = _with_obstacles(surface)
    distance_field(surface, START, bounds=problem.bounds, spacing=0.5).at([GOAL, START])
    path = plan(problem, "fast-marching", spacing=0.5).path
    if path is not None:
        refine(problem, path)


def _prove(surface: Surface) -> None:
    problem = _open_ground(surface)
    lower_bound(problem, length=math.inf).check(problem)


def _search_grid(surface: Surface) -> None:
    plan(_with_obstacles(surface), "a-star", spacing=1.0)


def _measure(surface: Surface) -> None:
    line_r(surface, START, GOAL)
    chord(surface, START, GOAL)
    if surface.is_raster:
        _read_degrees()


def _read_degrees() -> None:
    """A map in degrees, which is carried onto a plane."""
    from ..surface.raster import Raster

    heights = np.add.outer(np.arange(8.0), np.arange(8.0))[None]
    Raster.from_extent(heights, (11.0, 47.0, 11.01, 47.01), "EPSG:4326").to_surface(
        names=["height"]
    )


def _shoot(surface: Surface) -> None:
    christoffel_symbols(surface, START)
    gaussian_curvature(surface, START)
    plan(_open_ground(surface), "geodesic-traversal", directions=8)


def _find_routes(surface: Surface) -> None:
    alternatives(_with_obstacles(surface), count=2)


# The work that takes longest comes first.
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
    """Rehearsals of all kernels that `plan`, `field`, `check` and `reproduce` compile."""
    return [
        Rehearsal(rehearsal_name(kind, name), partial(_rehearse, work, surface))
        for name, surface in SURFACES.items()
        for kind, work in KINDS.items()
    ]


def _rehearse(work: Callable[[Surface], None], surface: Callable[[], Surface]) -> None:
    with np.errstate(all="ignore"):
        work(surface())


def _listed(directory: Path) -> list[str] | None:
    """The listed files, if they are of the present kernels, and all of them exist undamaged."""
    try:
        file = directory / LIST_FILE
        if not file.is_file():  # a pipe would be waited for
            return None
        record = json.loads(file.read_text(encoding="utf-8"))
        names: list[str] = record["files"]
        if record["key"] != cache.environment():
            return None
        sound = all(cache.read_sound(directory / name) is not None for name in names)
        return names if names and sound else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write_list(directory: Path, names: list[str]) -> None:
    record = {"key": cache.environment(), "files": names}
    with written_whole(directory / LIST_FILE) as temporary:
        temporary.write_text(json.dumps(record) + "\n", encoding="utf-8")


def _warmth(directory: Path, names: list[str], compiled: int) -> Warmth:
    size = sum((directory / name).stat().st_size for name in names)
    return Warmth(compiled, len(names), size, directory)


def warm_up(watch: Watch = watch_nothing) -> Warmth:
    """Compile the kernels that are missing or damaged in the cache.

    Raises InputError where kernels are not compiled at all, MapError where the cache cannot be
    written.
    """
    directory = compiler.cache_directory()
    if directory is None:
        raise InputError("NUMBA_DISABLE_JIT is set, so no kernel is compiled; unset it")
    names = _listed(directory)
    if names is not None:
        return _warmth(directory, names, 0)
    before = cache.kept_files()
    with told_to(lambda warning: None):  # the error below says the same
        _rehearse_all(rehearsals(), watch)
    if (failure := cache.unkept()) is not None:
        raise MapError(failure)
    names = cache.kept_files()
    _write_list(directory, names)
    return _warmth(directory, names, len(set(names) - set(before)))


def _rehearse_all(work: list[Rehearsal], watch: Watch) -> None:
    """Run all rehearsals. The second half also runs on a second core, so here it mostly loads."""
    half = len(work) // 2
    with SecondCore(*[rehearsal.name for rehearsal in work[half:]]) as second:
        for done, rehearsal in enumerate(work):
            if done == half:
                second.wait()
            watch(rehearsal.name, done, len(work))
            rehearsal.run()
    watch("compiled", len(work), len(work))


def rehearse(names: list[str]) -> None:
    """Run rehearsals by their names, as the second process does."""
    serve_first_core()
    for rehearsal in rehearsals():
        if rehearsal.name in names:
            rehearsal.run()


if __name__ == "__main__":
    rehearse(sys.argv[1:])
