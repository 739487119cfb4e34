"""The path that an informed tree begins with: the straight line, or one over a coarse lattice."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import NamedTuple

from ..problem import Path, Problem
from ..surface.metric import chord
from .base import INTERRUPT, Callback, Progress

# A straight line that is longer than this many chords is dear: a way around is looked for.
DEAR = 1.05

# The first lattice has between so many nodes on a side, so that it shows valleys and gaps, and so
# many, so that it costs no more than the default number of samples.
FEWEST_NODES, MOST_NODES = 100, 200

# The neighbours of a node. With fewer a search is hardly quicker, and oftener in a wrong valley.
NEIGHBOURS = 32

TIME_LIMIT = "time limit"


class FirstPath(NamedTuple):
    """What a tree begins with."""

    path: Path | None  # None where the lattices show none
    seconds: float = 0.0  # it took, without compiling
    stopped_by: str = ""  # what ended the whole run while it was looked for


def first_path(
    problem: Problem, callback: Callback | None, samples: int, time_limit: float | None
) -> FirstPath:
    """The straight line where it is free and cheap, else the shorter of it and a lattice's path.

    samples : how many the tree may draw, for the progress. time_limit : seconds.
    """
    started = time.perf_counter()
    straight = _straight(problem)
    if straight is not None and _is_cheap(problem):
        return FirstPath(straight, time.perf_counter() - started)
    found = _over_lattices(problem, callback, samples, time_limit)
    paths = [path for path in (found.path, straight) if path is not None]
    return found._replace(path=min(paths, key=lambda path: path.length, default=None))


def _straight(problem: Problem) -> Path | None:
    ends = [problem.start], [problem.goal]
    if not problem.free_space.segments_are_free(*ends).all():
        return None
    return problem.path([problem.start, problem.goal])


def _is_cheap(problem: Problem) -> bool:
    least = float(chord(problem.surface, problem.start, problem.goal))
    return problem.straight_length <= DEAR * least


def coarse_spacing(problem: Problem) -> float:
    """The spacing of the first lattice, map units: a cell or a feature, as far as that is cheap."""
    side = problem.bounds.side
    cells = (min(mask.spacing) for mask in problem.free_space.masks)
    finest = min(problem.surface.resolution, side / FEWEST_NODES, *cells)
    return max(finest, side / MOST_NODES)


def _over_lattices(
    problem: Problem, callback: Callback | None, samples: int, time_limit: float | None
) -> FirstPath:
    """The shortest path over a coarse lattice; where that shows none, over the default ones.

    The coarse one takes a moment, so only the others show their progress.
    """
    from .grid_search import AStar

    coarse = AStar(spacing=coarse_spacing(problem), neighbours=NEIGHBOURS)
    found = coarse.solve(problem, time_limit=time_limit)
    before = found.seconds

    def watch(progress: Progress) -> bool:
        seen = Progress(0, samples, before + progress.seconds, math.inf)
        return callback is not None and bool(callback(seen))

    if found.path is None and found.stopped_by not in (INTERRUPT, TIME_LIMIT):
        rest = None if time_limit is None else max(time_limit - before, 1e-9)
        found = replace(coarse, spacing=None).solve(problem, callback=watch, time_limit=rest)
        before += found.seconds
    ended = found.stopped_by if found.stopped_by in (INTERRUPT, "callback") else ""
    return FirstPath(found.path, before, ended)
