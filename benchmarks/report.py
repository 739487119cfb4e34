"""The benchmarks' report in Markdown: targets, tables, the machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from terrapath.paper.report import NOTHING, machine_lines, markdown_table

from .bound import GAP_TARGETS, BoundData
from .large_maps import STEEPEST, LargeMapData
from .marching import REFERENCE_ERRORS, MarchData, MarchRow
from .paths import NEAR, PathsData, PathsFound
from .peers import SCIKIT_FMM
from .settings import FULL, QUICK, Scale
from .startup import StartData
from .timing import Target, Timing, percent


@dataclass(frozen=True)
class Finding:
    """An experiment's section of the report."""

    title: str
    targets: list[Target]
    lines: list[str]  # Markdown
    timings: list[Timing]
    pictures: list[Path]


def _seconds(timing: Timing) -> str:
    return f"{timing.seconds:.3f}"


def _signed(share: float) -> str:
    return f"+{percent(share)}" if share > 0.0 else percent(share)


def _targets_table(targets: Iterable[Target]) -> list[str]:
    rows = []
    for target in targets:
        unit = f" {target.unit}" if target.unit else ""
        found = NOTHING if target.found is None else f"{target.found:.3g}{unit}"
        side = "at least" if target.at_least else "at most"
        rows.append([target.what, f"{side} {target.limit:.3g}{unit}", found, target.verdict])
    return markdown_table(["target", "limit", "measured", "verdict"], rows)


def bound_lines(data: BoundData) -> list[str]:
    """The section on lower bounds: each certificate of each scene."""
    rows = [
        [
            scene,
            f"{step.nodes:,}",
            percent(step.gap),
            _seconds(step.timing),
            f"{median(step.timing.wall):.3f}",
            _seconds(step.check),
        ]
        for scene, found in data.items()
        for step in found.steps
    ]
    header = ["scene", "nodes", "gap", "seconds", "wall time", "check (seconds)"]
    wanted = ", ".join(f"{percent(gap)} in {limit:g} s" for gap, limit in GAP_TARGETS)
    return [
        "The best certificate so far each time a lattice is done, and how long after the start "
        "that was. The search is given the true length; gaps are relative to the lower bound. "
        "Nodes are those that the certificate lies on: where they repeat, the finer lattice proved "
        f"no more. Targets: {wanted}. `check` proves a certificate again from nothing but the "
        "problem.",
        "",
        *markdown_table(header, rows),
    ]


def _marching_row(row: MarchRow) -> list[str]:
    found = row.found
    reference = REFERENCE_ERRORS.get((row.scene, row.nodes))
    return [
        row.scene,
        f"{row.nodes:,}",
        *map(_seconds, (found.edges, found.march, found.whole)),
        NOTHING if found.peer is None else _seconds(found.peer),
        NOTHING if found.ratio is None else f"{found.ratio:.2f}",
        _signed(row.error),
        NOTHING if reference is None else _signed(reference),
        NOTHING if row.bytes_per_node is None else f"{row.bytes_per_node:.0f}",
        NOTHING if found.memory_peak is None else f"{found.memory_peak / 1e9:.2f}",
    ]


def marching_lines(data: MarchData) -> list[str]:
    """The section on fast marching: each scene on each lattice."""
    peer = SCIKIT_FMM.missing
    if data.peer is not None:
        peer = (
            f"scikit-fmm {data.peer} solves the isotropic equation on the same lattice, all "
            "speeds 1, second order; it took turns with terrapath in one process."
        )
    header = ["scene", "nodes a side", "edges", "march", "in all", "scikit-fmm"]
    header += ["ratio", "error at the goal", "error of HFM", "bytes a node", "GB in all"]
    return [
        "The distance field of h from the start, in seconds: choosing and measuring the edges, and "
        "the march. Each lattice has a process of its own, warm. Memory is the process's peak; for "
        "a node, it is how far the peak is above the peak before.",
        "",
        peer,
        "",
        "HFM is HamiltonFastMarching (C++, github.com/Mirebeau/HamiltonFastMarching, model "
        "Riemann2, second order with two-point factoring). Its errors were measured once with that "
        "library as published, and are not run here; it took 0.10 s on 241 nodes a side "
        "and 2.1 to 2.4 s on 961.",
        "",
        *markdown_table(header, map(_marching_row, data.rows)),
    ]


