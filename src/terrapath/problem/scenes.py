"""Problems by name: the paper's surfaces, and a real terrain model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from ..errors import InputError
from ..surface import Surface
from . import Problem

Peak = tuple[float, float, float, float]

# The paper's region, start and goal (section 5).
REGION = (-1.0, -1.0, 11.0, 11.0)
START, GOAL = (0.0, 0.0), (10.0, 10.0)


def _alike(amplitude: float, *centres: tuple[float, float]) -> list[Peak]:
    return [(amplitude, 0.5, x1, x2) for x1, x2 in centres]


ONE_PEAK: list[Peak] = [(5.0, 0.1, 5.0, 5.0)]
THREE_PEAKS: list[Peak] = [(7.0, 0.5, 3.0, 3.0), (6.0, 0.5, 7.0, 3.0), (5.0, 0.5, 5.0, 7.0)]
FOUR_PEAKS = _alike(5.0, (3.0, 3.0), (7.0, 3.0), (3.0, 7.0), (7.0, 7.0))
TWO_RESISTANCE_PEAKS = _alike(3.0, (5.0, 8.0), (5.0, 2.0))
REPEAT_HEIGHT = _alike(5.0, (5.0, 8.0), (8.0, 5.0), (2.0, 2.0), (8.0, 2.0))
REPEAT_RESISTANCE = [*_alike(3.0, (2.0, 8.0), (8.0, 8.0)), (7.0, 0.5, 5.0, 5.0)]


@dataclass(frozen=True)
class Scene:
    """A built-in problem.

    name, description : for people. load : makes the problem. true_length : of the shortest path,
    map units, None where it is not known. It is the length of the shortest geodesic that 6,000
    rays in a sector of 130 degrees find, solved to ten digits.
    """

    name: str
    description: str
    load: Callable[[], Problem]
    true_length: float | None = None


def _paper_scene(
    name: str, description: str, *layers: list[Peak], true_length: float | None = None
) -> Scene:
    def load() -> Problem:
        names = ["height", "resistance"][: len(layers)]
        surface = Surface.from_peaks(layers, names=names)
        return Problem(surface, START, GOAL, REGION, name=name)

    return Scene(name, description, load, true_length)


def _load_jacksboro() -> Problem:
    """The terrain model that matplotlib ships, on a local projection in metres."""
    from matplotlib.cbook import get_sample_data

    from ..surface.raster import Raster

    with cast("Any", get_sample_data("jacksboro_fault_dem.npz")) as archive:
        heights = archive["elevation"].astype(np.float64)
        # The file names the northern edge ymin: its rows run from north to south.
        west, east, north, south = (float(archive[k]) for k in ("xmin", "xmax", "ymin", "ymax"))
    raster = Raster.from_extent(heights[None], (west, south, east, north), "EPSG:4326")
    surface = raster.to_surface(names=["height"], units=["m"])
    assert surface.georeference is not None
    start, goal = surface.georeference.from_map(np.array([JACKSBORO_START, JACKSBORO_GOAL]))
    return Problem(surface, start, goal, name="jacksboro")


# Longitude and latitude, degrees: from a valley in the mountains to the plateau's far side.
JACKSBORO_START = (-84.385, 36.545)
JACKSBORO_GOAL = (-84.115, 36.70)

SCENES: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        _paper_scene("one-peak", "one wide hill", ONE_PEAK, true_length=16.142532164),
        _paper_scene("three-peaks", "three steep hills", THREE_PEAKS, true_length=15.368572424),
        _paper_scene(
            "six-peaks",
            "four hills, and two peaks of ground resistance",
            FOUR_PEAKS,
            TWO_RESISTANCE_PEAKS,
            true_length=17.018129404,
        ),
        _paper_scene(
            "four-peaks", "the hills of six-peaks alone", FOUR_PEAKS, true_length=15.447891962
        ),
        _paper_scene(
            "repeat-3d",
            "the 150-run experiment in 3-D",
            REPEAT_HEIGHT,
            true_length=15.734152898,
        ),
        _paper_scene(
            "repeat-4d",
            "the 150-run experiment in 4-D: height and resistance",
            REPEAT_HEIGHT,
            REPEAT_RESISTANCE,
            true_length=18.101992220,
        ),
        Scene("jacksboro", "real terrain in Tennessee, 30 km x 32 km", _load_jacksboro),
    )
}


def names() -> list[str]:
    """Names of the built-in problems."""
    return list(SCENES)


def load(name: str) -> Problem:
    """The built-in problem of that name. Raises InputError for a name that is not known."""
    if name not in SCENES:
        raise InputError(f"scene={name!r} is not known; choose one of {', '.join(SCENES)}")
    return SCENES[name].load()
