"""The nearest free place, beside a search among many places by shapely."""

import numpy as np
import pytest
import shapely

import terrapath as tp
from terrapath.cli.main import run
from terrapath.errors import BlockedError
from terrapath.space.free_space import FreeSpace
from terrapath.space.nearest import nearest_free
from terrapath.surface.bounds import Bounds

BOUNDS = Bounds(0.0, 0.0, 20.0, 20.0)
FLAT = tp.Surface.from_peaks([[]])


def squares(mask):
    """The cells of a mask that are blocked, as one geometry."""
    (j, i), (dx, dy) = np.nonzero(mask.blocked), mask.spacing
    x, y = mask.x[i], mask.y[j]
    return shapely.union_all(shapely.box(x - 0.5 * dx, y - 0.5 * dy, x + 0.5 * dx, y + 0.5 * dy))


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_nearest_place_outside_all_obstacles(seed):
    random = np.random.default_rng(seed)
    axis = np.arange(20) + 0.5
    mask = tp.Mask(random.random((20, 20)) < 0.6, axis, axis)
    shapes = [shapely.Point(*random.uniform(4, 16, 2)).buffer(random.uniform(1, 3)) for _ in "abc"]
    disc = tp.Circle(*random.uniform(4, 16, 2), 1.5)
    space = FreeSpace(BOUNDS, [mask, *shapes, disc])
    disc_shape = shapely.Point(disc.x1, disc.x2).buffer(disc.radius, 64)
    blocked = shapely.union_all([squares(mask), *shapes, disc_shape])
    free = shapely.box(*BOUNDS) - blocked
    for point in random.uniform(0.5, 19.5, (10, 2)):
        here = shapely.Point(point)
        if not blocked.contains(here):
            continue
        least = here.distance(free)
        place, distance = nearest_free(space, tuple(point))
        assert space.blocker(place) is None
        assert distance == pytest.approx(np.hypot(*(np.array(place) - point)))
        assert least - 0.01 <= distance <= 1.06 * least + 0.01


def test_without_a_free_place_there_is_none():
    space = FreeSpace(BOUNDS, [shapely.box(-1, -1, 21, 21)])
    assert nearest_free(space, (3.0, 4.0)) is None
    with pytest.raises(tp.InputError, match="no place within the bounds is free"):
        tp.Problem(FLAT, (3, 4), (5, 5), BOUNDS, [shapely.box(-1, -1, 21, 21)])


def test_a_vehicle_wider_than_the_map_is_told_to_be_narrower():
    with pytest.raises(tp.BlockedError, match=r"radius=100 .*is free; give a smaller radius$"):
        tp.Problem(FLAT, (3, 4), (5, 5), BOUNDS, [shapely.box(8, 8, 9, 9)], radius=100.0)


WALL = shapely.box(4, 4, 9, 16)


def test_start_and_goal_are_moved_no_farther_than_allowed_and_this_is_said():
    with pytest.raises(tp.InputError, match=r"start=\(5, 10\) is inside an obstacle; the nearest"):
        tp.Problem(FLAT, (5, 10), (15, 10), BOUNDS, [WALL], snap=0.9)
    with pytest.warns(tp.errors.SnapWarning, match=r"it is moved to \(3\.9"):
        problem = tp.Problem(FLAT, (5, 10), (15, 10), BOUNDS, [WALL], snap=1.2)
    assert 3.9 < problem.start[0] < 4.0
    assert problem.goal == (15.0, 10.0)
    assert problem.between((15, 10), (3, 3)).start == (15.0, 10.0)
    with pytest.raises(tp.InputError, match="snap"):
        tp.Problem(FLAT, (5, 10), (15, 10), BOUNDS, [WALL], snap=-1)


# A ring around a yard: the nearest free place to its inner part is in the yard, a pocket.
RING = shapely.box(12, 8, 18, 14) - shapely.box(14, 10, 16, 12)


@pytest.mark.parametrize("turned", [False, True])
def test_an_end_is_not_left_in_a_pocket_where_ground_beyond_is_near_enough(turned):
    ends = [(2, 10), (13.5, 11)]
    with pytest.warns(tp.errors.SnapWarning) as told:
        problem = tp.Problem(FLAT, *(ends[::-1] if turned else ends), BOUNDS, [RING], snap=2.0)
    moved, kept = (problem.goal, problem.start)[:: -1 if turned else 1]
    assert kept == (2.0, 10.0)
    assert 11.9 < moved[0] < 12.0
    assert not problem.is_unreachable
    name = "start" if turned else "goal"
    assert f"no path leads from there to the other end; {name} is moved on to" in str(
        told[1].message
    )


def test_an_end_stays_in_a_pocket_where_nothing_beyond_is_near_enough():
    with pytest.warns(tp.errors.SnapWarning) as told:
        problem = tp.Problem(FLAT, (2, 10), (13.7, 11), BOUNDS, [RING], snap=1.0)
    assert len(told) == 1
    assert 14.0 < problem.goal[0] < 14.1
    assert problem.is_unreachable


