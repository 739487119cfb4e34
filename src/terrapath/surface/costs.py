"""Cost layers: what multiplies the length of a way by its level, on the knots of a surface."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from .._kernels.surfaces import Spline
from ..errors import InputError
from ..validation import Array


def require_costs(values: Array, x: Array, y: Array, names: Sequence[str]) -> None:
    """Raise InputError where a cost (layers, ny, nx) is not above 0, naming the place."""
    bad = np.argwhere(~(values > 0.0))
    if len(bad):
        k, j, i = bad[0]
        raise InputError(
            f"cost {names[k]!r} is {values[k, j, i]:g} at x1={x[i]:.10g}, x2={y[j]:.10g} and not "
            f"above 0 in {len(bad)} cells; a cost multiplies lengths, so block what is forbidden "
            "and give the rest a cost above 0"
        )


def _at_knots(coefficients: Array) -> Array:
    """Values (layers, ny, nx) of a spline at its knots."""
    c = (coefficients[:, :-2] + 4.0 * coefficients[:, 1:-1] + coefficients[:, 2:]) / 6.0
    return np.asarray((c[..., :-2] + 4.0 * c[..., 1:-1] + c[..., 2:]) / 6.0)


def limited(logs: Spline) -> Spline:
    """A spline made to stay, anywhere, between its values at the knots around.

    Costs have sharp edges, where an interpolating spline swings below the least of them and
    so makes ground cheap that is not. Its coefficients are kept within the values of the 3 x 3
    nodes around each; on smooth ground off the extremes they are there anyway.
    """
    values = _at_knots(logs.coefficients)
    around = np.pad(values, ((0, 0), (1, 1), (1, 1)), mode="edge")
    low = minimum_filter(around, size=(1, 3, 3), mode="nearest")
    high = maximum_filter(around, size=(1, 3, 3), mode="nearest")
    return logs._replace(coefficients=np.clip(logs.coefficients, low, high))


def with_costs(data: Spline, logs: Spline | None) -> Spline:
    """A surface's data under cost layers: the product of each cost to its weight."""
    if logs is None:
        return data
    total = np.tensordot(logs.weights, logs.coefficients, axes=1)
    return data._replace(
        log_cost=np.ascontiguousarray(total[None]), floor=math.exp(float(total.min()))
    )
