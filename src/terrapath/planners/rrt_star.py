"""RRT*-R: the search by a growing tree, and its planner."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .._kernels.planners import rrt_star as kernels, tree as trees
from .._kernels.planners.buckets import Buckets
from .._kernels.planners.sampling import PATH_SHARE
from .._kernels.travel.priced import is_directed, least_price
from ..problem import History, Path, Problem, SearchTree, Solution
from ..problem.path import sampled
from ..surface import Surface
from ..surface.metric import LINE_R, chord, edge_rule, is_rough
from ..validation import (
    Array,
    require_bool,
    require_choice,
    require_count,
    require_fraction,
    require_positive,
    require_seed,
)
from .base import (
    INTERRUPT,
    TIME_LIMIT,
    Callback,
    FirstPath,
    Progress,
    TreeOptions,
    answer_without_search,
    default_step,
    least_limit,
    status_of,
    straight_path,
)

# Samples between two looks at the clock, the callback and Ctrl-C.
CHUNK = 512

# The first samples keep the order in which they were drawn: the tree is still so small that
# another order would not help the processor's cache.
UNORDERED = 2048

# A straight line that is longer than this many chords is dear: a path around is looked for.
DEAR = 1.05

# A batch with so many samples no longer fits in the cache: those beside the path come first.
ALONG_PATH = 8192

# One application of Line-R measures a piece that is at most this many features of the surface long.
FEATURES_PER_PANEL = LINE_R.features


def _kernel_options(problem: Problem, options: TreeOptions) -> trees.Options:
    bounds = problem.bounds
    # Karaman and Frazzoli (2011), theorem 38 at d = 2; the kernel multiplies by the root of
    # the area that is searched, which is at least that of the free space in it.
    least = 2.0 * math.sqrt(1.5 / math.pi)
    step, rule = options.step or default_step(problem), LINE_R
    if options.panel is None and options.informed and options.riemannian:
        rule = edge_rule(problem.relief, bounds, min(step, default_step(problem)))
    return trees.Options(
        *bounds,
        *problem.start,
        *problem.goal,
        step=float(step),
        radius=float(options.radius_factor * least),
        goal_bias=float(options.goal_bias),
        panel=float(options.panel or rule.features * problem.surface.resolution),
        tolerance=rule.tolerance,
        riemannian=options.riemannian,
        prune=options.prune,
        informed=options.informed,
    )


def _allocate(samples: int, surface: Surface, branch: Array | None = None) -> trees.Tree:
    branch = np.empty((0, 2)) if branch is None else branch
    # The start, the first branch, and the goal that may join with the last sample.
    size = samples + 2 + len(branch)
    most = size // 2 + 64  # buckets
    directions = 2 if is_directed(surface.data) else 1
    return trees.Tree(
        places=np.empty((size, trees.LIFTED + len(surface.layers))),
        vertices=np.empty(size, trees.TENSOR),
        links=np.empty(size, trees.LINK),
        counters=np.zeros(trees.COUNTERS, np.int64),
        buckets=Buckets(
            first=np.empty(most + 1, np.int32),
            head=np.empty(most, np.int32),
            next=np.empty(size, np.int32),
            frame=np.zeros(3),
            shape=np.zeros(2, np.int64),
        ),
        floor=surface.least_cost,
        least=surface.least_cost * least_price(surface.data),
        branch=branch,
        near=np.empty(directions * size, trees.CANDIDATE),
        queue=np.empty(size, np.int32),
    )


@dataclass
class _Search:
    """A running search: the tree, what it began with, the clock and the history."""

    problem: Problem
    options: TreeOptions
    settings: trees.Options
    tree: trees.Tree
    first: FirstPath
    started: float = field(default_factory=time.perf_counter)
    rows: list[tuple[int, float, float]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.started + self.first.seconds

    @property
    def goal(self) -> int:
        return int(self.tree.counters[trees.GOAL])

    @property
    def best_cost(self) -> float:
        cost = self.tree.places[self.goal, trees.COST] if self.goal >= 0 else math.inf
        return float(cost) + self.problem.taken_off

    @property
    def samples(self) -> int:
        return int(self.tree.counters[trees.SAMPLES])

    def note(self) -> Progress:
        """Add the progress to the history and return it."""
        progress = Progress(self.samples, self.options.samples, self.seconds, self.best_cost)
        self.rows.append((progress.samples, progress.seconds, progress.best_cost))
        return progress

    def grow(self, draws: Array) -> None:
        problem = self.problem
        kernels.grow(problem.priced.data, problem.free_space.data, self.tree, self.settings, draws)


def _prepare(problem: Problem, tree: trees.Tree, settings: trees.Options) -> None:
    """Plant the tree; so the kernels are loaded, or compiled, before the clock starts."""
    kernels.grow(problem.priced.data, problem.free_space.data, tree, settings, np.empty((0, 3)))


def _reason_to_stop(search: _Search, callback: Callback | None) -> str:
    """Why the search should end now; empty where it should not."""
    options = search.options
    progress = search.note()
    if callback is not None and callback(progress):
        return "callback"
    if math.isfinite(progress.best_cost) and progress.best_cost <= options.target_length:
        return "first path" if math.isinf(options.target_length) else "target length"
    if options.time_limit is not None and progress.seconds >= options.time_limit:
        return TIME_LIMIT
    if progress.samples >= options.samples:
        return "samples"
    return ""


def _side_by_side(draws: Array, informed: bool) -> Array:
    """Sort draws (m, 3) so that each one lies near the one before.

    Their last two numbers are a point in a square; the order is row by row, to and fro. In a
    large batch of an informed tree those beside its path come before, in their order along it.
    """
    row = np.floor(draws[:, 2] * math.isqrt(len(draws)))
    column = np.where(row % 2 == 0, draws[:, 1], 1.0 - draws[:, 1])
    order = row + column
    if informed and len(draws) >= ALONG_PATH:
        order = np.where(draws[:, 0] < PATH_SHARE, draws[:, 1] - 1.0, order)
    return draws[np.argsort(order)]


def _chunks(seed: int, samples: int, informed: bool = False) -> Iterator[Array]:
    """The uniform numbers (m, 3) that samples are drawn with, chunk by chunk.

    They are drawn in batches; each is a quarter of all those before. Within a batch the order is
    free, so samples that need the same vertices follow one another, while these are in the
    processor's cache. A batch is always drawn whole. So a run with fewer samples grows the
    beginning of the tree that a run with more samples grows.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    batch = random.random((min(UNORDERED, samples), 3))
    drawn = 0
    while True:
        used = batch[: samples - drawn]
        yield from (used[first : first + CHUNK] for first in range(0, len(used), CHUNK))
        drawn += len(batch)
        if drawn >= samples:
            return
        batch = _side_by_side(random.random((drawn // 4, 3)), informed)


def _run(search: _Search, callback: Callback | None) -> str:
    """Grow the tree until there is a reason to stop, and return it."""
    options, reason = search.options, search.first.stopped_by
    if reason:
        search.note()
        return reason
    try:
        for draws in _chunks(options.seed, options.samples, options.informed):
            search.grow(draws)
            if reason := _reason_to_stop(search, callback):
                break
    except KeyboardInterrupt:
        search.note()  # what the kernel had done when the signal was seen
        reason = INTERRUPT
    return reason


def _path(problem: Problem, tree: trees.Tree) -> Path | None:
    vertex = int(tree.counters[trees.GOAL])
    if vertex < 0:
        return None
    visited, parents = [], tree.links["parent"]
    while vertex >= 0:
        visited.append(vertex)
        vertex = int(parents[vertex])
    return problem.path(tree.places[visited[::-1], : trees.COST])


def _first_path(problem: Problem, options: TreeOptions, callback: Callback | None) -> FirstPath:
    """What an informed tree begins with: the straight line if cheap, else a path over a lattice."""
    if not options.informed:
        return FirstPath(None)
    started, straight = time.perf_counter(), straight_path(problem)
    least = float(chord(problem.priced, problem.start, problem.goal))
    if straight is not None and straight.gauged <= DEAR * least:
        return FirstPath(straight, time.perf_counter() - started)
    from .first_path import path_over_lattices

    on_rough = options.riemannian and is_rough(problem.relief, problem.bounds)
    return path_over_lattices(problem, options, callback, straight, on_rough)


def _best(search: _Search) -> tuple[Path | None, float | None]:
    """The shorter of the tree's path and the one that it began with, and its cost.

    Lengths are true. A tree that measures chords minimises something else, so its path counts.
    """
    path, first = _path(search.problem, search.tree), search.first.path
    if path is None:
        return first, None if first is None else first.value
    if first is not None and search.options.riemannian and first.gauged < path.gauged:
        return first, first.value
    return path, search.best_cost


def _search_tree(tree: trees.Tree) -> SearchTree:
    """The vertices in the order in which they were added."""
    count = int(tree.counters[trees.VERTICES])
    ages, parents = tree.links["age"][:count], tree.links["parent"][:count]
    by_age = np.argsort(ages)
    parents = ages[parents[by_age]]
    parents[0] = -1  # the start came first
    points, costs = tree.places[by_age, : trees.COST], tree.places[by_age, trees.COST]
    return SearchTree(points, parents, costs)


def _counters(tree: trees.Tree) -> dict[str, int]:
    places = {
        "vertices": trees.VERTICES,
        "edges considered": trees.CONSIDERED,
        "edges pruned": trees.PRUNED,
        "edges integrated": trees.INTEGRATED,
        "edges tested for obstacles": trees.CHECKED,
        "edges rewired": trees.REWIRED,
    }
    return {name: int(tree.counters[place]) for name, place in places.items()}


def search_tree(problem: Problem, options: TreeOptions, callback: Callback | None) -> Solution:
    """Grow a tree from the start until an option's limit is met or the callback stops it."""
    answer = answer_without_search(problem, options.planner, options.seed, takes_travel=True)
    if answer is not None:
        return answer
    settings = _kernel_options(problem, options)
    first = _first_path(problem, options, callback)
    root = first.branch or first.path
    branch = None if root is None else sampled(root.points, settings.step)
    tree = _allocate(options.samples, problem.priced, branch)
    _prepare(problem, tree, settings)
    search = _Search(problem, options, settings, tree, first)
    stopped_by = _run(search, callback)
    seconds = search.seconds
    path, cost = _best(search)
    return Solution(
        problem=problem,
        planner=options.planner,
        status=status_of(path, stopped_by),
        path=path,
        cost=cost,
        seconds=seconds,
        samples=search.samples,
        seed=options.seed,
        stopped_by=stopped_by,
        history=History(*np.array(search.rows, np.float64).reshape(-1, 3).T),
        tree=_search_tree(tree),
        counters=_counters(tree),
    )


@dataclass(frozen=True, kw_only=True)
class RRTStar:
    """RRT*-R: RRT* with edges measured under h (paper, Algorithms 1 to 3).

    samples : how many are drawn.
    step : longest edge, map units; by default a twelfth of the region's side.
    metric : "riemannian" measures edges by Line-R; "chord" by the Euclidean distance in
        R^n; with ``informed=False`` that is the original RRT*, the paper's baseline.
    seed : of the random generator; the same seed gives the same tree, to the last bit.
    radius_factor : the search radius, as a multiple of the least one that optimality needs.
    goal_bias : share of samples that are the goal, until it is reached.
    informed : begin with the straight line to the goal, or where that is blocked or dear with a
        path over a coarse lattice. Then leave out samples that cannot improve the best path, by
        their chords (Gammell et al. 2014), and draw 0.3 of them near it (Akgun and Stilman 2011);
        where the tree is crowded, of these only the ones that shorten it are kept. Hang vertices
        below their parents' parents where that is shorter (Jeong et al. 2019). With ``False`` all
        of the region is sampled, as in the paper.
    prune : do not measure edges whose chord is already too long; the tree stays the same.
    panel : longest piece of an edge that one application of Line-R measures, map units; by
        default as long as the surface's features allow, and where that is not right to 1e-3
        edges of informed trees are measured adaptively; ``math.inf`` is exactly Algorithm 1.
    time_limit : seconds. target_length : stop when the cost is this low, map units.

    Source: the paper. What it leaves open is described in ``_kernels/planners/rrt_star.py``.
    """

    samples: int = 10_000
    step: float | None = None
    metric: Literal["riemannian", "chord"] = "riemannian"
    seed: int = 0
    radius_factor: float = 1.5
    goal_bias: float = 0.05
    informed: bool = True
    prune: bool = True
    panel: float | None = None
    time_limit: float | None = None
    target_length: float | None = None

    def __post_init__(self) -> None:
        require_count(samples=self.samples)
        require_positive(radius_factor=self.radius_factor)
        require_fraction(goal_bias=self.goal_bias)
        require_seed(self.seed)
        require_bool(informed=self.informed, prune=self.prune)
        require_choice(("riemannian", "chord"), metric=self.metric)
        optional = {
            "step": self.step,
            "time_limit": self.time_limit,
            "target_length": self.target_length,
        }
        require_positive(**{name: value for name, value in optional.items() if value is not None})
        if self.panel is not None and self.panel != float("inf"):
            require_positive(panel=self.panel)

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return "rrt-star-r" if self.metric == "riemannian" else "rrt-star"

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """Plan. ``callback`` sees the progress and stops the planner by returning True.

        time_limit : seconds for this call; the lower of it and the option counts.
        Ctrl-C, too, ends the search with the best path so far.
        """
        return search_tree(problem, self._tree_options(time_limit), callback)

    def _tree_options(self, time_limit: float | None = None) -> TreeOptions:
        return TreeOptions(
            planner=self.name,
            samples=int(self.samples),
            step=self.step,
            radius_factor=self.radius_factor,
            goal_bias=self.goal_bias,
            seed=int(self.seed),
            riemannian=self.metric == "riemannian",
            prune=self.prune,
            informed=self.informed,
            panel=self.panel,
            time_limit=least_limit(self.time_limit, time_limit),
            target_length=self.target_length or 0.0,
        )
