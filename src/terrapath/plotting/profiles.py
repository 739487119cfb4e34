"""Profiles of several paths in one chart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..problem import Path

COLOURS = ("#6e6e6e", "#e4002b", "#0b3dff", "#2e8b3d")


def draw_profiles(axes: Any, paths: Mapping[str, Path], layer: int) -> None:
    """Draw the values of one layer along each path, against the share of its length."""
    for (label, path), colour in zip(paths.items(), COLOURS, strict=False):
        profile = path.profile
        share = profile.value / profile.value[-1]
        axes.plot(100.0 * share, profile.values[:, layer], color=colour, lw=1.8, label=label)
        shown = path.surface.layers[layer]
    unit = f" ({shown.unit})" if shown.unit else ""
    axes.set(xlabel="travelled (% of the path)", ylabel=f"{shown.name}{unit}", xlim=(0, 100))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
