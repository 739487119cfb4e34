"""The default planner always answers: mazes, rooms and rough ground, judged by other libraries."""

import json
from itertools import pairwise

import numpy as np
import pytest
import shapely
from scipy import sparse

import terrapath as tp
from common import REAL_MAPS
from mazes import maze
from oracles import boxes_of_mask
from terrapath._kernels.surface.lengths import chord_through
from terrapath.planners import rrt_star
from terrapath.surface.metric import is_rough, segment_lengths

RANDOM_MAP = REAL_MAPS / "random-100-33.map"


def mask_of(blocked):
    axis = np.arange(float(len(blocked)))
    return tp.Mask(blocked, axis, axis)


def squares(blocked):
    """The union of the closed cells of a grid, each a square around its integer centre."""
    return shapely.union_all(boxes_of_mask(mask_of(blocked)))


def walled_maze(size, rng):
    """Blocked cells (size, size), size odd, with a wall around."""
    return np.pad(maze(rng, size - 2, size - 2), 1, constant_values=True)


def rooms(size, rng):
    """Blocked cells: walls every eight cells, each with one door of one cell for each room."""
    blocked = np.zeros((size, size), bool)
    blocked[::8], blocked[:, ::8] = True, True
    for wall in range(8, size - 1, 8):
        for room in range(0, size - 1, 8):
            blocked[wall, room + rng.integers(1, 8)] = False
            blocked[room + rng.integers(1, 8), wall] = False
    return blocked


def are_joined(blocked, start, goal):
    """Does scipy's Dijkstra find a path from cell to side-by-side cell? Cells are (x, y)."""
    size = len(blocked)
    free = np.flatnonzero(~blocked.ravel())
    pairs = [(k, k + step) for k in free for step in (1, size)]
    pairs = [p for p in pairs if p[1] < size * size and not blocked.ravel()[p[1]]]
    rows, columns = np.array(pairs).T
    graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(size * size,) * 2)
    ends = start[1] * size + start[0], goal[1] * size + goal[0]
    far = sparse.csgraph.dijkstra(graph.tocsr(), directed=False, indices=ends[0])
    return np.isfinite(far[ends[1]])


def solve(blocked, start, goal, *, as_mask):
    axis = np.arange(float(len(blocked)))
    surface = tp.Surface.from_grid(np.zeros(blocked.shape), axis, axis)
    obstacle = mask_of(blocked) if as_mask else squares(blocked)
    return tp.RRTStar(samples=2000).solve(tp.Problem(surface, start, goal, obstacles=[obstacle]))


@pytest.mark.parametrize("as_mask", [True, False], ids=["mask", "polygons"])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", [walled_maze, rooms])
def test_mazes_and_rooms_are_solved_and_no_wall_is_touched(kind, seed, as_mask):
    size = 33
    blocked = kind(size, np.random.default_rng(seed))
    start, goal = (1, 1), (size - 2, size - 2)
    assert are_joined(blocked, start, goal)
    solution = solve(blocked, start, goal, as_mask=as_mask)
    assert solution.status is tp.Status.SOLVED
    assert solution.path.line.disjoint(squares(blocked))


@pytest.mark.skipif(not RANDOM_MAP.exists(), reason="the map is not there")
@pytest.mark.parametrize("as_mask", [True, False], ids=["mask", "polygons"])
def test_an_occupancy_grid_is_solved_within_three_percent_of_its_exact_optima(as_mask):
    lines = RANDOM_MAP.read_text().split("\n")[4:104]
    blocked = np.array([[cell != "." for cell in line] for line in lines])
    walls = squares(blocked)
    axis = np.arange(100.0)
    surface = tp.Surface.from_grid(np.zeros((100, 100)), axis, axis)
    obstacle = mask_of(blocked) if as_mask else walls
    for case in json.loads(RANDOM_MAP.with_suffix(".exact.json").read_text()):
        problem = tp.Problem(surface, case["s"], case["t"], obstacles=[obstacle])
        solution = tp.plan(problem)
        assert solution.path.line.disjoint(walls)
        assert case["exact"] * (1.0 - 1e-9) <= solution.length <= 1.03 * case["exact"]


# Rough ground


def rough_surface(seed, weight, size=40):
    """Fractal ground with pits, exaggerated."""
    rng = np.random.default_rng(seed)
    waves = np.hypot(*np.meshgrid(*2 * [np.fft.fftfreq(size)]))
    waves[0, 0] = 1.0
    heights = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) / waves**1.5).real
    heights = 3.0 * heights / heights.std()
    heights[rng.random((size, size)) < 0.02] -= 10.0
    axis = np.arange(float(size))
    return tp.Surface.from_grid(heights, axis, axis, weights=[weight])


