"""Pictures: that they show what they should, by asking the figure and by counting pixels."""

import numpy as np
import pytest
import shapely
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import terrapath as tp
from terrapath.plotting import draw_route, plot_route
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
