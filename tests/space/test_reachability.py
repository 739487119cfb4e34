"""Proofs that no path exists, against flood fill, and what planners make of them."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings, strategies as st
from scipy import ndimage

import terrapath as tp
from terrapath.planners import PLANNERS
from terrapath.surface.bounds import Bounds

SIDE = 10.0
BOUNDS = Bounds(0.0, 0.0, SIDE, SIDE)
A, B = (1.0, 1.0), (9.0, 9.0)
seeds = st.integers(0, 2**32 - 1)


def separates(obstacles, a=A, b=B, bounds=BOUNDS):
    """The answer, which must be the same both ways."""
    space = tp.FreeSpace(bounds, obstacles)
    found = space.separates(a, b)
    assert space.separates(b, a) is found
    return found


# By hand


def ring(x, y, inner, outer):
    centre = shapely.Point(x, y)
    return centre.buffer(outer) - centre.buffer(inner)


WALL = shapely.box(4, -1, 5, 11)
TWO_TRIANGLES = [
    shapely.Polygon([(-1, 4), (5, 5), (-1, 6)]),
    shapely.Polygon([(11, 4), (5, 5), (11, 6)]),
]
ROOMS = shapely.box(6, 6, 10, 10) - shapely.union_all(
    [shapely.box(6.5, 6.5, 7.5, 9.5), shapely.box(8, 8, 9.5, 9.5)]
)
SEPARATED = {
    "a wall over the edge of the bounds": [WALL],
    "a wall from edge to edge": [shapely.LineString([(4, 0), (5, 10)])],
    "a wall along other edges": [shapely.LineString([(0, 5), (5, 5), (5, 0)])],
    "a bent wall": [shapely.LineString([(3, -1), (7, 4), (2, 6), (6, 11)])],
    "two walls that cross": [
        shapely.LineString([(4, -1), (6, 7)]),
        shapely.LineString([(4, 11), (6, 3)]),
    ],
    "polygons that touch in a point": TWO_TRIANGLES,
    "polygons that share an edge": [shapely.box(4, -1, 5, 5), shapely.box(4.5, 5, 6, 11)],
    "a corner on an edge": [shapely.box(-1, 4, 5, 6), shapely.Polygon([(5, 5), (11, 3), (11, 7)])],
    "a ring": [ring(9, 9, 0.5, 0.7)],
    "a ring around the other": [ring(1, 1, 0.5, 0.7)],
    "a closed line": [shapely.LinearRing([(8, 8), (9.5, 8), (9.5, 9.5), (8, 9.5)])],
    "a room among rooms": [ROOMS],
    "nested rings": [ring(9, 9, 0.2, 0.3), ring(9, 9, 0.5, 0.7), ring(9, 9, 0.8, 0.9)],
    "a ring that is cut by the edge of the bounds": [ring(10, 10, 2, 2.5)],
    "several parts": [shapely.MultiPolygon([WALL, shapely.box(7, 7, 8, 8)])],
    "discs that overlap": [tp.Circle(x, 5.0, 0.6) for x in range(11)],
    "a disc and two walls": [
        tp.Circle(5.0, 5.0, 1.0),
        shapely.LineString([(-1, 5), (4.5, 5)]),
        shapely.LineString([(11, 5), (5.5, 5)]),
    ],
    "a disc over the edge and a wall to it": [
        tp.Circle(5.0, 10.0, 1.0),
        shapely.LineString([(5, -1), (5, 9.5)]),
    ],
    "walls far beyond the bounds": [shapely.box(-1e6, 4, 1e6, 5)],
}
NARROW = shapely.LineString([A, B]).buffer(0.001)
JOINED = {
    "nothing": [],
    "a wall that ends": [shapely.box(4, -1, 5, 9)],
    "a wall that nearly ends": [shapely.LineString([(4, 0), (4, 10 - 1e-6)])],
    "polygons that nearly touch": [
        TWO_TRIANGLES[0],
        shapely.Polygon([(11, 4), (5 + 1e-6, 5), (11, 6)]),
    ],
    "a ring elsewhere": [ring(5, 5, 1, 2)],
    "a ring around both": [ring(5, 5, 7.5, 7.6)],
    "a ring with a slit": [ring(9, 9, 0.5, 0.7) - shapely.box(9, 9, 10, 9 + 1e-6)],
    "two walls side by side": [shapely.box(4, -1, 5, 9), shapely.box(6, 1, 7, 11)],
    "a wall around the other side of the edge": [shapely.LineString([(-1, 5), (-1, 11), (5, 11)])],
    "discs that nearly touch": [tp.Circle(x, 5.0, 0.5 - 1e-6) for x in range(11)],
    "two holes of the same obstacle, joined": [
        shapely.box(0, 0, 10, 10)
        - shapely.union_all([shapely.Point(A).buffer(0.5), shapely.Point(B).buffer(0.5), NARROW])
    ],
}
# No path exists, or none that a number could describe, but rounding leaves a doubt.
IN_DOUBT = {
    "a gap of rounding": [shapely.LineString([(4, 0), (4, 10 - 2e-15)])],
    "walls within rounding of one another": [
        shapely.LineString([(4, -1), (4, 11)]),
        shapely.LineString([(4 + 4e-15, 3), (4 + 4e-15, 5)]),
    ],
    "kissing discs": [tp.Circle(x, 5.0, 0.5) for x in range(11)],
    "walls that a lattice of numbers is too coarse for": [shapely.box(-1e15, 4, 1e15, 5)],
}


@pytest.mark.parametrize("name", SEPARATED)
def test_points_on_two_sides_of_the_walls_are_separated(name):
    assert separates(SEPARATED[name])


@pytest.mark.parametrize("name", SEPARATED)
@pytest.mark.parametrize("move", [(5e5, 4e6), (-1234567.0, 1e7)])
def test_large_map_coordinates_change_nothing(name, move):
    moved = [
        tp.Circle(o.x1 + move[0], o.x2 + move[1], o.radius)
        if isinstance(o, tp.Circle)
        else shapely.transform(o, lambda points: np.round(points, 6) + move)
        for o in SEPARATED[name]
    ]
    bounds = Bounds(move[0], move[1], move[0] + SIDE, move[1] + SIDE)
    a, b = (tuple(np.add(point, move)) for point in (A, B))
    assert separates(moved, a, b, bounds)


@pytest.mark.parametrize("name", [*JOINED, *IN_DOUBT])
def test_points_that_a_path_may_join_are_not_separated(name):
    assert not separates((JOINED | IN_DOUBT)[name])


def test_points_on_the_edge_of_the_bounds_are_where_their_neighbours_are():
    corners = [(0.0, 0.0), (0.0, 10.0), (10.0, 0.0), (10.0, 10.0)]
    for wall in (WALL, shapely.LineString([(4, 0), (5, 10)])):
        for a in corners:
            for b in corners:
                assert separates([wall], a, b) is (a[0] != b[0])
    assert separates([WALL], (3.0, 0.0), (6.0, 10.0))
    assert not separates([WALL], (3.0, 0.0), (3.5, 10.0))


def test_a_wall_along_the_edge_of_the_bounds_separates_nothing():
    assert not separates([shapely.LineString([(0, 0), (0, 10), (10, 10)])], (1, 1), (5, 5))


def test_the_order_and_the_number_of_the_points_do_not_matter():
    assert not separates([WALL], A, A)
    assert not separates([WALL], B, B)


@pytest.mark.parametrize("place", [(4.5, 5.0), (4.0, 5.0), (20.0, 1.0)])
def test_a_point_that_is_not_free_is_refused(place):
    space = tp.FreeSpace(BOUNDS, [WALL])
    for ends in ((place, B), (A, place)):
        with pytest.raises(tp.InputError, match=f"=\\({place[0]:g}, {place[1]:g}\\) is"):
            space.separates(*ends)


def test_more_walls_than_can_be_looked_at_prove_nothing(monkeypatch):
    assert separates([WALL])
    monkeypatch.setattr("terrapath.space.reachability.MOST_CORNERS", 4)
    assert not separates([WALL])


# Mazes


def maze(size, random):
    """A perfect maze: from every cell exactly one way to every other. Walls (m, 2, 2)."""
    seen, stack = {(0, 0)}, [(0, 0)]
    standing = {((i, j), (i + 1, j)) for i in range(size - 1) for j in range(size)}
    standing |= {((i, j), (i, j + 1)) for i in range(size) for j in range(size - 1)}
    while stack:
        i, j = stack[-1]
        around = [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]
        fresh = [c for c in around if c not in seen and min(c) >= 0 and max(c) < size]
        if not fresh:
            stack.pop()
            continue
        other = fresh[random.integers(len(fresh))]
        standing.discard(tuple(sorted([(i, j), other])))
        seen.add(other)
        stack.append(other)
    return [
        [(i + 1, j), (i + 1, j + 1)] if other[0] > i else [(i, j + 1), (i + 1, j + 1)]
        for (i, j), other in sorted(standing)
    ]


@pytest.mark.parametrize("size", [5, 12, 40])
def test_mazes(size):
    random = np.random.default_rng(size)
    walls = maze(size, random)
    lines = [shapely.LineString(wall) for wall in walls]
    bounds = Bounds(0.0, 0.0, size, size)
    a, b = (0.5, 0.5), (size - 0.5, size - 0.5)
    assert not separates(lines, a, b, bounds)
    # Rooms without a way in: a wall on every open side of the last cell.
    corner = shapely.LineString([(size - 1, size), (size - 1, size - 1), (size, size - 1)])
    assert separates([*lines, corner], a, b, bounds)
    # A maze with a wall taken away, and the same maze with a wall all across it.
    assert not separates(lines[1:], a, b, bounds)
    across = shapely.LineString([(0, size / 2 + 0.25), (size, size / 2 - 0.25)])
    assert separates([*lines, across], a, b, bounds)


# Random polygons against a flood fill that knows which cells are surely free, surely blocked


def random_obstacles(random):
    made = []
    for _ in range(random.integers(2, 14)):
        kind = random.integers(3)
        if kind == 0:
            x, y = random.uniform(-1, 9, 2)
            made.append(shapely.box(x, y, x + random.uniform(0.5, 9), y + random.uniform(0.5, 2)))
        elif kind == 1:
            inner = random.uniform(0.5, 3)
            made.append(ring(*random.uniform(0, 10, 2), inner, inner + random.uniform(0.4, 1)))
        else:
            line = shapely.LineString(random.uniform(-2, 12, (3, 2)))
            made.append(line.buffer(random.uniform(0.3, 0.6)))
    if random.integers(2):
        made += [tp.Circle(*map(float, random.uniform(0, 10, 2)), 1.5) for _ in range(3)]
    return made


def as_polygon(obstacle):
    if isinstance(obstacle, tp.Circle):
        return shapely.Point(obstacle.x1, obstacle.x2).buffer(obstacle.radius, quad_segs=256)
    return obstacle


def flood(obstacles, cells=100):
    """(surely joined, perhaps joined) parts of a picture of the region, (cells, cells) each."""
    corners = np.linspace(0.0, SIDE, cells + 1)
    x, y = np.meshgrid(corners[:-1], corners[:-1])
    squares = shapely.box(x, y, x + SIDE / cells, y + SIDE / cells)
    ground = shapely.union_all([as_polygon(o) for o in obstacles])
    shapely.prepare(ground)
    wholly_free = shapely.disjoint(ground, shapely.buffer(squares, 1e-3))
    # A path comes only through squares that are not wholly covered, from corner to corner.
    not_covered = ~shapely.covers(shapely.buffer(ground, -1e-2), squares)
    every_neighbour = np.ones((3, 3), bool)
    return ndimage.label(wholly_free)[0], ndimage.label(not_covered, every_neighbour)[0]


def random_ends(obstacles, random):
    space = tp.FreeSpace(BOUNDS, obstacles)
    points = [tuple(map(float, p)) for p in random.uniform(0.05, SIDE - 0.05, (60, 2))]
    return [point for point in points if space.blocker(point) is None]


@pytest.mark.slow
def test_random_obstacles_separate_what_flood_fill_finds_apart():
    random = np.random.default_rng(11)
    apart = joined = 0
    for _ in range(40):
        obstacles = random_obstacles(random)
        space = tp.FreeSpace(BOUNDS, obstacles)
        surely, perhaps = flood(obstacles)
        for a, b in np.reshape(random_ends(obstacles, random)[:16], (-1, 2, 2)).tolist():
            (i, j), (k, m) = (np.array([a, b])[:, ::-1] * 10.0).astype(int)
            found = space.separates(tuple(a), tuple(b))
            if surely[i, j] == surely[k, m] > 0:
                joined += 1
                assert not found, (obstacles, a, b)
            if perhaps[i, j] != perhaps[k, m]:
                apart += 1
                assert found, (obstacles, a, b)
    assert apart > 40
    assert joined > 40


# Masks


def parts_of(blocked, rows, columns):
    """Parts of the free quarters of cells between the given quarter rows and columns.

    ``blocked`` has two free cells around it, so that quarters beyond the grid are there too.
    """
    quarters = np.kron(blocked, np.ones((2, 2), bool))
    return ndimage.label(~quarters[rows[0] : rows[1], columns[0] : columns[1]])[0]


@given(
    seed=seeds,
    place=st.sampled_from([(0.0, 0.0), (5e5, 4e6), (-1234567.0, 1e7)]),
    size=st.sampled_from([1.0, 0.25, 30.0, 0.1]),
    kind=st.sampled_from(["mask", "boxes too", "two grids", "lines too"]),
)
@example(seed=181, place=(-1234567.0, 1e7), size=0.1, kind="mask")
@settings(deadline=None, max_examples=250)
def test_masks_separate_what_flood_fill_finds_apart(seed, place, size, kind):
    random = np.random.default_rng(seed)
    ny, nx = random.integers(2, 14, 2)
    blocked = random.uniform(size=(ny, nx)) < random.choice([0.2, 0.4, 0.6])
    wide = np.pad(blocked, 2)
    # Bounds from quarter to quarter: on borders of cells and through them, within and beyond.
    rows = np.sort(random.choice(2 * (ny + 4) + 1, 2, replace=False))
    columns = np.sort(random.choice(2 * (nx + 4) + 1, 2, replace=False))
    corner = np.array(place)
    low, high = (corner + size * (np.array([columns[k], rows[k]]) / 2.0 - 2.0) for k in (0, 1))
    bounds = Bounds(*map(float, low), *map(float, high))
    obstacles = as_obstacles(blocked, corner, size, kind, random)
    parts = parts_of(wide, rows, columns)
    free = np.argwhere(parts > 0)
    if len(free) == 0:
        return
    space = tp.FreeSpace(bounds, obstacles)
    for one, other in free[random.integers(len(free), size=(6, 2))]:
        a, b = (
            tuple(map(float, low + size * (quarter[::-1] + random.uniform(0.1, 0.9, 2)) / 2.0))
            for quarter in (one, other)
        )
        apart = bool(parts[tuple(one)] != parts[tuple(other)])
        # Tenths are not exact: boxes, cells and bounds that should touch may miss by rounding.
        bounds_touch = (rows % 2 == 0).any() or (columns % 2 == 0).any()
        if size != 0.1 or (kind == "mask" and not bounds_touch):
            assert space.separates(a, b) is apart
        else:
            assert apart or not space.separates(a, b)


def as_obstacles(blocked, corner, size, kind, random):
    """The same blocked cells as one mask, or dealt out to several obstacles."""
    ny, nx = blocked.shape
    x, y = (corner[k] + size * (np.arange((nx, ny)[k]) + 0.5) for k in (0, 1))
    dealt = random.uniform(size=blocked.shape) < 0.5
    cells = [
        shapely.box(
            *(corner + size * np.array([i, j])), *(corner + size * np.array([i + 1, j + 1]))
        )
        for j, i in np.argwhere(blocked & dealt)
    ]
    if kind == "boxes too":
        return [tp.Mask(blocked & ~dealt, x, y), *cells]
    if kind == "lines too":
        return [tp.Mask(blocked & ~dealt, x, y), *(shapely.boundary(c) for c in cells), *cells]
    if kind == "two grids":
        far = np.pad(blocked & dealt, ((1, 0), (1, 0)))
        more_x, more_y = (np.concatenate([[axis[0] - size], axis]) for axis in (x, y))
        return [tp.Mask(blocked & ~dealt, x, y), tp.Mask(far, more_x, more_y)]
    return [tp.Mask(blocked, x, y)]


def test_a_pocket_of_one_cell_is_closed_by_its_sides_and_open_to_none_of_its_corners():
    blocked = np.zeros((5, 5), bool)
    blocked[[1, 3, 2, 2], [2, 2, 1, 3]] = True
    centres = np.arange(5) * 2.0 + 1.0
    mask = tp.Mask(blocked, centres, centres)
    assert separates([mask], (5.0, 5.0), (1.0, 1.0))
    assert separates([mask, tp.Circle(9.0, 9.0, 0.5)], (5.0, 5.0), (1.0, 1.0))
    blocked[2, 3] = False
    assert not separates([tp.Mask(blocked, centres, centres)], (5.0, 5.0), (1.0, 1.0))


def test_diagonal_cells_block():
    centres = np.arange(10) + 0.5
    diagonal = np.eye(10, dtype=bool)
    assert separates([tp.Mask(diagonal, centres, centres)], (1.0, 9.0), (9.0, 1.0))
    diagonal[5, 5] = False
    holed = tp.Mask(diagonal, centres, centres)
    assert not separates([holed], (1.0, 9.0), (9.0, 1.0))
    assert not separates([holed, shapely.box(5.2, 5.2, 5.8, 5.8)], (1.0, 9.0), (9.0, 1.0))
    assert separates([holed, shapely.LineString([(5, 5), (6, 6)])], (1.0, 9.0), (9.0, 1.0))
    short = shapely.LineString([(5, 5), (6 - 1e-6, 6 - 1e-6)])
    assert not separates([holed, short], (1.0, 9.0), (9.0, 1.0))


def test_beyond_its_grid_a_mask_blocks_nothing():
    mask = tp.Mask(np.ones((2, 2), bool), [4.5, 5.5], [1.0, 3.0])
    assert not separates([mask])
    assert separates([mask], (3.0, 1.0), (8.0, 1.0), Bounds(0.0, 0.5, 10.0, 3.5))


@pytest.mark.parametrize("size", [0.1, 0.3, 1.0 / 3.0, 0.7])
@pytest.mark.parametrize("both", [False, True], ids=["mask", "mask and line"])
def test_cells_beyond_bounds_that_end_on_their_border_are_not_there_whatever_rounding_does(
    size, both
):
    blocked = np.zeros((16, 5), bool)
    centres = [size * (np.arange(count) + 0.5) for count in (5, 16)]
    for first in range(8):
        last = 15 - first
        blocked[:] = False
        blocked[first:last, 2] = True  # a wall of cells from edge to edge of the bounds
        obstacles = [tp.Mask(blocked, *centres)]
        if both:  # a line takes over half way
            blocked[8:] = False
            line = shapely.LineString([(2.5 * size, 7.5 * size), (2.5 * size, last * size)])
            obstacles = [tp.Mask(blocked, *centres), line]
        bounds = Bounds(0.0, size * first, 5 * size, size * last)
        a, b = ((size * k, 7.4 * size) for k in (0.5, 4.5))
        assert separates(obstacles, a, b, bounds)
        # A way that is there, however narrow, is not overlooked.
        wider = Bounds(0.0, size * first, 5 * size, size * (last + 1e-3))
        assert not separates(obstacles, a, b, wider)


# What planners make of it


FLAT = tp.Surface.from_peaks([[]])
OPTIONS = {"geodesic-traversal": {"directions": 20}}


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("obstacles", [[ring(9, 9, 0.5, 0.7)], [WALL, tp.Circle(1, 8, 1)]])
def test_every_planner_says_at_once_that_the_goal_is_unreachable(name, obstacles):
    problem = tp.Problem(FLAT, A, B, BOUNDS, obstacles)
    seen = []
    solution = tp.plan(problem, name, callback=seen.append, **OPTIONS.get(name, {}))
    assert solution.status is tp.Status.UNREACHABLE
    assert solution.stopped_by.startswith(
        "start and goal lie in different parts of the free space: "
    )
    assert solution.planner == name
    assert solution.path is solution.cost is solution.length is solution.gap is None
    assert solution.samples == 0
    assert solution.seconds > 0.0
    assert seen == []
    assert "no path exists" in solution.status.message
    assert "unreachable" in repr(solution)


@pytest.mark.parametrize("name", ["rrt", "rrt-star-r", "dijkstra", "a-star"])
def test_where_there_is_no_proof_there_is_no_claim(name):
    slit = ring(9, 9, 0.5, 0.7) - shapely.box(9, 9, 10, 9 + 1e-9)
    solution = tp.plan(tp.Problem(FLAT, A, B, BOUNDS, [slit]), name, time_limit=5.0)
    assert solution.status is tp.Status.NOT_FOUND
    assert solution.samples > 0
