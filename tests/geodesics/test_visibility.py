"""The shortest path on flat ground, against closed forms and an all-pairs visibility graph."""

import itertools
import json
import math

import numpy as np
import pytest
import shapely
from shapely import affinity

import terrapath as tp
from common import FLAT, REAL_MAPS, REGION, mostly_slow
from layouts import LAYOUTS, star
from mazes import maze
from oracles import boxes_of_mask
from processes import in_another_process
from terrapath._kernels.geodesics import sight
from terrapath.geodesics import visibility
from terrapath.geodesics.visibility import is_flat, shortest_taut_path
from terrapath.surface import Mask
from visibility_graph import shortest_by_all_pairs

FAR = (5e5, 4.2e6)  # as large as the coordinates of maps are


def problem_on(obstacles, start=(0.0, 0.0), goal=(10.0, 10.0), bounds=REGION, surface=FLAT):
    return tp.Problem(surface, start, goal, bounds=bounds, obstacles=obstacles)


def is_disjoint(path, obstacles):
    return path.line.disjoint(shapely.union_all(list(obstacles)))


def length_of(problem):
    """Of the shortest path, infinite where there is none; the path is checked to be free."""
    found = shortest_taut_path(problem)
    assert found.is_finished
    if found.path is None:
        assert math.isinf(found.least)
        return math.inf
    points = found.path.points
    assert points[0].tolist() == list(problem.start)
    assert points[-1].tolist() == list(problem.goal)
    assert problem.bounds.contains(points).all()
    assert problem.free_space.segments_are_free(points[:-1], points[1:]).all()
    assert found.least == pytest.approx(found.path.length, rel=1e-7)
    return found.path.length


def assert_shortest(problem, obstacles, away, h=None):
    """By brute force; what is returned is disjoint from the obstacles, by shapely."""
    found = length_of(problem)
    bounds = np.array(problem.bounds)
    right = shortest_by_all_pairs(obstacles, problem.start, problem.goal, bounds, away, h)
    assert math.isinf(found) == math.isinf(right)
    if math.isfinite(found):
        stretch = 1.0 if h is None else math.sqrt(np.linalg.eigvalsh(h)[1])
        assert right - 100.0 * stretch * away <= found <= right * (1.0 + 1e-9)
        assert is_disjoint(shortest_taut_path(problem).path, obstacles)
    return found


# Occupancy grids


def mask_of(blocked, offset=(0.0, 0.0), scale=(1.0, 1.0)):
    ny, nx = blocked.shape
    return Mask(blocked, offset[0] + scale[0] * np.arange(nx), offset[1] + scale[1] * np.arange(ny))


def as_obstacles(kind, mask):
    """A mask; the union of its cells' squares; the squares one by one."""
    squares = boxes_of_mask(mask)
    return {"mask": [mask], "union": [shapely.union_all(squares)], "squares": squares}[kind]


def bounds_of(mask):
    (dx, dy), (x, y) = mask.spacing, (mask.x, mask.y)
    return (x[0] - 0.5 * dx, y[0] - 0.5 * dy, x[-1] + 0.5 * dx, y[-1] + 0.5 * dy)


KINDS = ("mask", "union", "squares")


@pytest.mark.parametrize("offset", [(0.0, 0.0), FAR])
@pytest.mark.parametrize("kind", KINDS)
def test_the_lengths_of_a_benchmark_grid_are_met(kind, offset):
    if not (exact := REAL_MAPS / "random-100-33.exact.json").exists():
        pytest.skip("the grid is not there")
    rows = (REAL_MAPS / "random-100-33.map").read_text().splitlines()[4:]
    mask = mask_of(np.array([[cell not in ".G" for cell in row] for row in rows]), offset)
    obstacles = as_obstacles(kind, mask)
    for case in json.loads(exact.read_text()):
        ends = np.array([case["s"], case["t"]]) + offset
        problem = problem_on(obstacles, *ends, bounds=bounds_of(mask))
        assert length_of(problem) == pytest.approx(
            case["exact"], rel=1e-9 if offset[0] == 0 else 1e-8
        )


