"""Pictures: that they show what they should, by asking the figure and by counting pixels."""

import base64
import json
import re
from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.image import imread

import terrapath as tp
from common import made_up
from cost_rasters import cell_surface
from terrapath.plotting import (
    draw_field,
    draw_page,
    draw_profile,
    draw_route,
    plot_field,
    plot_page,
    plot_profile,
    plot_route,
)
from terrapath.plotting.map_view import PATH_COLOUR
from terrapath.plotting.perspective import (
    AZIMUTH,
    ELEVATION,
    Ground,
    _is_hidden,
    _view_direction,
)
from terrapath.plotting.terrain import Terrain


@pytest.fixture(scope="module")
def problem():
    mask = tp.Mask(np.eye(4, dtype=bool), [8.0, 8.5, 9.0, 9.5], [0.0, 0.5, 1.0, 1.5])
    surface = tp.scenes.load("six-peaks").surface
    hole = shapely.box(4, 4, 6, 5).difference(shapely.box(4.4, 4.4, 5.6, 4.6))
    obstacles = [hole, tp.Circle(9, 7, 0.8), shapely.LineString([(1, 3), (1, 6)]), mask]
    return tp.Problem(surface, (0, 0), (10, 10), (-1, -1, 11, 11), obstacles, name="all kinds")


@pytest.fixture(scope="module")
def solution(problem):
    return tp.RRTStar(samples=2000).solve(problem)


def pixels_of(picture, colour):
    return int((np.abs(picture[..., :3] - to_rgb(colour)).max(axis=-1) < 0.02).sum())


def test_the_picture_shows_the_route_in_both_views(solution, tmp_path):
    plot_route(solution, tmp_path / "route.png")
    picture = imread(tmp_path / "route.png")
    half = picture.shape[1] // 2
    assert pixels_of(picture[:, :half], PATH_COLOUR) > 1500
    assert pixels_of(picture[:, half:], PATH_COLOUR) > 800


def test_the_map_draws_the_path_the_tree_and_the_obstacles(solution):
    axes = draw_route(solution).axes[0]
    drawn = [line.get_xydata() for line in axes.lines]
    assert any(np.array_equal(points, solution.path.points) for points in drawn)
    sizes = [len(c.get_paths()) for c in axes.collections]
    assert len(solution.tree.points) - 1 in sizes
    assert 2 in sizes  # the polygon and the disc


def test_the_title_tells_length_and_samples(solution):
    title = draw_route(solution).get_suptitle()
    assert f"{solution.length:.4f}" in title
    assert "2,000 samples" in title


def test_the_title_of_a_straight_path_says_that_it_is_one():
    flat = tp.Problem(tp.Surface.from_grid(np.zeros((9, 9)), *2 * [np.arange(9.0)]), (1, 1), (7, 6))
    title = draw_route(made_up(flat, [flat.start, flat.goal])).get_suptitle()
    assert "length 7.8102 (as the straight line)" in title


def test_the_title_tells_the_bound_and_that_a_path_is_refined(solution, problem):
    assert "\n" not in draw_route(solution).get_suptitle()
    refined = tp.Path(problem.surface, solution.path.points[::2])
    proven = replace(solution, path=refined, unrefined=solution.path, lower_bound=16.9)
    title = draw_route(proven).get_suptitle()
    assert f"rrt-star-r, refined, {proven.path.ground_length:.4f} on the ground, value" in title
    assert "no path costs less than 16.9000 weighted units" in title
    assert f"a gap of {100 * proven.gap:.3g} %" in title


def test_heights_and_contours_of_a_further_layer_are_named():
    solution = tp.RRT().solve(tp.scenes.load("six-peaks"))
    plane, *others = draw_route(solution).axes
    (perspective,) = (axes for axes in others if axes.name == "3d")
    assert "height" in [text.get_text() for text in perspective.texts]
    shown = [text.get_text() for text in plane.get_legend().get_texts()]
    assert "contours: resistance" in shown


