"""The tree of RRT*-R: against plain Python, pruned against unpruned, and its invariants."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from scipy import spatial

import planner_oracles as oracles
import terrapath as tp
from terrapath._kernels.planners import rrt_star as kernels, sampling, tree as trees
from terrapath.planners import first_path, rrt_star
from terrapath.problem import scenes

LAYERS = {
    "six-peaks": [scenes.FOUR_PEAKS, scenes.TWO_RESISTANCE_PEAKS],
    "three-peaks": [scenes.THREE_PEAKS],
    "one-peak": [scenes.ONE_PEAK],
}
BOX = shapely.box(4.2, 4.3, 5.9, 6.1)
COURTYARD = shapely.box(0.5, 6.0, 4.0, 9.5) - shapely.box(1.5, 7.0, 3.0, 8.5)
POLYGONS = [BOX, shapely.Polygon([(8, 1), (9.5, 2), (8.5, 4.5), (7.9, 3)])]
OBSTACLES = [*POLYGONS, COURTYARD, tp.Circle(1.5, 3.5, 0.7)]


def scene(name, obstacles=()):
    surface = tp.Surface.from_peaks(LAYERS[name])
    return tp.Problem(surface, scenes.START, scenes.GOAL, scenes.REGION, obstacles)


def edges_of(tree):
    """Children, and their edges' lengths as the tree's costs tell them."""
    children = np.flatnonzero(tree.parents >= 0)
    return children, tree.costs[children] - tree.costs[tree.parents[children]]


# Against plain Python


def assert_same_tree(name, polygons, samples, seed, *, step=1.0, radius_factor=1.5):
    problem = scene(name, polygons)
    solution = tp.RRTStar(
        samples=samples, step=step, radius_factor=radius_factor, seed=seed, informed=False
    ).solve(problem)
    plain = oracles.PlainTree(
        LAYERS[name],
        scenes.START,
        scenes.GOAL,
        scenes.REGION,
        step,
        radius_factor,
        goal_bias=0.05,
        panel=rrt_star.FEATURES_PER_PANEL * problem.surface.resolution,
        blocked=lambda a, b: shapely.intersects(shapely.LineString([a, b]), polygons).any(),
    )
    for draw in np.random.Generator(np.random.PCG64(seed)).random((samples, 3)):
        plain.sample(draw)
    vertices = range(len(plain.points))
    np.testing.assert_allclose(solution.tree.points, plain.points, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(solution.tree.parents, plain.parents)
    costs = [plain.cost(v) for v in vertices]
    np.testing.assert_allclose(solution.tree.costs, costs, rtol=1e-12, atol=1e-12)
    if plain.goal_vertex is None:
        assert solution.path is None
    else:
        assert solution.cost == pytest.approx(costs[plain.goal_vertex], rel=1e-12)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("polygons", [[], POLYGONS], ids=["open", "polygons"])
def test_the_kernel_grows_the_tree_that_plain_python_grows(polygons, seed):
    assert_same_tree("six-peaks", polygons, 300, seed)


@pytest.mark.parametrize("step", [0.4, 4.0])
def test_the_kernel_grows_the_plain_tree_whatever_the_step(step):
    assert_same_tree("three-peaks", POLYGONS, 250, 11, step=step)


def test_the_kernel_grows_the_plain_tree_where_the_near_radius_shrinks():
    assert_same_tree("one-peak", [], 400, 3, step=6.0, radius_factor=0.5)


# Pruned and unpruned


@pytest.mark.parametrize("metric", ["riemannian", "chord"])
@pytest.mark.parametrize("informed", [True, False], ids=["informed", "uniform"])
@pytest.mark.parametrize("obstacles", [[], OBSTACLES], ids=["open", "obstacles"])
@pytest.mark.parametrize("name", LAYERS)
def test_pruning_changes_no_bit_of_the_tree(name, obstacles, informed, metric):
    problem = scene(name, obstacles)
    for seed in range(3):
        options = {"samples": 1500, "seed": seed, "informed": informed, "metric": metric}
        pruned = tp.RRTStar(**options).solve(problem)
        whole = tp.RRTStar(**options, prune=False).solve(problem)
        assert pruned.path is not None
        assert pruned.cost == whole.cost
        np.testing.assert_array_equal(pruned.tree.points, whole.tree.points)
        np.testing.assert_array_equal(pruned.tree.parents, whole.tree.parents)
        np.testing.assert_array_equal(pruned.tree.costs, whole.tree.costs)
        assert pruned.counters["edges rewired"] == whole.counters["edges rewired"]
        assert pruned.counters["edges considered"] == whole.counters["edges considered"]
        assert whole.counters["edges pruned"] == 0
        assert pruned.counters["edges pruned"] > 0
        if metric == "riemannian":
            assert pruned.counters["edges integrated"] < 0.5 * whole.counters["edges integrated"]


def test_pruning_changes_no_bit_on_a_spline_surface():
    x = np.linspace(-1.0, 11.0, 25)
    values = np.random.default_rng(8).normal(scale=0.6, size=(2, 25, 25))
    problem = tp.Problem(tp.Surface.from_grid(values, x, x), (0, 0), (10, 10), obstacles=OBSTACLES)
    pruned, whole = (
        tp.RRTStar(samples=3000, prune=p, seed=5).solve(problem) for p in (True, False)
    )
    np.testing.assert_array_equal(pruned.tree.points, whole.tree.points)
    np.testing.assert_array_equal(pruned.tree.parents, whole.tree.parents)
    np.testing.assert_array_equal(pruned.tree.costs, whole.tree.costs)
    assert 0 < pruned.counters["edges integrated"] < whole.counters["edges integrated"]


# Informed


def grown(problem, planner, draws):
    """A tree with some samples, and the kernels' settings."""
    tree = rrt_star._allocate(planner.samples, problem.surface)
    settings = rrt_star._kernel_options(problem, planner._tree_options())
    rrt_star._prepare(problem, tree, settings)
    kernels.grow(problem.surface.data, problem.free_space.data, tree, settings, draws)
    return tree, settings