def scattered(random):
    return random.random((9, 11)) < random.uniform(0.1, 0.45)


def rooms(random):
    """Rooms of 3 x 3 cells with doors of one cell, some of them shut."""
    blocked = np.zeros((13, 13), bool)
    blocked[::4], blocked[:, ::4] = True, True
    for j in range(0, 12, 4):
        for i in range(0, 12, 4):
            blocked[j, i + 1 + random.integers(3)] = random.random() < 0.2
            blocked[j + 1 + random.integers(3), i] = random.random() < 0.2
    return blocked


def walled_maze(random):
    return np.pad(maze(random, 11, 11), 1, constant_values=True)


def streets(random):
    """Blocks of buildings of uneven size."""
    blocked = np.zeros((14, 14), bool)
    for j in range(0, 14, 4):
        for i in range(0, 14, 4):
            height, width = random.integers(1, 4, 2)
            blocked[j : j + height, i : i + width] = True
    return blocked


GRIDS = (scattered, rooms, walled_maze, streets)


def free_places(random, blocked):
    """Two places in free cells, (x1, x2): in the middle, or close beside the cell's border."""
    cells = np.argwhere(~blocked)[:, ::-1]
    chosen = cells[random.choice(len(cells), 2, replace=False)]
    aside = 0.5 - 10.0 ** -random.integers(1, 7, (2, 1)) * random.uniform(0.5, 1.0, (2, 2))
    return chosen + np.where(
        random.random((2, 1)) < 0.5, 0.0, aside * random.choice([-1, 1], (2, 2))
    )


@pytest.mark.parametrize("seed", mostly_slow(range(40), 3))
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("make", GRIDS)
def test_paths_on_grids_are_the_shortest(make, kind, seed):
    random = np.random.default_rng(seed)
    blocked = make(random)
    mask = mask_of(blocked)
    problem = problem_on(as_obstacles(kind, mask), *free_places(random, blocked), bounds_of(mask))
    assert_shortest(problem, boxes_of_mask(mask), 1e-8)


@pytest.mark.parametrize("scale", [(100.0, 1.0), (1e-3, 1e-3), (1e4, 1e4)])
def test_cells_may_be_of_any_size(scale):
    random = np.random.default_rng(3)
    blocked = scattered(random)
    mask = mask_of(blocked, scale=scale)
    ends = free_places(random, blocked) * scale
    problem = problem_on([mask], *ends, bounds_of(mask))
    assert_shortest(problem, boxes_of_mask(mask), 1e-9 * min(scale))


def test_cells_that_touch_at_a_corner_shut_the_passage():
    blocked = np.zeros((4, 4), bool)
    blocked[0, 1] = blocked[1, 0] = True
    for kind in KINDS:
        obstacles = as_obstacles(kind, mask_of(blocked))
        problem = problem_on(obstacles, (0, 0), (3, 3), (-0.5, -0.5, 3.5, 3.5))
        assert math.isinf(length_of(problem))


# Polygons and lines


def random_shape(random, lattice):
    """A box, a hull, a star with or without a hole, or a line; on whole numbers or anywhere."""
    centre, size = random.uniform(0, 10, 2), random.uniform(0.3, 3.0)
    kind = random.integers(4)
    if kind == 0:
        shape = shapely.box(*np.round(2 * centre) / 2, *(np.round(2 * (centre + size)) / 2 + 0.5))
    elif kind == 1:
        radii = random.uniform(0.3, 1.0, random.integers(4, 9)) * size
        shape = star(*centre, radii, random.uniform(0, 6), random.choice([0.0, 0.5]))
    elif kind == 2:
        shape = shapely.MultiPoint(centre + random.uniform(-size, size, (6, 2))).convex_hull
    else:
        shape = shapely.LineString(random.uniform(0, 10, (random.integers(2, 5), 2)))
    return shapely.transform(shape, np.round) if lattice else shape