def test_an_end_that_was_given_in_a_pocket_stays_there():
    problem = tp.Problem(FLAT, (2, 10), (15, 11), BOUNDS, [RING], snap=9.0)
    assert problem.goal == (15.0, 11.0)


def test_what_is_suggested_is_free_and_near_enough():
    with pytest.raises(tp.InputError) as caught:
        tp.Problem(FLAT, (5.3, 10), (15, 10), BOUNDS, [WALL])
    shown = str(caught.value).split("a snap of ")[1]
    with pytest.warns(tp.errors.SnapWarning):
        tp.Problem(FLAT, (5.3, 10), (15, 10), BOUNDS, [WALL], snap=float(shown))


def steep_map(path):
    """A ramp of 60 degrees in the middle of flat ground, in degrees; its file's name."""
    from rasterio import Affine

    from rasters import write

    rise = np.clip(np.arange(60) - 25, 0, 10) * 60.0
    cell = 1 / 3600
    transform = Affine(cell, 0.0, 11.0, 0.0, -cell, 47.0)
    return str(write(path / "ramp.tif", np.tile(rise, (50, 1)), transform, "EPSG:4326"))


def test_refusals_and_moves_are_in_the_users_own_coordinates(tmp_path, capsys):
    path = steep_map(tmp_path)
    for latlon, start, goal, near in (
        (["--latlon"], "46.993,11.00835", "46.993,11.002", "(46.99"),
        ([], "11.00835,46.993", "11.002,46.993", "(11.00"),
    ):
        asked = ["plan", path, "--start", start, "--goal", goal, "--max-slope", "40", "--quiet"]
        assert run([*asked, *latlon]) == 2
        said = capsys.readouterr().err
        assert "degrees by Horn's formula, steeper than max_slope=40" in said
        assert f"the nearest free place is {near}" in said
        place = said.split("nearest free place is (")[1].split(")")[0].replace(" ", "")
        assert run([*asked, *latlon, "--start", place]) == 0
        capsys.readouterr()
        assert run([*asked, *latlon, "--snap", "300"]) == 0
        assert f"it is moved to {near}" in capsys.readouterr().err


def test_what_separates_start_and_goal_is_named(tmp_path, capsys):
    path = steep_map(tmp_path)
    ends = ["--latlon", "--start", "46.993,11.002", "--goal", "46.993,11.0150"]
    assert run(["plan", path, *ends, "--max-slope", "40", "--quiet"]) == 4
    assert "ground steeper than max_slope=40 degrees (" in capsys.readouterr().err


def test_a_scenario_with_constraints_keeps_to_them(tmp_path, capsys):
    path, file = steep_map(tmp_path), tmp_path / "ramp.toml"
    area = tmp_path / "area.geojson"
    area.write_text(
        '{"type": "Polygon", "coordinates": [[[11.0005, 46.987], [11.012, 46.987], '
        "[11.012, 46.9995], [11.0005, 46.9995], [11.0005, 46.987]]]}"
    )
    limits = ["--max-slope", "40", "--radius", "15", "--keep-in", str(area)]
    assert run(["init", path, "--output", str(file), *limits]) == 0
    text = file.read_text()
    assert "\nmax_slope = 40.0" in text
    assert "\nradius = 15.0" in text
    assert '\nkeep_in = "area.geojson"' in text
    capsys.readouterr()
    assert run(["plan", str(file), "--quiet"]) == 0


@pytest.mark.parametrize("corner", [(0.0, 0.0), (1e6, 4e6), (5e5, 5.2e6)])
@pytest.mark.parametrize("shape", ["box", "touching", "disc"])
def test_the_place_that_is_named_can_be_given(corner, shape):
    x0, y0 = corner
    axis = np.arange(30.0)
    surface = tp.Surface.from_grid(np.zeros((1, 30, 30)), x0 + axis, y0 + axis)
    obstacle = {
        "box": shapely.box(x0 + 5, y0 + 3, x0 + 8, y0 + 8),
        "touching": shapely.Polygon([(x0 + 5, y0 + 5), (x0 + 9, y0 + 4), (x0 + 9, y0 + 7)]),
        "disc": tp.Circle(x0 + 7.0, y0 + 5.0, 2.0),
    }[shape]
    goal = (x0 + 25.0, y0 + 25.0)
    with pytest.raises(BlockedError) as caught:
        tp.Problem(surface, (x0 + 5.0, y0 + 5.0), goal, obstacles=[obstacle])
    named = str(caught.value).split("nearest free place is (")[1].split(")")[0]
    place = tuple(map(float, named.split(",")))
    tp.Problem(surface, place, goal, obstacles=[obstacle])
