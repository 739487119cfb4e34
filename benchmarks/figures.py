"""The benchmarks' pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from terrapath.paper.figures import new_figure, save_figure

from .bound import GAP_TARGETS, BoundData
from .marching import REFERENCE_ERRORS, MarchData, MarchRow
from .paths import NEAR, TARGET_SCENE, TARGET_SECONDS, PathsData, PathsFound
from .timing import percent

TARGET_COLOUR = "#e4002b"

# Smaller excesses are rounding errors.
LEAST_EXCESS = 1e-9


def _plain_percent(share: float) -> str:
    """Like ``percent``, but without an exponent for small shares."""
    return f"{np.format_float_positional(100.0 * share, 3, fractional=False, trim='-')} %"


def label_percent(axis: Any) -> None:
    """Label the ticks of an axis in percent."""
    axis.set_major_formatter(lambda value, _: _plain_percent(value))
    axis.set_minor_formatter("")


def label_plain(axis: Any) -> None:
    """Label the ticks of an axis with plain numbers."""
    axis.set_major_formatter("{x:,.7g}")
    axis.set_minor_formatter("")


def draw_bound(data: BoundData, directory: Path) -> list[Path]:
    """Gap against seconds, one line for each scene."""
    figure = new_figure(8.0, 5.4)
    axes = figure.subplots()
    for scene, found in data.items():
        seconds = [step.timing.seconds for step in found.steps]
        axes.loglog(seconds, [step.gap for step in found.steps], "o-", lw=1.6, ms=5, label=scene)
    for gap, limit in GAP_TARGETS:
        axes.plot([1e-9, limit, limit], [gap, gap, 1e-9], ":", color=TARGET_COLOUR, lw=1.2)
        axes.plot(limit, gap, "s", color=TARGET_COLOUR, ms=7)
        axes.annotate(
            f"target: {percent(gap)} in {limit:g} s",
            (limit, gap),
            (6, 6),
            textcoords="offset points",
            color=TARGET_COLOUR,
            fontsize=9,
        )
    steps = [step for found in data.values() for step in found.steps]
    seconds = [step.timing.seconds for step in steps] + [limit for _, limit in GAP_TARGETS]
    gaps = [step.gap for step in steps] + [gap for gap, _ in GAP_TARGETS]
    axes.set(
        xlim=(0.6 * min(seconds), 1.7 * max(seconds)),
        ylim=(0.6 * min(gaps), 2.0 * max(gaps)),
        xlabel="seconds",
        ylabel="proven gap, (length - bound) / bound",
        title="Lower bounds with certificates",
    )
    label_plain(axes.xaxis)
    label_percent(axes.yaxis)
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=9)
    path = directory / "benchmark-bound.png"
    save_figure(figure, path)
    return [path]


def _draw_seconds(axes: Any, rows: dict[str, list[MarchRow]]) -> None:
    for scene, found in rows.items():
        nodes = [row.nodes for row in found]
        axes.loglog(nodes, [row.found.whole.seconds for row in found], "o-", label=scene)
    first = next(iter(rows.values()))
    peers = [(row.nodes, row.found.peer.seconds) for row in first if row.found.peer is not None]
    if peers:
        label = "scikit-fmm, isotropic"
        axes.loglog(*zip(*peers, strict=True), "x--", color="black", alpha=0.6, label=label)
    axes.set(ylabel="seconds", title="from the surface to the distance field")


def _draw_errors(axes: Any, rows: dict[str, list[MarchRow]]) -> None:
    for k, (scene, found) in enumerate(rows.items()):
        nodes, errors = [row.nodes for row in found], [abs(row.error) for row in found]
        axes.loglog(nodes, errors, "o-", color=f"C{k}", label=scene)
        known = [(n, abs(error)) for (s, n), error in REFERENCE_ERRORS.items() if s == scene]
        label = f"{scene}, HamiltonFastMarching"
        axes.loglog(*zip(*known, strict=True), "D", mfc="none", ms=8, color=f"C{k}", label=label)
    axes.set(ylabel="relative error, without its sign", title="error at the goal")
    label_percent(axes.yaxis)


def draw_marching(data: MarchData, directory: Path) -> list[Path]:
    """Seconds and errors against the number of nodes on a side."""
    rows: dict[str, list[MarchRow]] = {}
    for row in data.rows:
        rows.setdefault(row.scene, []).append(row)
    figure = new_figure(12.0, 5.0)
    left, right = figure.subplots(1, 2)
    _draw_seconds(left, rows)
    _draw_errors(right, rows)
    for axes in (left, right):
        axes.set_xlabel("nodes a side")
        # The labels 961 and 1,001 would overlap.
        axes.set_xticks(sorted({row.nodes for row in data.rows} - {961}))
        label_plain(axes.xaxis)
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=9)
    label_plain(left.yaxis)
    path = directory / "benchmark-fast-marching.png"
    save_figure(figure, path)
    return [path]


# Marks and colours of planners, by the beginnings of their labels.
MARKS = {
    "fast marching, refined": ("*", "#2ca02c"),
    "fast marching": ("o", "#2ca02c"),
    "optimal": ("P", "#d62728"),
    "RRT*-R until": ("v", "#08519c"),
    "RRT*-R": ("^", "#6baed6"),
    "Dijkstra": ("s", "#7f7f7f"),
    "A*": ("D", "#bcbd22"),
}


TREES_END = " samples"  # labels of trees do


def _draw_planners(axes: Any, labels: list[str], found: list[PathsFound]) -> None:
    trees = []
    for label, result in zip(labels, found, strict=True):
        name = label.replace("\\", "")
        if name.endswith(TREES_END):
            trees.append((name, result))
            continue
        marker, colour = next(mark for start, mark in MARKS.items() if name.startswith(start))
        axes.loglog(
            result.timing.seconds,
            max(result.typical_excess, LEAST_EXCESS),
            marker,
            color=colour,
            mfc="none" if name.endswith("32 neighbours") else colour,
            ms=11 if marker == "*" else 7,
            label=name,
        )
    _draw_tree_sizes(axes, trees)


def _draw_tree_sizes(axes: Any, trees: list[tuple[str, PathsFound]]) -> None:
    """Draw one planner with several numbers of samples as one line, with one legend entry."""
    planner = trees[0][0].split(",")[0]
    *others, last = (name.removeprefix(f"{planner}, ") for name, _ in trees)
    listed = ", ".join(size.removesuffix(TREES_END) for size in others)
    sizes = f"{listed} and {last}" if others else last
    marker, colour = MARKS[planner]
    axes.loglog(
        [result.timing.seconds for _, result in trees],
        [max(result.typical_excess, LEAST_EXCESS) for _, result in trees],
        f"{marker}-",
        color=colour,
        lw=1.0,
        ms=7,
        label=f"{planner}, {sizes}",
    )


def _draw_targets(axes: Any, scene: str) -> None:
    style = {"color": TARGET_COLOUR, "lw": 1.2}
    axes.axhline(NEAR, ls=":", label=f"near: within {percent(NEAR)}", **style)
    if scene == TARGET_SCENE:
        label = f"target on {scene}: near in {TARGET_SECONDS:g} s"
        axes.axvline(TARGET_SECONDS, ls="--", label=label, **style)


def draw_paths(data: PathsData, directory: Path) -> list[Path]:
    """Excess against seconds, one panel for each scene, one mark for each planner."""
    columns = min(len(data.found), 3)
    rows = -(-len(data.found) // columns)
    figure = new_figure(4.4 * columns + 2.2, 3.7 * rows)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, (scene, found) in zip(panels.flat, data.found.items(), strict=False):
        _draw_planners(axes, data.labels, found)
        _draw_targets(axes, scene)
        axes.set_title(scene)
        axes.grid(alpha=0.3)
        label_plain(axes.xaxis)
        label_percent(axes.yaxis)
    for axes in panels[-1]:
        axes.set_xlabel("seconds")
    for axes in panels[:, 0]:
        axes.set_ylabel("longer than the shortest by")
    shown = [panel.get_legend_handles_labels() for panel in panels.flat]
    entries = {label: handle for row in shown for handle, label in zip(*row, strict=True)}
    figure.legend(entries.values(), entries.keys(), loc="outside right upper", fontsize=9)
    path = directory / "benchmark-path.png"
    save_figure(figure, path)
    return [path]