@pytest.mark.parametrize("is_flat", [True, False])
def test_costs_have_their_colours_and_a_scale_of_their_own(is_flat):
    # A river of 200 and, where the map is masked, a cost that no route can have.
    costs = np.full((20, 20), 2.0)
    costs[:, 9:11], costs[:, 0] = 200.0, 5000.0
    heights = np.zeros((20, 20)) if is_flat else np.add.outer(np.arange(20.0), np.zeros(20))
    blocked = np.zeros((20, 20), bool)
    blocked[:, 0] = True
    axis = 10.0 * np.arange(20)
    surface = cell_surface(costs, heights)
    problem = tp.Problem(surface, (30, 40), (160, 150), obstacles=[tp.Mask(blocked, axis, axis)])
    plane, *others = draw_route(tp.AStar().solve(problem)).axes
    (scale,) = (axes for axes in others if axes.get_ylabel() == "cost: going")
    assert [text.get_text() for text in scale.get_yticklabels()] == ["2", "200"]
    assert scale.get_yscale() == "log"
    shown = plane.images[0].get_array()
    river, ground = shown[250, 250], shown[250, 400]
    assert ground.sum() > river.sum() + 0.5
    names = [text.get_text() for text in plane.get_legend().get_texts()]
    assert ("contours: height" in names) is not is_flat
    field = draw_field(tp.distance_field(surface, (30, 40)))
    assert "cost: going" in [axes.get_ylabel() for axes in field.axes]


@pytest.mark.parametrize("turns", range(4))
def test_the_legend_covers_neither_the_path_nor_its_ends(turns):
    # An L along two sides of the map leaves one corner.
    corners = np.roll([(1, 1), (1, 9), (9, 9), (9, 1)], turns, axis=0)
    start, middle, goal, free = map(tuple, corners)
    flat = tp.Surface.from_grid(np.zeros((11, 11)), np.arange(11.0), np.arange(11.0))
    problem = tp.Problem(flat, start, goal)
    path = problem.path([start, middle, goal])
    solution = replace(tp.RRT().solve(problem), path=path, tree=None)
    figure = draw_route(solution)
    FigureCanvasAgg(figure).draw()
    axes = figure.axes[0]
    box = axes.transData.inverted().transform_bbox(axes.get_legend().get_window_extent())
    assert np.hypot(*(np.clip(free, box.p0, box.p1) - free)) < 1.0
    assert not any(box.contains(*point) for point in path.points)


@pytest.mark.parametrize("is_corridor", [False, True])
def test_what_the_path_is_kept_in_is_named(is_corridor):
    flat = tp.Surface.from_grid(np.zeros((11, 11)), np.arange(11.0), np.arange(11.0))
    problem = tp.Problem(flat, (2, 2), (7, 7), keep_in=shapely.box(1, 1, 8, 8))
    solution = tp.RRT().solve(problem)
    part = SimpleNamespace(half_width=3.0, decimate=2, coarse_length=7.0)
    axes = draw_route(replace(solution, corridor=part) if is_corridor else solution).axes[0]
    shown = [text.get_text() for text in axes.get_legend().get_texts()]
    area = "the corridor of the coarse route" if is_corridor else "the keep-in area"
    assert f"outside {area}" in shown


def test_other_routes_are_drawn_thinner_and_dashed_with_their_lengths(problem):
    paths = [problem.path([(0, 0), (bow, 10 - bow), (10, 10)]) for bow in (3, 2.8, 3.6)]
    solution = replace(
        tp.RRT().solve(problem), path=paths[0], alternatives=tuple(paths[1:]), tree=None
    )
    axes = draw_route(solution).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    for path in paths[1:]:
        line = lines[f"next best, {path.length:.4f} weighted units"]
        np.testing.assert_array_equal(line.get_xydata(), path.points)
        assert line.get_linewidth() < lines["route"].get_linewidth()
        assert line.is_dashed()
    shown = [text.get_text() for text in axes.get_legend().get_texts()]
    assert set(shown) == set(lines)


# Distance fields


@pytest.fixture(scope="module")
def field(problem):
    obstacles = [shapely.Point(5, 5).buffer(2).exterior, tp.Circle(9, 7, 0.8)]
    return tp.distance_field(
        problem.surface, (0, 0), bounds=problem.bounds, obstacles=obstacles, spacing=0.1
    )


