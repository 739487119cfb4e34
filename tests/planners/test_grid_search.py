"""Dijkstra and A* against a plain shortest-path search over the same graph, and the truth."""

from __future__ import annotations

import dataclasses
import itertools
import math
import signal
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
import shapely

import occupancy
import planner_oracles as oracles
import terrapath as tp
from common import mostly_slow
from terrapath._kernels.planners import grid_search as kernels
from terrapath.planners import base, grid_search, make_planner
from terrapath.planners.rrt_star import FEATURES_PER_PANEL
from terrapath.problem import scenes
from terrapath.space.lattice import Cells, Lattice
from terrapath.surface.bounds import Bounds

NAMES = ("dijkstra", "a-star")
EVERY = pytest.mark.parametrize("name", NAMES)
NEIGHBOURS = pytest.mark.parametrize("neighbours", [8, 16, 32])
FLAT = tp.Surface.from_peaks([[]])
# Moves of chess pieces and beyond, written out: one eighth of the compass.
MOVES = {
    8: [(1, 0), (1, 1)],
    16: [(1, 0), (1, 1), (2, 1)],
    32: [(1, 0), (1, 1), (2, 1), (3, 1), (3, 2)],
}
REACH = {8: 1, 16: 2, 32: 3}


def offsets(neighbours):
    """All moves: the eighth, mirrored."""
    return {
        (sx * x, sy * y)
        for i, j in MOVES[neighbours]
        for x, y in ((i, j), (j, i))
        for sx, sy in itertools.product((1, -1), repeat=2)
    }


# The same graph, searched by networkx


def around(lattice, point, reach):
    """Indices of the nodes at most so many cells away."""
    s, t = ((point[k] - lattice.bounds[k]) / (lattice.dx, lattice.dy)[k] for k in (0, 1))
    return [
        (i, j)
        for i in range(lattice.nx)
        for j in range(lattice.ny)
        if abs(i - s) <= reach + 1e-9 and abs(j - t) <= reach + 1e-9
    ]


def plain_graph(layers, problem, spacing, neighbours, polygons):
    """Nodes (i, j), "start" and "goal"; edges as long as the oracle's Line-R or the chord."""
    lattice = Lattice.spanning(problem.bounds, spacing)
    panel = FEATURES_PER_PANEL * problem.surface.resolution
    ground = shapely.union_all(polygons)
    shapely.prepare(ground)
    place = {
        (i, j): (float(lattice.x[i]), float(lattice.y[j]))
        for i in range(lattice.nx)
        for j in range(lattice.ny)
    }
    place |= {"start": problem.start, "goal": problem.goal}
    graph = nx.Graph()
    graph.add_nodes_from(place)

    def join(one, other):
        a, b = place[one], place[other]
        if shapely.disjoint(ground, shapely.LineString([a, b])):
            length = max(oracles.line_r(layers, a, b, panel), oracles.chord(layers, a, b))
            graph.add_edge(one, other, weight=length)

    for (i, j), (di, dj) in itertools.product(list(place)[:-2], offsets(neighbours)):
        if (i + di, j + dj) in place and (di, dj) > (0, 0):
            join((i, j), (i + di, j + dj))
    reach = REACH[neighbours]
    for end in ("start", "goal"):
        for node in around(lattice, place[end], reach):
            join(end, node)
    apart = np.abs(np.subtract(problem.start, problem.goal)) / (lattice.dx, lattice.dy)
    if apart.max() <= reach:
        join("start", "goal")
    return graph, place


def random_case(seed):
    """Layers, polygons and ends in [0, 10] x [0, 7]."""
    random = np.random.default_rng([7, seed])
    layers = [
        [
            (random.uniform(-3, 5), random.uniform(0.1, 0.8), *random.uniform(0, 10, 2))
            for _ in range(random.integers(1, 4))
        ]
        for _ in range(random.integers(1, 3))
    ]
    polygons = []
    for _ in range(random.integers(0, 6)):
        corners = random.uniform(0, 10, 2) + random.uniform(-2, 2, (4, 2))
        polygons.append(shapely.MultiPoint(corners).convex_hull)
    ground = shapely.union_all(polygons)
    while True:
        start, goal = (tuple(map(float, p)) for p in random.uniform(0, (10, 7), (2, 2)))
        if shapely.disjoint(ground, shapely.MultiPoint([start, goal])):
            return layers, polygons, start, goal


