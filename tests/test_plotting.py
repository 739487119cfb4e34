"""Pictures: that they show what they should, by asking the figure and by counting pixels."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from matplotlib.colors import to_rgb
from matplotlib.contour import QuadContourSet
from matplotlib.image import imread

import terrapath as tp
from terrapath.plotting import draw_field, draw_route, plot_field, plot_route
from terrapath.plotting.map_view import PATH_COLOUR
from terrapath.plotting.perspective import _is_hidden, _view_direction
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


def test_the_title_tells_the_bound_and_that_a_path_is_refined(solution, problem):
    assert "\n" not in draw_route(solution).get_suptitle()
    refined = tp.Path(problem.surface, solution.path.points[::2])
    proven = replace(solution, path=refined, unrefined=solution.path, lower_bound=16.9)
    title = draw_route(proven).get_suptitle()
    assert "rrt-star-r, refined, length" in title
    assert f"no path is shorter than 16.9000, a gap of {100 * proven.gap:.3g} %" in title


def test_other_routes_are_drawn_thinner_and_dashed_with_their_lengths(problem):
    paths = [problem.path([(0, 0), (bow, 10 - bow), (10, 10)]) for bow in (3, 2, 6.5)]
    solution = replace(
        tp.RRT().solve(problem), path=paths[0], alternatives=tuple(paths[1:]), tree=None
    )
    axes = draw_route(solution).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    for path in paths[1:]:
        line = lines[f"next best, {path.length:.4f}"]
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
    nothing = tp.RRTStar(samples=5, step=0.1).solve(problem)
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


def test_a_failed_drawing_leaves_no_file(solution, tmp_path):
    with pytest.raises(tp.MapError, match=r"picture.bmp"):
        plot_route(solution, tmp_path / "picture.bmp")
    assert list(tmp_path.iterdir()) == []