def test_a_field_is_drawn_with_lines_of_equal_distance_and_hatches(field, tmp_path):
    axes = draw_field(field).axes[0]
    lines, hatched = (
        [c for c in axes.collections if isinstance(c, QuadContourSet) and c.filled == filled]
        for filled in (False, True)
    )
    assert len(lines) == len(hatched) == 1
    assert hatched[0].hatches == ["////"]
    for level, path in zip(lines[0].levels, lines[0].get_paths(), strict=True):
        for point in path.vertices[::40]:
            assert float(field.at(point)) == pytest.approx(level, abs=0.2)
    plot_field(field, tmp_path / "field.png")
    assert imread(tmp_path / "field.png").shape[0] > 500


def test_the_field_of_flat_ground_without_obstacles_is_drawn():
    flat = tp.Surface.from_peaks([[(0, 1, 0, 0)]])
    field = tp.distance_field(flat, (0, 0), bounds=(-1, -1, 2, 2), spacing=0.1)
    title = draw_field(field).get_suptitle()
    assert title == f"distance from (0, 0), at most {field.values.max():.4f}"


def test_a_search_without_a_path_is_drawn_too(problem, tmp_path):
    nothing = tp.RRTStar(samples=5, step=0.1, informed=False).solve(problem)
    plot_route(nothing, tmp_path / "nothing.svg")
    assert "no path" in draw_route(nothing).get_suptitle()
    assert (tmp_path / "nothing.svg").stat().st_size > 10_000


def test_flat_ground_and_a_raster_in_metres_are_drawn():
    flat = tp.Surface.from_peaks([[(0, 1, 0, 0)]])
    draw_route(tp.RRT().solve(tp.Problem(flat, (0, 0), (1, 1), (-1, -1, 2, 2))))
    figure = draw_route(tp.RRT().solve(tp.scenes.load("jacksboro")))
    assert figure.axes[0].get_xlabel() == "$x_1$ (km)"


def test_blocked_samples_agree_with_the_free_space(problem):
    terrain = Terrain.sample(problem, 60)
    for j, y in enumerate(terrain.y):
        for i, x in enumerate(terrain.x):
            point = (float(x), float(y))
            if shapely.LineString([(1, 3), (1, 6)]).distance(shapely.Point(point)) == 0:
                continue
            assert terrain.blocked[j, i] == (problem.free_space.blocker(point) is not None)


def test_points_behind_a_hill_are_hidden_and_points_before_it_are_not():
    surface = tp.Surface.from_peaks([[(5, 0.5, 5, 5)]])
    problem = tp.Problem(surface, (0, 0), (10, 10), (-1, -1, 11, 11))
    terrain = Terrain.sample(problem, 200)
    spread = np.array([12.0, 12.0, 5.0])
    towards = _view_direction(np.array([1.0, 1.0, 0.26]), spread)
    assert towards[1] < 0  # the viewer stands to the south
    ground = np.array([[5.6, 6.5, 0.2], [4.4, 2.0, 0.1], [9.0, 9.0, 0.01]])
    assert _is_hidden(terrain, ground, towards, 0.02).tolist() == [True, False, False]


def painted(draw):
    """What is drawn onto 3-D axes that show nothing else, as pixels."""
    figure = Figure(figsize=(4, 4), dpi=100)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    draw(axes)
    axes.set_proj_type("ortho")
    axes.set_axis_off()
    axes.set(xlim=(-1, 11), ylim=(-1, 11), zlim=(0, 6))
    axes.view_init(elev=ELEVATION, azim=AZIMUTH)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(int)


def test_the_ground_in_3d_is_painted_as_matplotlib_paints_a_surface():
    terrain = Terrain.sample(tp.scenes.load("six-peaks"), 60)
    colours = terrain.shaded(0)
    x, y = np.meshgrid(terrain.x, terrain.y)
    style = {"rcount": 60, "ccount": 60, "shade": False, "antialiased": False, "linewidth": 0}
    theirs = painted(
        lambda axes: axes.plot_surface(x, y, terrain.values[0], facecolors=colours, **style)
    )
    ground = (theirs < 250).any(axis=-1)
    assert ground.mean() > 0.15

    def differing(terrain, colours):
        ours = painted(lambda axes: axes.add_collection(Ground(terrain, colours)))
        assert ((ours < 250).any(axis=-1) == ground).mean() > 0.99
        return (np.abs(ours - theirs).max(axis=-1) > 40)[ground].mean()

    # Hills hide what is behind them; painted from near to far, they would not.
    mirrored = replace(terrain, x=terrain.x[::-1], values=terrain.values[..., ::-1])
    assert differing(terrain, colours) < 0.01
    assert differing(mirrored, colours[:, ::-1]) > 0.03


