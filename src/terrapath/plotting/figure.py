"""The figure of a planned route."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MapError
from ..files import written_whole
from ..problem import Solution
from .map_view import draw_map
from .perspective import draw_perspective

DOTS_PER_INCH = 140
PANEL_WIDTH = 5.4  # inches
FORMATS = (".png", ".svg", ".pdf", ".jpg")


def _title(solution: Solution) -> str:
    problem = solution.problem
    unit = f" {problem.surface.unit}" if problem.surface.unit else ""
    name = f"{problem.name}: " if problem.name else ""
    if solution.length is None:
        return f"{name}{solution.planner} found no path ({solution.samples:,} samples)"
    saved = 1.0 - solution.length / problem.straight_length if problem.straight_length else 0.0
    against = f"{abs(saved):.1%} {'shorter' if saved >= 0.0 else 'longer'} than the straight way"
    digits = ".4f" if solution.length < 1000.0 else ",.0f"
    return (
        f"{name}{solution.planner}, length {solution.length:{digits}}{unit} "
        f"({against}), {solution.samples:,} samples"
    )


def draw_route(solution: Solution) -> Any:
    """A matplotlib figure: the map with tree and path beside the surface in 3-D."""
    from matplotlib.figure import Figure

    bounds = solution.problem.bounds
    height = float(np.clip(PANEL_WIDTH * bounds.height / bounds.width, 3.8, 8.0)) + 0.8
    figure = Figure(figsize=(14.0, height), layout="constrained")
    panels = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.05))
    draw_map(figure.add_subplot(panels[0]), solution)
    draw_perspective(figure.add_subplot(panels[1], projection="3d"), solution)
    figure.suptitle(_title(solution), fontsize=12)
    return figure


def require_known_picture(path: Path) -> None:
    """Raise MapError for an ending that is no picture format."""
    if path.suffix.lower() not in FORMATS:
        raise MapError(f"plot={str(path)!r} has no known format; end it in {', '.join(FORMATS)}")


def plot_route(solution: Solution, path: str | Path) -> None:
    """Draw a solution into a picture file, whole or not at all."""
    target = Path(path)
    require_known_picture(target)
    figure = draw_route(solution)
    with written_whole(target) as temporary:
        figure.savefig(temporary, dpi=DOTS_PER_INCH)