def best_path(tree):
    """Points (m, 2) from the start to the goal, and what each has cost."""
    way = [int(tree.counters[trees.GOAL])]
    while tree.links[way[-1]]["parent"] >= 0:
        way.append(int(tree.links[way[-1]]["parent"]))
    rows = tree.places[way[::-1]]
    return rows[:, :2], rows[:, trees.COST]


def test_a_share_of_informed_samples_lies_around_the_best_path():
    problem, planner = scene("six-peaks", OBSTACLES), tp.RRTStar(samples=2000)
    random = np.random.default_rng(6)
    tree, settings = grown(problem, planner, random.random((800, 3)))
    points, costs = best_path(tree)
    radius, line = kernels.near_radius(tree, settings), shapely.LineString(points)
    distances, worth = [], []
    for draw in random.random((4000, 3)):
        draw[0] *= sampling.PATH_SHARE
        x, y, worthwhile = kernels.sample(problem.surface.data, tree, settings, draw)
        run, offset = draw[1] * costs[-1], 2.0 * draw[2] - 1.0
        centre = np.array([np.interp(run, costs, points[:, k]) for k in (0, 1)])
        first = np.searchsorted(costs, run, side="right") - 1
        along = points[first + 1] - points[first]
        away = np.array([x, y]) - centre
        assert math.hypot(*away) == pytest.approx(radius * abs(offset) ** 5, abs=1e-9)
        assert along @ away == pytest.approx(0.0, abs=1e-9)
        assert offset * (along[0] * away[1] - along[1] * away[0]) >= -1e-15  # rounding
        assert line.distance(shapely.Point(x, y)) <= math.hypot(*away) + 1e-9
        distances.append(math.hypot(*away) / radius)
        worth.append(worthwhile)
    assert np.quantile(distances, 0.5) == pytest.approx(1.0 / 32.0, abs=0.01)
    assert np.mean(worth) > 0.9  # the chord rules none of them out that is on the path


