"""Figures of routes, profiles, distance fields and paces, and picture files of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from .._support.files import written_whole
from ..distance.field import DistanceField
from ..errors import MapError
from ..problem import Solution
from ..surface.ground import quantity, value_unit
from ..travel import TravelModel
from .elevation import chart_size, draw_charts
from .field_view import draw_distances
from .labels import format_length, in_words, lengths_in_words, nothing_in_words, straight_name
from .map_view import draw_map
from .perspective import draw_perspective
from .travel_view import draw_pace

DOTS_PER_INCH = 140
# Of PNG's nine levels of compression: twice as fast as level 6, the default, and 5 % larger.
QUICK = {"compress_level": 3}
PANEL_WIDTH = 5.4  # inches
FIELD_WIDTH = 7.0
# Letters in a line of a title that fit into the width of a map and of a profile.
MAP_LETTERS, PROFILE_LETTERS = 150, 100
LEAST_SHARE = 5e-4  # of which a title says how much it is
FORMATS = (".png", ".svg", ".pdf", ".jpg")


def _title(solution: Solution, width: int) -> str:
    """What was found, in lines of at most so many letters."""
    return "\n".join(fill(line, width) for line in _lines(solution))


def _lines(solution: Solution) -> Iterator[str]:
    problem, value = solution.problem, solution.value
    name = f"{in_words(problem.name)}: " if problem.name else ""
    samples = f"{solution.samples:,} samples"
    if value is None:
        yield f"{name}{nothing_in_words(solution)} ({samples})"
        return
    straight = solution.straight_value
    saved = 1.0 - value / straight if straight else 0.0
    less, more = ("less", "more") if solution.is_weighted else ("shorter", "longer")
    share = f"{100.0 * abs(saved):.1f} % {less if saved >= 0.0 else more} than"
    against = f"{share if abs(saved) >= LEAST_SHARE else 'as'} the {straight_name(solution)}"
    refined = "" if solution.unrefined is None else ", refined"
    yield f"{name}{solution.planner}{refined}, {lengths_in_words(solution)} ({against}), {samples}"
    if solution.lower_bound is None or solution.gap is None:
        return
    bound = format_length(solution.lower_bound, solution.unit)
    yield f"proven: {solution.bound_in_words} than {bound}, a gap of {solution.gap_in_words}"


def draw_route(solution: Solution) -> Any:
    """A matplotlib figure: the map with tree and path, and beside it the surface in 3-D."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    bounds = solution.problem.bounds
    height = float(np.clip(PANEL_WIDTH * bounds.height / bounds.width, 3.8, 8.0)) + 1.2
    # The layout is made for axes of any shape; a map's aspect then moves its labels a little.
    figure = Figure(figsize=(14.0, height), layout=ConstrainedLayoutEngine(h_pad=0.16))
    panels = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.05))
    draw_map(figure.add_subplot(panels[0]), solution)
    draw_perspective(figure.add_subplot(panels[1], projection="3d"), solution)
    figure.suptitle(_title(solution, MAP_LETTERS), fontsize=12)
    return figure


def draw_field(field: DistanceField) -> Any:
    """A matplotlib figure: lines of equal distance on the map."""
    from matplotlib.figure import Figure

    bounds = field.lattice.bounds
    height = float(np.clip(FIELD_WIDTH * bounds.height / bounds.width, 3.8, 10.0)) + 0.8
    figure = Figure(figsize=(FIELD_WIDTH + 1.6, height), layout="constrained")
    draw_distances(figure.add_subplot(), field)
    reached = field.values[np.isfinite(field.values)]
    farthest = format_length(float(reached.max(initial=0.0)), value_unit(field.surface))
    start = ", ".join(f"{coordinate:.10g}" for coordinate in field.source)
    figure.suptitle(f"{quantity(field.surface)} from ({start}), at most {farthest}", fontsize=12)
    return figure


def draw_profile(solution: Solution) -> Any:
    """A matplotlib figure: height, slope and further layers along the route."""
    from matplotlib.figure import Figure

    if solution.path is None:
        raise MapError("there is no profile to draw: no path was found")
    figure = Figure(figsize=chart_size(solution.path), layout="constrained")
    draw_charts(figure, solution, solution.path)
    figure.suptitle(_title(solution, PROFILE_LETTERS), fontsize=12)
    return figure


def draw_travel(model: TravelModel) -> Any:
    """A matplotlib figure: a travel model's pace over the grade, as published and relaxed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    draw_pace(figure.add_subplot(), model)
    figure.suptitle(repr(model), fontsize=11, wrap=True)
    figure.supxlabel(model.source, fontsize=8, wrap=True)
    return figure


def require_known_picture(path: Path) -> None:
    """Raise MapError for a file ending that is not of a known picture format."""
    if path.suffix.lower() not in FORMATS:
        raise MapError(f"{path} has no known picture format; end it in {', '.join(FORMATS)}")


def plot_route(solution: Solution, path: str | Path) -> None:
    """Draw a solution to a picture file, completely or not at all."""
    _save(lambda: draw_route(solution), Path(path))


def plot_profile(solution: Solution, path: str | Path) -> None:
    """Draw a route's profile of heights and slopes to a picture file, completely or not at all."""
    _save(lambda: draw_profile(solution), Path(path))


def plot_field(field: DistanceField, path: str | Path) -> None:
    """Draw a distance field to a picture file, completely or not at all."""
    _save(lambda: draw_field(field), Path(path))


def plot_travel(model: TravelModel, path: str | Path) -> None:
    """Draw a travel model's pace to a picture file, completely or not at all."""
    _save(lambda: draw_travel(model), Path(path))


def _save(draw: Callable[[], Any], target: Path) -> None:
    require_known_picture(target)
    figure = draw()
    options = {"pil_kwargs": QUICK} if target.suffix.lower() == ".png" else {}
    with written_whole(target) as temporary:
        figure.savefig(temporary, dpi=DOTS_PER_INCH, **options)
