"""Routes where costs are constant in cells, before closed forms and an independent walker."""

import math

import numpy as np
import pytest
import shapely
from scipy.optimize import minimize_scalar

import terrapath as tp
from cost_rasters import CELL, Walker, cell_surface, random_costs, random_heights
from terrapath.geodesics import cell_routes
from terrapath.geodesics.cell_routes import polished, shortest_through_cells
from terrapath.geodesics.snell import obeying_snell

COUNT = 40
AXIS = CELL * np.arange(COUNT)


def random_problem(seed, steep=0.0, **options):
    random = np.random.default_rng(seed)
    costs, heights = random_costs(random, COUNT), random_heights(random, COUNT, steep)
    problem = tp.Problem(cell_surface(costs, heights), (30.0, 34.0), (361.0, 347.0), **options)
    return problem, Walker(costs, heights, AXIS, AXIS)


@pytest.mark.parametrize("ratio", [1.5, 3.0, 100.0])
def test_snells_law_holds_at_a_side(ratio):
    costs = np.ones((COUNT, COUNT))
    costs[:, 20:] = ratio  # the side is at x = 195
    problem = tp.Problem(cell_surface(costs), (20.0, 31.0), (330.0, 352.0))

    def through(y):
        return math.hypot(175.0, y - 31.0) + ratio * math.hypot(135.0, 352.0 - y)

    best = minimize_scalar(through, bounds=(31.0, 352.0), method="bounded", options={"xatol": 1e-9})
    path = tp.refine(problem, [problem.start, (195.0, 200.0), problem.goal])
    assert path.length == pytest.approx(best.fun, rel=1e-10)
    assert len(path.points) == 3
    x, y = path.points[1]
    assert x == pytest.approx(195.0, abs=1e-6)
    sines = [(y - 31.0) / math.hypot(175.0, y - 31.0), (352.0 - y) / math.hypot(135.0, 352.0 - y)]
    assert sines[0] == pytest.approx(ratio * sines[1], rel=1e-5)


def test_a_route_meets_a_road_at_the_critical_angle():
    costs = np.full((COUNT, COUNT), 5.0)
    costs[20] = 1.0  # a road one cell wide, from y = 195 to 205
    problem = tp.Problem(cell_surface(costs), (10.0, 100.0), (380.0, 100.0))
    # Along the road's side the road's cost counts; it is reached where the sine is 1 / 5.
    down = 95.0 / math.sqrt(1.0 - 0.04)
    expected = 2.0 * 5.0 * down + (370.0 - 2.0 * 0.2 * down)
    solution = tp.plan(problem, "optimal")
    assert solution.length == pytest.approx(expected, rel=1e-7)
    assert solution.lower_bound <= expected <= 1.02 * solution.lower_bound


def test_a_river_is_crossed_at_its_ford():
    costs = np.ones((COUNT, COUNT))
    costs[:, 20], costs[32:35, 20] = 255.0, 1.0
    problem = tp.Problem(cell_surface(costs), (100.0, 170.0), (300.0, 170.0))
    # Round both corners of the ford, at (195, 315) and (205, 315).
    expected = 2.0 * math.hypot(95.0, 145.0) + 10.0
    walker = Walker(costs, 0.0 * costs, AXIS, AXIS)
    for planner in ("optimal", "fast-marching", "a-star", "rrt-star-r"):
        solution = tp.plan(problem, planner, refine=planner != "optimal")
        assert solution.length == pytest.approx(expected, rel=1e-9), planner
        assert walker.length(solution.path.points) == pytest.approx(expected, rel=1e-6)


def rivals(problem):
    for neighbours, spacing in ((32, None), (16, CELL / 3.0)):
        yield tp.plan(problem, "a-star", neighbours=neighbours, spacing=spacing, refine=True)
    yield tp.plan(problem, "rrt-star-r", samples=2000, refine=True)


def mcp_path(problem, costs):
    graph = pytest.importorskip("skimage.graph")
    ends = problem.start, problem.goal
    cells = [tuple(np.rint(np.array(end)[::-1] / CELL).astype(int)) for end in ends]
    search = graph.MCP_Geometric(costs)
    search.find_costs([cells[0]])
    places = CELL * np.array(search.traceback(cells[1]))[:, ::-1]
    return np.vstack([ends[0], places, ends[1]])


@pytest.mark.parametrize(
    ("seed", "steep"),
    [(1, 0.0), (2, 0.5)]
    + [pytest.param(s, 0.4 * (s % 3), marks=pytest.mark.slow) for s in range(3, 7)]
    + [pytest.param(15, 0.0, marks=pytest.mark.slow)],
)
def test_optimal_is_the_best_that_is_known(seed, steep):
    problem, walker = random_problem(seed, steep)
    solution = tp.plan(problem, "optimal", target_gap=0.01)
    assert solution.length == pytest.approx(walker.length(solution.path.points), rel=1e-6)
    best = min(rival.length for rival in rivals(problem))
    assert solution.length <= best * 1.0005
    assert solution.lower_bound <= min(best, solution.length) * (1.0 + 1e-9)
    if steep == 0.0:
        assert solution.gap <= 0.02
    assert solution.length <= walker.length(mcp_path(problem, walker.costs))


