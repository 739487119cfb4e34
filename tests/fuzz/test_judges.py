"""The judges of random maps and their generators, judged by closed forms and brute force."""

import json
import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
import shapely
from scipy.integrate import quad

import judges
import terrapath as tp
from common import REAL_MAPS
from fuzz_worker import Worker
from misbehaving import prepare, work
from occupancy_grids import GRIDS, random_grid
from planner_oracles import visibility_length
from rough_maps import GROUNDS, pathological_map, random_map

AXIS = np.linspace(0.0, 10.0, 21)
FLAT = judges.Ground(AXIS, AXIS, np.zeros((21, 21)))
ENDS = np.array([1.0, 2.0]), np.array([9.0, 7.0])


def raised(function, weight=1.0, **more):
    """The ground of a function of x and y."""
    return judges.Ground(AXIS, AXIS, function(*np.meshgrid(AXIS, AXIS)), weight, **more)


# Value and chord


@pytest.mark.parametrize("slope", [0.0, 1.0, 1e5])
def test_on_a_plane_the_value_is_the_chord_and_both_are_pythagoras(slope):
    ground = raised(lambda x, y: slope * (0.6 * x + 0.8 * y))
    truth = math.hypot(8.0, 5.0, slope * (0.6 * 8.0 + 0.8 * 5.0))
    assert judges.chord(ground, *ENDS)[0] == pytest.approx(truth, rel=1e-12)
    assert judges.value_of(ground, np.array(ENDS)) == pytest.approx(truth, rel=1e-10)


@pytest.mark.parametrize("weight", [1.0, 100.0, 1e4])
def test_a_parabola_has_its_closed_form(weight):
    # A cubic spline with not-a-knot ends is the parabola itself.
    ground = raised(lambda x, y: 0.5 * (x - 5.0) ** 2, weight)
    s = 4.0 * weight  # the slope at both ends of a path from x = 1 to 9
    truth = (s * math.hypot(1.0, s) + math.asinh(s)) / weight
    path = np.array([(1.0, 3.0), (2.7, 3.0), (9.0, 3.0)])
    assert judges.value_of(ground, path) == pytest.approx(truth, rel=1e-9)
    assert judges.chord(ground, path[0], path[-1])[0] == pytest.approx(8.0)


