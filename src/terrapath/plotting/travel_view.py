"""Chart of a travel model: the pace of its source, the relaxed one, and the critical grades."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..travel import TravelModel

RAW_COLOUR = "#b0b0b0"
RELAXED_COLOUR = "#e4002b"
CRITICAL_COLOUR = "#0b3dff"
GENTLEST = 0.3  # a chart shows at least the grades up to this one
STEEPEST = 1.5  # and at most those up to this one


def draw_pace(axes: Any, model: TravelModel) -> None:
    """Draw the pace over the grade, before and after relaxation, with the critical grades."""
    low, high = _shown(model)
    # Points at both sides of kinks and of the range's ends, so that jumps are upright.
    marks = [m for m in (*model.pace.kinks, *model.critical, *model.grades) if low < m < high]
    beside = [m + side for m in marks for side in (-1e-9, 0.0, 1e-9)]
    grades = np.unique(np.concatenate([np.linspace(low, high, 1201), beside]))
    known = grades
    if model.beyond == "refuse":
        known = grades[(grades >= model.grades[0]) & (grades <= model.grades[1])]
    raw = model.raw(known)
    relaxed = model(known)
    shown = np.where(np.isfinite(raw), raw, np.nan)
    axes.plot(100.0 * known, shown, color=RAW_COLOUR, lw=4.0, label="pace of the source")
    axes.plot(
        100.0 * known, relaxed, color=RELAXED_COLOUR, lw=1.8, label="relaxed: with switchbacks"
    )
    label = "not convex: a lower bound"
    for bridge in model.bridges:
        start, end = 100.0 * np.clip(bridge, low, high)
        axes.axvspan(start, end, color=RAW_COLOUR, alpha=0.25, lw=0, label=label)
        label = ""  # one entry in the legend
    for grade in model.critical:
        if low <= grade <= high:
            _mark_critical(axes, model, grade)
    floor, top = min(0.0, float(relaxed.min())), float(relaxed.max())
    axes.set(
        xlim=(100.0 * low, 100.0 * high),
        ylim=(floor - 0.03 * (top - floor), top + 0.12 * (top - floor)),
        xlabel="grade (%), uphill to the right",
        ylabel=f"pace ({model.unit} per horizontal metre)",
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", fontsize=9)


def _mark_critical(axes: Any, model: TravelModel, grade: float) -> None:
    pace = float(model(grade))
    axes.axvline(100.0 * grade, color=CRITICAL_COLOUR, ls=":", lw=1.2)
    axes.plot([100.0 * grade], [pace], "o", color=CRITICAL_COLOUR, ms=5)
    axes.annotate(
        f"critical\n{100.0 * grade:.1f} %",
        (100.0 * grade, pace),
        xytext=(-6 if grade > 0 else 6, 10),
        textcoords="offset points",
        ha="right" if grade > 0 else "left",
        color=CRITICAL_COLOUR,
        fontsize=9,
    )


def _shown(model: TravelModel) -> tuple[float, float]:
    """The grades that a chart shows: twice the critical ones, within what is known."""
    low, high = (
        _within(2.0 * abs(critical) if math.isfinite(critical) else 0.0)
        for critical in model.critical
    )
    if model.beyond == "refuse":
        return max(-low, model.grades[0]), min(high, model.grades[1])
    return -low, high


def _within(grade: float) -> float:
    return min(max(grade, GENTLEST), STEEPEST)