def test_a_failed_drawing_leaves_no_file(solution, tmp_path):
    with pytest.raises(tp.MapError, match=r"picture.bmp"):
        plot_route(solution, tmp_path / "picture.bmp")
    assert list(tmp_path.iterdir()) == []


# Profiles


def test_the_profile_chart_shows_height_slope_and_each_further_layer(solution, tmp_path):
    figure = draw_profile(solution)
    height, slope, resistance = figure.axes
    profile = solution.path.profile
    for axes, values in ((height, profile.values[:, 0]), (resistance, profile.values[:, 1])):
        np.testing.assert_array_equal(axes.lines[0].get_xdata(), profile.distance)
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), values)
    # Heights by differences, independently of the gradients that slopes are made of.
    along = slope.lines[0].get_ydata()
    steps = np.hypot(*np.diff(profile.points, axis=0).T)
    measured = np.degrees(np.arctan(np.diff(profile.values[:, 0]) / steps))
    assert np.median(np.abs(0.5 * (along[1:] + along[:-1]) - measured)) < 0.2
    assert slope.get_ylabel() == "slope (degrees)"
    assert height.get_ylabel() == "height"
    assert resistance.get_xlabel() == "distance on the ground"
    assert f"{solution.length:.4f}" in figure.get_suptitle()
    for ending in (".png", ".svg", ".pdf"):
        plot_profile(solution, tmp_path / f"profile{ending}")
    picture = imread(tmp_path / "profile.png")
    assert pixels_of(picture, PATH_COLOUR) > 500


def test_the_limit_of_the_slope_is_drawn_where_there_is_one(solution):
    problem = copy(solution.problem)
    problem.max_slope = 25.0
    slope = draw_profile(replace(solution, problem=problem)).axes[1]
    limits = [line for line in slope.lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in limits] == [25.0, -25.0]


def test_long_profiles_in_metres_are_labelled_in_kilometres():
    figure = draw_profile(tp.RRT(samples=2000).solve(tp.scenes.load("jacksboro")))
    assert figure.axes[-1].get_xlabel() == "distance on the ground (km)"
    assert figure.axes[0].get_ylabel() == "height (m)"


def test_there_is_no_profile_without_a_path(problem, tmp_path):
    nothing = tp.RRTStar(samples=5, step=0.1, informed=False).solve(problem)
    with pytest.raises(tp.MapError, match="no path"):
        plot_profile(nothing, tmp_path / "profile.png")
    assert list(tmp_path.iterdir()) == []


# Pages


def traces_of(page):
    """The traces in a page's JSON, by their names."""
    text = page.read_text(encoding="utf-8")
    start = text.index("[", text.rindex("Plotly.newPlot("))
    traces, _ = json.JSONDecoder().raw_decode(text[start:])
    return {trace["name"]: trace for trace in traces}


def decoded(array):
    """Plotly's JSON of an array, as NumPy."""
    if not isinstance(array, dict):
        return np.array(array, float)
    values = np.frombuffer(base64.b64decode(array["bdata"]), array["dtype"])
    return values.reshape([int(n) for n in array["shape"].split(",")] if "shape" in array else -1)


def test_a_page_holds_the_route_on_the_terrain(solution, tmp_path):
    plot_page(solution, tmp_path / "page.html")
    traces = traces_of(tmp_path / "page.html")
    assert {"terrain", "blocked", "outlines", "route", "start", "goal"} <= set(traces)
    route, profile = traces["route"], solution.path.profile
    x, y, z = (decoded(route[axis]) for axis in "xyz")
    assert np.column_stack([x, y]).tolist() == profile.points.tolist()
    told = decoded(route["customdata"])
    assert told[:, 0].tolist() == profile.distance.tolist()
    assert told[:, 1].tolist() == profile.values[:, 0].tolist()
    assert ((z > profile.values[:, 0]) & (z < profile.values[:, 0] + 0.25)).all()
    ground = traces["terrain"]
    heights = decoded(ground["z"])
    assert max(heights.shape) <= 300
    at = np.stack(np.meshgrid(decoded(ground["x"]), decoded(ground["y"])), axis=-1)
    expected = solution.problem.surface.values(at)
    np.testing.assert_allclose(heights, expected[..., 0], atol=1e-5)
    np.testing.assert_allclose(decoded(ground["surfacecolor"]), expected[..., 1], atol=1e-5)
    blocked = decoded(traces["blocked"]["z"])
    for j, i in [(0, 0), (130, 130), (150, 110), (200, 250)]:
        free = solution.problem.free_space.blocker(tuple(at[j, i])) is None
        assert np.isnan(blocked[j, i]) == free


