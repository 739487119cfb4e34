"""Charts of many runs: box plots, and lengths against the number of samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..validation import Array

TRUE_COLOUR = "#e4002b"
BOX_COLOUR = "#9ecae1"


def draw_box(axes: Any, lengths: Sequence[float], true_length: float, title: str) -> None:
    """Draw a box plot of path lengths (map units), with a point for each run beside it."""
    values = np.asarray(lengths)
    axes.boxplot(
        values,
        positions=[0.0],
        widths=0.35,
        patch_artist=True,
        boxprops={"facecolor": BOX_COLOUR},
        medianprops={"color": "black", "lw": 1.6},
        flierprops={"marker": "x", "ms": 5},
    )
    # Spread by their index, not at random, so that the picture is the same every time.
    spread = 0.36 + 0.22 * (np.arange(len(values)) * 0.618034 % 1.0)
    axes.plot(spread, values, "o", ms=3, color="#08519c", alpha=0.5, mew=0.0)
    axes.axhline(true_length, color=TRUE_COLOUR, lw=1.6, label=f"true: {true_length:.5f}")
    axes.set(title=title, ylabel="path length (map units)", xlim=(-0.4, 0.75), xticks=[])
    axes.grid(axis="y", alpha=0.3)
    axes.legend(loc="upper right", fontsize=9)
    low, high = min(values.min(), true_length), max(values.max(), true_length)
    axes.set_ylim(low - 0.06 * (high - low), high + 0.22 * (high - low))


def draw_orders(axes: Any, scales: Sequence[float], errors: Array, name: str) -> None:
    """Draw relative errors against a length scale, on logarithmic axes; scales, errors: (k,)."""
    axes.loglog(scales, np.abs(errors), "o-", lw=1.6, ms=5, label=name)
    axes.set(
        xlabel="scale of the smoothing (map units)",
        ylabel="relative error of the length (absolute value)",
    )
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=9)


def draw_convergence(axes: Any, samples: Sequence[int], lengths: Array, true_length: float) -> None:
    """Draw the mean length against samples, with one standard deviation and the extremes.

    samples : (k,). lengths : (k, runs), map units.
    """
    mean, spread = lengths.mean(axis=1), lengths.std(axis=1, ddof=1)
    low, high = lengths.min(axis=1), lengths.max(axis=1)
    axes.fill_between(samples, low, high, color=BOX_COLOUR, alpha=0.4, lw=0, label="extremes")
    axes.errorbar(
        samples, mean, spread, color="#08519c", marker="o", ms=5, capsize=3, label="mean and sd"
    )
    axes.axhline(
        true_length, color="black", ls=":", lw=1.6, label=f"true length: {true_length:.5f}"
    )
    axes.set(xlabel="samples", ylabel="path length (map units)")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
