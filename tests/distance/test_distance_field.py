"""The distance field: known distances, orders, obstacles."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

import terrapath as tp
from common import FLAT, REGION, fitted_order, points_in
from planner_oracles import visibility_length
from rough_maps import fractal
from terrapath._kernels.distance import descent, edges, star
from terrapath.distance.medium import Medium
from terrapath.problem import scenes

PAPER = [name for name in scenes.names() if name != "jacksboro"]


# Orders


@pytest.mark.parametrize("name", ["three-peaks", "six-peaks", "repeat-4d"])
def test_second_order_on_the_papers_scenes(name):
    problem = tp.scenes.load(name)
    random = np.random.default_rng(1)
    goals = random.uniform(0.0, 10.5, (60, 2))
    fine = tp.distance_field(
        problem.surface, problem.start, bounds=problem.bounds, spacing=12.0 / 960
    )
    kept, truths = [], []
    for goal in goals[:24]:
        sub = tp.Problem(problem.surface, problem.start, goal, problem.bounds)
        exact = tp.refine(sub, fine.path_to(goal)).length
        if abs(exact / float(fine.at(goal)) - 1.0) < 1e-4:  # the same side of the cut locus
            kept.append(goal)
            truths.append(exact)
    assert len(kept) >= 15
    spacings = 12.0 / np.array([60.0, 120.0, 240.0])
    errors = []
    for spacing in spacings:
        field = tp.distance_field(
            problem.surface, problem.start, bounds=problem.bounds, spacing=float(spacing)
        )
        errors.append(np.abs(field.at(np.array(kept)) - truths).mean())
    assert 1.5 <= fitted_order(spacings, errors) <= 3.2


# Known distances


def test_distances_on_a_tilted_plane_and_a_cylinder():
    tilted = tp.Surface.from_expression("2*x1 - x2", (-5, -5, 5, 5))
    field = tp.distance_field(tilted, (0.3, 0.2))
    goals = np.array([[4.0, 4.0], [-4.9, 1.0], [0.35, 0.2], [5.0, -5.0]])
    offsets = goals - [0.3, 0.2]
    exact = np.sqrt((offsets**2).sum(1) + (2.0 * offsets[:, 0] - offsets[:, 1]) ** 2)
    assert field.at(goals) == pytest.approx(exact, rel=1e-3)

    bent = tp.Surface.from_expression("sqrt(36 - x1**2)", (-4, -4, 4, 4))
    field = tp.distance_field(bent, (-3.0, -2.0))
    arc = 6.0 * (math.asin(3.5 / 6.0) + math.asin(3.0 / 6.0))
    assert float(field.at((3.5, 3.0))) == pytest.approx(math.hypot(arc, 5.0), rel=2e-4)
    assert field.path_to((3.5, 3.0)).length == pytest.approx(math.hypot(arc, 5.0), rel=1e-4)


@pytest.mark.parametrize("name", PAPER)
def test_the_goal_of_the_papers_scenes(name):
    problem = tp.scenes.load(name)
    field = tp.distance_field(problem.surface, problem.start, bounds=problem.bounds)
    truth = scenes.SCENES[name].true_length
    assert float(field.at(problem.goal)) == pytest.approx(truth, rel=1e-3)
    path = field.path_to(problem.goal)
    assert truth <= path.length * (1.0 + 1e-9)
    assert path.length <= 1.001 * truth  # six-peaks: 1.00033, the others at most 1.00006
    assert tuple(path.points[0]) == problem.start
    assert tuple(path.points[-1]) == problem.goal


def test_a_slope_of_a_hundred():
    steep = tp.Surface.from_expression("100*x1", (0, 0, 10, 10))
    field = tp.distance_field(steep, (1.0, 1.0), spacing=0.1)
    for goal in ((9.0, 9.0), (1.0, 9.0), (1.5, 4.0)):
        exact = math.hypot(math.hypot(1.0, 100.0) * (goal[0] - 1.0), goal[1] - 1.0)
        assert float(field.at(goal)) == pytest.approx(exact, rel=2e-3)


# Obstacles


def test_obstacles_on_flat_ground_against_the_visibility_graph():
    polygons = [
        shapely.box(2.0, 1.0, 3.0, 7.0),
        shapely.Point(6.0, 4.0).buffer(1.5, quad_segs=4),
        shapely.box(4.0, 7.0, 9.0, 7.4),
    ]
    problem = tp.Problem(FLAT, (0.0, 4.0), (9.0, 9.0), (-1, -1, 10, 10), polygons)
    solution = tp.FastMarching().solve(problem)
    truth = visibility_length(problem.start, problem.goal, polygons, problem.bounds)
    assert all(solution.path.line.disjoint(polygon) for polygon in polygons)
    assert truth * (1.0 - 1e-9) <= solution.length <= 1.05 * truth
    assert tp.refine(problem, solution.path).length == pytest.approx(truth, rel=1e-6)


def test_no_wall_is_too_thin_and_gaps_are_found():
    wall = shapely.MultiLineString([[(5, -1), (5, 3)], [(5, 3.2), (5, 11)]])
    problem = tp.Problem(FLAT, (1.0, 8.0), (9.0, 8.0), REGION, [wall])
    solution = tp.FastMarching().solve(problem)
    assert solution.path.line.disjoint(wall)
    assert solution.length >= 2.0 * math.hypot(4.0, 4.8)
    assert solution.length <= 1.02 * 2.0 * math.hypot(4.0, 4.8)


def boxes_far_from_the_origin(seed):
    """The origin, boxes with corners at multiples of a half, and a start and a goal."""
    random = np.random.default_rng([13, seed])
    origin, boxes = np.array([5e5, 4.2e6]), []
    for _ in range(14):
        corner = origin + random.integers(0, 30, 2) / 2.0
        boxes.append(shapely.box(*corner, *(corner + random.integers(1, 8, 2) / 2.0)))
    return origin, shapely.union_all(boxes), origin + random.integers(0, 33, (2, 2)) / 2.0


# In 1355 the end of a step, rounded, once lay in a corner.
@pytest.mark.parametrize("seed", [1355, 2, 4, 5, 9])
def test_no_path_touches_a_box_far_from_the_origin(seed):
    origin, ground, (start, goal) = boxes_far_from_the_origin(seed)
    axis = np.arange(-1.0, 18.0)
    surface = tp.Surface.from_grid(np.zeros((19, 19)), *(at + axis for at in origin))
    bounds = (*(origin - 0.5), *(origin + 17.0))
    field = tp.distance_field(surface, start, bounds=bounds, obstacles=[ground], spacing=17.5 / 97)
    path = field.path_to(goal)
    assert path is not None
    assert path.line.disjoint(ground)


def test_a_gap_finer_than_the_nodes_is_found_on_finer_ones():
    wall = shapely.box(5, -1, 5.2, 4).union(shapely.box(5, 4.03, 5.2, 11))
    problem = tp.Problem(FLAT, (2.0, 2.0), (8.0, 2.0), REGION, [wall])
    solution = tp.FastMarching().solve(problem)
    assert solution.status is tp.Status.SOLVED
    assert solution.path.line.disjoint(wall)


def test_a_start_in_a_one_cell_pocket_with_one_way_out():
    blocked = np.ones((20, 20), bool)
    blocked[10, 4:] = False
    blocked[:, 15:] = False
    mask = tp.Mask(blocked, np.arange(20) + 0.5, np.arange(20) + 0.5)
    problem = tp.Problem(FLAT, (4.5, 10.5), (18.0, 2.0), (0, 0, 20, 20), [mask])
    solution = tp.FastMarching(spacing=1.7).solve(problem)
    assert solution.status is tp.Status.SOLVED
    assert solution.length == pytest.approx(10.5 + math.hypot(3.0, 8.0), rel=0.1)


@pytest.mark.parametrize("bounds", [(0.0, 0.0, 10.0, 0.02), (0.0, 0.0, 0.02, 10.0)])
def test_ground_one_cell_wide(bounds):
    start, goal = (0.01, 0.01), (bounds[2] - 0.005, bounds[3] - 0.005)
    problem = tp.Problem(FLAT, start, goal, bounds)
    solution = tp.FastMarching().solve(problem)
    assert solution.length == pytest.approx(math.dist(start, goal), rel=1e-3)


def test_a_goal_on_the_boundary_and_in_the_corner():
    for goal in ((11.0, 5.0), (11.0, 11.0), (-1.0, 3.0)):
        problem = tp.Problem(FLAT, (0.0, 0.0), goal, REGION)
        assert tp.FastMarching().solve(problem).length == pytest.approx(math.hypot(*goal), rel=1e-4)


def test_what_cannot_be_reached_is_infinitely_far():
    moat = shapely.Point(8, 8).buffer(1.0).exterior
    field = tp.distance_field(FLAT, (0, 0), bounds=REGION, obstacles=[moat])
    assert field.at((8.0, 8.0)) == math.inf
    assert field.path_to((8.0, 8.0)) is None
    assert field.reached < 1.0


# Bad input


def test_bad_input_is_told_in_one_line():
    with pytest.raises(tp.InputError, match=r"spacing=0"):
        tp.distance_field(FLAT, (0, 0), bounds=REGION, spacing=0)
    with pytest.raises(tp.InputError, match=r"spacing=1e-09 makes"):
        tp.distance_field(FLAT, (0, 0), bounds=REGION, spacing=1e-9)
    with pytest.raises(tp.InputError, match=r"start=\(5, 5\)"):
        tp.distance_field(FLAT, (5, 5), bounds=REGION, obstacles=[shapely.box(4, 4, 6, 6)])
    with pytest.raises(tp.InputError, match=r"spacing=nan"):
        tp.FastMarching(spacing=math.nan)


def test_the_same_field_twice():
    problem = tp.scenes.load("repeat-4d")
    a, b = (
        tp.distance_field(problem.surface, problem.start, bounds=problem.bounds, spacing=0.2)
        for _ in range(2)
    )
    assert (a.values == b.values).all()


# Rough ground


def chords_to_nodes(field):
    """(ny, nx), by a loop over nothing but the lifted points."""
    lifted = field.surface.lift(field.lattice.points)
    return np.linalg.norm(lifted - field.surface.lift(np.asarray(field.source)), axis=-1)


def longest_edge_walk(field, count=8):
    """(ny, nx): Dijkstra over the nodes around, each edge as long as in very short chords."""
    points, surface = field.lattice.points, field.surface
    ny, nx = points.shape[:2]
    numbers = np.arange(ny * nx).reshape(ny, nx)
    tails, heads, lengths = [], [], []
    for rows, columns in ((0, 1), (1, 0), (1, 1), (1, -1)):
        first = np.s_[: ny - rows, max(-columns, 0) : nx - max(columns, 0)]
        second = np.s_[rows:, max(columns, 0) : nx - max(-columns, 0)]
        shares = np.linspace(0.0, 1.0, count + 1)[:, None, None, None]
        way = points[first] + shares * (points[second] - points[first])
        steps = np.linalg.norm(np.diff(surface.lift(way), axis=0), axis=-1)
        cost = surface.cost(0.5 * (way[1:] + way[:-1])) if surface.costs else 1.0
        tails.append(numbers[first].ravel())
        heads.append(numbers[second].ravel())
        lengths.append((steps * cost).sum(axis=0).ravel())
    edges = (np.concatenate(lengths), (np.concatenate(tails), np.concatenate(heads)))
    graph = csr_array(edges, shape=(ny * nx, ny * nx))
    start = np.argmin(np.hypot(*np.moveaxis(points - field.source, -1, 0)))
    return dijkstra(graph, directed=False, indices=start).reshape(ny, nx)


AXIS = 5.0 + 10.0 * np.arange(60)


def hills():
    wave = np.sin(AXIS / 90.0)[None, :] * np.cos(AXIS / 70.0)[:, None]
    return 0.3 * AXIS[None, :] + 20.0 * wave


def with_pit(depth):
    heights = hills()
    heights[34:40, 30:36] = depth
    return heights


def rough(seed):
    return 40.0 * fractal(np.random.default_rng(seed), 60, 60, 1.8)


ROUGH = {
    "hills": hills(),
    "shallow pit": with_pit(0.0),
    "pit": with_pit(-100.0),
    "fractal": rough(0),
    "noise": 300.0 * np.random.default_rng(3).standard_normal((60, 60)),
    "wall": np.where(np.arange(60) == 30, 500.0, 0.0)[None, :] + np.zeros((60, 1)),
}


@pytest.mark.parametrize("weight", [1.0, 10.0, 1000.0])
@pytest.mark.parametrize("name", ROUGH)
def test_a_field_is_between_the_chord_and_a_walk_over_its_nodes(name, weight):
    surface = tp.Surface.from_grid(ROUGH[name], AXIS, AXIS, weights=[weight])
    field = tp.distance_field(surface, (155.0, 305.0), spacing=10.0)
    chords = chords_to_nodes(field)
    assert np.isfinite(field.values).all()
    assert (field.values >= chords * (1.0 - 1e-12)).all()
    # The edges' own costs are those of paths that bend, and of few samples.
    walk = longest_edge_walk(field)
    assert np.median(field.values / np.maximum(walk, 1e-9)) <= 1.0
    goals = points_in(surface.bounds, 20, seed=1)
    for goal, value in zip(goals, field.at(goals), strict=True):
        assert value >= (1.0 - 1e-9) * tp.chord(surface, [field.source], [goal])[0]
        path = field.path_to(goal)
        assert path is not None
        assert path.length >= (1.0 - 1e-9) * tp.chord(surface, [field.source], [goal])[0]


@pytest.mark.parametrize("slope", [0.0, 1.0, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4, 1e5])
@pytest.mark.parametrize("angle", [math.atan2(0.8, 0.6), 0.0, 0.3, 1.5])
@pytest.mark.parametrize("source", [(155.0, 305.0), (158.3, 301.7)])
def test_planes_of_any_slope(slope, angle, source):
    rise = slope * (math.cos(angle) * AXIS[None, :] + math.sin(angle) * AXIS[:, None])
    surface = tp.Surface.from_grid(rise, AXIS, AXIS)
    field = tp.distance_field(surface, source, spacing=10.0)
    chords = chords_to_nodes(field)
    assert (field.values >= chords * (1.0 - 1e-12)).all()
    excess = field.values[chords > 0.0] / chords[chords > 0.0] - 1.0
    assert np.median(excess) <= 1e-8
    if slope <= 1.0:
        assert excess.max() <= 1e-8
    elif slope <= 10.0:
        assert excess.max() <= 1e-3
    else:  # nodes level with the source follow from others that are farther
        assert np.percentile(excess, 95.0) <= 1e-5
        assert np.percentile(excess, 99.0) <= 5e-3
        assert excess.max() <= 0.03


@pytest.mark.parametrize(
    ("name", "weight", "middle", "most"),
    [("hills", 1.0, 1e-4, 1e-3), ("hills", 10.0, 1e-3, 0.02), ("fractal", 1.0, 0.01, 0.1)],
)
def test_values_at_the_maps_own_spacing(name, weight, middle, most):
    """Against a lattice eight times finer: the errors that are documented."""
    surface = tp.Surface.from_grid(ROUGH[name], AXIS, AXIS, weights=[weight])
    coarse, fine = (tp.distance_field(surface, (155.0, 305.0), spacing=d) for d in (10.0, 1.25))
    truth = fine.values[::8, ::8]
    errors = np.abs(coarse.values[truth > 0.0] / truth[truth > 0.0] - 1.0)
    assert np.median(errors) <= middle
    assert errors.max() <= most


def test_there_and_back_on_rough_ground():
    surface = tp.Surface.from_grid(rough(1), AXIS, AXIS)
    ends = points_in(surface.bounds, 12, seed=2)
    fields = [tp.distance_field(surface, end, spacing=10.0).at(ends) for end in ends]
    there = np.array(fields)[~np.eye(12, dtype=bool)]
    back = np.array(fields).T[~np.eye(12, dtype=bool)]
    assert np.median(np.abs(there / back - 1.0)) <= 0.01


def test_more_obstacles_are_never_shorter():
    surface = tp.Surface.from_grid(rough(2), AXIS, AXIS)
    boxes = [shapely.box(x, y, x + 60.0, y + 40.0) for x, y in ((100, 100), (300, 250), (180, 400))]
    without = tp.distance_field(surface, (55.0, 55.0), spacing=10.0)
    within = tp.distance_field(surface, (55.0, 55.0), obstacles=boxes, spacing=10.0)
    # Both have errors of their own.
    assert (within.values >= without.values * (1.0 - 0.01)).all()


def test_a_costly_field_is_at_least_the_least_cost_times_the_chord():
    random = np.random.default_rng(5)
    costs = np.where(random.random((60, 60)) < 0.4, 255.0, 1.0)
    surface = tp.read_surface(
        (hills(), AXIS, AXIS), costs={"going": (costs, AXIS, AXIS)}, smoothing=None
    )
    field = tp.distance_field(surface, (155.0, 305.0), spacing=10.0)
    assert (field.values >= surface.least_cost * chords_to_nodes(field) * (1.0 - 1e-12)).all()
    walk = longest_edge_walk(field)
    assert np.median(field.values / np.maximum(walk, 1e-9)) <= 1.02


def test_costs_that_leap_by_many_powers_of_ten_end():
    random = np.random.default_rng(0)
    axis, costs = np.arange(12.0), 10.0 ** random.uniform(-8.0, 8.0, (12, 12))
    surface = tp.Surface.from_grid(
        np.array([0.0 * costs, costs]), axis, axis, kinds=["rise", "cost"]
    )
    field = tp.distance_field(surface, (1.0, 1.0), spacing=0.1)
    assert np.isfinite(field.values).all()
    assert (field.values >= surface.least_cost * chords_to_nodes(field) * (1.0 - 1e-12)).all()


@pytest.mark.parametrize("size", [2, 3, 4])
def test_on_a_lattice_of_few_nodes_a_node_has_its_own_value(size):
    random, axis = np.random.default_rng(0), np.arange(4.0)
    surface = tp.Surface.from_grid(random.random((4, 4)), axis, axis)
    field = tp.distance_field(surface, (0.2, 0.3), spacing=3.0 / (size - 1))
    assert field.at((3.0, 3.0)) <= field.values[-1, -1] * (1.0 + 1e-12)


def test_a_limit_leaves_out_what_is_farther():
    problem = tp.scenes.load("one-peak")
    medium = Medium(problem.surface, tp.Lattice.spanning(problem.bounds, 0.2), problem.free_space)
    whole = medium.march(problem.start)[0]
    part = medium.march(problem.start, limit=7.0)[0]
    reached = np.isfinite(part)
    assert (part[reached] == whole[reached]).all()
    assert whole[~reached].min() > 6.3
    assert part[reached].max() < 7.5


def test_where_a_descent_leads_nowhere_a_path_follows_the_edges(monkeypatch):
    monkeypatch.setattr(descent, "trace", lambda *arguments: 0)
    wall = shapely.box(4.0, -3.0, 5.0, 9.0)
    field = tp.distance_field(FLAT, (0.0, 0.0), bounds=REGION, obstacles=[wall], spacing=0.25)
    path = field.path_to((8.0, 0.0))
    assert path.line.disjoint(wall)
    truth = visibility_length((0.0, 0.0), (8.0, 0.0), [wall], REGION)
    assert truth <= path.length <= 1.11 * truth  # of edges to eight neighbours


@pytest.mark.parametrize("seed", range(6))
def test_on_steep_noise_distances_are_above_zero(seed):
    random = np.random.default_rng([7, seed])
    axis = 10.0 * np.arange(40)
    surface = tp.Surface.from_grid(300.0 * random.standard_normal((40, 40)), axis, axis)
    field = tp.distance_field(surface, (200.0, 200.0), spacing=5.0)
    at_source = field.values == 0.0
    assert at_source.sum() == 1
    assert (field.values[~at_source] > 0.0).all()


@pytest.mark.parametrize("weight", [0.3, 10.0])
def test_edges_cost_the_same_four_at_once_as_by_themselves(weight):
    random = np.random.default_rng(4)
    costs = random.uniform(0.5, 2.0, (60, 60))
    surface = tp.Surface.from_grid(
        np.array([ROUGH["fractal"], 3.0 * ROUGH["fractal"].T, costs]),
        AXIS,
        AXIS,
        kinds=["rise", "rise", "cost"],
        weights=[weight, weight, 1.0],
    )
    lattice = tp.Lattice.spanning(surface.bounds, 7.0)
    medium = Medium(surface, lattice, tp.Problem(surface, (50.0, 50.0), (60.0, 60.0)).free_space)
    tails, directions, found = star.list_edges(medium.stars)
    assert len(set(directions.tolist())) > 8
    for costs in (medium.stars.base, medium.stars.others):
        costs.fill(np.nan)  # nothing of what was found four at a time is left
    for n, k in zip(tails, directions, strict=True):
        edges.write_single(medium.ground, lattice.nx, n, k, medium.stars)
    assert (star.list_edges(medium.stars)[2] == found).all()