def _paths_table(data: PathsData, shown: str) -> list[str]:
    def cell(found: PathsFound) -> str:
        if shown == "excess":
            return percent(max(found.typical_excess, 0.0))
        text = _seconds(found.timing)
        return text if found.is_near else f"({text})"

    rows = [
        [label, *(cell(found[k]) for found in data.found.values())]
        for k, label in enumerate(data.labels)
    ]
    return markdown_table([shown, *data.found], rows)


def _proofs(data: PathsData) -> Iterable[str]:
    for k, label in enumerate(data.labels):
        gaps = {scene: found[k].gap for scene, found in data.found.items()}
        shown = [f"{scene} {percent(gap)}" for scene, gap in gaps.items() if gap is not None]
        if shown:
            yield f"Gaps that {label} reached: {', '.join(shown)}."


def paths_lines(data: PathsData) -> list[str]:
    """The section on paths: seconds and excess of every planner on every scene."""
    return [
        "From the problem's numbers to a path, warm. In brackets where not every path is within "
        f"{percent(NEAR)} of the true length. *Until near* means that the planner stops when it "
        f"believes its path within {percent(NEAR)}; default settings otherwise. Medians; trees "
        "with a seed for each run.",
        "",
        *_paths_table(data, "seconds"),
        "By how much the paths are longer than the true length, in the median:",
        "",
        *_paths_table(data, "excess"),
        *_proofs(data),
        "",
    ]


def large_maps_lines(data: LargeMapData) -> list[str]:
    """The section on large maps."""
    rows = [
        [
            f"{cells:,}",
            _seconds(found.timing),
            NOTHING if found.memory_peak is None else f"{found.memory_peak / 1e9:.2f}",
            f"{found.length:,.0f}",
            f"{found.coarse_length:,.0f}",
            percent(found.length / found.corridor_bound - 1.0),
            percent(found.length / found.least_length - 1.0),
        ]
        for cells, found in data.found.items()
    ]
    header = ["cells a side", "seconds", "GB in all", "length (m)", "coarse length (m)"]
    header += ["gap in the corridor", "gap on the map"]
    return [
        "A synthetic map, a tiled GeoTIFF of 32-bit heights with hills of all sizes, noise in "
        "every cell and a lake without data, from corner to corner over ground of at most "
        f"{STEEPEST:g} degrees: read coarser, planned on, then read and planned on in a corridor "
        "around the coarse route, by fast marching with refinement and bound. A process of its "
        "own, warm; memory is its peak.",
        "",
        *markdown_table(header, rows),
    ]


def startup_lines(data: StartData) -> list[str]:
    """The section on start-up: each command."""
    rows = [
        [
            runs.label,
            _seconds(found.timing),
            f"{median(found.timing.wall):.3f}",
            f"{median(found.timing.processor):.3f}",
        ]
        for runs, found in data.found
    ]
    return [
        "Whole processes, from their start to their end. Cold: the cache of compiled kernels is "
        "empty, as at the first run after an installation; Python's own cache is not.",
        "",
        *markdown_table(["command", "seconds", "wall time", "processor time"], rows),
    ]


def _disturbance(timings: Sequence[Timing]) -> str:
    """A sentence on how busy the machine was with other jobs."""
    waiting = median(timing.waiting for timing in timings)
    return (
        "Seconds are medians, of processor time or of wall time, whichever is less: the "
        "first leaves out waiting for other jobs. In the median of all measurements here wall "
        f"time was {waiting:.2f} times processor time, so "
        + ("the machine was quiet." if waiting < 1.1 else "**other jobs ran beside them**.")
    )


def make_report(found: Mapping[str, Finding], scale: Scale) -> str:
    """The report's text."""
    targets = [target for finding in found.values() for target in finding.targets]
    met = sum(target.met for target in targets)
    lines = ["# Benchmarks", ""]
    if scale != FULL:
        word = "Quick run" if scale == QUICK else "Reduced run"
        lines += [f"**{word}.** Fewer repetitions, smaller lattices.", ""]
    timings = [timing for finding in found.values() for timing in finding.timings]
    if timings:
        lines += [_disturbance(timings), ""]
    lines += ["## Targets", "", f"{met} of {len(targets)} are met.", "", *_targets_table(targets)]
    for finding in found.values():
        shown = [f"![{finding.title}]({picture.name})" for picture in finding.pictures]
        lines += [f"## {finding.title}", "", *finding.lines, *shown, ""]
    return "\n".join([*lines, *machine_lines()]) + "\n"
