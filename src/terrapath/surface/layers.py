"""Layers: the scalar fields over the plane that make up a surface, and its cost layers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple, get_args

import numpy as np

from .._kernels.surface.cells import NO_CELLS, CostCells
from .._kernels.surface.surfaces import Peaks, Spline
from .._kernels.travel.priced import PricedSpline
from .._support.memory import blocks
from ..errors import InputError
from ..validation import Array, require_choice, require_not_negative
from .bounds import Bounds

if TYPE_CHECKING:
    from typing_extensions import TypeIs

Kind = Literal["rise", "cost", "cells"]


LONGEST_NAME = 200  # letters of a layer's name, which stands in tables, files and figures


@dataclass(frozen=True)
class Layer:
    """One scalar field over the plane.

    For a layer of the kind "rise", a change along a path costs. The layer times its weight is a
    coordinate of R^n: a change of one unit counts as ``weight`` map units of travel. For a layer
    of the kind "cost" or "cells", the value itself costs: lengths are multiplied by the layer to
    the power of ``weight``. A layer of the kind "cost" is smooth; one of the kind "cells" is
    constant in each cell of its raster.
    """

    name: str
    unit: str = ""
    weight: float = 1.0
    kind: Kind = "rise"

    def __str__(self) -> str:
        unit = f" [{self.unit}]" if self.unit else ""
        if self.kind != "rise":
            power = f" ^ {self.weight:g}" if self.weight != 1.0 else ""
            cells = " in cells" if self.kind == "cells" else ""
            return f"cost {self.name}{unit}{power}{cells}"
        weight = f" x {self.weight:g}" if self.weight != 1.0 else ""
        return f"{self.name}{unit}{weight}"


def make_layers(
    count: int,
    names: Sequence[str] | None,
    units: Sequence[str] | None,
    weights: Sequence[float] | None,
    kinds: Sequence[str] | None = None,
) -> tuple[Layer, ...]:
    """Layers with defaults: the first is the height, the others are numbered as x_k."""
    kinds = ["rise"] * count if kinds is None else kinds
    names = ["height", *(f"x{k}" for k in range(4, count + 3))] if names is None else names
    units = [""] * count if units is None else units
    weights = [1.0] * count if weights is None else weights
    lists = (("names", names), ("units", units), ("weights", weights), ("kinds", kinds))
    for what, given in lists:
        if len(given) != count:
            raise InputError(f"{what} has {len(given)} entries for {count} layers; give one each")
    if len(set(names)) != count:
        raise InputError(f"names={list(names)} repeats a name; layers need distinct names")
    for name in names:
        if len(str(name)) > LONGEST_NAME:
            raise InputError(
                f"the layer's name {str(name)[:40]!r}... has {len(str(name)):,} letters; give it "
                f"one of at most {LONGEST_NAME}"
            )
    for name, weight, kind in zip(names, weights, kinds, strict=True):
        require_not_negative(**{f"the weight of {name}": weight})
        require_choice(get_args(Kind), **{f"the kind of {name}": kind})
    return tuple(
        Layer(str(n), str(u), float(w), k)  # type: ignore[arg-type] # checked
        for n, u, w, k in zip(names, units, weights, kinds, strict=True)
    )


def weights_of(layers: Sequence[Layer], kind: Kind | None = None) -> Array:
    """(layers,): their weights; of those of a kind alone where it is given."""
    return np.array([layer.weight for layer in layers if kind in (None, layer.kind)])


# A slope above this is not real ground: most often a no-data value that a file does not declare.
STEEPEST = 1e12


def _steepest_of(coefficients: Array, dx: float, dy: float) -> float:
    """An upper bound on the slope of one spline layer, found block by block."""
    steepest = 0.0
    for rows in blocks(*coefficients.shape):
        block = coefficients[rows.start : rows.stop + 1]
        along_x = np.abs(np.diff(block, axis=1)).max() / dx
        along_y = np.abs(np.diff(block, axis=0)).max(initial=0.0) / dy
        steepest = max(steepest, float(along_x), float(along_y))
    return steepest


def is_spline(data: Peaks | Spline) -> TypeIs[Spline]:
    """Is it a spline and no exact peaks, with a pace or without?"""
    return isinstance(data, Spline | PricedSpline)


def _steepest(data: Peaks | Spline) -> float:
    """An upper bound on the weighted slope of every layer, layer units/map unit."""
    with np.errstate(over="ignore"):
        if not is_spline(data):
            amplitude, falloff = np.abs(data.peaks[:, 0]), data.peaks[:, 1]
            weights = np.repeat(data.weights, np.diff(data.first))
            slopes = weights * amplitude * np.sqrt(2.0 * falloff / math.e)
            return float(slopes.max(initial=0.0))
        slopes = [_steepest_of(layer, data.dx, data.dy) for layer in data.coefficients]
        return float((data.weights * slopes).max())


def require_ground(data: Peaks | Spline) -> None:
    """Raise InputError where slopes are not those of real ground."""
    slope = _steepest(data)
    if not slope <= STEEPEST:
        raise InputError(
            f"the surface has slopes of up to {slope:.2g}, over {STEEPEST:g}; check the "
            "units and the weights, and whether the map declares its no-data value"
        )


# Cost layers: their values multiply lengths


def require_costs(values: Array, x: Array, y: Array, name: str) -> None:
    """Raise InputError where a cost (ny, nx) is not above 0, naming the place."""
    bad = np.argwhere(~(values > 0.0))
    if len(bad):
        j, i = bad[0]
        raise InputError(
            f"cost {name!r} is {values[j, i]:g} at x1={x[i]:.10g}, x2={y[j]:.10g} and not "
            f"above 0 in {len(bad)} cells; a cost multiplies lengths, so block what is forbidden "
            "and give the rest a cost above 0"
        )


# Up to this, squares of costs are finite in single precision too.
LARGEST_COST = 1e12


def require_cost_range(data: Peaks | Spline) -> None:
    """Raise InputError where the product of all costs is beyond 1e-12 to 1e12."""
    if not is_spline(data):
        return
    ranges = [(float(k.min()), float(k.max())) for k in _logs(data)]
    low, high = (math.fsum(ends) for ends in zip(*ranges, strict=True)) if ranges else (0.0, 0.0)
    most = math.log(LARGEST_COST)
    if not -most <= low <= high <= most:
        raise InputError(
            f"the costs, to their weights, reach from 1e{low / math.log(10):.3g} to "
            f"1e{high / math.log(10):.3g}, beyond {1.0 / LARGEST_COST:g} to {LARGEST_COST:g}; "
            "scale them, or lower their weights"
        )


def _logs(data: Spline) -> list[Array]:
    """Logarithms of the smooth cost and of the cells' costs, where there are such."""
    with np.errstate(divide="ignore"):
        return [k for k in (data.log_cost, np.log(data.cells.costs)) if k.size]