def random_shapes(random, lattice):
    shapes = [random_shape(random, lattice) for _ in range(random.integers(2, 12))]
    return [s for s in shapes if s.is_valid and s.length > 0.0 and not s.is_empty]


def random_ends(random, obstacles):
    places = random.uniform(-1, 11, (100, 2))
    clear = ~shapely.dwithin(shapely.union_all(obstacles), shapely.points(places), 1e-3)
    return places[clear][:2]


@pytest.mark.parametrize("seed", mostly_slow(range(200), 10))
@pytest.mark.parametrize("lattice", [True, False])
def test_paths_among_shapes_are_the_shortest(lattice, seed):
    random = np.random.default_rng(seed)
    obstacles = random_shapes(random, lattice)
    problem = problem_on(obstacles, *random_ends(random, obstacles))
    assert_shortest(problem, obstacles, 1e-8)


@pytest.mark.parametrize("seed", mostly_slow(range(60), 4))
def test_far_from_the_origin_the_same_holds(seed):
    random = np.random.default_rng(seed)
    shapes = random_shapes(random, lattice=seed % 2 == 0)
    ends = random_ends(random, shapes) + FAR
    obstacles = [affinity.translate(shape, *FAR) for shape in shapes]
    bounds = np.array(REGION) + np.tile(FAR, 2)
    problem = problem_on(obstacles, *ends, bounds)
    found = length_of(problem)
    right = shortest_by_all_pairs(obstacles, *ends, bounds, 3e-8)
    assert math.isinf(found) == math.isinf(right)
    if math.isfinite(found):
        assert found == pytest.approx(right, rel=1e-6)
        assert is_disjoint(shortest_taut_path(problem).path, obstacles)


def test_the_path_round_a_box_is_known():
    problem = problem_on([shapely.box(2, -1, 6, 3)], (0, 1), (8, 1))
    assert length_of(problem) == pytest.approx(2 * math.hypot(2, 2) + 4, rel=1e-9)


def test_the_path_round_the_end_of_a_line_is_known():
    problem = problem_on([shapely.LineString([(5, -1), (5, 6)])], (0, 5), (10, 5))
    assert length_of(problem) == pytest.approx(2 * math.hypot(5, 1), rel=1e-9)


def test_along_a_wall_of_boxes_the_path_is_straight():
    boxes = [shapely.box(k, 0.0, k + 1, 1.0) for k in range(10)]
    problem = problem_on(boxes, (-1, 0.0), (11, 0.0), (-1, -1, 11, 11))
    assert length_of(problem) == pytest.approx(12.0, rel=1e-9)


@pytest.mark.parametrize("name", LAYOUTS)
def test_nothing_is_left_for_refinement(name):
    problem = problem_on(LAYOUTS[name], (0.5, 5.2), (10.5, 5.2))
    found = shortest_taut_path(problem).path
    assert tp.refine(problem, found).length == pytest.approx(found.length, rel=1e-9)


BOX = np.pad(np.ones((2, 2), bool), 1)


@pytest.mark.parametrize(
    ("obstacle", "away"),
    # The cells of masks are widened by 2e-10.
    [(mask_of(BOX), 3e-9), (mask_of(BOX), 1e-7)]
    + [(shapely.box(0.5, 0.5, 2.5, 2.5), away) for away in (1e-12, 1e-10, 1e-8)],
)
def test_ends_may_be_nearer_to_a_corner_than_the_path(obstacle, away):
    bounds = (-0.5, -0.5, 3.5, 3.5)
    for angle in np.linspace(0.1, 1.4, 5):
        end = (2.5 + away * math.cos(angle), 2.5 + away * math.sin(angle))
        problem = problem_on([obstacle], (0.0, 1.0), end, bounds)
        right = math.hypot(0.5, 1.5) + 2.0
        for one in (problem, problem.between(end, (0.0, 1.0))):
            assert length_of(one) == pytest.approx(right, abs=10 * away + 1e-8)


# Discs, radius, areas


def test_the_path_round_a_disc_is_known():
    problem = problem_on([tp.Circle(5, 5, 2)], (0, 5), (10, 5))
    right = 2 * math.sqrt(25 - 4) + 2 * (math.pi - 2 * math.acos(2 / 5))
    assert length_of(problem) == pytest.approx(right, rel=3e-7)


