"""The path over a lattice that an informed tree begins with where the straight line is no good."""

from __future__ import annotations

import math
import time
from dataclasses import replace

from .._support.watching import never, stop_after
from ..errors import told_to
from ..problem import Path, Problem
from .base import (
    INTERRUPT,
    TIME_LIMIT,
    Callback,
    FirstPath,
    Progress,
    TreeOptions,
    seconds_left,
)
from .fast_marching import FastMarching
from .grid_search import AStar

# The first lattice has between so many nodes on a side, so that it shows valleys and gaps, and so
# many, so that it costs no more than the default number of samples. They cost more on rough ground.
FEWEST_NODES, MOST_NODES, MOST_ON_ROUGH = 100, 200, 500

# The neighbours of a node. With fewer a search is hardly quicker, and oftener in a wrong valley.
NEIGHBOURS = 32


def coarse_spacing(problem: Problem, is_rough: bool = False) -> float:
    """The spacing of the first lattice, map units: a cell or a feature, as far as that is cheap."""
    side = problem.bounds.side
    cells = (min(cells.dx, cells.dy) for cells in problem.mask_cells)
    finest = min(problem.surface.resolution, side / FEWEST_NODES, *cells)
    return max(finest, side / (MOST_ON_ROUGH if is_rough else MOST_NODES))


def path_over_lattices(
    problem: Problem,
    options: TreeOptions,
    callback: Callback | None,
    straight: Path | None,
    is_rough: bool,
) -> FirstPath:
    """The shortest path over a coarse lattice; where that shows none, over the default ones.

    straight : the straight line where that is free; the shorter path counts. The coarse lattice
    takes a moment, so only the others show their progress.
    """
    spacing = coarse_spacing(problem, is_rough)
    # Nodes where the samples are, which is best on rough ground, unless they are far too many.
    at_samples = is_rough and min(problem.default_spacing) >= 0.5 * spacing
    coarse = AStar(spacing=None if at_samples else spacing, neighbours=NEIGHBOURS)
    found = coarse.solve(problem, time_limit=options.time_limit)
    seconds = found.seconds

    def watch(progress: Progress) -> bool:
        seen = Progress(0, options.samples, seconds + progress.seconds, math.inf)
        return callback is not None and bool(callback(seen))

    is_over = found.stopped_by in (INTERRUPT, TIME_LIMIT)
    if found.path is None and straight is None and not is_over:
        rest = seconds_left(options.time_limit, seconds)
        found = replace(coarse, spacing=None).solve(problem, callback=watch, time_limit=rest)
        seconds += found.seconds
    paths = [path for path in (found.path, straight) if path is not None]
    ended = found.stopped_by if found.stopped_by in (INTERRUPT, "callback") else ""
    best = min(paths, key=lambda path: path.gauged, default=None)
    if not is_rough or best is None or is_over:
        return FirstPath(best, seconds, ended)
    started = time.perf_counter()
    shorter = _shorter(problem, paths, seconds_left(options.time_limit, seconds))
    # A path shortened like that has so many points that a tree would grow slowly from it.
    return FirstPath(shorter, seconds + time.perf_counter() - started, ended, branch=best)


def _shorter(problem: Problem, paths: list[Path], time_limit: float | None) -> Path:
    """A path on rough ground that a tree hardly finds, within a time limit, seconds.

    There the shortest paths bend between the nodes of a lattice. A distance field allows for that,
    so its path may lead through another valley. All are moved sideways to where they are shorter.
    """
    from ..geodesics.refinement.lanes import COARSE, STAGES, shortened

    must_stop = never if time_limit is None else stop_after(time_limit)
    found = [*paths]
    if problem.travel is None:
        with told_to(lambda _: None):  # it is one of several paths
            field = FastMarching().solve(problem, time_limit=time_limit)
        found += [] if field.path is None else [field.path]
    for stages, count in ((COARSE, len(found)), (STAGES[2:3], 1)):
        found.sort(key=lambda path: path.gauged)
        moved = [shortened(problem, path.points, must_stop, stages) for path in found[:count]]
        found += [problem.path(path.points) for path in moved]
    return min(found, key=lambda path: path.gauged)
