"""Vehicle radius, steep ground and areas to keep in: what a path keeps away from."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from matplotlib.cbook import get_sample_data
from scipy import ndimage

import terrapath as tp
from common import FLAT, REAL_MAPS
from oracles import boxes_of_mask
from terrapath.space.inflation import inflated
from terrapath.space.slope_limit import SlopeLimit
from terrapath.surface.bounds import Bounds

SIDE = 10.0
BOUNDS = (0.0, 0.0, SIDE, SIDE)
HILLS = tp.Surface.from_peaks([[(2.0, 0.3, 3.0, 4.0), (-1.5, 0.2, 7.0, 6.0)]])
SCENES = 500

# What shapely itself may err by, as a share of the radius.
ROUNDING = 1e-12


def shape_of(obstacle):
    """An obstacle as a shapely geometry and what to subtract from distances to it."""
    if isinstance(obstacle, tp.Circle):
        return shapely.Point(obstacle.x1, obstacle.x2), obstacle.radius
    if isinstance(obstacle, tp.Mask):
        return shapely.MultiPolygon(list(boxes_of_mask(obstacle))), 0.0
    return obstacle, 0.0


def clearance(path, obstacles):
    """Distance of a path from the nearest obstacle, by shapely."""
    distances = []
    for obstacle in obstacles:
        shape, size = shape_of(obstacle)
        if not shape.is_empty:
            distances.append(shapely.distance(path.line, shape) - size)
    return min(distances, default=math.inf)


# The radius, on random scenes


def random_star(random):
    count = int(random.integers(3, 12))
    angles = np.sort(random.uniform(0, 2 * math.pi, count))
    radii = random.uniform(0.1, 1.5, count)
    centre = random.uniform(0, SIDE, 2)
    return shapely.Polygon(
        centre + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    )


def random_wall(random):
    steps = random.normal(scale=0.8, size=(int(random.integers(2, 9)), 2))
    return shapely.LineString(random.uniform(0, SIDE, 2) + np.cumsum(steps, axis=0))


def random_bay(random):
    """A room with a gap: the sort of concave outline that a buffer simplifies."""
    x, y = random.uniform(0, 7, 2)
    outer = shapely.box(x, y, x + 3, y + 3)
    gap = shapely.box(x + random.uniform(0.3, 2), y - 1, x + 2.5, y + 1)
    return shapely.difference(
        outer, shapely.union(shapely.box(x + 0.2, y + 0.2, x + 2.8, y + 2.8), gap)
    )


def random_mask(random):
    rows, columns = random.integers(2, 9, 2)
    x0, y0 = random.uniform(-1, 8, 2)
    dx, dy = random.uniform(0.1, 0.7, 2)
    blocked = random.random((rows, columns)) < 0.3
    return tp.Mask(blocked, x0 + dx * np.arange(columns), y0 + dy * np.arange(rows))


def random_obstacle(random):
    kind = int(random.integers(6))
    if kind == 4:
        return tp.Circle(*random.uniform(0, SIDE, 2), random.uniform(0.1, 1.0))
    if kind == 5:
        return shapely.Point(random.uniform(0, SIDE, 2))
    return (random_star, random_wall, random_bay, random_mask)[kind](random)


def random_scene(seed):
    """Obstacles, a radius, and a problem among them: None where the ends are not free."""
    random = np.random.default_rng([5, seed])
    drawn = [random_obstacle(random) for _ in range(int(random.integers(1, 7)))]
    obstacles = [o for o in drawn if not isinstance(o, shapely.Polygon) or o.is_valid]
    radius = float(10.0 ** random.uniform(-2, 0.0))
    for _ in range(40):
        start, goal = random.uniform(0, SIDE, (2, 2))
        try:
            return obstacles, tp.Problem(
                HILLS, start, goal, BOUNDS, obstacles, radius=radius, name=str(seed)
            )
        except tp.InputError:
            continue
    return obstacles, None


def solved(problem, seed):
    planner = ("fast-marching", "dijkstra", "rrt")[seed % 3]
    options = {"samples": 300, "seed": seed} if planner == "rrt" else {"spacing": SIDE / 30}
    return tp.plan(problem, planner, **options)


def test_no_route_is_nearer_to_an_obstacle_than_the_radius_on_500_scenes():
    routes = refined = nearest = 0
    for seed in range(SCENES):
        obstacles, problem = random_scene(seed)
        if problem is None:
            continue
        solution = solved(problem, seed)
        if solution.path is None:
            continue
        paths = [solution.path]
        if seed % 5 == 0:
            paths.append(tp.refine(problem, solution.path))
            refined += 1
        for path in paths:
            found = clearance(path, obstacles)
            assert found >= problem.radius * (1.0 - ROUNDING), (seed, found, problem.radius)
            routes += 1
            nearest += found < 1.02 * problem.radius
    assert routes > 400
    assert refined > 60
    assert nearest > 30  # the radius is used up, not far exceeded


# Inflation, one kind at a time


def outlines_are_clear(given, grown, radius):
    shape, size = shape_of(given)
    return shapely.distance(shapely.boundary(grown), shape) - size >= radius


@given(seed=st.integers(0, 2**32 - 1), where=st.sampled_from([0.0, 5e5, -4e6]))
@settings(deadline=None, max_examples=60)
def test_an_inflated_outline_is_never_nearer_than_the_radius(seed, where):
    random = np.random.default_rng(seed)
    maker = (random_star, random_wall, random_bay)[seed % 3]
    shape = shapely.transform(maker(random), lambda xy: xy + where)
    if not shape.is_valid:
        return
    radius = float(10.0 ** random.uniform(-3, 1))
    bounds = Bounds(where, where, where + SIDE, where + SIDE)
    for grown in inflated([shape], radius, bounds):
        assert shapely.distance(grown.boundary, shape) >= radius
        assert shapely.hausdorff_distance(shapely.envelope(grown), shapely.envelope(shape)) < (
            1.02 * math.sqrt(2.0) * radius
        )


def test_overlapping_obstacles_become_one_and_far_ones_are_left_out():
    row = [shapely.box(k, 4, k + 0.9, 5) for k in range(10)]
    far = shapely.box(100, 100, 101, 101)
    (joined,) = inflated([*row, far], 0.2, Bounds(*BOUNDS))
    assert all(shapely.contains_properly(joined, box) for box in row)
    assert inflated([*row, far], 0.0, Bounds(*BOUNDS)) == [*row, far]


def test_discs_grow_exactly_and_points_become_discs():
    points = shapely.MultiPoint([(1, 2), (3, 4)])
    grown = inflated([tp.Circle(5, 5, 1), points], 0.5, Bounds(*BOUNDS))
    radii = sorted((c.x1, c.x2, c.radius) for c in grown)
    assert [r[:2] for r in radii] == [(1, 2), (3, 4), (5, 5)]
    assert [r[2] for r in radii] == pytest.approx([0.5, 0.5, 1.5], rel=1e-8)
    assert all(r[2] >= exact for r, exact in zip(radii, (0.5, 0.5, 1.5), strict=True))


def test_points_are_obstacles_only_where_there_is_a_radius():
    with pytest.raises(tp.InputError, match="give the problem a radius"):
        tp.Problem(FLAT, (0, 0), (9, 9), BOUNDS, [shapely.Point(5, 5)])
    problem = tp.Problem(FLAT, (0, 0), (9, 9), BOUNDS, [shapely.Point(4.5, 4.5)], radius=1.0)
    assert not problem.free_space.segments_are_free([[0, 0]], [[9, 9]]).any()


def inflated_by_force(mask, radius, x, y):
    """Cells of a grid whose rectangle is nearer than the radius to that of a blocked cell."""
    (dx, dy), (rows, columns) = mask.spacing, np.nonzero(mask.blocked)
    across = np.abs(x[:, None] - mask.x[columns]) - dx
    along = np.abs(y[:, None] - mask.y[rows]) - dy
    gaps = np.hypot(np.maximum(across, 0.0)[None], np.maximum(along, 0.0)[:, None])
    return (gaps < radius - 1e-6).any(axis=-1), (gaps < radius + 1e-6).any(axis=-1)


@given(seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=80)
def test_a_mask_grows_by_the_cells_that_are_nearer_than_the_radius(seed):
    random = np.random.default_rng(seed)
    mask = random_mask(random)
    radius = float(random.choice([0.05, 0.3, 1.0, 4.0, mask.spacing[0], 3 * mask.spacing[1]]))
    bounds = Bounds(*random.uniform(-3, 1, 2), *random.uniform(4, 12, 2))
    (grown,) = inflated([mask], radius, bounds)
    surely, at_most = inflated_by_force(mask, radius, grown.x, grown.y)
    if mask.blocked.any():
        assert (grown.blocked >= surely).all()
        assert (grown.blocked <= at_most).all()
        # Whatever of the bounds is not on the grid is as far from it as it need be.
        corners = shapely.box(
            grown.x[0] - 0.5 * mask.spacing[0],
            grown.y[0] - 0.5 * mask.spacing[1],
            grown.x[-1] + 0.5 * mask.spacing[0],
            grown.y[-1] + 0.5 * mask.spacing[1],
        )
        rest = shapely.box(*bounds) - corners
        if not rest.is_empty:
            assert shapely.distance(rest, shape_of(mask)[0]) >= radius


def test_large_masks_grow_in_parts_as_they_do_at_once(monkeypatch):
    random = np.random.default_rng(0)
    axis = np.arange(120.0)
    mask = tp.Mask(random.random((120, 120)) < 0.003, axis, axis)
    bounds = Bounds(0, 0, 119, 119)
    (whole,) = inflated([mask], 5.5, bounds)
    monkeypatch.setattr("terrapath.space.inflation.MOST_CELLS_AT_ONCE", 120)
    (parts,) = inflated([mask], 5.5, bounds)
    assert (whole.blocked == parts.blocked).all()
    assert 0.1 < whole.blocked.mean() < 0.9


def test_a_gap_that_the_vehicle_does_not_fit_through_is_closed():
    walls = [shapely.box(4, -1, 5, 4), shapely.box(4, 5, 5, 11)]
    for radius, is_open in ((0.45, True), (0.55, False)):
        problem = tp.Problem(FLAT, (1, 1), (9, 9), BOUNDS, walls, radius=radius)
        solution = tp.plan(problem, "fast-marching", refine=True)
        assert (solution.path is not None) == is_open
        assert problem.is_unreachable == (not is_open)


# Steep ground


def test_slopes_are_the_surfaces_own_by_scipy_and_those_of_numpy():
    random = np.random.default_rng(1)
    x, y = 5.0 + 2.0 * np.arange(17), -2.0 + 3.0 * np.arange(13)
    heights = random.normal(size=(13, 17)).cumsum(axis=0)
    surface = tp.Surface.from_grid(heights, x, y)
    slopes = SlopeLimit(surface, 45.0, surface.bounds, "steepest")._slopes_of_rows()
    found = np.vstack([slopes(*rows) for rows in ((0, 3), (3, 4), (4, 13))])
    assert (found == slopes(0, 13)).all()
    along, across = np.gradient(heights, 3.0, 2.0)
    padded = np.pad(heights, 1, mode="reflect", reflect_type="odd")
    horn_x = ndimage.correlate(padded, np.outer([1, 2, 1], [-1, 0, 1]) / 16.0)[1:-1, 1:-1]
    horn_y = ndimage.correlate(padded, np.outer([-1, 0, 1], [1, 2, 1]) / 24.0)[1:-1, 1:-1]
    expected = np.maximum(across**2 + along**2, horn_x**2 + horn_y**2)
    places = np.linspace(-0.5, 0.5, 5)
    for dx in places * 2.0:
        for dy in places * 3.0:
            points = np.stack(np.meshgrid(x + dx, y + dy), axis=-1)
            points = np.clip(points, surface.bounds[:2], surface.bounds[2:])
            gradients = surface.gradients(points)[..., 0, :]
            expected = np.maximum(expected, (gradients**2).sum(axis=-1))
    assert found == pytest.approx(expected, rel=1e-9)


def test_ground_is_blocked_exactly_where_it_is_too_steep():
    axis = np.linspace(0, 10, 101)
    x, _ = np.meshgrid(axis, axis)
    ramp = np.where(x < 5, 0.0, np.tan(np.radians(30)) * (x - 5))
    surface = tp.Surface.from_grid(ramp, axis, axis, smoothing=0.2)
    blocked = {
        m: tp.Problem(surface, (1, 1), (2, 2), max_slope=m).constraints.steep for m in (29, 31)
    }
    assert blocked[31] is None
    assert blocked[29].blocked[:, 80:].all()
    assert not blocked[29].blocked[:, :45].any()


def test_a_route_over_exact_peaks_keeps_to_the_slope():
    problem = tp.Problem(HILLS, (0.5, 0.5), (9.5, 9.5), BOUNDS, max_slope=25)
    solution = tp.plan(problem, "fast-marching", refine=True)
    free = tp.plan(tp.Problem(HILLS, (0.5, 0.5), (9.5, 9.5), BOUNDS), "fast-marching")

    def steepest(path):
        gradients = HILLS.gradients(path.profile.points)[:, 0]
        return np.degrees(np.arctan(np.hypot(*gradients.T).max()))

    assert steepest(solution.path) <= 25.0
    assert steepest(free.path) > 25.0


def test_steep_ground_beyond_the_bounds_keeps_the_vehicle_off_too():
    # The flank of a hill whose foot the bounds cut off.
    hill = tp.Surface.from_peaks([[(4.0, 1.0, 7.0, 5.0)]])
    ends, bounds = ((1.0, 5.0), (4.9, 5.0)), (0.0, 0.0, 5.0, 10.0)
    tp.Problem(hill, *ends, bounds, max_slope=25)
    with pytest.raises(tp.InputError, match=r"radius=0\.8"):
        tp.Problem(hill, *ends, bounds, max_slope=25, radius=0.8)


def test_a_route_on_a_real_map_keeps_to_the_slope_by_horn_and_by_differences():
    data = get_sample_data("jacksboro_fault_dem.npz")
    heights = data["elevation"].astype(float)[::-1]
    size = 90.0
    axes = [size * np.arange(n) for n in heights.shape[::-1]]
    surface = tp.Surface.from_grid(heights, *axes)
    start, goal = (11_000.0, 22_000.0), (27_000.0, 26_000.0)
    problem = tp.Problem(surface, start, goal, max_slope=25, slope_measure="steepest")
    solution = tp.plan(problem, "fast-marching", refine=True)
    points = solution.path.profile.points
    j, i = np.rint(points[:, 1] / size).astype(int), np.rint(points[:, 0] / size).astype(int)
    along, across = np.gradient(heights, size)
    horn_x = ndimage.correlate(heights, np.outer([1, 2, 1], [-1, 0, 1]) / (8.0 * size))
    horn_y = ndimage.correlate(heights, np.outer([-1, 0, 1], [1, 2, 1]) / (8.0 * size))
    for gx, gy in ((across, along), (horn_x, horn_y)):
        slopes = np.degrees(np.arctan(np.hypot(gx, gy)))
        assert slopes[j, i].max() <= 25.0
        assert slopes.max() > 30.0
    own = np.degrees(np.arctan(np.hypot(*surface.gradients(points)[:, 0].T)))
    assert own.max() <= 25.0 + 0.5


@pytest.mark.parametrize(
    ("name", "band", "limit", "start", "goal"),
    [
        ("herodotus_mons.tif", 2, 14.0, (-5_000, -3_000), (5_000, 3_000)),
        ("aristarchus_plateau.tif", 3, 12.0, (-20_000, -20_000), (20_000, 18_000)),
    ],
)
def test_routes_on_the_moon_keep_to_the_slope_by_the_raster(name, band, limit, start, goal):
    import rasterio

    if not (REAL_MAPS / name).exists():
        pytest.skip("the lunar maps are not here")
    surface = tp.read_surface(REAL_MAPS / name, height_band=band)
    steep = {}
    for max_slope in (limit, None):
        problem = tp.Problem(surface, start, goal, max_slope=max_slope, slope_measure="steepest")
        points = tp.plan(problem, "fast-marching", refine=True).path.profile.points
        with rasterio.open(REAL_MAPS / name) as raster:
            heights = raster.read(band, masked=True).astype(float).filled(np.nan)
            rows, columns = rasterio.transform.rowcol(raster.transform, *points.T)
            along, across = np.gradient(heights, raster.res[0])
        slopes = np.degrees(np.arctan(np.hypot(along, across)))
        steep[max_slope] = slopes[rows, columns].max()
    assert steep[limit] <= limit < steep[None]


def test_heights_in_feet_on_a_plane_in_metres_are_compared_in_metres():
    class Placed:
        unit = "m"
        is_map_crs = True

    axis = np.arange(20.0)
    heights = np.meshgrid(axis, axis)[0]  # 45 degrees if in metres, 17 if in feet
    for unit, blocked in (("m", True), ("ft", False), ("", True)):
        surface = tp.Surface.from_grid(heights, axis, axis, units=[unit], georeference=Placed())
        assert (SlopeLimit(surface, 30.0, surface.bounds).mask is not None) == blocked
    surface = tp.Surface.from_grid(heights, axis, axis, units=["K"], georeference=Placed())
    with pytest.raises(tp.InputError, match="'K'"):
        SlopeLimit(surface, 30.0, surface.bounds)


# Keeping in


def test_the_vehicle_stays_inside_the_area_with_its_whole_width():
    area = shapely.box(0.5, 0.5, 9.5, 9.5) - shapely.box(3, -1, 4, 7) - shapely.box(6, 6, 6.5, 6.5)
    problem = tp.Problem(FLAT, (1.5, 1.5), (8, 1.5), BOUNDS, keep_in=area, radius=0.4)
    solution = tp.plan(problem, "fast-marching", refine=True)
    assert area.contains(solution.path.line)
    assert 0.4 <= shapely.distance(solution.path.line, area.boundary) < 0.41


def test_an_area_beyond_the_bounds_leaves_all_within_them_free():
    problem = tp.Problem(
        FLAT, (0, 0), (10, 10), BOUNDS, keep_in=shapely.box(-5, -5, 15, 15), radius=2
    )
    assert problem.free_space.segments_are_free([[0, 0], [0, 10]], [[10, 10], [10, 0]]).all()


def test_several_areas_count_as_one():
    areas = [shapely.box(0.5, 0.5, 5, 9), shapely.box(4, 3, 9.5, 9)]
    problem = tp.Problem(FLAT, (1, 1), (9, 8), BOUNDS, keep_in=areas)
    assert problem.free_space.segments_are_free([[1, 5]], [[9, 5]]).all()
    apart = tp.Problem(FLAT, (1, 1), (9, 8), BOUNDS, keep_in=[areas[0], shapely.box(6, 3, 9.5, 9)])
    assert apart.is_unreachable


# What is refused, in one line


NODATA = tp.Mask(np.eye(12, dtype=bool), np.arange(12) - 0.5, np.arange(12) - 0.5)
HOLED = tp.Surface.from_grid(np.zeros((12, 12)), NODATA.x, NODATA.y, nodata=NODATA)


@pytest.mark.parametrize(
    ("surface", "options", "shown"),
    [
        (FLAT, {"radius": -1}, "radius=-1 must be"),
        (FLAT, {"radius": math.nan}, "radius=nan must be"),
        (FLAT, {"radius": "wide"}, "radius='wide' must be"),
        (FLAT, {"max_slope": 0}, "max_slope=0 must be above 0"),
        (FLAT, {"max_slope": 91}, "max_slope=91"),
        (FLAT, {"max_slope": "steep"}, "max_slope='steep'"),
        (FLAT, {"max_slope": math.nan}, "max_slope=nan"),
        (FLAT, {"keep_in": shapely.LineString([(0, 0), (1, 1)])}, "keep_in holds a LineString"),
        (FLAT, {"keep_in": [None]}, "keep_in holds a NoneType"),
        (FLAT, {"keep_in": shapely.Polygon()}, "keep_in is empty"),
        (FLAT, {"keep_in": []}, "keep_in is empty"),
        (
            FLAT,
            {"keep_in": shapely.Polygon([(0, 0), (9, 9), (9, 0), (0, 9)])},
            "keep_in is not valid",
        ),
        (FLAT, {"keep_in": 7}, "keep_in=7"),
        (FLAT, {"obstacles": 7}, "obstacles=7"),
        (FLAT, {"keep_in": shapely.box(5, 5, 6, 6)}, "outside the area of keep_in"),
        (FLAT, {"keep_in": shapely.box(1, 1, 6, 6), "radius": 1.5}, "to the edge of keep_in: 1"),
        (FLAT, {"obstacles": [shapely.box(4, 1, 5, 3)], "radius": 2.5}, "to an obstacle: 2;"),
        (FLAT, {"obstacles": [tp.Circle(5, 2, 1)], "radius": 2.5}, "radius=2.5 to an obstacle: 2;"),
        (
            FLAT,
            {"obstacles": [shapely.Point(4, 2)], "radius": 2.5},
            "radius=2.5 to an obstacle: 2;",
        ),
        (
            FLAT,
            {"obstacles": [shapely.GeometryCollection([shapely.Point(4, 2)])], "radius": 2.5},
            "radius=2.5 to an obstacle: 2;",
        ),
        (HILLS, {"max_slope": 1}, "degrees, steeper than max_slope=1"),
        (HOLED, {"radius": 0.7, "start": (1, 2.2)}, "radius=0.7 to a no-data cell: 0.2"),
        (
            HOLED,
            {"radius": 0.1, "start": (1.9, 0.1)},
            "in the margin that radius=0.1 makes around a no-data cell",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_value(surface, options, shown):
    ends = {"start": (2, 2), "goal": (9, 2), **options}
    with pytest.raises(tp.InputError) as caught:
        tp.Problem(surface, bounds=(0, 0, 10, 10), **ends)
    assert shown in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_problem_that_is_half_made_can_be_shown():
    problem = object.__new__(tp.Problem)
    assert repr(problem).startswith("Problem(")
    whole = tp.Problem(FLAT, (1, 1), (2, 2), BOUNDS, name="here")
    assert repr(whole).startswith("Problem(here: (1.0, 1.0) to (2.0, 2.0) within")


def test_certificates_tell_problems_of_other_constraints_apart():
    from terrapath.certificates.certificate import fingerprint

    def make(**options):
        wall = shapely.box(4, 2, 5, 9)
        return fingerprint(tp.Problem(HILLS, (0.5, 0.5), (9.5, 9.5), BOUNDS, [wall], **options))

    area = shapely.box(0.1, 0.1, 9.9, 9.9)
    made = [
        make(),
        make(radius=0.1),
        make(radius=0.2),
        make(max_slope=40),
        make(max_slope=30),
        make(keep_in=area),
        make(keep_in=area, radius=0.1),
    ]
    assert len(set(made)) == len(made)
    assert make(radius=0.1, max_slope=30) == make(radius=0.1, max_slope=30)


def test_maps_explain_what_the_radius_adds_and_what_is_too_steep():
    from matplotlib.figure import Figure

    from terrapath.plotting.map_view import MARGIN_COLOUR, draw_map

    axis = np.linspace(0.0, 10.0, 60)
    heights = HILLS.values(np.stack(np.meshgrid(axis, axis), axis=-1))[..., 0]
    surface = tp.Surface.from_grid(heights, axis, axis)
    obstacles = [shapely.box(7, 1, 8, 2), tp.Circle(8, 4, 0.5), shapely.Point(2, 8)]
    area = shapely.box(0.1, 0.1, 9.9, 9.9)
    problem = tp.Problem(
        surface, (1, 1), (9, 9), None, obstacles, radius=0.25, max_slope=30, keep_in=area
    )
    axes = Figure().add_subplot()
    draw_map(axes, tp.plan(problem, "fast-marching"))
    shown = [text.get_text() for text in axes.get_legend().get_texts()]
    assert shown[:3] == ["radius 0.25", "outside the keep-in area", "steeper than 30°"]
    tones = [c for c in axes.collections if np.allclose(c.get_facecolor()[:1], [MARGIN_COLOUR])]
    drawn = shapely.union_all([shapely.Polygon(path.vertices) for path in tones[0].get_paths()[:]])
    assert shapely.covers(drawn, shapely.Point(8, 4).buffer(0.7))