@NEIGHBOURS
@pytest.mark.parametrize("seed", range(12))
def test_the_cost_is_that_of_the_shortest_way_through_the_graph(seed, neighbours):
    layers, polygons, start, goal = random_case(seed)
    surface = tp.Surface.from_peaks(layers)
    problem = tp.Problem(surface, start, goal, (0, 0, 10, 7), polygons)
    graph, place = plain_graph(layers, problem, 0.83, neighbours, polygons)
    for name in NAMES:
        solution = tp.plan(problem, name, spacing=0.83, neighbours=neighbours)
        if not nx.has_path(graph, "start", "goal"):
            assert solution.path is None
            continue
        expected = nx.dijkstra_path_length(graph, "start", "goal")
        assert solution.status is tp.Status.SOLVED
        assert solution.cost == pytest.approx(expected, rel=1e-12)
        # Straight runs are one segment of the path, but no vertex is anywhere else.
        points = [tuple(p) for p in solution.path.points.tolist()]
        assert set(points) <= set(place.values())
        assert points[0] == start
        assert points[-1] == goal
        segments = shapely.linestrings(list(pairwise(points)))
        assert shapely.disjoint(shapely.union_all(polygons), segments).all()
        assert solution.length == pytest.approx(solution.cost, rel=2e-3)


def test_the_moves_are_those_of_the_board():
    for neighbours in (8, 16, 32):
        found = [tuple(move) for move in grid_search._offsets(neighbours).tolist()]
        assert len(found) == neighbours
        assert set(found) == offsets(neighbours)