def typical_cost(data: Peaks | Spline) -> float:
    """The geometric mean of the cost."""
    if not is_spline(data):
        return 1.0
    return math.exp(math.fsum(float(logs.mean()) for logs in _logs(data)))


def at_knots(coefficients: Array) -> Array:
    """Values (..., ny, nx) at its knots of a spline with coefficients (..., ny + 2, nx + 2)."""
    c = coefficients[..., :-2, :] + 4.0 * coefficients[..., 1:-1, :] + coefficients[..., 2:, :]
    c = c / 6.0
    return np.asarray((c[..., :-2] + 4.0 * c[..., 1:-1] + c[..., 2:]) / 6.0)


def limited(logs: Spline) -> Spline:
    """A spline that is limited, everywhere, to the range of its values at the knots around.

    Costs have sharp edges. There an interpolating spline falls below the least cost, and makes
    expensive ground cheap. So each coefficient is limited to the range of the values at the
    3 x 3 knots around it. On smooth ground, away from extremes, this changes nothing.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    values = at_knots(logs.coefficients)
    around = np.pad(values, ((0, 0), (1, 1), (1, 1)), mode="edge")
    low = minimum_filter(around, size=(1, 3, 3), mode="nearest")
    high = maximum_filter(around, size=(1, 3, 3), mode="nearest")
    return logs._replace(coefficients=np.clip(logs.coefficients, low, high))


def with_costs(data: Spline, logs: Spline | None, cells: CostCells = NO_CELLS) -> Spline:
    """A surface's data with its cost: the product of the cost layers, each to its weight."""
    if logs is None:
        return data._replace(cells=cells, floor=cells.least)
    total = np.tensordot(logs.weights, logs.coefficients, axes=1)
    return data._replace(
        log_cost=np.ascontiguousarray(total[None]),
        cells=cells,
        floor=math.exp(float(total.min())) * cells.least,
    )


class Span(NamedTuple):
    """Limits that hold for a surface everywhere inside a rectangle."""

    least: float  # the smooth cost is never lower
    steepest: float  # the slope of that cost on the plane is never larger, 1/map unit
    rise: float  # the layers of two points never differ by more, weighted, map units


def span_within(data: Spline, bounds: Bounds) -> Span:
    """Limits of the cost and the layers inside a rectangle, from the spline's coefficients."""
    rows = cells_within(bounds.x2_min, bounds.x2_max, data.y0, data.dy, data.log_cost.shape[1])
    columns = cells_within(bounds.x1_min, bounds.x1_max, data.x0, data.dx, data.log_cost.shape[2])
    logs, layers = data.log_cost[0, rows, columns], data.coefficients[:, rows, columns]
    slope = math.hypot(
        float(np.abs(np.diff(logs, axis=1)).max()) / data.dx,
        float(np.abs(np.diff(logs, axis=0)).max()) / data.dy,
    )
    heights = layers.max(axis=(1, 2)) - layers.min(axis=(1, 2))
    return Span(
        math.exp(float(logs.min())),
        slope * math.exp(float(logs.max())),
        math.hypot(*(data.weights * heights)),
    )


def cells_within(low: float, high: float, origin: float, step: float, count: int) -> slice:
    """The coefficients along an axis that determine the spline over [low, high].

    In a cell, the spline stays within the range of the four coefficients from its index on.
    """
    first = min(max(math.floor((low - origin) / step) - 1, 0), count - 4)
    last = min(max(math.floor((high - origin) / step) + 1, first), count - 4)
    return slice(first, last + 4)