def test_a_page_needs_no_network_and_is_the_same_each_time(solution, tmp_path):
    plot_page(solution, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img|iframe)[^>]*\b(src|href)\s*=", text)
    assert 4e6 < len(text) < 12e6  # plotly.js is inside
    plot_page(solution, tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == text


def test_a_page_exaggerates_heights_by_its_buttons(solution):
    figure = draw_page(solution)
    buttons = figure.layout.updatemenus[0].buttons
    assert [button.label for button in buttons] == ["1x", "2x", "5x"]
    ratios = [button.args[0]["scene.aspectratio"] for button in buttons]
    low, high = figure.layout.scene.zaxis.range
    west, east = figure.layout.scene.xaxis.range
    # At 1x a unit of height is drawn as long as a unit of the plane.
    assert ratios[0]["z"] / ratios[0]["x"] == pytest.approx((high - low) / (east - west))
    assert [ratio["z"] / ratios[0]["z"] for ratio in ratios] == pytest.approx([1, 2, 5])


def test_far_from_zero_a_page_counts_from_a_nearer_corner():
    axis = np.linspace(0, 100, 9)
    x, y = 4_100_000.25 + axis, 512_000.5 + axis
    surface = tp.Surface.from_grid(np.outer(axis, axis) / 1000, x, y)
    problem = tp.Problem(surface, (x[1], y[1]), (x[7], y[6]))
    solution = made_up(problem, [problem.start, problem.goal])
    path, figure = solution.path, draw_page(solution)
    route = next(trace for trace in figure.data if trace.name == "route")
    np.testing.assert_array_equal(route.x + 4_100_000, path.profile.points[:, 0])
    np.testing.assert_array_equal(route.customdata[:, 4:6], path.profile.points)
    assert figure.layout.scene.xaxis.title.text == "x1 - 4100000"


def test_names_from_files_are_no_markup(solution, tmp_path):
    problem = copy(solution.problem)
    problem.name = "</script><script>alert(1)</script>\udc80"
    plot_page(replace(solution, problem=problem), tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "alert(1)" in text
    assert "<script>alert" not in text


def test_next_best_routes_and_a_search_without_a_path_have_their_pages(solution, tmp_path):
    bow = solution.problem.path([(0, 0), (3, 7), (10, 10)])
    plot_page(replace(solution, alternatives=(bow,)), tmp_path / "page.html")
    drawn = traces_of(tmp_path / "page.html")[f"next best, {bow.length:.4f} weighted units"]
    assert decoded(drawn["x"]).tolist() == bow.profile.points[:, 0].tolist()
    nothing = tp.RRTStar(samples=5, step=0.1, informed=False).solve(solution.problem)
    assert "found no path" in draw_page(nothing).layout.title.text
    with pytest.raises(tp.MapError, match=r"page\.png.*\.html"):
        plot_page(solution, tmp_path / "page.png")


def test_names_of_any_letters_are_drawn(tmp_path):
    axis = np.linspace(0, 10, 9)
    values = np.random.default_rng(0).uniform(0, 1, (3, 9, 9))
    names = ["height", "a $ and $^ of\n\u2028\udc80 <b>", "%{x} $\\frac$"]
    surface = tp.Surface.from_grid(values, axis, axis, names=names, units=["$", "\x00", "m^2$$"])
    problem = tp.Problem(surface, (1, 1), (9, 8), name="$\\undefined$ \udc80")
    solution = made_up(problem, [problem.start, problem.goal])
    for plot, name in ((plot_profile, "p.svg"), (plot_route, "r.png"), (plot_page, "p.html")):
        plot(solution, tmp_path / name)
    assert "a $ and $^ of" in draw_profile(solution).axes[2].get_ylabel().replace("\\$", "$")
