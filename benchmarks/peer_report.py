"""The report's sections about peers, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from terrapath.paper.report import NOTHING, markdown_table

from .edges import EdgesData
from .grids import METHODS, GridRow, GridsData
from .growth import GrowthData, GrowthRow
from .timing import percent
from .trees import LEVELS, NEAR, Best, SceneTrees, TreesData


def _digits(seconds: float | None) -> str:
    """Seconds of any size, to three digits."""
    return NOTHING if seconds is None else f"{seconds:.3g}"


def _named(versions: Mapping[str, str]) -> str:
    return "; ".join(f"{name}: {version}" for name, version in versions.items())


def _paragraphs(*texts: str) -> list[str]:
    return [line for text in texts if text for line in (text, "")]


def _options(best: Best) -> str:
    shown = (
        f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in best.options
        if name != "informed"
    )
    return ", ".join(shown) or NOTHING


def _tree_row(scene: SceneTrees, label: str) -> list[str]:
    best = scene.found[label]
    curve = best.curve
    spread = (
        percent(max(scene.excess(edge[-1]), 0.0)) for edge in (curve.low, curve.middle, curve.high)
    )
    low, middle, high = ("none" if text.startswith("inf") else text for text in spread)
    return [
        label,
        _options(best),
        *(_digits(scene.time_within(label, level)) for level in LEVELS),
        _digits(curve.seconds[-1]),
        f"{middle} ({low} to {high})",
    ]


def _scene_trees(name: str, scene: SceneTrees) -> Iterator[str]:
    header = ["planner", "best options", *(f"within {percent(level)}" for level in LEVELS)]
    header += ["in all", "excess then (quartiles)"]
    optimum = f"Shortest path: {scene.optimum.length:.10g}"
    if scene.optimum.searched:
        gap = scene.optimum.gap
        proof = "without proof" if gap is None else f"with a proven gap of {percent(gap)}"
        optimum += f", the shortest that was found, by `optimal` {proof}"
    yield from (f"### {name}", "", f"{optimum}.", "")
    yield from markdown_table(header, [_tree_row(scene, label) for label in scene.found])


def trees_lines(data: TreesData) -> list[str]:
    """The section on trees: each planner on each scene."""
    shown = [line for name, scene in data.scenes.items() for line in _scene_trees(name, scene)]
    return [
        *_paragraphs(
            "Seconds until the median path is within the given share of the shortest path, by its "
            "true length under h, whatever the planner believes. One core each; the best options "
            f"are those of a small sweep that get within {percent(NEAR)} first. OMPL's objective "
            "is the same Line-R, with the same panels, and obstacles are tested exactly; in C++ "
            "with the plane's distance as heuristic and ellipses for informed samples. Through "
            "Python the objective is written with NumPy, and the options are those that were best "
            "in C++.",
            f"Seeds: {data.seeds}; fewer for OMPL's other planners through Python.",
            _named(data.versions),
            *data.missing,
        ),
        *shown,
    ]


def _grid_row(row: GridRow) -> list[str]:
    return [
        row.scene,
        METHODS[row.method].label,
        f"{row.nodes:,}",
        _digits(row.found.timing.seconds),
        f"{100.0 * row.error:+.3g} %",
    ]


def grids_lines(data: GridsData) -> list[str]:
    """The section on lattices and meshes: each method on each of them."""
    header = ["scene", "method", "nodes a side", "seconds", "error at the goal"]
    return [
        *_paragraphs(
            "The distance from start to goal over height alone, from the problem's numbers: laying "
            "out the lattice or the mesh is part of it. MCP_Geometric knows one cost for each cell "
            "and no direction; it is given det(h)^(1/4), the geometric mean of the factors by "
            "which h stretches lengths. potpourri3d and pygeodesic take the lattice as a mesh of "
            "triangles; exact there means exact on the triangles. Edge flips find a locally "
            "shortest path.",
            _named(data.versions),
            *data.missing,
        ),
        *markdown_table(header, map(_grid_row, data.rows)),
    ]


def _growth_row(row: GrowthRow) -> list[str]:
    found, size = row.found, row.bytes_per_sample
    return [
        row.scene,
        f"{row.samples:,}",
        f"{found.vertices:,}",
        _digits(found.timing.seconds),
        NOTHING if found.length is None else f"{found.length:.5f}",
        NOTHING if size is None else f"{size:.0f}",
        NOTHING if found.memory_peak is None else f"{found.memory_peak / 1e9:.2f}",
    ]


def growth_lines(data: GrowthData) -> list[str]:
    """The section on growth: each number of samples."""
    header = ["scene", "samples", "vertices", "seconds", "length", "bytes a sample", "GB in all"]
    return [
        *_paragraphs(
            "RRT\\*-R with its default step; samples drawn everywhere, but for the rows with the "
            "default options. Each in a process of its own, warm. Memory is the process's peak; "
            "for a sample, it is how far the peak is above the peak before."
        ),
        *markdown_table(header, map(_growth_row, data.rows)),
    ]


def edges_lines(data: EdgesData) -> list[str]:
    """The section on edges: both surfaces."""
    rows = []
    for kind, found in data.found.items():
        loop, difference = found.loop, found.difference
        rows.append(
            [
                kind,
                f"{data.nanoseconds(found.ours):.1f}",
                NOTHING if loop is None else f"{data.nanoseconds(loop):.1f}",
                NOTHING if loop is None else f"{found.ours.seconds / loop.seconds:.2f}",
                NOTHING if difference is None else f"{difference:.1g}",
            ]
        )
    header = ["six-peaks by its", "Line-R (ns an edge)", "loop in C++", "ratio"]
    header.append("largest difference, relative")
    version = "" if data.version is None else f"The loop in C++: {data.version}."
    return [
        *_paragraphs(
            f"{data.edges:,} edges at random, up to 1 long, two layers, one application of Line-R "
            "each, one after another on one core; taking turns with the same in C++.",
            version,
            *data.missing,
        ),
        *markdown_table(header, rows),
    ]
