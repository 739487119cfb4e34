"""The report in Markdown: the paper's numbers, our numbers and the true lengths."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from .experiments import (
    CONVERGENCE_SCENE,
    FULL,
    PRINTED_LIMIT,
    QUICK,
    SECTOR,
    STEP,
    ComparativeData,
    ComparedPath,
    ConvergenceData,
    RepeatData,
    SceneData,
    SensitivityData,
    Settings,
)
from .nonsmooth import SmoothedPath, by_surface, observed_order

NOTHING = "-"


def _length(value: float | None) -> str:
    return NOTHING if value is None else f"{value:.5f}"


def _excess(value: float | None, true_length: float) -> str:
    """By how much a length exceeds the true length, in percent."""
    if value is None:
        return NOTHING
    # Adding 0 makes a rounded -0 a 0.
    return f"{round(100.0 * (value / true_length - 1.0), 2) + 0.0:+.2f} %"


def markdown_table(
    header: Sequence[str], rows: Iterable[Sequence[str]], align: str = "---:"
) -> list[str]:
    """The lines of a table in Markdown; the first column is aligned to the left."""
    lines = [header, ["---", *[align] * (len(header) - 1)], *rows]
    return [*("| " + " | ".join(line) + " |" for line in lines), ""]


def _spread(lengths: Sequence[float]) -> list[str]:
    """The mean, the least and the largest length."""
    return [_length(float(np.mean(lengths))), _length(min(lengths)), _length(max(lengths))]


def _scene_table(data: SceneData) -> list[str]:
    printed, truth = data.printed, data.truth.true_length
    runs = data.at(STEP)
    fan, wide = data.traversal, data.truth
    measured = [
        ("RRT\\*-R", printed.rrt_star_r, [p.length for p in runs.rrt_star_r]),
        ("RRT\\* by chords, true length", printed.chord, [p.length for p in runs.chord]),
        ("RRT\\* by chords, as believed", printed.chord, [p.cost for p in runs.chord]),
    ]
    rows = [
        [
            name,
            _length(paper),
            *_spread(lengths),
            _length(truth),
            _excess(paper, truth),
            _excess(float(np.mean(lengths)), truth),
        ]
        for name, paper, lengths in measured
    ]
    single = [
        (f"geodesic of {printed.directions} that ends near the goal", fan.paper_length),
        ("shortest geodesic of these that hits the goal", fan.true_length),
        ("shortest geodesic of the wide search", wide.true_length),
    ]
    for name, length in single:
        excesses = [_excess(printed.geodesic, truth), _excess(length, truth)]
        rows.append(
            [name, _length(printed.geodesic), _length(length), "", "", _length(truth), *excesses]
        )
    header = ["quantity", "paper", "ours (mean)", "least", "largest", "true length"]
    return markdown_table([*header, "paper's excess", "our excess"], rows)


def _step_table(data: SceneData) -> list[str]:
    truth = data.truth.true_length
    rows = []
    for effect in data.steps:
        ours = float(np.mean([p.length for p in effect.rrt_star_r]))
        believed = float(np.mean([p.cost for p in effect.chord]))
        chord = float(np.mean([p.length for p in effect.chord]))
        values = [text for v in (ours, believed, chord) for text in (_length(v), _excess(v, truth))]
        rows.append([f"{effect.step:g}", *values])
    header = ["step", "RRT\\*-R", "excess", "by chords, believed", "excess"]
    return markdown_table([*header, "by chords, true", "excess"], rows)


def _scene_section(data: SceneData, settings: Settings) -> list[str]:
    runs = settings.scale.seeds
    others = [
        geodesic.length
        for geodesic in data.truth.geodesics
        if geodesic.length > data.truth.true_length + 1e-6 and not geodesic.conjugate_points
    ]
    other = f"; the next that is locally shortest has {others[0]:.6f}" if others else ""
    return [
        f"{settings.scale.samples:,} samples, {runs} runs. Excess is over the true length, that of "
        f"the shortest geodesic, {data.truth.true_length:.9f}{other}. The paper does not say "
        "whether its chord length is what that planner believed or the true length of its path.",
        "",
        *_scene_table(data),
        f"{data.traversal.near} of the {data.printed.directions} rays pass within 0.5 of the goal. "
        "The shortest of them is measured to where it is closest to the goal, as in the paper; it "
        "need not be near the shortest geodesic, and may come out too short.",
        "",
        f"The step is not in the paper. It bounds the near radius, too. Means of {runs} runs "
        "with others; long chords tunnel through the peaks, so their planner believes in less "
        "than the true length while its path gets longer:",
        "",
        *_step_table(data),
    ]


def _compared_rows(data: ComparativeData, scene: str, name: str) -> list[str]:
    paths = data.planned_on(scene)

    def mean(read: Callable[[ComparedPath], float]) -> str:
        return _length(float(np.mean([read(path) for path in paths])))

    return [
        f"planned {name} resistance",
        mean(lambda p: p.height_only),
        mean(lambda p: p.with_resistance),
        mean(lambda p: p.highest),
        mean(lambda p: p.most_resistance),
    ]


def _comparative_section(data: ComparativeData, settings: Settings) -> list[str]:
    rows = [
        _compared_rows(data, "four-peaks", "without"),
        _compared_rows(data, "six-peaks", "with"),
        [
            "true shortest",
            _length(data.true_height_only),
            _length(data.true_with_resistance),
            NOTHING,
            NOTHING,
        ],
    ]
    header = ["path", "length, height only", "length, height and resistance"]
    return [
        "The hills of six-peaks, planned without and with the ground's resistance; means of "
        f"{settings.scale.seeds} runs. The paper prints no number here, but says that the path "
        "without resistance is shorter there and leads over the peaks of resistance.",
        "",
        *markdown_table([*header, "highest", "most resistance"], rows),
    ]


def _repeat_section(data: list[RepeatData], settings: Settings) -> list[str]:
    rows = []
    for runs in data:
        values, truth = np.array(runs.lengths), runs.truth.true_length
        quartiles = np.quantile(values, [0.0, 0.25, 0.5, 0.75, 1.0])
        mean, deviation = float(values.mean()), float(values.std(ddof=1))
        shown = [_length(mean), _length(deviation), *map(_length, quartiles.tolist())]
        rows.append([runs.scene, *shown, _length(truth), _excess(mean, truth)])
    header = ["scene", "mean", "sd", "min", "quartile", "median", "quartile", "max"]
    return [
        f"{len(data[0].lengths)} runs, {settings.scale.samples:,} samples each. The paper shows "
        "box plots without numbers.",
        "",
        *markdown_table([*header, "true length", "excess of the mean"], rows),
        *_outside_sector(data),
    ]


def _outside_sector(data: list[RepeatData]) -> list[str]:
    """A line for each scene whose shortest geodesic the paper's traversal cannot find."""
    lines = []
    for runs in data:
        angle = float(np.degrees(runs.truth.geodesics[0].angle))
        if not 0.0 <= angle <= 90.0:
            lines += [
                f"The shortest geodesic of {runs.scene} starts at {angle:.2f} degrees, outside the "
                "sector from 0 to 90 degrees that the paper traverses.",
                "",
            ]
    return lines


