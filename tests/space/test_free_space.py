"""Free space against shapely, and the checks of a problem's start, goal and bounds."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from shapely import affinity

import occupancy
import terrapath as tp
from common import FLAT
from oracles import (
    boxes_of_mask,
    clearance_by_shapely,
    is_blocked,
    mask_is_free_by_shapely,
    segment_is_free_by_shapely,
)
from terrapath.space.free_space import index_grid
from terrapath.surface.bounds import Bounds

BOUNDS = Bounds(-1.0, -1.0, 11.0, 11.0)
DOUBT = 1e-6  # nearer than this the kernel may say "blocked"
seeds = st.integers(0, 2**32 - 1)


def box_with_hole(random, lattice):
    x, y = random.integers(-2, 9, 2)
    width, height = random.integers(2, 6, 2)
    outer = shapely.box(x, y, x + width, y + height)
    if lattice and width > 2 and height > 2:
        return outer - shapely.box(x + 1, y + 1, x + width - 1, y + height - 1)
    return outer - shapely.box(x + 0.3, y + 0.4, x + width - 0.7, y + height - 0.5)


def hull(random, lattice):
    corners = random.uniform(-2, 12, 2) + random.uniform(-3, 3, (int(random.integers(3, 9)), 2))
    return shapely.MultiPoint(np.round(corners) if lattice else corners).convex_hull


def star(random, lattice):
    """A polygon that is not convex: corners around a centre, at uneven distances."""
    angle = np.sort(random.uniform(0, 2 * np.pi, int(random.integers(4, 12))))
    corners = random.uniform(0, 10, 2) + random.uniform(0.3, 3, (len(angle), 1)) * np.column_stack(
        [np.cos(angle), np.sin(angle)]
    )
    return shapely.Polygon(np.round(corners) if lattice else corners)


def line(random, lattice):
    corners = random.uniform(-2, 12, (int(random.integers(2, 6)), 2))
    return shapely.LineString(np.round(corners) if lattice else corners)


def random_geometries(random, lattice, most=12):
    makers = [box_with_hole, hull, star, line]
    made = [makers[random.integers(4)](random, lattice) for _ in range(random.integers(1, most))]
    return [g for g in made if g.is_valid and g.geom_type in ("Polygon", "LineString")]


def random_circles(random, lattice):
    made = np.column_stack([random.uniform(-1, 11, (3, 2)), random.uniform(0.1, 3, 3)])
    made = np.maximum(np.round(made), [-1, -1, 1]) if lattice else made
    return [tuple(map(float, row)) for row in made[: random.integers(0, 4)]]


def random_segments(random, lattice, count=150):
    """Ends anywhere, near together, one straight above the other, or the same point."""
    a = random.uniform(-1, 11, (count, 2))
    b = random.uniform(-1, 11, (count, 2))
    kind = random.integers(0, 6, count)
    near = a + random.normal(size=(count, 2)) * 10.0 ** random.uniform(-9, 0, (count, 1))
    b[kind == 0] = near[kind == 0]
    b[kind == 1, 0] = a[kind == 1, 0]
    b[kind == 2, 1] = a[kind == 2, 1]
    b[kind == 3, 1] = a[kind == 3, 1] + 1e-9 * random.normal(size=(kind == 3).sum())
    if lattice:
        a, b = np.round(2 * a) / 2, np.round(2 * b) / 2
    return np.clip(a, -1, 11), np.clip(b, -1, 11)


def check(geometries, circles, a, b, bounds=BOUNDS):
    """One end free; then never free where shapely sees a touch, nor blocked far from one."""
    obstacles = [*geometries, *(tp.Circle(*c) for c in circles)]
    space = tp.FreeSpace(bounds, obstacles)
    starts_free = segment_is_free_by_shapely(geometries, circles, a, a)
    a, b = a[starts_free], b[starts_free]
    expected = segment_is_free_by_shapely(geometries, circles, a, b)
    clearance = clearance_by_shapely(geometries, circles, a, b)
    for start, end in ((a, b), (b, a)):
        found = space.segments_are_free(start, end)
        wrongly_free = found & ~expected
        assert not wrongly_free.any(), (start[wrongly_free][0], end[wrongly_free][0])
        wrongly_blocked = ~found & (clearance > DOUBT)
        assert not wrongly_blocked.any(), (start[wrongly_blocked][0], end[wrongly_blocked][0])
    return found


# Segments against polygons, lines and circles


@pytest.mark.parametrize("lattice", [False, True], ids=["anywhere", "lattice"])
@given(seed=seeds)
@settings(deadline=None, max_examples=120)
def test_a_segment_is_free_where_shapely_finds_it_disjoint_from_all_obstacles(lattice, seed):
    random = np.random.default_rng(seed)
    geometries, circles = random_geometries(random, lattice), random_circles(random, lattice)
    check(geometries, circles, *random_segments(random, lattice))


@given(seed=seeds, x=st.sampled_from([0.0, 5e5, -7e6]), y=st.sampled_from([4e6, 8388608.0, -1e7]))
@settings(deadline=None, max_examples=60)
def test_large_map_coordinates_change_nothing(seed, x, y):
    random = np.random.default_rng(seed)
    lattice = bool(random.integers(2))
    geometries = [
        affinity.translate(shapely.set_precision(g, 2.0**-20), x, y)
        for g in random_geometries(random, lattice)
    ]
    geometries = [g for g in geometries if g.is_valid and not g.is_empty]
    circles = [(cx + x, cy + y, r) for cx, cy, r in random_circles(random, lattice)]
    a, b = random_segments(random, lattice)
    bounds = Bounds(x - 1, y - 1, x + 11, y + 11)
    a, b = (np.clip(p + np.array([x, y]), bounds[:2], bounds[2:]) for p in (a, b))
    check(geometries, circles, a, b, bounds)


@pytest.mark.parametrize(("items", "side"), [(0, 1), (7, 1), (8, 2), (200, 10), (10**9, 1024)])
def test_the_index_has_a_cell_for_every_two_items_up_to_its_most(items, side):
    grid = index_grid(Bounds(-1.0, -2.0, 11.0, 2.0), items)
    assert (grid.nx, grid.ny) == (side, side)
    corner = (grid.x0 + grid.nx * grid.dx, grid.y0 + grid.ny * grid.dy)
    assert corner == pytest.approx((11.0, 2.0), rel=1e-12)


@given(seed=seeds)
@settings(deadline=None, max_examples=8)
def test_segments_across_many_cells_of_the_index_see_every_obstacle(seed):
    random = np.random.default_rng(seed)
    centres = random.uniform(-1, 11, (600, 2))
    half = random.uniform(0.001, 0.03, (600, 2))
    boxes = list(shapely.box(*(centres - half).T, *(centres + half).T))
    circles = [(*map(float, c), 0.02) for c in random.uniform(-1, 11, (100, 2))]
    a, b = random_segments(random, lattice=False, count=300)
    found = check([shapely.MultiPolygon(boxes[:1]), *boxes[1:]], circles, a, b)
    assert found.any()
    assert not found.all()


@given(seed=seeds, scale=st.sampled_from([1e-3, 1e3, 1e6]))
@settings(deadline=None, max_examples=30)
def test_the_unit_of_the_map_does_not_matter(seed, scale):
    random = np.random.default_rng(seed)
    geometries = [
        affinity.scale(g, scale, scale, origin=(0, 0)) for g in random_geometries(random, True)
    ]
    a, b = (scale * p for p in random_segments(random, lattice=True))
    bounds = Bounds(*(scale * np.array(BOUNDS)))
    space = tp.FreeSpace(bounds, geometries)
    free = segment_is_free_by_shapely(geometries, [], a, a)
    a, b = a[free], b[free]
    found = space.segments_are_free(a, b)
    assert not (found & ~segment_is_free_by_shapely(geometries, [], a, b)).any()
    assert not (~found & (clearance_by_shapely(geometries, [], a, b) > DOUBT * scale)).any()


def test_a_touch_is_a_hit():
    space = tp.FreeSpace(BOUNDS, [shapely.box(2, 2, 4, 4), tp.Circle(8, 8, 1)])
    touching = [
        ((0, 3), (3, 6)),  # passes by: free
        ((0, 0), (2, 2)),  # ends at a corner
        ((1, 5), (5, 1)),  # passes through it
        ((2, 0), (2, 8)),  # runs along an edge
        ((2, 0), (2, 2)),
        ((0, 6), (4, 2)),  # through a corner
        ((7, 0), (7, 10)),  # tangent to the circle
        ((8, 0), (8, 7)),  # ends on it
    ]
    a, b = np.array(touching, float).swapaxes(0, 1)
    assert space.segments_are_free(a, b).tolist() == [True, *[False] * 7]


def test_a_hole_is_free_and_its_border_is_not():
    ring = shapely.box(0, 0, 10, 10) - shapely.box(2, 2, 8, 8)
    space = tp.FreeSpace(BOUNDS, [ring])
    assert space.blocker((5, 5)) is None
    assert space.blocker((2, 5)) == "inside an obstacle"
    assert space.blocker((1, 5)) == "inside an obstacle"
    ends = np.array([[7.5, 5.0], [8.0, 5.0], [9.0, 5.0], [10.5, 5.0]])
    assert space.segments_are_free(np.full((4, 2), 5.0), ends).tolist() == [True] + [False] * 3


@pytest.mark.parametrize("reach", [1e3, 1e9, 1e15, 1e20, 1e30])
def test_an_obstacle_that_reaches_far_beyond_the_bounds_blocks(reach):
    walls = [
        shapely.box(-reach, 4, reach, 5),
        shapely.LineString([(-reach, 4), (reach, 4)]),
        tp.Circle(5.0, 4.0 - reach, reach),
    ]
    for wall in walls:
        space = tp.FreeSpace(BOUNDS, [wall, shapely.box(9, 9, 9.5, 9.5)])
        crossing = space.segments_are_free([[5.0, 8.0]], [[5.0, 0.0]])
        assert not crossing.any(), wall


def test_without_obstacles_all_is_free():
    space = tp.FreeSpace(BOUNDS)
    assert space.segments_are_free([[0, 0]], [[10, 10]]).all()
    assert space.segments_are_free(np.empty((0, 2)), np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (np.zeros((3, 2)), np.zeros((2, 2))),
        (np.zeros((2, 2)), np.zeros((3, 2))),
        ((0, 0), (1, 1)),
        (np.zeros((2, 3)), np.zeros((2, 3))),
        ([[0, np.nan]], [[1, 1]]),
    ],
)
def test_what_are_not_two_lists_of_as_many_points_is_refused(a, b):
    with pytest.raises(tp.InputError):
        tp.FreeSpace(BOUNDS, [shapely.box(2, 2, 4, 4)]).segments_are_free(a, b)


# Masks


def random_mask(random, x0=0.0, y0=0.0, size=1.0):
    rows, columns = random.integers(2, 12, 2)
    blocked = random.uniform(size=(rows, columns)) < random.choice([0.05, 0.3, 0.7])
    return tp.Mask(blocked, x0 + size * np.arange(columns), y0 + 0.5 * size * np.arange(rows))


@given(
    seed=seeds,
    place=st.sampled_from([(0.0, 0.0), (5e5, 4e6), (-1234567.0, 1e7)]),
    size=st.sampled_from([1.0, 0.25, 32.0]),
    lattice=st.booleans(),
)
@settings(deadline=None, max_examples=150)
def test_a_segment_is_free_where_shapely_finds_no_blocked_cell_on_it(seed, place, size, lattice):
    random = np.random.default_rng(seed)
    mask = random_mask(random, *place, size)
    bounds = Bounds(*(mask.x[0] - size, mask.y[0] - size, mask.x[-1] + size, mask.y[-1] + size))
    a, b = random_segments(random, lattice=False)
    a, b = (p / 12 * (bounds.width, bounds.height) for p in (a + 1, b + 1))
    if lattice:  # corners, centres and borders of cells
        steps = size * np.array([0.5, 0.25])
        a, b = np.round(a / steps) * steps, np.round(b / steps) * steps
    a, b = (np.clip(p + bounds[:2], bounds[:2], bounds[2:]) for p in (a, b))
    starts_free = mask_is_free_by_shapely(mask, a, a)
    a, b = a[starts_free], b[starts_free]
    found = tp.FreeSpace(bounds, [mask]).segments_are_free(a, b)
    wrongly_free = found & ~mask_is_free_by_shapely(mask, a, b)
    assert not wrongly_free.any(), (a[wrongly_free][0], b[wrongly_free][0])
    clearance = clearance_by_shapely(boxes_of_mask(mask), [], a, b)
    wrongly_blocked = ~found & (clearance > DOUBT * size)
    assert not wrongly_blocked.any(), (a[wrongly_blocked][0], b[wrongly_blocked][0])


@given(seed=seeds)
@settings(deadline=None, max_examples=60)
def test_a_mask_covers_its_closed_blocked_cells(seed):
    random = np.random.default_rng(seed)
    mask = random_mask(random)
    places = random.uniform((-1, -1), (mask.x[-1] + 1, mask.y[-1] + 1), (60, 2))
    places[30:] = np.round(places[30:] / [0.5, 0.25]) * [0.5, 0.25]  # borders and corners
    covered = ~mask_is_free_by_shapely(mask, places, places)
    assert [is_blocked(mask, place) for place in places] == covered.tolist()


def test_a_place_that_a_mask_leaves_free_can_be_left():
    """What ``blocker`` lets a problem start from, a segment must be able to start from."""
    mask = tp.Mask(np.eye(4, dtype=bool), np.arange(4.0), np.arange(4.0))
    space = tp.FreeSpace(Bounds(-1, -1, 4, 4), [mask])
    places = np.stack(np.meshgrid(*[np.arange(-1, 4.25, 0.25)] * 2), axis=-1).reshape(-1, 2)
    free = [space.blocker(tuple(place)) is None for place in places]
    assert space.segments_are_free(places, places).tolist() == free


def test_several_masks_block_together_with_other_obstacles():
    cell = np.array([[True, False], [False, False]])
    masks = [tp.Mask(cell, [x, x + 1], [5, 6]) for x in (1, 4)]
    space = tp.FreeSpace(BOUNDS, [*masks, shapely.box(7, 5, 8, 6)])
    a = np.array([[x, 0.0] for x in (1, 2, 4, 5, 7.5, 9)])
    assert space.segments_are_free(a, a + np.array([0, 10])).tolist() == [False, True] * 3


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        ((np.zeros((3, 3)), range(3), range(3)), "float64"),
        ((np.zeros(3, bool), range(3), range(3)), "(3,)"),
        ((np.zeros((1, 3), bool), range(3), range(1)), "(1, 3)"),
        ((np.zeros((3, 4), bool), range(3), range(4)), "(3,)"),
        ((np.zeros((3, 3), bool), [0, 1, 3], range(3)), "x of a mask"),
        ((np.zeros((3, 3), bool), range(3), [2, 1, 0]), "y of a mask"),
        ((np.zeros((3, 3), bool), [0, np.nan, 2], range(3)), "nan"),
    ],
)
def test_masks_that_make_no_sense_are_refused(arguments, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.Mask(*arguments)
    assert shown in str(caught.value)
    assert "\n" not in str(caught.value)


# Obstacles that are none


with np.errstate(invalid="ignore"):
    NOWHERE = shapely.LineString([(0, 0), (np.nan, 1)])
BOWTIE = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])


@pytest.mark.parametrize(
    ("obstacle", "shown"),
    [
        (BOWTIE, "obstacles[1] is not valid: Self-intersection"),
        (shapely.MultiPolygon([shapely.box(0, 0, 2, 2), shapely.box(1, 1, 3, 3)]), "not valid"),
        (shapely.Point(1, 1), "obstacles[1] holds a Point"),
        (shapely.MultiPoint([(1, 1), (2, 2)]), "holds a Point"),
        (shapely.GeometryCollection([shapely.box(0, 0, 1, 1), shapely.Point(5, 5)]), "a Point"),
        (NOWHERE, "not valid"),
        ((1, 2, 3), "obstacles[1] is a tuple"),
        ("wall", "obstacles[1] is a str"),
        (None, "obstacles[1] is a NoneType"),
    ],
)
def test_what_cannot_be_an_obstacle_is_refused_with_its_place_and_the_remedy(obstacle, shown):
    with pytest.raises(tp.InputError) as caught:
        tp.FreeSpace(BOUNDS, [shapely.box(9, 9, 10, 10), obstacle])
    assert shown in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "circle",
    [(0, 0, 0), (0, 0, -1), (0, 0, np.nan), (0, 0, np.inf), (np.nan, 0, 1), (0, np.inf, 1)],
)
def test_circles_without_a_place_or_a_size_are_refused(circle):
    with pytest.raises(tp.InputError):
        tp.Circle(*circle)


def test_empty_geometries_block_nothing_and_collections_block_with_all_parts():
    empty = [shapely.Polygon(), shapely.GeometryCollection(), shapely.MultiPolygon()]
    space = tp.FreeSpace(BOUNDS, empty)
    assert space.segments_are_free([[0, 0]], [[10, 10]]).all()
    nested = shapely.GeometryCollection(
        [
            shapely.GeometryCollection([shapely.MultiPolygon([shapely.box(1, 1, 2, 2)])]),
            shapely.MultiLineString([[(4, 0), (4, 5)], [(6, 0), (6, 5)]]),
            shapely.LinearRing([(8, 1), (9, 1), (9, 2)]),
            shapely.Polygon(),
        ]
    )
    space = tp.FreeSpace(BOUNDS, [nested])
    a = np.array([[1.5, 0.5], [3.5, 1], [5.5, 1], [8.4, 0.5], [3, 9]])
    assert space.segments_are_free(a, a + 1.0).tolist() == [False] * 4 + [True]


# What blocks a point, in words


def test_the_blocker_of_a_point_is_named():
    mask = tp.Mask(np.array([[True, False], [False, False]]), [0, 1], [9, 10])
    space = tp.FreeSpace(BOUNDS, [shapely.box(2, 2, 4, 4), tp.Circle(8, 8, 1), mask])
    assert space.blocker((6, 6)) is None
    assert space.blocker((11.5, 6)) == "outside the bounds x1 in [-1, 11], x2 in [-1, 11]"
    assert space.blocker((3, 3)) == "inside an obstacle"
    assert space.blocker((2, 4)) == "inside an obstacle"
    assert space.blocker((8, 8.5)) == "inside a circular obstacle"
    assert space.blocker((7, 8)) == "inside a circular obstacle"
    assert space.blocker((0.2, 9.1)) == "in a blocked or no-data cell"
    assert space.blocker((-0.5, 9.5)) == "in a blocked or no-data cell"


# Problems


GRID = tp.Surface.from_grid(np.zeros((12, 12)), np.arange(12) - 0.5, np.arange(12) - 0.5)


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize(
    ("obstacle", "place"),
    [
        (shapely.box(2, 2, 4, 4), (3.25, 3.5)),
        (shapely.box(2, 2, 4, 4), (2, 3)),
        (shapely.box(2, 2, 4, 4), (4, 4)),
        (shapely.LineString([(0, 5), (10, 5)]), (5, 5)),
        (tp.Circle(5, 5, 2), (5.5, 5)),
        (tp.Circle(5, 5, 2), (7, 5)),
        (tp.Mask(np.ones((2, 2), bool), [2, 3], [4, 5]), (2.2, 4.4)),
        (tp.Mask(np.ones((2, 2), bool), [2, 3], [4, 5]), (1.5, 4)),
        (tp.Mask(np.ones((2, 2), bool), [2, 3], [4, 5]), (3.5, 5.5)),
        (tp.Mask(np.array([[True, False], [False, False]]), [2, 3], [4, 5]), (2.5, 4.5)),
    ],
)
def test_a_start_or_goal_in_or_on_an_obstacle_is_refused(end, obstacle, place):
    ends = {"start": (0, 0), "goal": (10, 10), end: place}
    with pytest.raises(tp.InputError) as caught:
        tp.Problem(FLAT, **ends, bounds=BOUNDS, obstacles=[obstacle])
    text = str(caught.value)
    assert text.startswith(f"{end}=({place[0]:g}, {place[1]:g}) is in")
    assert "move it there, or let it be moved with a snap of " in text


@pytest.mark.parametrize("end", ["start", "goal"])
def test_a_start_or_goal_without_data_below_it_is_refused(end):
    nodata = tp.Mask(np.eye(12, dtype=bool), np.arange(12) - 0.5, np.arange(12) - 0.5)
    surface = tp.Surface.from_grid(np.zeros((12, 12)), nodata.x, nodata.y, nodata=nodata)
    ends = {"start": (0, 3), "goal": (10, 2), end: (4.6, 4.4)}
    with pytest.raises(tp.InputError, match=rf"{end}=\(4.6, 4.4\) is in a blocked or no-data cell"):
        tp.Problem(surface, **ends)


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("surface", [FLAT, GRID], ids=["peaks", "grid"])
def test_a_start_or_goal_out_of_bounds_is_refused(end, surface):
    ends = {"start": (0, 0), "goal": (10, 10), end: (10.125, 3)}
    with pytest.raises(tp.OutsideSurfaceError) as caught:
        tp.Problem(surface, **ends, bounds=(0, 0, 10, 10))
    assert f"{end}=(10.125, 3) is outside the bounds x1 in [0, 10]" in str(caught.value)


@pytest.mark.parametrize(
    ("surface", "bounds", "error", "shown"),
    [
        (FLAT, None, tp.InputError, "bounds=None"),
        (GRID, (-1, 0, 10, 10), tp.OutsideSurfaceError, "(-1.0, 0.0, 10.0, 10.0)"),
        (GRID, (0, 0, 10, 10.75), tp.OutsideSurfaceError, "10.75"),
        (FLAT, (10, 0, 0, 10), tp.InputError, "(10.0, 0.0, 0.0, 10.0)"),
        (FLAT, (0, 10, 10, 0), tp.InputError, "order"),
        (FLAT, (0, 0, 0, 10), tp.InputError, "empty"),
        (FLAT, (0, 0, 10), tp.InputError, "(0, 0, 10)"),
        (FLAT, (0, 0, np.nan, 10), tp.InputError, "nan"),
        (FLAT, "everywhere", tp.InputError, "everywhere"),
        (FLAT, 5, tp.InputError, "5"),
    ],
)
def test_bounds_that_make_no_sense_are_refused(surface, bounds, error, shown):
    with pytest.raises(error) as caught:
        tp.Problem(surface, (1, 1), (9, 9), bounds)
    assert shown in str(caught.value)


@pytest.mark.parametrize("place", [(1,), (1, 2, 3), "here", (np.nan, 1), (1, np.inf), None])
def test_a_start_that_is_no_point_is_refused(place):
    with pytest.raises(tp.InputError, match="start"):
        tp.Problem(FLAT, place, (9, 9), BOUNDS)


def test_a_problem_takes_one_obstacle_or_many_and_the_surfaces_bounds_by_default():
    wall = shapely.box(4, 0, 5, 9)
    for obstacles in (wall, [wall], (o for o in [wall])):
        problem = tp.Problem(GRID, (0, 0), (10, 10), obstacles=obstacles)
        assert problem.bounds == GRID.bounds
        assert not problem.free_space.segments_are_free([[0, 0]], [[10, 5]]).any()


# The same both ways, and sharp


@given(
    seed=seeds,
    kind=st.sampled_from(occupancy.KINDS),
    place=st.sampled_from([(0.0, 0.0, 1.0), (5e5, 4.2e6, 0.5), (-1.3e7, 8e6, 0.1)]),
)
@settings(deadline=None, max_examples=60)
def test_a_segment_is_as_free_one_way_as_the_other_and_what_is_free_is_disjoint(seed, kind, place):
    random = np.random.default_rng(seed)
    *origin, size = place
    blocked = occupancy.grid_of(kind, random, 9)
    side = size * len(blocked)
    bounds = Bounds(*origin, *(x + side for x in origin))
    ends = random.integers(0, 2 * len(blocked) + 1, (200, 2, 2)) / 2.0  # corners and centres
    near = random.normal(size=ends.shape) * 10.0 ** random.uniform(-16, -6, (200, 1, 1))
    ends = ends + near * random.integers(0, 2, (200, 1, 1))
    ends = np.clip(origin + size * ends, bounds[:2], bounds[2:])
    ground = shapely.union_all(occupancy.squares(blocked, origin, size))
    ends = ends[shapely.disjoint(ground, shapely.points(ends[:, 0]))]
    disjoint = shapely.disjoint(ground, shapely.linestrings(ends))
    for obstacles in occupancy.obstacles_of(blocked, origin, size).values():
        space = tp.FreeSpace(bounds, obstacles)
        there, back = (space.segments_are_free(ends[:, k], ends[:, 1 - k]) for k in (0, 1))
        assert (there == back).all()
        assert not (there & ~disjoint).any()


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (5e5, 4.2e6)])
def test_cells_of_masks_are_sharp(x, y):
    blocked = np.zeros((4, 4), bool)
    blocked[1, 1] = blocked[2, 2] = True
    mask = tp.Mask(blocked, x + np.arange(4.0), y + np.arange(4.0))
    space = tp.FreeSpace(Bounds(x - 0.5, y - 0.5, x + 3.5, y + 3.5), [mask])
    away = 1e-9 + 1e-15 * max(x, y)
    passing = [(0.5 - away, 0.0, 0.5 - away, 1.5 - away)]  # beside a cell, up to the contact
    blocking = [
        (0.5, 0.0, 0.5, 1.4),  # along its side
        (0.0, 1.0, 1.0, 0.0),  # through its corner
        (1.0, 2.0, 2.0, 1.0),  # between two cells that touch at a corner
    ]
    segments = np.array([*passing, *blocking]) + np.array([x, y, x, y])
    free = space.segments_are_free(segments[:, :2], segments[:, 2:])
    assert free.tolist() == [True, False, False, False]