def test_the_heap_gives_vertices_in_the_order_of_their_keys():
    random = np.random.default_rng(5)
    for size in (1, 2, 5, 300):
        vertices = np.zeros(size, kernels.VERTEX)
        heap = np.zeros(size + 1, kernels.ENTRY)
        keys = np.round(random.uniform(0, 50, size))
        held = 0
        for vertex in range(size):
            held += 1
            kernels.raise_to(vertices, heap, held, vertex, keys[vertex])
        for vertex in random.choice(size, size // 2, replace=False).tolist():
            keys[vertex] -= random.uniform(0.0, 20.0)
            kernels.raise_to(vertices, heap, int(vertices["slot"][vertex]), vertex, keys[vertex])
        expected = sorted(keys)
        for key in expected:
            first = kernels.take_first(vertices, heap, held)
            held -= 1
            assert keys[first] == key
            assert vertices["slot"][first] == kernels.DONE
            slots = vertices["slot"][vertices["slot"] > 0]
            assert sorted(slots) == list(range(1, held + 1))


# A* and Dijkstra


@NEIGHBOURS
@pytest.mark.parametrize("name", [n for n in scenes.names() if n != "jacksboro"])
def test_a_star_finds_what_dijkstra_finds_and_settles_fewer_vertices(name, neighbours):
    problem = scenes.load(name)
    options = {"spacing": 0.2, "neighbours": neighbours}
    dijkstra, a_star = (tp.plan(problem, planner, **options) for planner in NAMES)
    assert a_star.cost == pytest.approx(dijkstra.cost, rel=1e-14)
    assert a_star.samples < 0.9 * dijkstra.samples
    assert a_star.counters["edges integrated"] < dijkstra.counters["edges integrated"]
    assert dijkstra.cost >= tp.chord(problem.surface, problem.start, problem.goal)
    # The edges of Line-R stray from the true length by their error alone.
    assert dijkstra.length == pytest.approx(dijkstra.cost, rel=1e-3)
    assert dijkstra.length >= scenes.SCENES[name].true_length


@pytest.mark.parametrize("spacing", [0.13, 0.4, 1.1])
def test_more_neighbours_never_make_the_way_longer(spacing):
    for name in ("one-peak", "six-peaks"):
        problem = scenes.load(name)
        costs = [
            tp.Dijkstra(spacing=spacing, neighbours=n).solve(problem).cost for n in (8, 16, 32)
        ]
        assert costs[0] > costs[1] > costs[2]


# How near the truth


def elongation(neighbours):
    """Exactly: half of the widest angle between two neighbouring moves, 1 / cos of it."""
    angles = sorted(math.atan2(y, x) for x, y in MOVES[neighbours])
    return 1.0 / math.cos(max(b - a for a, b in pairwise(angles)) / 2.0)


def shortest_by_moves(neighbours, along, norm):
    """Length of the shortest sum of moves that makes ``along`` columns and rows.

    That sum has two different moves at most, as any basis of a linear programme with two rows.
    """
    best = math.inf
    for one, other in itertools.combinations(sorted(offsets(neighbours)), 2):
        basis = np.array([one, other], float).T
        if abs(np.linalg.det(basis)) < 0.5:
            continue
        a, b = np.linalg.solve(basis, along)
        if min(a, b) > -1e-9:
            best = min(best, a * norm(one) + b * norm(other))
    return best


def test_the_known_elongations():
    bounds = [elongation(n) for n in (8, 16, 32)]
    np.testing.assert_allclose(bounds, [1.0823922, 1.0274863, 1.0130815], atol=1e-7)


@EVERY
@NEIGHBOURS
def test_on_a_plane_the_cost_is_that_of_the_moves_to_the_last_digits(name, neighbours):
    slope = np.array([0.7, -0.4])
    plane = tp.Surface.from_grid(
        np.add.outer(slope[1] * np.arange(41.0), slope[0] * np.arange(41.0)),
        np.arange(41.0),
        np.arange(41.0),
    )
    ratios = []
    for goal in [
        (33, 11),
        (40, 0),
        (25, 25),
        (13, 29),
        (3, 38),
        (20, 8),
        (20, 7),
        (29, 12),
        (38, 9),
        (37, 6),
    ]:
        for surface, rise in ((FLAT, np.zeros(2)), (plane, slope)):
            problem = tp.Problem(surface, (0, 0), goal, (0, 0, 40, 40))
            solution = tp.plan(problem, name, spacing=1.0, neighbours=neighbours)

            def norm(move, rise=rise):
                return math.sqrt(move[0] ** 2 + move[1] ** 2 + (rise @ move) ** 2)

            expected = shortest_by_moves(neighbours, goal, norm)
            assert solution.cost == pytest.approx(expected, rel=1e-9)
            if surface is FLAT:
                ratios.append(solution.cost / math.hypot(*goal))
    assert min(ratios) >= 1.0 - 1e-12
    assert max(ratios) <= elongation(neighbours) * (1.0 + 1e-12)
    # The bound is the best: some direction comes near it.
    assert max(ratios) > 1.0 + 0.9 * (elongation(neighbours) - 1.0)


@NEIGHBOURS
def test_ends_between_the_nodes_cost_at_most_some_spacings(neighbours):
    random = np.random.default_rng(3)
    for spacing in (0.8, 0.1):
        for start, goal in random.uniform(0, 10, (15, 2, 2)):
            problem = tp.Problem(FLAT, start, goal, (0, 0, 10, 10))
            solution = tp.AStar(spacing=spacing, neighbours=neighbours).solve(problem)
            straight = math.dist(start, goal)
            assert straight * (1.0 - 1e-12) <= solution.cost
            assert solution.cost <= elongation(neighbours) * straight + 2.0 * spacing


@NEIGHBOURS
def test_finer_grids_converge_from_above(neighbours):
    problem = scenes.load("six-peaks")
    spacings = 0.5 ** np.arange(6)
    costs = np.array(
        [tp.AStar(spacing=s, neighbours=neighbours).solve(problem).cost for s in spacings]
    )
    # Every way through a grid is one through the next finer, but for the error of Line-R.
    assert (costs[1:] < costs[:-1]).all()
    assert costs[-1] > scenes.SCENES["six-peaks"].true_length
    # On level ground the elongation is exact; on slopes it may be somewhat more.
    assert costs[-1] < scenes.SCENES["six-peaks"].true_length * (elongation(neighbours) ** 1.2)
    order = np.polyfit(np.log(spacings[:-1]), np.log(costs[:-1] - costs[-1]), 1)[0]
    assert 1.0 < order < 3.0


# Obstacles


PILLARS = [
    shapely.box(x, y, x + 0.9, y + 1.3) for x in (1.0, 3.5, 6.0, 8.5) for y in (0.5, 3.0, 6.2, 8.0)
]


@EVERY
@NEIGHBOURS
def test_around_obstacles_the_way_is_free_and_never_below_the_exact_shortest(name, neighbours):
    ends = [((0.3, 0.2), (9.7, 9.9)), ((0.0, 5.0), (10.0, 4.4)), ((2.4, 9.9), (7.3, 0.1))]
    for start, goal in ends:
        problem = tp.Problem(FLAT, start, goal, (0, 0, 10, 10), PILLARS)
        exact = oracles.visibility_length(start, goal, PILLARS, (0, 0, 10, 10))
        solution = tp.plan(problem, name, spacing=0.1, neighbours=neighbours)
        line = solution.path.line
        assert all(line.disjoint(pillar) for pillar in PILLARS)
        assert exact <= solution.cost <= exact * elongation(neighbours) + 0.8
        assert solution.length == pytest.approx(solution.cost, rel=1e-12)


@EVERY
def test_the_way_through_a_mask_is_free(name):
    random = np.random.default_rng(2)
    blocked = random.uniform(size=(40, 40)) < 0.25
    blocked[:3, :3] = blocked[-3:, -3:] = False
    centres = np.arange(40) * 0.25 + 0.125
    mask = tp.Mask(blocked, centres, centres)
    cells = shapely.union_all(
        [
            shapely.box(0.25 * i, 0.25 * j, 0.25 * (i + 1), 0.25 * (j + 1))
            for j, i in np.argwhere(blocked)
        ]
    )
    surface = tp.Surface.from_peaks([scenes.ONE_PEAK])
    problem = tp.Problem(surface, (0.1, 0.2), (9.9, 9.8), (0, 0, 10, 10), [mask])
    solution = tp.plan(problem, name, spacing=0.0625)
    assert solution.status is tp.Status.SOLVED
    assert solution.path.line.disjoint(cells)


def test_nodes_inside_an_obstacle_are_never_used():
    # A block full of nodes, between them free segments that nothing leads to.
    block = shapely.box(2, -1, 8, 9)
    problem = tp.Problem(FLAT, (1, 1), (9, 1), (0, 0, 10, 10), [block])
    for name in NAMES:
        solution = tp.plan(problem, name, spacing=0.5)
        assert solution.path.line.disjoint(block)
        assert solution.cost > 2 * 8.0


@EVERY
def test_a_wall_thinner_than_the_spacing_is_not_jumped_over(name):
    wall = shapely.LineString([(5.05, -1), (5.05, 9.02)])
    problem = tp.Problem(FLAT, (1, 1), (9, 1), (0, 0, 10, 10), [wall])
    solution = tp.plan(problem, name, spacing=0.1, neighbours=32)
    assert solution.path.line.disjoint(wall)
    assert solution.cost > 2 * 8.9


# Ends


def test_start_and_goal_that_are_nodes_are_named_once():
    problem = tp.Problem(FLAT, (0, 0), (6, 3), (0, 0, 10, 10))
    for name in NAMES:
        points = tp.plan(problem, name, spacing=1.0).path.points
        np.testing.assert_array_equal(points, [(0, 0), (6, 3)])


def test_a_straight_run_is_one_segment_only_where_that_is_proven_free(monkeypatch):
    problem = tp.Problem(FLAT, (0.4, 0.3), (9.7, 4.8), (0, 0, 10, 10))
    short = tp.AStar(spacing=0.5).solve(problem)
    assert len(short.path.points) < 8
    # In doubt, the path keeps every node.
    answers = iter([False, True])  # of the straight run, then of all nodes
    monkeypatch.setattr(tp.Problem, "allows", lambda problem, points: next(answers))
    whole = tp.AStar(spacing=0.5).solve(problem)
    assert whole.cost == short.cost
    steps = np.hypot(*np.diff(whole.path.points, axis=0).T)
    assert steps.max() <= math.hypot(1.0, 0.5) + 1e-9
    assert set(map(tuple, short.path.points)) < set(map(tuple, whole.path.points))


@EVERY
def test_neighbouring_ends_are_joined_by_one_edge(name):
    near = tp.Problem(FLAT, (3.31, 4.27), (3.64, 4.95), (0, 0, 10, 10))
    solution = tp.plan(near, name, spacing=1.0)
    np.testing.assert_array_equal(solution.path.points, [near.start, near.goal])
    assert solution.cost == pytest.approx(math.dist(near.start, near.goal), rel=1e-15)
    # Not so where a wall stands between them.
    wall = shapely.LineString([(3.0, 4.6), (4.0, 4.6)])
    apart = tp.Problem(FLAT, near.start, near.goal, (0, 0, 10, 10), [wall])
    solution = tp.plan(apart, name, spacing=1.0)
    assert solution.path.line.disjoint(wall)


@EVERY
@NEIGHBOURS
def test_a_goal_on_the_edge_or_in_a_corner_is_reached(name, neighbours):
    surface = tp.Surface.from_peaks([scenes.ONE_PEAK])
    for goal in [(10.0, 3.3), (10.0, 10.0), (0.123, 10.0), (0.0, 0.0), (7.7, 0.0)]:
        problem = tp.Problem(surface, (4.4, 5.1), goal, (0, 0, 10, 10))
        solution = tp.plan(problem, name, spacing=0.7, neighbours=neighbours)
        assert solution.status is tp.Status.SOLVED
        assert problem.bounds.contains(solution.path.points).all()
        np.testing.assert_array_equal(solution.path.points[-1], goal)


@EVERY
@pytest.mark.parametrize("height", [0.001, 0.3, 40.0])
def test_grids_may_be_thin(name, height):
    problem = tp.Problem(FLAT, (0.2, 0.0), (9.9, height), (0, 0, 10, height))
    solution = tp.plan(problem, name, spacing=1.0)
    straight = math.hypot(9.7, height)
    assert straight <= solution.cost <= 1.03 * straight + 0.5


@EVERY
def test_a_spacing_wider_than_the_region_leaves_its_four_corners(name):
    problem = tp.Problem(FLAT, (0, 0), (10, 7), (0, 0, 10, 7))
    solution = tp.plan(problem, name, spacing=1e6)
    assert solution.cost == math.hypot(10, 7)


@EVERY
def test_a_start_in_a_pocket_without_a_node_nearby_sees_one_farther_off(name):
    # A corridor narrower than the spacing, that opens some cells away.
    walls = [
        shapely.LineString([(0.3, 1.3), (2.4, 1.3)]),
        shapely.LineString([(0.3, 1.3), (0.3, 1.7), (2.4, 1.7)]),
    ]
    problem = tp.Problem(FLAT, (0.5, 1.5), (9.5, 9.5), (0, 0, 10, 10), walls)
    both_ways = tp.Problem(FLAT, problem.goal, problem.start, (0, 0, 10, 10), walls)
    for case in (problem, both_ways):
        solution = tp.plan(case, name, spacing=1.0, neighbours=8)
        assert solution.status is tp.Status.SOLVED
        assert all(solution.path.line.disjoint(wall) for wall in walls)


@EVERY
@pytest.mark.parametrize("swap", [False, True])
def test_an_end_that_sees_no_node_is_a_result_that_says_so(name, swap, monkeypatch):
    # A bent corridor: there is a way out, but no straight one.
    room = shapely.box(2.1, 2.1, 2.9, 2.9) - shapely.box(2.2, 2.2, 2.8, 2.8)
    room -= shapely.LineString([(2.75, 2.5), (2.85, 2.5), (2.85, 2.95)]).buffer(0.025)
    ends = [(2.3, 2.3), (9.0, 9.0)]
    problem = tp.Problem(FLAT, *(ends[::-1] if swap else ends), (0, 0, 10, 10), [room])
    monkeypatch.setattr(base, "HALVINGS", 0)
    solution = tp.plan(problem, name, spacing=1.0)
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.stopped_by == f"no node can be seen from the {'goal' if swap else 'start'}"
    assert solution.path is solution.cost is None
    assert tp.plan(problem, name, spacing=0.02).status is tp.Status.SOLVED


@EVERY
def test_a_way_narrower_than_the_spacing_is_not_found(name):
    wall = shapely.LineString([(5.5, -1), (5.5, 9.99)])
    problem = tp.Problem(FLAT, (1, 1), (9, 1), (0, 0, 10, 9.995), [wall])
    solution = tp.plan(problem, name, spacing=1.0, neighbours=8)
    # The row of nodes along the edge passes over the wall's end.
    assert solution.status is tp.Status.SOLVED
    shifted = tp.Problem(FLAT, (1, 1), (9, 1), (0, 0, 10, 10), [wall.buffer(0.002)])
    ringed = shapely.LineString([(5.5, 9.995), (5.5, 11)])
    narrow = tp.Problem(FLAT, (1, 1), (9, 1), (0, 0, 10, 10), [wall, ringed])
    assert tp.plan(shifted, name, spacing=1.0).status is tp.Status.SOLVED
    solution = tp.plan(narrow, name, spacing=1.0)
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.stopped_by == "no path on from the nodes reached"
    assert solution.samples > 60
    assert solution.counters["vertices"] > solution.samples


def test_where_the_start_is_the_goal_the_path_has_length_zero():
    for name in NAMES:
        solution = tp.plan(tp.Problem(FLAT, (2, 5), (2, 5), (0, 0, 10, 10)), name)
        assert solution.status is tp.Status.SOLVED
        assert solution.cost == solution.length == 0.0


# What a planner offers


@pytest.fixture(scope="module")
def problem():
    return scenes.load("six-peaks")


@EVERY
def test_the_solution_says_what_was_done(name, problem):
    solution = tp.plan(problem, name, spacing=0.3)
    counters = solution.counters
    assert solution.planner == name == make_planner(name).name
    assert solution.stopped_by == "goal settled"
    assert solution.seed is solution.tree is solution.history is solution.gap is None
    assert 0 < solution.samples <= counters["vertices"] <= 41 * 41 + 2
    assert counters["edges considered"] == (counters["edges pruned"] + counters["edges integrated"])
    assert counters["edges tested for obstacles"] <= counters["edges integrated"]
    assert counters["edges considered"] <= 16 * solution.samples + 100
    assert solution.seconds > 0.0
    assert name in repr(solution)


def test_the_default_spacing_is_a_250th_of_the_longer_side():
    surface = tp.Surface.from_peaks([scenes.ONE_PEAK])
    problem = tp.Problem(surface, (0, 0), (10, 4), (0, 0, 10, 5))
    costs = [tp.AStar(spacing=spacing).solve(problem).cost for spacing in (None, 10 / 250)]
    assert costs[0] == costs[1]
    assert len(tp.Dijkstra().solve(problem).path.points) > 2


@EVERY
@pytest.mark.parametrize("chunk", [1, 97])
def test_how_often_the_clock_is_looked_at_changes_nothing(name, chunk, problem, monkeypatch):
    expected = tp.plan(problem, name, spacing=0.4)
    monkeypatch.setattr(grid_search, "CHUNK", chunk)
    seen = []
    found = tp.plan(problem, name, spacing=0.4, callback=seen.append)
    assert found.cost == expected.cost
    assert found.counters == expected.counters
    np.testing.assert_array_equal(found.path.points, expected.path.points)
    assert [p.samples for p in seen[:-1]] == [chunk * (k + 1) for k in range(len(seen) - 1)]
    assert seen[-1].samples == found.samples
    assert {p.total for p in seen} == {31 * 31 + 2}
    costs = np.array([p.best_cost for p in seen])
    assert costs[-1] == found.cost
    assert (np.minimum.accumulate(costs) == costs).all()


@EVERY
def test_a_time_limit_and_a_callback_end_the_search(name, problem):
    by_time = tp.plan(problem, name, spacing=0.05, time_limit=1e-9)
    by_callback = tp.plan(problem, name, spacing=0.05, callback=lambda progress: True)
    chunk = grid_search.CHUNK
    stopped = (by_time, "time limit", 0), (by_callback, "callback", chunk)
    for solution, reason, samples in stopped:
        assert solution.status is tp.Status.NOT_FOUND
        assert solution.stopped_by == reason
        assert solution.samples == samples
        assert solution.path is None


@EVERY
def test_a_search_that_ends_when_stopped_has_its_path(name, problem, monkeypatch):
    monkeypatch.setattr(grid_search, "CHUNK", 1)
    stop = tp.plan(problem, name, spacing=0.3, callback=lambda p: math.isfinite(p.best_cost))
    whole = tp.plan(problem, name, spacing=0.3)
    assert stop.stopped_by == "callback"
    assert stop.status is tp.Status.SOLVED
    assert stop.samples < whole.samples
    assert stop.cost >= whole.cost
    assert stop.cost == pytest.approx(stop.length, rel=1e-2)


@EVERY
def test_ctrl_c_gives_the_best_so_far(name, problem, monkeypatch):
    monkeypatch.setattr(grid_search, "CHUNK", 64)

    def interrupt(progress):
        if progress.samples >= 128:
            signal.raise_signal(signal.SIGINT)

    solution = tp.plan(problem, name, callback=interrupt)
    assert solution.status is tp.Status.INTERRUPTED
    assert solution.stopped_by == "interrupt"
    assert solution.samples == 128
    assert solution.path is None


BAD = [
    ({"spacing": 0.0}, "spacing=0"),
    ({"spacing": -1.0}, "spacing=-1"),
    ({"spacing": math.nan}, "spacing=nan"),
    ({"spacing": math.inf}, "spacing=inf"),
    ({"spacing": "fine"}, "spacing='fine'"),
    ({"neighbours": 4}, "neighbours=4"),
    ({"neighbours": 16.0}, "neighbours=16"),
    ({"neighbours": True}, "neighbours=True"),
    ({"neighbours": None}, "neighbours=None"),
    ({"time_limit": 0}, "time_limit=0"),
]


@EVERY
@pytest.mark.parametrize(("options", "start"), BAD, ids=[start for _, start in BAD])
def test_a_bad_option_is_named_with_its_value_and_what_it_must_be(name, options, start):
    with pytest.raises(tp.InputError) as raised:
        make_planner(name, **options)
    assert str(raised.value).startswith(start)
    assert "must be" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_options_are_frozen_keyword_only_and_each_planners_own():
    for kind in (tp.Dijkstra, tp.AStar):
        with pytest.raises(TypeError):
            kind(0.1)
        with pytest.raises(dataclasses.FrozenInstanceError):
            kind().spacing = 1.0
        assert kind(spacing=0.1) == kind(spacing=0.1) != kind()
        assert kind(neighbours=np.int32(8)) == kind(neighbours=8)
    assert tp.Dijkstra() != tp.AStar()


@EVERY
def test_more_nodes_than_can_be_numbered_are_refused(name, problem):
    with pytest.raises(
        tp.InputError, match=r"spacing=1e-06 makes .* nodes; give a wider one|wider"
    ):
        tp.plan(problem, name, spacing=1e-6)


# Doors of one cell


@EVERY
@pytest.mark.parametrize("kind", occupancy.KINDS)
@pytest.mark.parametrize("side", [11, *mostly_slow([260], quick=0)])
def test_what_free_cells_join_is_found_as_a_mask_and_as_polygons(name, kind, side):
    random = np.random.default_rng(side)
    blocked = occupancy.grid_of(kind, random, side)
    start, goal = np.array(occupancy.far_ends(blocked, random)) + 0.5
    ground = shapely.union_all(occupancy.squares(blocked))
    bounds = (0, 0, *blocked.shape[::-1])
    for obstacles in occupancy.obstacles_of(blocked).values():
        problem = tp.Problem(FLAT, start, goal, bounds, obstacles)
        solution = tp.plan(problem, name, refine=True)
        assert solution.status is tp.Status.SOLVED
        for path in (solution.path, solution.unrefined):
            assert path.line.disjoint(ground)


@EVERY
def test_a_finer_lattice_finds_what_the_first_one_misses(name):
    walls = [shapely.box(4.2, -1, 4.4, 5.2), shapely.box(4.2, 5.4, 4.4, 11)]
    problem = tp.Problem(FLAT, (1, 1), (9, 9), (0, 0, 10, 10), walls)
    seen = []
    solution = tp.plan(problem, name, spacing=1.0, callback=seen.append)
    assert len({progress.total for progress in seen}) > 1
    assert solution.path.line.disjoint(shapely.union_all(walls))


@pytest.mark.parametrize("spacing", [0.2, 0.5, 1.0, 2.5])
def test_nodes_lie_at_the_centres_of_cells(spacing):
    cells = Cells(0.7, 100.25, 1.0, 0.5)
    lattice = Lattice.at_cells(Bounds(0.0, 100.0, 20.0, 110.0), spacing, cells)
    for nodes, centre, size, low, high in (
        (lattice.x, 0.7, 1.0, 0.0, 20.0),
        (lattice.y, 100.25, 0.5, 100.0, 110.0),
    ):
        step = nodes[1] - nodes[0]
        assert step <= spacing + 1e-9
        assert low <= nodes[0] < low + step
        assert high - step < nodes[-1] <= high
        places = (nodes - centre) / size
        if step < size:  # every centre is a node
            places = np.arange(math.ceil((low - centre) / size), (high - centre) // size)
            places = (centre + size * places - nodes[0]) / step
        np.testing.assert_allclose(places, np.round(places), atol=1e-9)
