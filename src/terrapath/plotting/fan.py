"""A fan of geodesics in the plane, and how far the ends of its rays move as they turn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm

from ..geodesics.rays import Ray
from ..planners import Fan
from ..problem import Problem
from ..validation import Array
from .map_view import PATH_COLOUR, draw_ends, draw_ground

# The paper's colours: all rays, those near the goal, and the shortest of these.
RAY_COLOUR, NEAR_COLOUR = "#2e8b3d", "#0b3dff"
MOVEMENT_COLOURS = "inferno_r"
PAIR_COLOURS = (NEAR_COLOUR, "#00b3b3")
# Opacity of the ground under many lines.
PALE = 0.3
MOST_RAYS_DRAWN = 800


def draw_fan(axes: Any, problem: Problem, fan: Fan, shortest: Array) -> None:
    """Draw rays green, those that pass near the goal blue, the shortest geodesic red.

    shortest : (m, 2), the shortest geodesic that ends at the goal, map units.
    """
    draw_ground(axes, problem, PALE)
    near = [ray.points for ray, is_near in zip(fan.rays, fan.near, strict=True) if is_near]
    away = [ray.points for ray, is_near in zip(fan.rays, fan.near, strict=True) if not is_near]
    for rays, colour, width, label in (
        (away, RAY_COLOUR, 0.35, "rays"),
        (near, NEAR_COLOUR, 1.1, "near the goal"),
    ):
        axes.add_collection(LineCollection(rays, colors=colour, linewidths=width, zorder=3))
        axes.plot([], [], color=colour, lw=1.5, label=label)
    axes.plot(*shortest.T, color=PATH_COLOUR, lw=2.4, zorder=5, label="shortest")
    draw_ends(axes, problem)
    axes.legend(loc="upper left", fontsize=8, framealpha=0.85)


def draw_movement_fan(
    axes: Any, problem: Problem, rays: Sequence[Ray], movement: Array, pair: Sequence[Ray]
) -> None:
    """Draw rays coloured by the movement of their ends (n,), map units per radian.

    Rays with the largest movement are on top. pair : two rays with nearly the same direction that
    end far apart; they are drawn over the others.
    """
    draw_ground(axes, problem, PALE)
    shown = np.arange(0, len(rays), -(-len(rays) // MOST_RAYS_DRAWN))
    order = shown[np.argsort(movement[shown])]
    colours = LineCollection(
        [rays[k].points for k in order],
        array=movement[order],
        cmap=MOVEMENT_COLOURS,
        norm=LogNorm(*np.quantile(movement, [0.02, 0.98])),
        linewidths=0.5,
        zorder=3,
    )
    axes.add_collection(colours)
    apart = np.degrees(pair[-1].angle - pair[0].angle)
    label = f"two rays {apart:.2g} degrees apart"
    for k, (ray, colour) in enumerate(zip(pair, PAIR_COLOURS, strict=True)):
        style = {"lw": 2.0, "zorder": 4, "label": label if k == 0 else "the second of them"}
        axes.plot(*ray.points.T, color=colour, **style)
    draw_ends(axes, problem)
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9)
    label = "movement of the end (map units per radian)"
    axes.figure.colorbar(colours, ax=axes, label=label, shrink=0.72, pad=0.02, extend="both")


def draw_movement(axes: Any, angles: Array, movement: Array, length: float, exact: Array) -> None:
    """Draw the movement of the end against the initial direction, on a logarithmic scale.

    angles : (n,), radians. movement : (n,), map units per radian. length : of the rays; on flat
    ground it equals their movement. exact : (k,), directions of the geodesics that end at the
    goal, the shortest first, radians.
    """
    degrees = np.degrees(angles)
    style: dict[str, Any] = {"lw": 0.7, "color": "black", "zorder": 3}
    axes.semilogy(degrees, movement, label="movement of the end", **style)
    axes.axhline(length, color=RAY_COLOUR, ls="--", lw=1.2, label="on flat ground")
    hits = np.degrees(exact[(exact >= angles[0]) & (exact <= angles[-1])])
    style = {"ms": 9, "color": NEAR_COLOUR, "label": "directions that hit the goal"}
    axes.plot(hits, np.full(len(hits), 0.02), "|", transform=axes.get_xaxis_transform(), **style)
    axes.axvline(
        np.degrees(exact[0]), color=PATH_COLOUR, lw=1.4, label="direction of the shortest path"
    )
    axes.set(
        xlabel="initial direction (degrees)",
        ylabel="movement of the end (map units per radian)",
        xlim=(degrees[0], degrees[-1]),
        ylim=(1.0, 6.0 * movement.max()),
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", ncols=2, fontsize=8, framealpha=0.9)