def test_costs_multiply_lengths():
    ground = raised(lambda x, y: 0.75 * x, cost=lambda p: np.exp(p[:, 0]), least_cost=1.0)
    truth = 1.25 * (math.e**4 - math.e)
    path = np.array([(1.0, 5.0), (4.0, 5.0)])
    assert judges.value_of(ground, path) == pytest.approx(truth, rel=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_a_rough_path_is_as_long_as_quadpack_says(seed):
    random = np.random.default_rng(seed)
    ground = judges.Ground(AXIS, AXIS, random.standard_normal((21, 21)), 10.0**seed)
    a, b = random.uniform(0.0, 10.0, (2, 2))

    def speed(t):
        return ground.speeds((a + t * (b - a))[None], (b - a)[None])[0]

    knots = sorted({(k - a[i]) / (b[i] - a[i]) for i in (0, 1) for k in AXIS})
    cuts = [0.0, *(t for t in knots if 0.0 < t < 1.0), 1.0]
    truth = sum(quad(speed, *ends, epsrel=1e-11)[0] for ends in pairwise(cuts))
    assert judges.value_of(ground, np.array([a, b])) == pytest.approx(truth, rel=1e-9)


def test_large_coordinates_cost_no_digits():
    heights = np.random.default_rng(0).standard_normal((21, 21))
    here = judges.Ground(AXIS, AXIS, heights, 30.0)
    there = judges.Ground(5e5 + AXIS, 4.2e6 + AXIS, heights, 30.0)
    path = np.array(ENDS)
    moved = path + np.array([5e5, 4.2e6])
    assert judges.value_of(there, moved) == pytest.approx(judges.value_of(here, path), rel=1e-8)


def test_the_judges_spline_is_that_of_the_package():
    made = random_map(4)
    surface, random = made.surface(), np.random.default_rng(0)
    points = random.uniform((made.x[0], made.y[0]), (made.x[-1], made.y[-1]), (50, 2))
    ground = made.own_ground(surface)
    length = tp.curve_length(surface, points)
    assert judges.value_of(ground, points) == pytest.approx(length, rel=1e-9)


# Obstacles


def test_a_touch_is_seen_and_a_near_miss_is_none():
    box = shapely.box(4.0, 2.0, 5.0, 8.0)
    assert judges.touches([box], np.array([(3.0, 9.0), (5.0, 7.0)])) > 0.0
    assert judges.touches([box], np.array([(3.0, 9.0), (5.0, 7.0), (4.0, 9.0)])) > 0.0
    assert judges.touches([box], np.array([(3.0, 7.0), (5.0, 9.0)])) == 0.0  # at a corner
    assert judges.touches([box], np.array([(3.0, 8.0), (6.0, 8.0)])) == 1.0  # along an edge
    assert judges.touches([box], np.array([(3.0, 8.0 + 1e-9), (6.0, 8.0 + 1e-9)])) is None
    assert judges.touches([], np.array([(0.0, 0.0), (1.0, 1.0)])) is None


def test_boxes_are_the_squares_of_cells():
    blocked = np.zeros((3, 4), bool)
    blocked[2, 1] = True
    x, y = 10.0 * np.arange(4) + 5e5, 30.0 * np.arange(3)
    (box,) = judges.boxes_of(blocked, x, y)
    assert box.bounds == (5e5 + 5.0, 45.0, 5e5 + 15.0, 75.0)


# Search


@pytest.mark.parametrize(
    ("neighbours", "directions"),
    [(8, [(1, 0), (1, 1)]), (16, [(1, 0), (2, 1), (1, 1)])],
)
def test_distances_on_flat_ground_are_those_of_the_directions(neighbours, directions):
    start, goal = (2.0, 3.0), (8.0, 5.5)
    found = judges.reach(FLAT, judges.united([]), start, goal, neighbours)
    dx, dy = 6.0, 2.5
    for (ax, ay), (bx, by) in pairwise(directions):
        area = ax * by - ay * bx
        along = (dx * by - dy * bx) / area, (ax * dy - ay * dx) / area
        if min(along) >= 0.0:
            truth = along[0] * math.hypot(ax, ay) + along[1] * math.hypot(bx, by)
    assert found.distances[-1] == pytest.approx(truth)
    path = found.path()
    assert tuple(path[0]) == start
    assert tuple(path[-1]) == goal
    assert judges.value_of(FLAT, path) == pytest.approx(truth)


def test_walls_stop_the_search_and_a_door_lets_it_through():
    wall = [shapely.box(4.8, -1.0, 5.2, 6.8), shapely.box(4.8, 7.2, 5.2, 11.0)]
    open_ = judges.reach(FLAT, judges.united(wall), *map(tuple, ENDS))
    assert open_.found
    assert judges.touches(wall, open_.path()) is None
    shut = judges.reach(FLAT, judges.united([*wall, shapely.box(4.8, 6, 5.2, 8)]), *ENDS)
    assert not shut.found


def test_nothing_passes_where_two_boxes_meet_at_a_corner():
    boxes = [shapely.box(-1.0, 5.0, 5.0, 11.0), shapely.box(5.0, -1.0, 11.0, 5.0)]
    assert not judges.reach(FLAT, judges.united(boxes), (2.0, 2.0), (8.0, 8.0)).found


# The exact length


def cells(*rows):
    """A mask as a picture, the first row on top."""
    return np.array([[c == "#" for c in row] for row in rows[::-1]])


def test_around_one_cell():
    blocked = cells(".....", "..#..", ".....")
    # From the left to the right of it, over or under two corners.
    truth = 2.0 * math.hypot(1.5, 0.5) + 1.0
    assert judges.exact_length(blocked, (0.5, 1.5), (4.5, 1.5)) == pytest.approx(truth, rel=1e-12)
    assert judges.exact_length(blocked, (0.5, 0.5), (4.5, 0.5)) == 4.0
    assert judges.exact_length(blocked, (0.5, 1.0), (4.5, 1.0), 10.0) == 40.0  # along its edge


@pytest.mark.parametrize(
    "rows",
    [
        ("..#..", "..#..", "..#.."),
        ("...#.", "..#..", "..#.."),  # cells that meet at a corner
        (".....", "####.", ".#.#."),  # enclosed beside the edge of the grid
    ],
)
def test_what_is_closed_is_closed(rows):
    assert judges.exact_length(cells(*rows), (0.5, 0.5), (4.5, 2.5)) == math.inf


def test_the_edge_of_the_grid_is_no_gap():
    blocked = cells("...", ".#.", ".#.")
    around = math.hypot(0.5, 1.5) * 2.0 + 1.0
    assert judges.exact_length(blocked, (0.5, 0.5), (2.5, 0.5)) == pytest.approx(around)


def test_same_place():
    assert judges.exact_length(np.zeros((3, 3), bool), (0.5, 0.5), (0.5, 0.5)) < 1e-12


def without_contacts(blocked):
    """More cells blocked, until no two meet at a corner alone: the oracle lets paths through."""
    filled = blocked.copy()
    for j, i in np.argwhere(np.ones((blocked.shape[0] - 1, blocked.shape[1] - 1), bool)):
        four = filled[j : j + 2, i : i + 2]
        four |= four.sum() == 2 and four[0, 0] == four[1, 1]
    return filled if (filled == blocked).all() else without_contacts(filled)


@pytest.mark.parametrize("seed", range(12))
def test_the_exact_length_is_that_of_all_pairs_of_corners(seed):
    blocked = np.random.default_rng(seed).random((7, 9)) < 0.2
    blocked[:2, :2] = blocked[5:, 7:] = False
    blocked = without_contacts(blocked)
    boxes = list(judges.boxes_of(blocked, np.arange(9) + 0.5, np.arange(7) + 0.5))
    # The oracle would let paths through between an obstacle and the bounds.
    frame = shapely.box(-1, -1, 10, 8) - shapely.box(0, 0, 9, 7)
    start, goal = (0.5, 0.5), (8.5, 6.5)
    try:
        truth = visibility_length(start, goal, [*boxes, frame], (0.0, 0.0, 9.0, 7.0))
    except nx.NetworkXNoPath:
        truth = math.inf
    assert judges.exact_length(blocked, start, goal) == pytest.approx(truth, rel=1e-12)


@pytest.mark.slow
def test_the_exact_length_is_that_of_an_integer_visibility_graph():
    if not (REAL_MAPS / "random-100-33.map").exists():
        pytest.skip("the grid is not beside this clone")
    rows = (REAL_MAPS / "random-100-33.map").read_text(encoding="utf-8").split("map\n")[1].split()
    blocked = np.array([[letter != "." for letter in row] for row in rows])
    case = json.loads((REAL_MAPS / "random-100-33.exact.json").read_text(encoding="utf-8"))[0]
    # There places are counted from the centre of the first cell.
    ends = np.array([case["s"], case["t"]]) + 0.5
    assert judges.exact_length(blocked, *ends) == pytest.approx(case["exact"], rel=1e-12)


# Generators


@pytest.mark.parametrize("make", [random_map, pathological_map, random_grid])
def test_the_same_seed_makes_the_same_map(make):
    assert str(make(5)) == str(make(5))
    assert str(make(5)) != str(make(6))


def test_maps_are_of_all_kinds_and_their_ends_are_free():
    made = [random_map(seed) for seed in range(30)]
    assert {one.ground for one in made} == set(GROUNDS)
    assert any(one.mask is not None for one in made)
    assert any(one.cost is not None for one in made)
    assert any(one.polygons for one in made)
    assert {random_grid(seed).kind for seed in range(4)} == set(GRIDS)
    for one in made:
        assert shapely.disjoint(shapely.MultiPoint([one.start, one.goal]), one.walls()).all()
        one.problem()


def test_pathological_maps_have_all_that_is_bad():
    made = [pathological_map(seed) for seed in range(60)]
    assert any(one.start == one.goal for one in made)
    starts = [shapely.Point(one.start) for one in made]
    touched = [shapely.intersects(p, one.polygons).any() for p, one in zip(starts, made, strict=1)]
    assert any(touched)
    assert max(one.weight for one in made) == 1e6
    assert max(one.cell.max() / one.cell.min() for one in made) == 1e6


# The worker


def test_a_hang_and_a_death_end_one_try_alone():
    worker = Worker(work, prepare, patience=1.0)
    try:
        assert worker.tried(("sleep well",)) == ("well", None)
        assert worker.tried(("hang",))[1][:2] == ("hang", "hang")
        assert worker.tried(("die",))[1] == ("died", "die", "exit code 3")
        assert worker.tried(("sleep well",)) == ("well", None)
    finally:
        worker.stop()


@pytest.mark.skipif("sys.platform != 'linux'", reason="limits of memory are Linux's")
def test_a_child_has_a_limit_on_memory():
    worker = Worker(work, prepare, patience=30.0)
    try:
        assert worker.tried(("fill memory",)) == ("refused", None)
    finally:
        worker.stop()