def test_the_vehicle_keeps_its_radius():
    walls = [shapely.box(3, -1, 4, 6), shapely.box(6, 4, 7, 11)]
    problem = tp.Problem(FLAT, (1, 5), (9, 5), bounds=REGION, obstacles=walls, radius=0.5)
    assert length_of(problem) < 11.0
    path = shortest_taut_path(problem).path
    assert all(path.line.distance(wall) >= 0.5 for wall in walls)
    finest = [wall.buffer(0.5, quad_segs=64) for wall in walls]
    right = shortest_by_all_pairs(finest, problem.start, problem.goal, np.array(REGION), 1e-7)
    assert right <= path.length <= right * 1.005


def test_the_path_keeps_in_its_area():
    area = shapely.Polygon([(0, 0), (10, 0), (10, 10), (0, 10), (0, 6), (8, 6), (8, 4), (0, 4)])
    problem = tp.Problem(FLAT, (0.5, 0.5), (0.5, 9.5), bounds=REGION, keep_in=area)
    assert length_of(problem) == pytest.approx(2 * math.hypot(7.5, 3.5) + 2, rel=1e-9)


# What holds for all


@pytest.mark.parametrize("seed", mostly_slow(range(40), 5))
def test_reversed_and_mirrored_paths_are_as_long(seed):
    random = np.random.default_rng(seed)
    obstacles = random_shapes(random, lattice=seed % 2 == 0)
    start, goal = random_ends(random, obstacles)
    found = length_of(problem_on(obstacles, start, goal))
    mirrored = [affinity.scale(shape, -1, 1, origin=(5, 5)) for shape in obstacles]
    turned = [affinity.rotate(shape, 90, origin=(5, 5)) for shape in obstacles]
    others = (
        problem_on(obstacles, goal, start),
        problem_on(mirrored, (10 - start[0], start[1]), (10 - goal[0], goal[1])),
        problem_on(turned, (10 - start[1], start[0]), (10 - goal[1], goal[0])),
    )
    for other in others:
        assert length_of(other) == pytest.approx(found, rel=1e-9)


@pytest.mark.parametrize("seed", mostly_slow(range(40), 5))
def test_more_obstacles_never_make_it_shorter(seed):
    random = np.random.default_rng(seed)
    obstacles = random_shapes(random, lattice=False)
    ends = random_ends(random, obstacles)
    lengths = [length_of(problem_on(obstacles[:k], *ends)) for k in range(len(obstacles) + 1)]
    assert lengths[0] == pytest.approx(math.dist(*ends), rel=1e-12)
    assert all(b >= a * (1.0 - 1e-9) for a, b in itertools.pairwise(lengths))


def test_no_path_is_a_result():
    ring = shapely.box(3, 3, 9, 9) - shapely.box(4, 4, 8, 8)
    problem = problem_on([ring], (0, 0), (6, 6))
    assert shortest_taut_path(problem) == visibility.Taut(None, True, math.inf)


def test_the_start_may_be_the_goal():
    found = shortest_taut_path(problem_on([shapely.box(3, 3, 4, 4)], (1, 1), (1, 1)))
    assert found.path.length == found.least == 0.0


def test_a_watch_stops_the_search():
    blocked = np.random.default_rng(0).random((200, 200)) < 0.2
    blocked[:2, :2] = blocked[-2:, -2:] = False
    problem = problem_on([mask_of(blocked)], (0, 0), (199, 199), (-0.5, -0.5, 199.5, 199.5))
    settled = []
    stopped = shortest_taut_path(problem, watch=lambda count: settled.append(count) or count > 1000)
    assert not stopped.is_finished
    assert stopped.path is None
    assert settled == list(range(visibility.CHUNK, settled[-1] + 1, visibility.CHUNK))
    assert math.dist(problem.start, problem.goal) <= stopped.least <= length_of(problem)


# Metrics


