"""The distance near a source, in closed form: there the lattice alone is least accurate."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..space.lattice import Lattice
from ..surface import Surface, metric
from ..validation import Array

# Nodes within this distance of the source, in nodes, take the source model's value.
SEED_RADIUS = 3.0
# Differences are factored by the source model within this distance of the source, in nodes, or
# within two features of the surface where that is less: the model does not hold beyond.
WINDOW_RADIUS = 16

Nodes = npt.NDArray[np.int64]


class SourceModel(NamedTuple):
    """The distance from the source in closed form, on a window of nodes around it."""

    row: int  # of the lattice: the window's first
    column: int  # likewise
    values: Array  # (rows, columns), map units, NaN where the model does not hold
    slope_x: Array  # (rows, columns), of the distance along x1, map units per node
    slope_y: Array  # (rows, columns), along x2
    seeds: Nodes  # (k,), numbers of the nodes that take the model's value
    seed_values: Array  # (k,), map units


def near_distance(surface: Surface, source: tuple[float, float], points: Array) -> Array:
    """Distance (...) under h from a source to points (..., 2) nearby, map units.

    The square of a geodesic's length is that of its chord c plus |II(c, c)|^2 / 12. II is the
    second fundamental form, taken in the middle; so the relative error is of fourth order.
    Costs multiply the length by their mean along the chord, minus what a path saves by bending
    to cheaper ground.
    """
    offsets = points - np.asarray(source)
    middle = np.asarray(source) + 0.5 * offsets
    chords = surface.lift(points) - surface.lift(np.asarray(source))
    weights = surface.data.weights
    bends = (
        np.einsum("...i,...kij,...j->...k", offsets, surface.hessians(middle), offsets) * weights
    )
    pull = np.einsum("...k,...ki->...i", bends * weights, surface.gradients(middle))
    inverse = (
        metric.inverse_metric_tensor(surface, middle) * surface.cost(middle)[..., None, None] ** 2
    )
    normal = np.square(bends).sum(-1) - np.einsum("...i,...ij,...j->...", pull, inverse, pull)
    squared = np.square(chords).sum(-1)
    # On rough ground the formula fails beyond the next bump, so what it adds is limited.
    squared += np.minimum(np.maximum(normal, 0.0) / 12.0, 0.05 * squared)
    distance = np.asarray(np.sqrt(squared))
    return distance * _mean_cost(surface, source, points, inverse) if surface.costs else distance


def _mean_cost(
    surface: Surface, source: tuple[float, float], points: Array, inverse: Array
) -> Array:
    """The factor (...) of the cost on distances to points (..., 2) nearby.

    It is Simpson's mean of the cost along the chord, of length d. Where the logarithm of the cost
    has the slope g across the chord, bending to cheaper ground saves the share g^2 d^2 / 24.
    inverse : (..., 2, 2), of h in the middle, without costs.
    """
    offsets = points - np.asarray(source)
    middle = np.asarray(source) + 0.5 * offsets
    mean = (
        surface.cost(np.asarray(source)) + 4.0 * surface.cost(middle) + surface.cost(points)
    ) / 6
    slope = surface.log_cost_jets(middle)[..., 1:3]
    squared = np.einsum("...i,...ij,...j->...", offsets, np.linalg.inv(inverse), offsets)
    squared_slope = np.einsum("...i,...ij,...j->...", slope, inverse, slope)
    saved = (squared_slope * squared - np.square((slope * offsets).sum(-1))) / 24.0
    return np.asarray(mean * (1.0 - np.clip(saved, 0.0, 0.05)))


def model_source(
    lattice: Lattice,
    source: tuple[float, float],
    radius: float,
    distance: Callable[[Array], Array],
    is_visible: Callable[[Array], npt.NDArray[np.bool_]] | None = None,
) -> SourceModel:
    """The model on all nodes at most ``radius`` rows and columns from the source.

    distance : points (..., 2) -> (...), map units. is_visible : points (m, 2) -> (m,) bool.
    """
    column = (source[0] - lattice.bounds.x1_min) / lattice.dx
    row = (source[1] - lattice.bounds.x2_min) / lattice.dy
    columns = np.arange(max(math.floor(column - radius), 0), min(column + radius + 1, lattice.nx))
    rows = np.arange(max(math.floor(row - radius), 0), min(row + radius + 1, lattice.ny))
    columns, rows = columns.astype(np.int64), rows.astype(np.int64)
    points = np.stack(np.meshgrid(lattice.x[columns], lattice.y[rows]), axis=-1)
    values = distance(points)
    if is_visible is not None:
        values[~is_visible(points.reshape(-1, 2)).reshape(values.shape)] = np.nan
    slope_x, slope_y = (_slope(distance, points, lattice, axis) for axis in range(2))
    steps = np.hypot(*np.meshgrid(columns - column, rows - row))
    planted = (steps <= SEED_RADIUS) & ~np.isnan(values)
    seeds = (rows[:, None] * lattice.nx + columns)[planted]
    return SourceModel(
        int(rows[0]), int(columns[0]), values, slope_x, slope_y, seeds, values[planted]
    )


def _slope(distance: Callable[[Array], Array], points: Array, lattice: Lattice, axis: int) -> Array:
    """Derivative of the distance along an axis, per node, by central differences."""
    nodes = 1e-4  # small, and far above rounding
    step = np.zeros(2)
    step[axis] = nodes * (lattice.dx, lattice.dy)[axis]
    bounds = lattice.bounds
    ahead = np.clip(points + step, bounds[:2], bounds[2:])
    behind = np.clip(points - step, bounds[:2], bounds[2:])
    width = (ahead - behind)[..., axis] / (lattice.dx, lattice.dy)[axis]
    return np.asarray((distance(ahead) - distance(behind)) / width)


def window_radius(surface: Surface, lattice: Lattice) -> float:
    """Within how many nodes of the source its model is used."""
    features = 2.0 * surface.resolution / max(lattice.dx, lattice.dy)
    return min(max(features, SEED_RADIUS + 1.0), WINDOW_RADIUS)
