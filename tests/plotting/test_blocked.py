"""The picture of a search that found nothing: what can be reached, and what is between."""

import json

import numpy as np
import pytest
import shapely
from matplotlib.image import imread
from scipy import ndimage

import terrapath as tp
from rasters import write
from terrapath.cli.main import run
from terrapath.plotting.blocked import START_COLOUR, Blockage
from terrapath.plotting.figure import draw_route
from terrapath.plotting.page import draw_page
from terrapath.plotting.terrain import Terrain

AXIS = np.linspace(0.0, 100.0, 41)
X, Y = np.meshgrid(AXIS, AXIS)
FLAT = tp.Surface.from_grid(0.01 * X, AXIS, AXIS)


def blockage(problem, side=120):
    return Blockage(Terrain.sample(problem, side))


def box_ring(x, y, half, width):
    outer = shapely.box(x - half, y - half, x + half, y + half)
    return outer.difference(outer.buffer(-width, join_style="mitre"))


def test_a_wall_of_no_width_is_not_leaked_through():
    wall = shapely.LineString([(0, 40), (55, 55), (100, 42)])
    problem = tp.Problem(FLAT, (20, 10), (70, 90), obstacles=[wall])
    found = blockage(problem)
    x, y = np.meshgrid(found.terrain.x, found.terrain.y)
    below = np.interp(x, [0, 55, 100], [40, 55, 42]) - y
    assert found.from_start[below > 1.0].all()
    assert not found.from_start[below < 0.0].any()
    assert found.from_goal[below < -1.0].all()
    assert not found.is_joined
    assert "thin obstacles" in found.in_words


@pytest.mark.parametrize("seed", range(4))
def test_what_is_reached_on_cells_is_what_a_flood_fill_reaches(seed):
    """SciPy floods the cells themselves; at two samples to a cell or more, both are the same."""
    random = np.random.default_rng(seed)
    cells = random.uniform(size=(20, 20)) < 0.38
    cells[1, 1] = cells[-2, -2] = False
    axis = np.arange(20) + 0.5
    surface = tp.Surface.from_grid(np.zeros((20, 20)), axis, axis)
    mask = tp.Mask(cells, axis, axis)
    start, goal = (1.5, 1.5), (18.5, 18.5)
    problem = tp.Problem(surface, start, goal, (0.5, 0.5, 19.5, 19.5), [mask])
    found = blockage(problem, side=96)
    parts, _ = ndimage.label(~cells)
    x, y = np.meshgrid(found.terrain.x, found.terrain.y)
    expected = (parts == parts[1, 1])[
        np.clip(y, 0, 19.9).astype(int), np.clip(x, 0, 19.9).astype(int)
    ]
    away = (np.abs(x - np.round(x)) > 1e-6) & (np.abs(y - np.round(y)) > 1e-6)
    assert (found.from_start == expected)[away].all()
    assert found.is_joined == (parts[1, 1] == parts[-2, -2])


def test_steep_ground_a_radius_and_the_edge_of_an_area_are_named():
    ridge = tp.Surface.from_grid(40 * np.exp(-((X - 50) ** 2) / 60), AXIS, AXIS)
    ends = (10, 50), (90, 50)
    steep = blockage(tp.Problem(ridge, *ends, max_slope=30))
    assert next(iter(steep.reasons)) == "ground steeper than 30°"
    gap = [shapely.box(45, 0, 55, 48), shapely.box(45, 52, 55, 100)]
    assert blockage(tp.Problem(FLAT, *ends, obstacles=gap)).is_joined
    wide = blockage(tp.Problem(FLAT, *ends, obstacles=gap, radius=4.0))
    assert next(iter(wide.reasons)) == "the vehicle's radius around what blocks"
    area = [shapely.box(0, 0, 40, 100), shapely.box(60, 0, 100, 100)]
    kept = blockage(tp.Problem(FLAT, *ends, keep_in=area))
    assert next(iter(kept.reasons)) == "the edge of the keep-in area"
    solid = blockage(tp.Problem(FLAT, *ends, obstacles=[box_ring(90, 50, 8, 3)]))
    assert next(iter(solid.reasons)) == "obstacles or no data"


def test_a_goal_between_the_samples_is_shut_in_all_the_same():
    problem = tp.Problem(FLAT, (10, 10), (50.2, 50.2), obstacles=[box_ring(50.2, 50.2, 0.15, 0.05)])
    found = blockage(problem, side=40)
    assert not found.is_joined
    assert not found.from_goal.any()
    assert found.shut_in.mean() > 0.9


def test_open_ground_says_that_a_path_may_be_found():
    problem = tp.Problem(FLAT, (10, 10), (90, 90))
    nothing = tp.RRTStar(samples=2, step=1.0, informed=False).solve(problem)
    figure = draw_route(nothing)
    assert "rrt-star-r found no path (2 samples)" in figure.get_suptitle()
    assert "free ground joins start and goal" in figure.axes[0].get_title()


def test_the_picture_and_the_page_show_both_sides(tmp_path):
    problem = tp.Problem(FLAT, (20, 20), (80, 80), obstacles=[box_ring(80, 80, 12, 4)])
    nothing = tp.plan(problem, "dijkstra")
    figure = draw_route(nothing)
    assert "because none exists" in figure.get_suptitle()
    assert "between start and goal: obstacles or no data" in figure.axes[0].get_title()
    shown = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert any("from the start" in text for text in shown)
    assert any("from the goal" in text for text in shown)
    assert "what blocks" in shown
    tp.plot_route(nothing, tmp_path / "nothing.png")
    picture = imread(tmp_path / "nothing.png")[..., :3]
    start = np.array([int(START_COLOUR[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    bluish = picture[..., 2] > picture[..., 0] + 0.3 * start[2]
    assert bluish.mean() > 0.1
    names = [trace.name or "" for trace in draw_page(nothing).data]
    assert sum("can be reached" in name for name in names) == 2


def test_the_command_draws_what_blocks_and_writes_no_route(tmp_path, capsys):
    heights = np.zeros((30, 30), np.float32)
    heights[:, 14:16] = -32768.0
    dem = write(tmp_path / "map.tif", heights, nodata=-32768.0)
    ends = ["--start", "500050,3999900", "--goal", "500250,3999900", "--json"]
    outputs = [tmp_path / name for name in ("route.gpx", "map.png", "page.html", "profile.png")]
    flags = ("--output", "--plot", "--page", "--profile")
    named = [text for pair in zip(flags, map(str, outputs), strict=True) for text in pair]
    assert run(["plan", str(dem), *ends, *named]) == 4
    record = json.loads(capsys.readouterr().out)
    assert record["status"] == "unreachable"
    assert record["value"] is record["ground_length"] is record["steepest_side"] is None
    assert [path.exists() for path in outputs] == [False, True, True, False]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.png", "map.tif", "page.html"]
