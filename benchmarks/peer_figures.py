"""Pictures of the comparisons with peers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from matplotlib.ticker import LogLocator

from terrapath.paper.figures import new_figure, save_figure

from .figures import LEAST_EXCESS, TARGET_COLOUR, label_percent, label_plain
from .grids import METHODS, GridsData
from .growth import GROWTH_TARGET, GrowthData
from .timing import percent
from .trees import NEAR, Best, SceneTrees, TreesData

# A colour for each program, a line style for each planner.
COLOURS = {"terrapath": "#08519c", "ompl-cpp": "#d95f0e", "ompl-python": "#7f7f7f"}
LINES = {"rrt-star-r": "-", "rrt-star": "-", "informed-rrt-star": "--", "bit-star": ":"}


def _line(best: Best) -> Any:
    options = dict(best.options)
    if options.get("refine") or options.get("new_state_rejection"):
        return "-."
    return "--" if options.get("informed") else LINES[best.contender.planner]


def _draw_scene_trees(axes: Any, scene: SceneTrees) -> None:
    for label, best in scene.found.items():
        curve, contender = best.curve, best.contender
        rows = [
            (seconds, *(max(scene.excess(length), LEAST_EXCESS) for length in (low, middle, high)))
            for seconds, low, middle, high in zip(
                curve.seconds, curve.low, curve.middle, curve.high, strict=True
            )
            if math.isfinite(middle)
        ]
        if not rows:
            continue
        seconds, low, middle, high = zip(*rows, strict=True)
        style = _line(best)
        colour = COLOURS[contender.program]
        name = label.replace("\\", "")
        # The same planner with other options: shown beside it, but not in front of it.
        strength = {"lw": 1.0, "alpha": 0.5} if contender.late else {"lw": 1.8}
        axes.loglog(seconds, middle, ls=style, color=colour, label=name, **strength)
        shown = [value if math.isfinite(value) else middle[k] for k, value in enumerate(high)]
        axes.fill_between(seconds, low, shown, color=colour, alpha=0.12, lw=0.0)


def draw_trees(data: TreesData, directory: Path) -> list[Path]:
    """Excess against seconds, one panel for each scene: medians and quartiles."""
    columns = min(len(data.scenes), 2)
    rows = -(-len(data.scenes) // columns)
    figure = new_figure(5.6 * columns + 2.6, 4.4 * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes, (name, scene) in zip(panels.flat, data.scenes.items(), strict=False):
        _draw_scene_trees(axes, scene)
        label = f"target: within {percent(NEAR)}"
        axes.axhline(NEAR, color=TARGET_COLOUR, ls=":", lw=1.2, label=label)
        axes.set(title=name, xlabel="seconds", ylabel="longer than the shortest by")
        axes.grid(alpha=0.3)
        label_plain(axes.xaxis)
        label_percent(axes.yaxis)
    for axes in panels.flat[len(data.scenes) :]:
        axes.set_visible(False)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=9)
    path = directory / "benchmark-trees.png"
    save_figure(figure, path)
    return [path]


def draw_grids(data: GridsData, directory: Path) -> list[Path]:
    """Error against seconds, one panel for each scene, one line for each method."""
    names = list(dict.fromkeys(row.scene for row in data.rows))
    figure = new_figure(4.6 * len(names) + 2.8, 4.4)
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True)
    for axes, name in zip(panels.flat, names, strict=True):
        for k, (method, known) in enumerate(METHODS.items()):
            rows = [row for row in data.rows if (row.scene, row.method) == (name, method)]
            if rows:
                seconds = [row.found.timing.seconds for row in rows]
                errors = [max(abs(row.error), LEAST_EXCESS) for row in rows]
                style = "o-" if known.peer is None else "s--"
                axes.loglog(seconds, errors, style, color=f"C{k}", ms=5, label=known.label)
        axes.set(title=name, xlabel="seconds")
        axes.grid(alpha=0.3)
        label_plain(axes.xaxis)
        label_percent(axes.yaxis)
    panels[0, 0].set_ylabel("error of the distance, without its sign")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=9)
    path = directory / "benchmark-grids.png"
    save_figure(figure, path)
    return [path]


def draw_growth(data: GrowthData, directory: Path) -> list[Path]:
    """Seconds against samples, and the growth that the target allows."""
    figure = new_figure(6.4, 4.6)
    axes = figure.subplots()
    for k, name in enumerate(dict.fromkeys(row.scene for row in data.rows)):
        rows = [row for row in data.rows if row.scene == name]
        samples = [row.samples for row in rows]
        seconds = [row.found.timing.seconds for row in rows]
        axes.loglog(samples, seconds, "o-", color=f"C{k}", label=name)
        power = math.log10(GROWTH_TARGET)
        allowed = [seconds[0] * (count / samples[0]) ** power for count in samples]
        (limit,) = axes.loglog(samples, allowed, ":", color=TARGET_COLOUR, lw=1.2)
    limit.set_label(f"{GROWTH_TARGET:g} times the seconds for ten times the samples")
    axes.set(xlabel="samples", ylabel="seconds", title="RRT*-R: growth")
    axes.set_xticks(sorted({row.samples for row in data.rows}))
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    label_plain(axes.xaxis)
    label_plain(axes.yaxis)
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=9)
    path = directory / "benchmark-growth.png"
    save_figure(figure, path)
    return [path]