def lifted_length(surface, a, b, pieces=4096):
    """The length of a lifted segment, by the surface's values alone: a polyline in R^n."""
    points = a + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (np.subtract(b, a))
    heights = surface.values(points) * [layer.weight for layer in surface.layers]
    lifted = np.hstack([points, heights])
    return np.linalg.norm(np.diff(lifted, axis=0), axis=1).sum()


def errors_of_edges(solution):
    """What a tree believes of its edges, over their true lengths, less 1."""
    tree = solution.tree
    children = np.flatnonzero(tree.parents >= 0)
    believed = tree.costs[children] - tree.costs[tree.parents[children]]
    a, b = tree.points[tree.parents[children]], tree.points[children]
    return np.abs(believed / segment_lengths(solution.problem.surface, a, b) - 1.0)


def test_what_a_tree_believes_of_its_edges_is_right_on_a_real_map():
    # On the map at its true scale 24 % of the edges were off by more than this.
    solution = tp.RRTStar(samples=3000).solve(tp.scenes.load("jacksboro"))
    assert errors_of_edges(solution).max() <= 1e-3


@pytest.mark.parametrize("weight", [1.0, 10.0, 100.0])
def test_what_a_tree_believes_of_its_edges_is_right_on_rough_ground(weight):
    surface = rough_surface(1, weight)
    solution = tp.RRTStar(samples=1500).solve(tp.Problem(surface, (1, 2), (37, 35)))
    errors = errors_of_edges(solution)
    assert np.quantile(errors, 0.99) <= 1e-3
    assert errors.max() <= 1e-2
    assert solution.cost == pytest.approx(solution.length, rel=1e-3)
    points = solution.path.points
    pairs = pairwise(points)
    assert solution.cost == pytest.approx(
        sum(lifted_length(surface, *pair) for pair in pairs), rel=1e-3
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("weight", [1.0, 30.0])
def test_no_path_is_longer_than_the_straight_line_or_the_lattice_path(seed, weight):
    problem = tp.Problem(rough_surface(seed, weight), (1.3, 2.2), (37.6, 35.1))
    for samples in (1, 300, 3000):
        solution = tp.RRTStar(samples=samples, seed=seed).solve(problem)
        lattice = tp.AStar(spacing=0.78, neighbours=32).solve(problem)
        assert solution.length <= min(problem.straight_length, 1.001 * lattice.length)


def test_pruning_changes_no_bit_on_rough_ground():
    problem = tp.Problem(rough_surface(3, 20.0), (1.3, 2.2), (37.6, 35.1))
    assert is_rough(problem.surface, problem.bounds)
    pruned, whole = (tp.RRTStar(samples=600, prune=p).solve(problem) for p in (True, False))
    np.testing.assert_array_equal(pruned.tree.points, whole.tree.points)
    np.testing.assert_array_equal(pruned.tree.parents, whole.tree.parents)
    np.testing.assert_array_equal(pruned.tree.costs, whole.tree.costs)
    assert pruned.counters["edges integrated"] < 0.5 * whole.counters["edges integrated"]


@pytest.mark.parametrize("weight", [1.0, 100.0])
def test_a_sum_of_short_chords_is_a_lower_bound_above_the_chord(weight):
    surface, rng = rough_surface(2, weight), np.random.default_rng(0)
    a, b = rng.uniform(0.0, 39.0, (2, 200, 2))
    through = np.array(
        [chord_through(surface.data, *p, *q, 0.5) for p, q in zip(a, b, strict=True)]
    )
    assert (through <= segment_lengths(surface, a, b) * (1.0 + 1e-12)).all()
    assert (through >= tp.chord(surface, a, b) * (1.0 - 1e-12)).all()


@pytest.mark.parametrize("name", sorted(set(tp.scenes.names()) - {"jacksboro"}))
def test_the_scenes_are_not_rough_so_line_r_measures_their_edges(name):
    problem = tp.scenes.load(name)
    assert not is_rough(problem.surface, problem.bounds)
    options = tp.RRTStar()._tree_options()
    assert rrt_star._kernel_options(problem, options).tolerance == 0.0


def test_uniform_samples_and_panels_of_the_caller_mean_line_r_on_rough_ground_too():
    problem = tp.Problem(rough_surface(3, 20.0), (1.3, 2.2), (37.6, 35.1))
    for options in ({"informed": False}, {"panel": 2.0}):
        settings = rrt_star._kernel_options(problem, tp.RRTStar(**options)._tree_options())
        assert settings.tolerance == 0.0
    assert rrt_star._kernel_options(problem, tp.RRTStar()._tree_options()).tolerance > 0.0
