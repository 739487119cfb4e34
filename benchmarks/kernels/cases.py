"""The table of cases: every kernel whose speed matters, and work of any size for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import shapely

from terrapath import FastMarching, Lattice, Problem, RRTStar, Surface, refine
from terrapath._kernels.surface.lengths import fill_chords, fill_line_r
from terrapath._kernels.surface.points import fill_jets, fill_metric, fill_values
from terrapath.certificates.search import Search
from terrapath.distance.field import field_of, march_from
from terrapath.distance.medium import Medium
from terrapath.geodesics.rays import trace_ray
from terrapath.planners import Dijkstra
from terrapath.problem import scenes
from terrapath.problem.scenes import GOAL, REGION, START
from terrapath.surface.metric import segment_lengths

SIDE = REGION[2] - REGION[0]  # map units
SAMPLES = 121  # on a side, of the splines
LONGEST = 1.0  # segment, map units


class Work(NamedTuple):
    """The call that is measured, and how many items it handles."""

    run: Callable[[], object]
    items: int


class Case(NamedTuple):
    """A kernel, called in the same manner as planners call it."""

    name: str
    item: str  # what is counted
    prepare: Callable[[int], Work]  # for a size: items, or nodes on a side
    size: int
    least: int  # the smallest size, which only shows that the work runs


# Ground


@cache
def peaks() -> Surface:
    """Two layers of exact Gaussian peaks."""
    return scenes.load("six-peaks").surface


@cache
def spline(*kinds: str) -> Surface:
    """The spline through samples of both layers; all are above 0, as costs must be."""
    axis = np.linspace(REGION[0], REGION[2], SAMPLES)
    values = np.moveaxis(peaks().values(np.stack(np.meshgrid(axis, axis), axis=-1)), -1, 0)
    return Surface.from_grid(values + 1.0, axis, axis, kinds=kinds or None)


def costs() -> Surface:
    """The spline whose second layer is a cost, so that it multiplies lengths."""
    return spline("rise", "cost")


GROUNDS: dict[str, Callable[[], Surface]] = {"peaks": peaks, "spline": spline, "costs": costs}


@cache
def polygons() -> list[shapely.Polygon]:
    """Sixty polygons with sixteen corners each, none over the start or the goal."""
    places = np.random.default_rng(1).uniform(1.0, 9.0, (60, 2))
    return [shapely.Point(place).buffer(0.3, quad_segs=4) for place in places]


@cache
def problem(ground: Callable[[], Surface], *, cluttered: bool = False) -> Problem:
    """The problem from corner to corner, among polygons or over open ground."""
    return Problem(ground(), START, GOAL, REGION, polygons() if cluttered else ())


def places(count: int) -> Any:
    """Random points (count, 2) within the region."""
    return np.random.default_rng(0).uniform(REGION[0], REGION[2], (count, 2))


def segments(count: int) -> tuple[Any, Any]:
    """The two ends of random segments, (count, 2) each."""
    random, start = np.random.default_rng(2), places(count)
    end = start + random.uniform(-LONGEST, LONGEST, (count, 2)) / np.sqrt(2.0)
    return start, np.clip(end, REGION[0], REGION[2])


# Work


def fill(kernel: Any, ground: Callable[[], Surface], shape: tuple[int, ...], count: int) -> Work:
    """Evaluate a kernel at points, with a result of some shape for each."""
    filled = np.empty((count, *shape))
    return Work(partial(kernel, ground().data, places(count), filled), count)


def measure(kernel: Any, ground: Callable[[], Surface], count: int) -> Work:
    """Measure the lengths of segments."""
    return Work(partial(kernel, ground().data, *segments(count), np.empty(count)), count)


def measure_truly(ground: Callable[[], Surface], count: int) -> Work:
    """Measure the lengths of segments to nine digits."""
    return Work(partial(segment_lengths, ground(), *segments(count)), count)


def avoid(count: int) -> Work:
    """Test segments against polygons."""
    space = problem(peaks, cluttered=True).free_space
    return Work(partial(space.segments_are_free, *segments(count)), count)


def grow(ground: Callable[[], Surface], options: dict[str, Any], count: int) -> Work:
    """Grow a tree with this many samples."""
    cluttered = options.get("informed", True)
    planner = RRTStar(samples=count, **options)
    return Work(partial(planner.solve, problem(ground, cluttered=cluttered)), count)


def shoot(ground: Callable[[], Surface], count: int) -> Work:
    """Trace geodesics from the start, with their Jacobi fields."""
    angles = np.linspace(0.2, 1.3, count)

    def run() -> list[object]:
        return [trace_ray(ground(), START, angle, SIDE) for angle in angles]

    return Work(run, count)


def lattice_of(side: int) -> Lattice:
    """A lattice with this many cells on a side."""
    return Lattice.spanning(problem(peaks).bounds, SIDE / side)


def lay_edges(ground: Callable[[], Surface], side: int) -> Work:
    """Sample the ground, and choose and measure the edges of all nodes."""
    lattice = lattice_of(side)
    surface = ground()
    free = Problem(surface, START, START, lattice.bounds).free_space
    return Work(partial(Medium, surface, lattice, free), lattice.nx * lattice.ny)


def march(side: int) -> Work:
    """March among polygons."""
    lattice, of = lattice_of(side), problem(peaks, cluttered=True)
    medium = Medium(of.surface, lattice, of.free_space)
    run = partial(march_from, medium, START)
    return Work(run, lattice.nx * lattice.ny)


def look_up(count: int) -> Work:
    """Look up distances between the nodes of a field."""
    return Work(partial(field_of(problem(peaks), spacing=0.1).at, places(count)), count)


def descend(side: int) -> Work:
    """Follow the field down to its source."""
    field = field_of(problem(peaks), spacing=SIDE / side)
    path = field.path_to(GOAL)
    return Work(partial(field.path_to, GOAL), len(path.points))


def tighten(cluttered: bool, side: int) -> Work:
    """Refine a path from a lattice to the locally shortest one."""
    of = problem(peaks, cluttered=cluttered)
    path = FastMarching(spacing=SIDE / side).solve(of).path
    return Work(partial(refine, of, path), 1)


def prove(side: int) -> Work:
    """Prove a lower bound from one lattice, without repairs."""
    lattice = lattice_of(side)

    def run() -> object:
        return Search(problem(peaks), lattice, 1.5 * SIDE).certify()

    return Work(run, lattice.nx * lattice.ny)


def check(side: int) -> Work:
    """Prove a lower bound again."""
    lattice = lattice_of(side)
    certificate = Search(problem(peaks), lattice, 1.5 * SIDE).certify()
    return Work(partial(certificate.check, problem(peaks)), lattice.nx * lattice.ny)


def search_grid(side: int) -> Work:
    """Run Dijkstra's algorithm among polygons, with 16 neighbours."""
    of = problem(peaks, cluttered=True)
    planner = Dijkstra(spacing=SIDE / side)
    return Work(partial(planner.solve, of), lattice_of(side).nx * lattice_of(side).ny)