def test_the_other_informed_samples_are_spread_over_the_ellipse():
    problem, planner = scene("one-peak"), tp.RRTStar(samples=2000)
    random = np.random.default_rng(7)
    tree, settings = grown(problem, planner, random.random((800, 3)))
    _, costs = best_path(tree)
    draws = random.random((4000, 3))
    draws[:, 0] = sampling.PATH_SHARE + (1.0 - sampling.PATH_SHARE) * draws[:, 0]
    points = np.array([kernels.sample(problem.surface.data, tree, settings, d)[:2] for d in draws])
    sums = sum(np.hypot(*(points - end).T) for end in (problem.start, problem.goal))
    assert sums.max() <= costs[-1] + 1e-9
    # The ellipse with its sum of distances s has the share s sqrt(s^2 - f^2) of the area.
    focal = math.dist(problem.start, problem.goal)
    half = 0.5 * (focal + costs[-1])
    expected = half * math.sqrt(half**2 - focal**2)
    expected /= costs[-1] * math.sqrt(costs[-1] ** 2 - focal**2)
    assert np.mean(sums <= half) == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("step", [0.7, 1.0, 30.0])
def test_an_informed_tree_begins_with_the_straight_line_where_that_is_cheap(step):
    flat = tp.Surface.from_peaks([[]])
    problem = tp.Problem(flat, scenes.START, scenes.GOAL, scenes.REGION)
    solution = tp.RRTStar(samples=1, step=step).solve(problem)
    assert solution.length == pytest.approx(problem.straight_length, rel=1e-12)
    steps = math.ceil(math.dist(problem.start, problem.goal) / step)
    np.testing.assert_array_equal(solution.tree.parents[: steps + 1], np.arange(-1, steps))


@pytest.mark.parametrize("obstacles", [[], [shapely.box(4.0, 4.0, 6.0, 6.0)]])
def test_an_informed_tree_begins_with_a_lattice_path_where_the_straight_line_is_no_good(obstacles):
    problem = scene("six-peaks", obstacles)
    branch = first_path.path_over_lattices(
        problem, tp.RRTStar()._tree_options(), None, None, False
    ).path
    lattice = tp.AStar(spacing=first_path.coarse_spacing(problem), neighbours=32).solve(problem)
    np.testing.assert_array_equal(branch.points, lattice.path.points)
    solution = tp.RRTStar(samples=1).solve(problem)
    assert solution.length <= branch.length < problem.straight_length
    # The branch is a chain along that path.
    chain = solution.tree.points[:-1]
    np.testing.assert_array_equal(chain[-1], problem.goal)
    assert np.hypot(*np.diff(chain, axis=0).T).max() <= 1.0 + 1e-12
    assert shapely.distance(branch.line, shapely.points(chain)).max() <= 1e-12


def test_a_crowd_beside_the_path_is_limited_and_uniform_samples_never_are(monkeypatch):
    problem, planner = scene("one-peak"), tp.RRTStar(samples=40_000, step=30.0)
    draws = np.random.default_rng(1).random((40_000, 3))
    beside, spread = draws.copy(), draws.copy()
    beside[:, 0] *= sampling.PATH_SHARE
    spread[:, 0] = sampling.PATH_SHARE + (1.0 - sampling.PATH_SHARE) * draws[:, 0]
    tree, settings = grown(problem, planner, draws[:200])
    grow = (problem.surface.data, problem.free_space.data, tree, settings)
    kernels.grow(*grow, beside)
    crowd = int(tree.counters[trees.VERTICES])
    assert crowd < 20_000  # most of them are left out
    points = tree.places[:crowd, :2]
    radius = sampling.near_radius(tree, settings)
    disc = spatial.cKDTree(points).query_ball_point(points, 0.5 * radius, return_length=True)
    # Of those within half the radius of any vertex, the last to come saw all the others.
    assert disc.max() <= kernels.CROWD * math.log(crowd) + 1
    worth = sum(kernels.sample(*grow[:1], tree, settings, draw)[2] for draw in spread[:500])
    kernels.grow(*grow, spread[:500])
    assert int(tree.counters[trees.VERTICES]) - crowd >= 0.95 * worth


