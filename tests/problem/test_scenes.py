"""The built-in problems are the paper's, and the public face is there."""

import numpy as np
import pytest

import terrapath as tp


def test_all_scenes_load_and_carry_their_names():
    for name in tp.scenes.names():
        assert tp.scenes.load(name).name == name


@pytest.mark.parametrize(
    ("name", "point", "values"),
    [
        ("one-peak", (5, 5), [5.0]),
        ("one-peak", (4, 7), [5 * np.exp(-0.1 * 5)]),
        ("three-peaks", (3, 3), [7 + 6 * np.exp(-8) + 5 * np.exp(-10)]),
        ("four-peaks", (5, 5), [20 * np.exp(-4)]),
        ("six-peaks", (5, 5), [20 * np.exp(-4), 6 * np.exp(-4.5)]),
        ("repeat-3d", (5, 5), [10 * np.exp(-4.5) + 10 * np.exp(-9)]),
        ("repeat-4d", (5, 5), [10 * np.exp(-4.5) + 10 * np.exp(-9), 7 + 6 * np.exp(-9)]),
    ],
)
def test_the_surfaces_have_the_values_of_the_papers_formulas(name, point, values):
    problem = tp.scenes.load(name)
    assert problem.surface.values(point) == pytest.approx(values, rel=1e-12)
    assert problem.start == (0, 0)
    assert problem.goal == (10, 10)
    assert tuple(problem.bounds) == (-1, -1, 11, 11)


def test_jacksboro_is_the_terrain_that_matplotlib_ships():
    from matplotlib.cbook import get_sample_data

    with get_sample_data("jacksboro_fault_dem.npz") as archive:
        heights, dx = archive["elevation"], float(archive["dx"])
        west, north = float(archive["xmin"]), float(archive["ymin"])
    problem = tp.scenes.load("jacksboro")
    reference = problem.surface.georeference
    rows, columns = np.array([40, 150, 300]), np.array([50, 200, 380])
    lonlat = np.column_stack([west + dx * (columns + 0.5), north - dx * (rows + 0.5)])
    found = problem.surface.values(reference.from_map(lonlat))[:, 0]
    # Resampled from cells of 75 m x 93 m: a few metres on slopes.
    assert np.abs(found - heights[rows, columns]).max() < 12.0
    points = np.stack(np.meshgrid(np.arange(10, 330, 10), np.arange(10, 390, 10)), -1).reshape(
        -1, 2
    )
    lonlat = np.column_stack([west + dx * (points[:, 1] + 0.5), north - dx * (points[:, 0] + 0.5)])
    found = problem.surface.values(reference.from_map(lonlat))[:, 0]
    assert np.abs(found - heights[points[:, 0], points[:, 1]]).mean() < 1.5


def test_an_unknown_scene_names_the_known_ones():
    with pytest.raises(tp.InputError, match="six-peaks"):
        tp.scenes.load("seven-peaks")


def test_every_name_of_the_public_face_is_there():
    for name in tp.__all__:
        assert getattr(tp, name) is not None
        assert name in dir(tp)
    with pytest.raises(AttributeError, match="nonsense"):
        tp.nonsense  # noqa: B018