# The table


def batches() -> Iterator[Case]:
    """Cases with many points or segments at once, on every kind of ground."""
    fills = {
        "values": (fill_values, (2,)),
        "jets": (fill_jets, (2, 6)),
        "metric": (fill_metric, (2, 2)),
    }
    lengths = {"chords": fill_chords, "Line-R": fill_line_r}
    for kind, ground in GROUNDS.items():
        for name, (kernel, shape) in fills.items():
            yield Case(f"{name}, {kind}", "point", partial(fill, kernel, ground, shape), 20_000, 8)
        for name, kernel in lengths.items():
            yield Case(f"{name}, {kind}", "segment", partial(measure, kernel, ground), 10_000, 8)
        yield Case(f"true lengths, {kind}", "segment", partial(measure_truly, ground), 500, 8)


NEAREST_ALONE = {"metric": "chord", "radius_factor": 1e-9}  # no neighbour but the nearest vertex
MANY_NEIGHBOURS = {"metric": "chord", "radius_factor": 4.0}

CASES = [
    *batches(),
    Case("free segments", "segment", avoid, 10_000, 8),
    Case("tree, nearest alone", "sample", partial(grow, peaks, NEAREST_ALONE), 5_000, 50),
    Case("tree, within a radius", "sample", partial(grow, peaks, MANY_NEIGHBOURS), 3_000, 50),
    Case("tree, peaks, informed", "sample", partial(grow, peaks, {}), 3_000, 50),
    Case("tree, spline, informed", "sample", partial(grow, spline, {}), 3_000, 50),
    Case("tree, open ground", "sample", partial(grow, peaks, {"informed": False}), 3_000, 50),
    Case("rays, peaks", "ray", partial(shoot, peaks), 12, 1),
    Case("rays, spline", "ray", partial(shoot, spline), 2, 1),
    Case("edges, peaks", "node", partial(lay_edges, peaks), 120, 12),
    Case("edges, spline", "node", partial(lay_edges, spline), 120, 12),
    Case("fast marching", "node", march, 120, 12),
    Case("field, look-up", "point", look_up, 3_000, 8),
    Case("field, descent", "point", descend, 120, 12),
    Case("refinement, free", "path", partial(tighten, False), 60, 12),
    Case("refinement, taut", "path", partial(tighten, True), 60, 30),
    Case("bound, found", "node", prove, 60, 30),
    Case("bound, checked", "node", check, 60, 30),
    Case("grid search", "node", search_grid, 60, 12),
]