def plane(slope, weight, bounds=REGION, costs=None):
    x, y = np.linspace(bounds[0], bounds[2], 9), np.linspace(bounds[1], bounds[3], 7)
    height = slope[0] * x + slope[1] * y[:, None]
    if costs is None:
        return tp.Surface.from_grid(height, x, y, weights=[weight])
    layers = np.stack([height, np.broadcast_to(costs, height.shape)])
    return tp.Surface.from_grid(layers, x, y, weights=[weight, 1.0], kinds=["rise", "cost"])


@pytest.mark.parametrize("seed", mostly_slow(range(60), 5))
def test_tilted_planes_are_flat_as_well(seed):
    random = np.random.default_rng(seed)
    slope, weight = random.normal(size=2), 10.0 ** random.uniform(-1, 2)
    obstacles = random_shapes(random, lattice=seed % 2 == 0)
    problem = problem_on(obstacles, *random_ends(random, obstacles), surface=plane(slope, weight))
    assert is_flat(problem)
    h = np.eye(2) + weight**2 * np.outer(slope, slope)
    assert_shortest(problem, obstacles, 1e-8, h)


def test_a_constant_cost_multiplies_the_length():
    box = [shapely.box(2, -1, 6, 3)]
    problem = problem_on(box, (0, 1), (8, 1), surface=plane((0.0, 0.0), 1.0, costs=3.0))
    assert is_flat(problem)
    assert length_of(problem) == pytest.approx(3 * (2 * math.hypot(2, 2) + 4), rel=1e-9)


def test_what_is_not_flat_is_told():
    hill = tp.Surface.from_peaks([[(1.0, 0.1, 5.0, 5.0)]])
    costs = np.where(np.arange(9) < 4, 1.0, 2.0)
    assert is_flat(problem_on([]))
    assert is_flat(problem_on([], surface=hill.with_weights({"height": 0.0})))
    assert not is_flat(problem_on([], surface=hill))
    assert not is_flat(problem_on([], surface=plane((1.0, 0.0), 1.0, costs=costs)))
    x = np.linspace(0, 10, 41)
    bent = tp.Surface.from_grid(np.maximum(x - 5.0, 0.0) + 0.0 * x[:, None], x, x)
    whole = tp.Problem(bent, (1, 1), (2, 2))
    assert not is_flat(whole)
    with pytest.raises(tp.InputError, match="not flat"):
        shortest_taut_path(whole)


# Kernels


def test_all_that_is_visible_is_seen():
    """The sweep may show too much, but never too little."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        obstacles = random_shapes(random, lattice=seed % 2 == 0)
        start, goal = random_ends(random, obstacles)
        scene = visibility._scene(problem_on(obstacles, start, goal))
        view = visibility._empty_view(scene)
        corners = scene.corners[:, :2]
        count = sight.look(scene, view, 0, *start, 0.0, 2.0 * math.pi)
        seen = view.found[:count].tolist()
        assert len(seen) == len(set(seen))
        lines = shapely.linestrings(np.stack([np.broadcast_to(start, corners.shape), corners], 1))
        visible = shapely.disjoint(shapely.union_all(obstacles), lines)
        visible &= (corners != start).any(axis=1)
        assert set(np.flatnonzero(visible)) <= set(seen)


PLAIN = """
import json
import numpy as np, shapely, terrapath as tp
from terrapath.geodesics.visibility import shortest_taut_path
random = np.random.default_rng(5)
boxes = [shapely.box(x, y, x + 0.7, y + 0.5) for x, y in random.uniform(0, 9, (30, 2))]
flat = tp.Surface.from_peaks([np.empty((0, 4))])
problem = tp.Problem(flat, (-0.5, -0.5), (10.5, 10.5), (-1, -1, 11, 11), boxes)
print(json.dumps(shortest_taut_path(problem).path.points.tolist()))
"""


def test_without_compilation_the_path_is_the_same():
    compiled, plain = (in_another_process(PLAIN, NUMBA_DISABLE_JIT=flag) for flag in "01")
    assert compiled == plain