CHAIN = [(2.0, 1.0), (2.0, 2.0), (3.0, 2.0), (3.0, 3.0)]


@pytest.mark.parametrize(
    ("informed", "obstacles", "parents"),
    [
        (False, [], [-1, 0, 1, 2, 3]),
        (True, [], [-1, 0, 0, 0, 3]),  # the last is more than a step away from the start
        (True, [shapely.box(1.4, 1.4, 1.6, 1.6)], [-1, 0, 1, 0, 3]),
    ],
)
def test_an_informed_tree_skips_parents_where_that_is_shorter(informed, obstacles, parents):
    flat = tp.Surface.from_peaks([[]])
    problem = tp.Problem(flat, (1, 1), (9, 8), bounds=(0, 0, 10, 10), obstacles=obstacles)
    # So small a radius that the nearest vertex is the only candidate.
    planner = tp.RRTStar(samples=10, step=2.5, radius_factor=0.05, informed=informed)
    tree, settings = grown(problem, planner, np.empty((0, 3)))
    for x, y in CHAIN:
        assert kernels.extend(flat.data, problem.free_space.data, tree, settings, x, y, False)
    found = rrt_star._search_tree(tree)
    np.testing.assert_array_equal(found.points[1:], CHAIN)
    np.testing.assert_array_equal(found.parents, parents)
    ways = found.points - found.points[found.parents]
    edges = np.where(found.parents >= 0, np.hypot(*ways.T), 0.0)
    np.testing.assert_allclose(found.costs, edges + found.costs[found.parents] * (edges > 0.0))


# Counters


def test_without_pruning_every_candidate_is_measured_exactly_once():
    # Each new vertex with m candidates considers m edges to itself and m - 1 back, and
    # measures m: so considered = 2 * integrated - (vertices - 1).
    planner = tp.RRTStar(samples=800, prune=False, informed=False)
    counters = planner.solve(scene("six-peaks", OBSTACLES)).counters
    expected = 2 * counters["edges integrated"] - (counters["vertices"] - 1)
    assert counters["edges considered"] == expected


@pytest.mark.parametrize("metric", ["riemannian", "chord"])
def test_every_edge_considered_is_pruned_or_measured(metric):
    solution = tp.RRTStar(samples=2000, metric=metric).solve(scene("six-peaks", OBSTACLES))
    counters = solution.counters
    kept = counters["edges considered"] - counters["edges pruned"]
    assert counters["vertices"] == len(solution.tree.points)
    # One measurement serves both directions of an edge.
    measured = counters["edges integrated"]
    assert kept >= counters["vertices"] - 1 + counters["edges rewired"]
    if metric == "riemannian":
        assert measured <= kept <= 2 * measured
    else:
        assert measured == 0
    assert counters["edges tested for obstacles"] >= counters["vertices"] - 1


# Invariants


@pytest.mark.parametrize("metric", ["riemannian", "chord"])
@pytest.mark.parametrize("panel", [None, 0.3, math.inf])
def test_costs_add_up_line_r_along_the_tree_and_never_less_than_the_chord(panel, metric):
    problem = scene("six-peaks", OBSTACLES)
    tree = tp.RRTStar(samples=700, panel=panel, metric=metric, step=2.0).solve(problem).tree
    pieces = panel or rrt_star.FEATURES_PER_PANEL * problem.surface.resolution
    children, edges = edges_of(tree)
    layers = LAYERS["six-peaks"]
    for child, edge in zip(children, edges, strict=True):
        a, b = tuple(tree.points[tree.parents[child]]), tuple(tree.points[child])
        expected = oracles.chord(layers, a, b)
        if metric == "riemannian":
            expected = max(expected, oracles.line_r(layers, a, b, pieces))
        assert edge == pytest.approx(expected, rel=1e-11, abs=1e-13)


