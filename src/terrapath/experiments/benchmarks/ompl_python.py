"""OMPL through Python, in a process of its own: ``python -m ... TASK``.

What a user of OMPL's Python package would write: the objective is a class in Python, which
measures edges by Line-R with NumPy.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from ..._kernels.surfaces import Peaks, Spline
from ...problem import Problem
from ...validation import Array
from .exchange import discs_of, panel_of
from .problems import load_problem
from .timing import Stopwatch

# Boole's weights, but for panels' ends that two of them share.
WEIGHTS = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0

Gradients = Callable[[Array], Array]  # points (m, 2) -> weighted gradients (m, layers, 2)


def _gradients_of_peaks(surface: Peaks) -> Gradients:
    layers = len(surface.weights)
    amplitude, falloff = surface.peaks[:, 0], surface.peaks[:, 1]
    centres = surface.peaks[:, 2:]
    # (layers, peaks): the weight of a peak's own layer, 0 elsewhere.
    owner = np.repeat(np.arange(layers), np.diff(surface.first))
    shares = np.where(owner == np.arange(layers)[:, None], surface.weights[:, None], 0.0)
    factors = -2.0 * amplitude * falloff

    def gradients(points: Array) -> Array:
        offsets = points[:, None, :] - centres
        sizes = factors * np.exp(-falloff * np.einsum("mpi,mpi->mp", offsets, offsets))
        return np.asarray(np.einsum("lp,mpi->mli", shares, sizes[:, :, None] * offsets))

    return gradients


# Of the four cubic B-splines on a cell, by powers of the place in it.
_BASIS = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0
_SLOPES = _BASIS[:, 1:] * np.arange(1, 4)


def _gradients_of_spline(surface: Spline) -> Gradients:
    _, rows, columns = surface.coefficients.shape
    window = np.arange(4)

    def basis(place: Array) -> tuple[Array, Array]:
        powers = place[:, None] ** np.arange(4)
        return powers @ _BASIS.T, powers[:, :3] @ _SLOPES.T

    def gradients(points: Array) -> Array:
        s = (points[:, 0] - surface.x0) / surface.dx
        t = (points[:, 1] - surface.y0) / surface.dy
        i = np.clip(np.floor(s), 0, columns - 4).astype(np.int64)
        j = np.clip(np.floor(t), 0, rows - 4).astype(np.int64)
        bx, sx = basis(s - i)
        by, sy = basis(t - j)
        patch = surface.coefficients[
            :, (j[:, None] + window)[:, :, None], (i[:, None] + window)[:, None, :]
        ]
        found = np.empty((len(points), len(surface.weights), 2))
        found[..., 0] = np.einsum("lmji,mj,mi->ml", patch, by, sx) / surface.dx
        found[..., 1] = np.einsum("lmji,mj,mi->ml", patch, sy, bx) / surface.dy
        return found * surface.weights[:, None]

    return gradients


def line_r_with_numpy(problem: Problem) -> Callable[[float, float, float, float], float]:
    """Line-R in panels over the segment from (ax, ay) to (bx, by), map units."""
    data = problem.surface.data
    gradients = _gradients_of_peaks(data) if isinstance(data, Peaks) else _gradients_of_spline(data)
    panel = panel_of(problem)

    def length(ax: float, ay: float, bx: float, by: float) -> float:
        v = np.array([bx - ax, by - ay])
        panels = max(math.ceil(math.hypot(*v) / panel), 1)
        places = (np.arange(panels)[:, None] + np.arange(5) / 4.0).ravel() / panels
        slopes = gradients(np.array([ax, ay]) + places[:, None] * v) @ v
        speeds = np.sqrt(v @ v + np.einsum("ml,ml->m", slopes, slopes))
        return float((speeds.reshape(panels, 5) @ WEIGHTS).sum() / panels)

    return length


def _is_free(problem: Problem) -> Callable[[float, float, float, float], bool]:
    discs = [tuple(map(float, disc)) for disc in discs_of(problem)]

    def free(ax: float, ay: float, bx: float, by: float) -> bool:
        dx, dy = bx - ax, by - ay
        squared = dx * dx + dy * dy
        for x, y, radius in discs:
            t = ((x - ax) * dx + (y - ay) * dy) / squared if squared > 0.0 else 0.0
            t = min(max(t, 0.0), 1.0)
            if math.hypot(ax + t * dx - x, ay + t * dy - y) <= radius:
                return False
        return True

    return free