def _convergence_section(data: ConvergenceData, settings: Settings) -> list[str]:
    rows = []
    for samples, lengths in zip(data.samples, data.lengths, strict=True):
        mean, low, high = _spread(lengths)
        deviation = _length(float(np.std(lengths, ddof=1)))
        excess = _excess(float(np.mean(lengths)), data.true_length)
        rows.append([f"{samples:,}", mean, deviation, low, high, _length(data.true_length), excess])
    header = ["samples", "mean", "sd", "min", "max", "true length", "excess of the mean"]
    return [
        f"{len(data.lengths[0])} runs for each number of samples. The paper's curve goes to "
        f"{PRINTED_LIMIT}, the length of a geodesic on a scene that it does not name; no scene "
        f"that it prints was seen to have that length. Shown here is {CONVERGENCE_SCENE}, whose "
        f"true length is {data.true_length:.9f}.",
        "",
        *markdown_table(header, rows),
    ]


def _wildest(data: SensitivityData, count: int = 5) -> list[list[str]]:
    """The highest local maxima of the movement, highest first."""
    angles, movement = np.array(data.found.angles), np.array(data.found.movement)
    inner = movement[1:-1]
    peaks = 1 + np.flatnonzero((inner > movement[:-2]) & (inner >= movement[2:]))
    peaks = peaks[np.argsort(-movement[peaks], kind="stable")][:count]
    return [
        [
            data.scene,
            f"{np.degrees(angles[k]):.3f}",
            f"{movement[k]:,.1f}",
            f"{movement[k] / data.sweep.length:,.1f}",
        ]
        for k in peaks
    ]


def _sensitivity_section(data: list[SensitivityData], settings: Settings) -> list[str]:
    rows = [row for item in data for row in _wildest(item)]
    header = ["scene", "direction (degrees)", "movement (map units a radian)", "times flat ground"]
    return [
        "The paper reports that a very small change of the initial direction can change the shape "
        "of a geodesic dramatically, without a number. The Jacobi field is that number: how far "
        "the point at the length of the shortest geodesic moves per radian of the direction. On "
        f"flat ground it is the length itself. {len(data[0].found.angles):,} directions from 0 to "
        "90 degrees; the directions that move it the most:",
        "",
        *markdown_table(header, rows),
    ]


