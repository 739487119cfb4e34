"""The pictures of the paper's section 5, drawn from the experiments' data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.files import written_whole
from ..planners import GeodesicTraversal
from ..plotting.fan import draw_fan, draw_movement, draw_movement_fan
from ..plotting.map_view import draw_map
from ..plotting.perspective import draw_perspective
from ..plotting.profiles import draw_profiles
from ..plotting.trials import draw_box, draw_convergence, draw_orders
from ..problem import Solution, scenes
from .experiments import (
    ComparativeData,
    ConvergenceData,
    RepeatData,
    SceneData,
    SensitivityData,
    Settings,
)
from .nonsmooth import SmoothedPath, by_surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 130


def new_figure(width: float, height: float) -> Figure:
    """An empty matplotlib figure, inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save_figure(figure: Figure, path: Path) -> None:
    """Write a picture, completely or not at all."""
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=DOTS_PER_INCH)


def _solve(scene: str, settings: Settings, *, chord: bool = False) -> Solution:
    """Plan the first run again, to have its tree."""
    return settings.planner(chord=chord).solve(scenes.load(scene))


def draw_scene(data: SceneData, settings: Settings, directory: Path) -> list[Path]:
    """The paper's four panels: 3-D view, tree, fan of geodesics, the baseline's tree."""
    problem = scenes.load(data.scene)
    ours, baseline = (_solve(data.scene, settings, chord=chord) for chord in (False, True))
    fan = GeodesicTraversal(directions=data.printed.directions).fan(problem)
    figure = new_figure(13.0, 11.0)
    panels = figure.add_gridspec(2, 2)
    view = figure.add_subplot(panels[0, 0], projection="3d")
    draw_perspective(view, ours)
    view.set_title("(a) RRT*-R on the surface")
    tree = figure.add_subplot(panels[0, 1])
    draw_map(tree, ours)
    tree.set_title(f"(b) RRT*-R, {ours.samples:,} samples: length {ours.length:.5f}")
    rays = figure.add_subplot(panels[1, 0])
    draw_fan(rays, problem, fan, fan.geodesics[0].points)
    shortest = fan.geodesics[0].length
    rays.set_title(f"(c) {len(fan.rays)} geodesics, the shortest to the goal: {shortest:.5f}")
    chord = figure.add_subplot(panels[1, 1])
    draw_map(chord, baseline)
    chord.set_title(
        f"(d) RRT* by chords: believed {baseline.cost:.5f}, true length {baseline.length:.5f}"
    )
    path = directory / f"{data.scene}.png"
    save_figure(figure, path)
    return [path]


def draw_comparative(data: ComparativeData, settings: Settings, directory: Path) -> list[Path]:
    """The path planned without resistance, on both surfaces; and the profiles of both paths."""
    plain, full = _solve("four-peaks", settings), _solve("six-peaks", settings)
    assert plain.path is not None
    assert full.path is not None
    carried = full.problem.path(plain.path.points)
    above = replace(plain, problem=full.problem, path=carried)
    figure = new_figure(18.0, 5.6)
    panels = figure.add_gridspec(1, 3)
    left = figure.add_subplot(panels[0], projection="3d")
    draw_perspective(left, plain)
    left.set_title("(a) planned without resistance")
    tree = figure.add_subplot(panels[1])
    draw_map(tree, plain)
    tree.set_title(f"(b) its tree: length without resistance {plain.length:.5f}")
    right = figure.add_subplot(panels[2], projection="3d")
    draw_perspective(right, above)
    right.set_title(f"(c) the same path over the resistance: length {above.length:.5f}")
    surfaces = directory / "comparative.png"
    save_figure(figure, surfaces)

    figure = new_figure(12.0, 4.4)
    paths = {"planned without resistance": carried, "planned with resistance": full.path}
    for layer, axes in enumerate(figure.subplots(1, 2)):
        draw_profiles(axes, paths, layer)
        axes.set_title(("(a) height", "(b) ground resistance")[layer])
    profiles = directory / "comparative-profiles.png"
    save_figure(figure, profiles)
    return [surfaces, profiles]


def draw_repeat(data: list[RepeatData], settings: Settings, directory: Path) -> list[Path]:
    """Box plots of the lengths, with the true length as a line."""
    figure = new_figure(10.0, 5.0)
    for axes, runs in zip(figure.subplots(1, len(data)), data, strict=True):
        title = f"{runs.scene}, {len(runs.lengths)} runs"
        draw_box(axes, runs.lengths, runs.truth.true_length, title)
    path = directory / "repeat.png"
    save_figure(figure, path)
    return [path]


def draw_convergence_figure(
    data: ConvergenceData, settings: Settings, directory: Path
) -> list[Path]:
    """Length against samples."""
    figure = new_figure(7.5, 5.0)
    axes = figure.subplots()
    draw_convergence(axes, data.samples, np.array(data.lengths), data.true_length)
    axes.set_title(f"{data.scene}, {len(data.lengths[0])} runs for each number of samples")
    path = directory / "convergence.png"
    save_figure(figure, path)
    return [path]


def draw_sensitivity(
    data: list[SensitivityData], settings: Settings, directory: Path
) -> list[Path]:
    """For each scene the rays, coloured by the movement of their ends, and a chart of it."""
    figure = new_figure(14.0, 5.2 * len(data))
    panels = figure.add_gridspec(len(data), 2, width_ratios=(1.0, 1.25))
    for row, item in enumerate(data):
        problem = scenes.load(item.scene)
        angles, movement = np.array(item.found.angles), np.array(item.found.movement)
        plane = figure.add_subplot(panels[row, 0])
        pair = item.sweep.around(problem, float(angles[movement.argmax()]))
        draw_movement_fan(plane, problem, item.sweep.rays(problem), movement, pair)
        plane.set_title(f"{item.scene}: {len(angles):,} rays")
        curve = figure.add_subplot(panels[row, 1])
        exact = np.array([g.angle for g in item.truth.geodesics])
        draw_movement(curve, angles, movement, item.sweep.length, exact)
        curve.set_title(f"movement of the end after {item.sweep.length:.5f} map units")
    path = directory / "sensitivity.png"
    save_figure(figure, path)
    return [path]


def draw_smoothing(data: list[SmoothedPath], settings: Settings, directory: Path) -> list[Path]:
    """How the error of the length falls with the scale."""
    figure = new_figure(7.5, 5.0)
    axes = figure.subplots()
    for name, rows in by_surface(data).items():
        errors = np.array([row.relative_error for row in rows])
        draw_orders(axes, [row.scale for row in rows], errors, name)
    axes.set_xticks(sorted({row.scale for row in data}))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.set_title("geodesics of smoothed surfaces against those of the sharp ones")
    path = directory / "smoothing.png"
    save_figure(figure, path)
    return [path]


Draw = Callable[[Any, Settings, Path], list[Path]]

DRAWERS: dict[str, Draw] = {
    "comparative": draw_comparative,
    "repeat": draw_repeat,
    "convergence": draw_convergence_figure,
    "sensitivity": draw_sensitivity,
    "smoothing": draw_smoothing,
}


def draw(name: str, data: object, settings: Settings, directory: Path) -> list[Path]:
    """Draw an experiment's pictures into a directory and return their paths."""
    return DRAWERS.get(name, draw_scene)(data, settings, directory)