def test_a_route_and_the_route_back_are_the_same():
    problem, _ = random_problem(5, 0.3)
    back = tp.Problem(problem.surface, problem.goal, problem.start)
    there, here = (tp.plan(p, "optimal", target_gap=0.02) for p in (problem, back))
    assert there.length == pytest.approx(here.length, rel=1e-12)


@pytest.mark.parametrize("steep", [0.0, 0.5])
def test_polishing_never_lengthens_and_keeps_free_space(steep):
    obstacles = [shapely.box(120.0, 90.0, 210.0, 215.0), shapely.Point(270.0, 300.0).buffer(35.0)]
    problem, _ = random_problem(11, steep, obstacles=obstacles)
    for path in (tp.plan(problem, "a-star").path, shortest_through_cells(problem)):
        other = polished(problem, path)
        assert other.length <= path.length * (1.0 + 1e-12)
        assert problem.allows(other)
        # It is at rest there.
        assert polished(problem, other).length == pytest.approx(other.length, rel=1e-4)


def test_rays_refuse_cells_and_name_the_remedy():
    problem, _ = random_problem(1)
    with pytest.raises(tp.InputError, match=r"cost going is constant in cells; .*smooth_costs"):
        tp.plan(problem, "geodesic-traversal")


def test_a_bend_at_a_corner_does_not_hold_up_the_others():
    dear = 36.356933
    costs = np.ones((5, 6))
    costs[1:3] = costs[4] = dear
    costs[:, 2] = 1.0
    x, y = 0.5 * np.arange(6), 0.5 * np.arange(5)
    problem = tp.Problem(cell_surface(costs, x=x, y=y), (0.75, 0.0), (0.0, 1.853968626))
    path = tp.refine(problem, [(0.75, 0.0), (0.75, 1.25), (0.003, 1.75), (0.0, 1.853968626)])

    def length(bend):
        """Up the side of the cheap column, over the cheap row, and through the dear row."""
        return 1.25 + math.hypot(0.75 - bend, 0.5) + dear * math.hypot(bend, 0.103968626)

    least = minimize_scalar(length, bounds=(0.0, 0.1), options={"xatol": 1e-12}).fun
    assert least * (1.0 - 1e-9) <= path.length <= least * (1.0 + 1e-7)


@pytest.mark.parametrize("seed", [1, 3, 15])
def test_on_large_maps_the_sides_of_those_cells_are_searched_that_matter(seed, monkeypatch):
    problem, _ = random_problem(seed)
    everywhere = polished(problem, shortest_through_cells(problem))
    searched = []

    def points_on(grid, cells, per_side, points_on=cell_routes._points_on):
        searched.append(int(cells.sum()))
        return points_on(grid, cells, per_side)

    monkeypatch.setattr(cell_routes, "_points_on", points_on)
    monkeypatch.setattr(cell_routes, "MANY_POINTS", 0)
    monkeypatch.setattr(cell_routes, "MOST_POINTS", 3 * 900)
    near = polished(problem, shortest_through_cells(problem))
    assert 0 < searched[0] <= 900 < COUNT * COUNT
    assert near.length <= 1.0005 * everywhere.length


def test_bends_stay_within_cells_that_the_bounds_cut_off():
    # Upwards to the west edge, where the last column is half a cell: Newton's steps lead beyond.
    costs = np.full((COUNT, COUNT), 9.0)
    costs[:, 0] = 1.0
    surface = cell_surface(costs)
    problem = tp.Problem(surface, (60.0, 100.0), (60.0, 300.0), bounds=(3.0, 95.0, 200.0, 305.0))
    west, bend = problem.bounds.x1_min, 185.0
    bent = [problem.start, (4.9, 120.0), (4.9, 125.0), (west, 125.0), (west, bend), problem.goal]
    grid = cell_routes.grid_of(problem)
    for first in range(2):
        moved = obeying_snell(surface, grid.x, grid.y, np.array(bent), first)
        assert problem.allows(moved)
        assert problem.path(moved).length <= problem.path(bent).length
    surface_edge = tp.Problem(surface, (60.0, 100.0), (60.0, 300.0))
    bent = np.array([(60.0, 100.0), (0.0, 105.0), (0.0, 295.0), (60.0, 300.0)])
    grid = cell_routes.grid_of(surface_edge)
    for first in range(2):
        assert surface_edge.allows(obeying_snell(surface, grid.x, grid.y, bent, first))