def _smoothing_section(data: list[SmoothedPath], settings: Settings) -> list[str]:
    lines = [
        "The paper leaves surfaces with edges open. Here a cone, a square pyramid and a cliff, of "
        "slope 1 and height 2, are smoothed by a Gaussian of the given standard deviation (map "
        "units); the lengths are those of exact geodesics, and the true ones come from unrolling "
        "the sharp surface.",
        "",
    ]
    header = ["surface", "scale", "largest change", "rms change", "length", "true", "error"]
    rows = [
        [
            row.surface,
            f"{row.scale:g}",
            f"{row.largest_change:.4f}",
            f"{row.rms_change:.5f}",
            f"{row.length:.6f}",
            f"{row.true_length:.6f}",
            f"{row.relative_error:+.2e}",
        ]
        for row in data
    ]
    orders = ", ".join(
        f"{name} {observed_order([r.scale for r in rows], [r.relative_error for r in rows]):.2f}"
        for name, rows in by_surface(data).items()
    )
    return [
        *lines,
        *markdown_table(header, rows),
        f"Order of the error in the scale, fitted over all scales: {orders}. A geodesic misses "
        "the apex of a cone, so its error is of second order; it crosses the edges of a pyramid, "
        "first order. A cliff's error goes as s times the root of a logarithm of 1/s, so its order "
        "reaches 1 only slowly. A smoothed edge always shortens the path.",
        "",
    ]


_SECTIONS: dict[str, tuple[str, Callable[[Any, Settings], list[str]]]] = {
    "one-peak": ("One peak (3-D)", _scene_section),
    "three-peaks": ("Three peaks (3-D)", _scene_section),
    "six-peaks": ("Six peaks (4-D)", _scene_section),
    "comparative": ("Comparative experiment", _comparative_section),
    "repeat": ("Repeatability", _repeat_section),
    "convergence": ("Convergence", _convergence_section),
    "sensitivity": ("Sensitivity of geodesics", _sensitivity_section),
    "smoothing": ("Ground with edges", _smoothing_section),
}


def _open_settings(settings: Settings) -> list[str]:
    planner = settings.planner()
    low, high = np.degrees(SECTOR)
    rows = [
        ["step", f"{STEP:g} map unit, and others for comparison"],
        [
            "neighbours",
            "within min(step, g sqrt(A log n / n)) of n vertices, A the region's area, g "
            f"{planner.radius_factor:g} times the least that optimality needs (Karaman and "
            "Frazzoli 2011)",
        ],
        ["distance that chooses neighbours", "Euclidean, on the plane"],
        ["samples that are the goal", f"{planner.goal_bias:.0%}, until it is reached"],
        [
            "sampling",
            "uniform over the region, before and after the first path; from 2,048 samples on "
            "in batches of a quarter of those before, taken in the order in which they lie",
        ],
        ["cost of a new vertex", "updated when its parent changes; Algorithm 3 leaves that out"],
        ["goal", "joins the tree as a vertex as soon as a step reaches it"],
        ["length that is reported", "true length under h of the path found, to 1e-9"],
        [
            "runs behind a number",
            f"seeds {settings.seed}, {settings.seed + 1}, ...; the paper: one",
        ],
        [
            "true lengths",
            "shortest of the geodesics that hit the goal exactly, found between the neighbours of "
            f"{settings.scale.directions:,} directions from {low:.0f} to {high:.0f} degrees",
        ],
    ]
    return [
        "## What the paper leaves open",
        "",
        *markdown_table(["setting", "chosen"], rows, align="---"),
    ]


def _scale_note(settings: Settings) -> list[str]:
    if settings.scale == FULL:
        return []
    full, used = FULL, settings.scale
    word = "Quick run" if used == QUICK else "Reduced run"
    return [
        f"**{word}.** {used.samples:,} samples instead of {full.samples:,}, {used.seeds} runs a "
        f"scene instead of {full.seeds}, {used.repeats} repetitions instead of {full.repeats}, "
        f"convergence up to {used.convergence_samples[-1]:,} samples instead of "
        f"{full.convergence_samples[-1]:,} with {used.convergence_runs} runs each instead of "
        f"{full.convergence_runs}, {used.directions:,} directions instead of "
        f"{full.directions:,}.",
        "",
    ]


def processor() -> str:
    """The processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def machine_lines() -> list[str]:
    """The report's section on the machine and on the versions of libraries."""
    packages = ", ".join(f"{p} {version(p)}" for p in ("numpy", "scipy", "numba", "matplotlib"))
    return [
        "## Machine and versions",
        "",
        f"{processor()}, {os.cpu_count()} logical cores, {platform.system()} "
        f"{platform.machine()}. terrapath {__version__}, Python {platform.python_version()}, "
        f"{packages}.",
    ]


def make_report(found: Mapping[str, tuple[object, Sequence[Path]]], settings: Settings) -> str:
    """The report's text.

    found : for each experiment its data and its pictures. The same data give the same text.
    """
    lines = [
        "# The paper's section 5, reproduced",
        "",
        *_scale_note(settings),
        "Lengths are in map units. Region [-1, 11] x [-1, 11], start (0, 0), goal (10, 10).",
        "",
        *_open_settings(settings),
    ]
    for name, (data, pictures) in found.items():
        title, section = _SECTIONS[name]
        shown = [f"![{title}]({picture.name})" for picture in pictures]
        lines += [f"## {title}", "", *section(data, settings), *shown, ""]
    return "\n".join([*lines, *machine_lines()]) + "\n"