def test_no_edge_is_longer_than_the_step_and_no_vertex_is_twice_in_the_tree():
    for step in (0.3, 1.0, 5.0):
        tree = tp.RRTStar(samples=1500, step=step).solve(scene("six-peaks", OBSTACLES)).tree
        segments = tree.segments
        assert np.hypot(*(segments[:, 1] - segments[:, 0]).T).max() <= step * (1 + 1e-12)
        assert len(np.unique(tree.points, axis=0)) == len(tree.points)


@pytest.mark.parametrize("metric", ["riemannian", "chord"])
def test_no_vertex_ever_gets_costlier(metric):
    # Uniform sampling without goal bias places the same vertices however many follow.
    problem = scene("six-peaks", OBSTACLES)
    options = {"informed": False, "goal_bias": 0.0, "metric": metric, "seed": 4}
    before = tp.RRTStar(samples=400, **options).solve(problem).tree
    for samples in (500, 800, 3000):
        after = tp.RRTStar(samples=samples, **options).solve(problem).tree
        size = len(before.costs)
        np.testing.assert_array_equal(after.points[:size], before.points)
        assert (after.costs[:size] <= before.costs * (1 + 1e-14)).all()
        assert (after.costs[:size] < before.costs).any()
        before = after


def test_no_near_vertex_offers_a_better_parent_to_the_newest_one():
    # RRT*: a vertex is hung where it is cheapest to reach, among those within the radius.
    problem = scene("three-peaks")
    for samples in (150, 300, 450):
        options = {"informed": False, "goal_bias": 0.0, "prune": True, "step": 2.0}
        tree = tp.RRTStar(samples=samples, panel=math.inf, **options).solve(problem).tree
        newest = len(tree.points) - 1
        count = newest
        least = 2.0 * math.sqrt(1.5 * 144.0 / math.pi)
        radius = min(2.0, 1.5 * least * math.sqrt(math.log(count) / count))
        distances = np.hypot(*(tree.points[:-1] - tree.points[-1]).T)
        near = np.flatnonzero(distances <= radius)
        a, b = tree.points[near], tree.points[-1]
        lengths = np.maximum(tp.line_r(problem.surface, a, b), tp.chord(problem.surface, a, b))
        assert len(near) > 5
        assert tree.costs[newest] == pytest.approx((tree.costs[near] + lengths).min(), rel=1e-12)


def test_informed_sampling_adds_no_vertex_that_the_chord_rules_out():
    problem = scene("six-peaks")
    solution = tp.RRTStar(samples=6000, seed=2).solve(problem)
    first = solution.history.best_cost[0]
    early = tp.RRTStar(samples=rrt_star.CHUNK, seed=2).solve(problem)
    assert math.isfinite(first)
    later = solution.tree.points[len(early.tree.points) :]
    layers = LAYERS["six-peaks"]
    assert len(later) > 1000
    for x, y in later[:: len(later) // 500]:
        through = oracles.chord(layers, scenes.START, (x, y)) + oracles.chord(
            layers, (x, y), scenes.GOAL
        )
        # Steering may move a sample by a step towards the tree before it becomes a vertex.
        assert through < first + 2.0 * steepest_way(layers)


def steepest_way(layers):
    """A bound of the length on the surface of a step of 1: sum of the peaks' steepest slopes."""
    slopes = [sum(a * math.sqrt(2 * f / math.e) for a, f, _, _ in layer) for layer in layers]
    return math.hypot(1.0, *slopes)


def test_informed_sampling_finds_shorter_paths_than_uniform_sampling():
    problem = scene("one-peak")
    lengths = {
        informed: np.mean(
            [
                tp.RRTStar(samples=3000, seed=s, informed=informed).solve(problem).length
                for s in range(6)
            ]
        )
        for informed in (True, False)
    }
    assert lengths[True] < lengths[False]
