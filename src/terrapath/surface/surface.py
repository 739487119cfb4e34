"""The surface that a robot moves on, as data for the kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._kernels.surface.points import fill_cell_costs, fill_jets, fill_log_costs, fill_values
from .._kernels.surface.surfaces import Peaks, Spline
from .._support.extras import require_packages
from ..errors import InputError, OutsideSurfaceError
from ..validation import Array, as_array, as_points, require_not_negative, require_positive
from .bounds import Bounds, Cells, Mask, as_bounds
from .fitting import Gradient, fit_function, fit_grid, fit_smoothed
from .georeference import Georeference
from .layers import (
    Layer,
    is_spline,
    make_layers,
    require_cost_range,
    require_ground,
    typical_cost,
    weights_of,
    with_costs,
)

if TYPE_CHECKING:
    from .carrying import Native
    from .costs import CellLayers
    from .smoothing import Smoothing


@dataclass(frozen=True)
class Fit:
    """How a surface was made, and the largest error that was found.

    Where it was smoothed, ``smoothing`` has the change of the layers; the errors do not include
    it.
    """

    method: str
    value_error: float  # in the layers' units
    gradient_error: float | None = None  # layer units per map unit; None where not measured
    smoothing: Smoothing | None = None

    def __str__(self) -> str:
        text = f"{self.method}; value error {self.value_error:.2g}"
        if self.gradient_error is not None:
            text += f", gradient error {self.gradient_error:.2g}"
        return text if self.smoothing is None else f"{text}; {self.smoothing}"


def _scale_of(smoothing: float | None, bounds: Bounds) -> float:
    """The scale of a smoothing, map units; 0 for none."""
    if smoothing is None:
        return 0.0
    from .smoothing import check_scale

    return check_scale(smoothing, bounds)


EXACT = Fit("exact Gaussian peaks", 0.0, 0.0)


@dataclass(frozen=True, eq=False, repr=False)
class Surface:
    """The graph s(x1, x2) = (x1, x2, x3, ..., xn) of n - 2 layers over the plane.

    Make one with ``from_peaks``, ``from_grid``, ``from_function`` or
    ``from_expression``. The error of the fit is part of it, in ``fit``.
    """

    data: Peaks | Spline
    layers: tuple[Layer, ...]
    bounds: Bounds | None  # where it is defined; None: everywhere
    fit: Fit
    resolution: float  # map units: the size of the smallest features
    nodata: Mask | None = None
    georeference: Georeference | None = None
    costs: tuple[Layer, ...] = ()  # the layers of other kinds than "rise"
    cost_data: Spline | None = None  # the logarithms of the smooth ones, before their weights
    cost_cells: CellLayers | None = None  # those that are constant in cells
    source: str = ""  # the map that it was read from
    is_raster: bool = False  # was it made of a grid, whose cells have slopes of their own?
    native: Native | None = None  # the map's own cells, where it was carried over from them
    unknown: npt.NDArray[np.bool_] | None = None  # cells of ``nodata`` whose height is not known
    unit_of_axes: str = ""  # of lengths on the plane, where no CRS names it

    def __post_init__(self) -> None:
        require_ground(self.data)
        require_cost_range(self.data)

    # Constructors

    @classmethod
    def from_peaks(
        cls,
        layers: Sequence[Sequence[Sequence[float]]],
        *,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        weights: Sequence[float] | None = None,
    ) -> Surface:
        """Layers that are sums of Gaussian peaks, exact everywhere.

        layers : for each layer its peaks (amplitude, falloff, x1, x2), each the function
        amplitude * exp(-falloff * r^2); amplitude in the layer's unit, falloff > 0 in
        1/map unit^2. A layer without peaks is flat. Source: the surfaces of the paper's section 5.
        """
        if len(layers) == 0:
            raise InputError("layers is empty; a surface needs at least one layer")
        rows = [
            as_array(peaks if len(peaks) else np.empty((0, 4)), f"layers[{k}]", shape=(None, 4))
            for k, peaks in enumerate(layers)
        ]
        peaks = np.concatenate(rows)
        if len(peaks) and peaks[:, 1].min() <= 0.0:
            raise InputError(
                f"falloff={peaks[:, 1].min():g} must be above 0; a peak is "
                "(amplitude, falloff, x1, x2) with the value amplitude * exp(-falloff * r^2)"
            )
        made = make_layers(len(layers), names, units, weights)
        first = np.cumsum([0, *(len(row) for row in rows)]).astype(np.int64)
        # Half of the standard deviation of the sharpest peak.
        resolution = math.inf if len(peaks) == 0 else 0.5 / math.sqrt(2.0 * peaks[:, 1].max())
        data = Peaks(peaks, first, np.array([layer.weight for layer in made]))
        return cls(data, made, None, EXACT, resolution)

    @classmethod
    def from_grid(
        cls,
        values: npt.ArrayLike,
        x: npt.ArrayLike,
        y: npt.ArrayLike,
        *,
        smoothing: float | None = None,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        weights: Sequence[float] | None = None,
        kinds: Sequence[str] | None = None,
        nodata: Mask | None = None,
        georeference: Georeference | None = None,
    ) -> Surface:
        """The bicubic spline through samples on a grid.

        values : (layers, ny, nx), or (ny, nx) for one layer, in the layers' units; finite,
        at least 4 x 4. x : (nx,), y : (ny,) increasing, map units; where the steps are not
        equal, the grid is resampled and the error at the samples reported in ``fit``.
        smoothing : standard deviation, map units, of a Gaussian that the layers are convolved
        with; the change that it makes at the samples is reported in ``fit.smoothing``.
        kinds : of each layer, "rise" (the default), "cost" or "cells". Costs must be above 0. One
        of the kind "cost" is smooth; between samples it stays within the range of the samples
        around. One of the kind "cells" is constant in the cell around each sample.
        """
        array = np.asarray(values)
        if array.ndim == 2:
            array = array[None]
        x, y = as_array(x, "x", shape=(None,)), as_array(y, "y", shape=(None,))
        if len(x) < 4 or len(y) < 4:
            raise InputError(
                f"the grid has {len(x)} x {len(y)} samples; a surface needs at least 4 x 4"
            )
        for name, axis in (("x", x), ("y", y)):
            if not (np.diff(axis) > 0.0).all():
                raise InputError(f"{name} does not increase; flip it, and the values with it")
        array = as_array(array, "values", shape=(None, len(y), len(x)))
        made = make_layers(len(array), names, units, weights, kinds)
        is_rise = np.array([layer.kind == "rise" for layer in made])
        rises = tuple(layer for layer in made if layer.kind == "rise")
        costs = tuple(layer for layer in made if layer.kind != "rise")
        if not rises:
            raise InputError(
                f"all layers are of the kind 'cost' ({', '.join(c.name for c in costs)}); give "
                "the ground as the first, zeros where it is flat"
            )
        bounds = Bounds(float(x[0]), float(y[0]), float(x[-1]), float(y[-1]))
        scale = _scale_of(smoothing, bounds)
        fitted = fit_grid(array[is_rise] if costs else array, x, y, weights_of(rises), scale)
        data, logs, cells = fitted.spline, None, None
        if costs:
            from .costs import cost_cells, fit_costs

            logs, cells = fit_costs(array, x, y, made, scale)
            data = with_costs(data, logs, cost_cells(cells, costs))
        fit = Fit(
            f"bicubic spline through {len(x)} x {len(y)} samples",
            fitted.value_error,
            smoothing=fitted.smoothing,
        )
        spacing = float(min(np.diff(x).max(), np.diff(y).max()))
        resolution = spacing if fitted.smoothing is None else fitted.smoothing.resolution(spacing)
        made_of = (rises, bounds, fit, resolution, nodata, georeference, costs, logs, cells)
        return cls(data, *made_of, is_raster=True)

    @classmethod
    def from_function(
        cls,
        f: Callable[[Array, Array], npt.ArrayLike],
        bounds: Sequence[float] | Array,
        tolerance: float = 1e-6,
        *,
        gradient: Gradient | None = None,
        smoothing: float | None = None,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        weights: Sequence[float] | None = None,
    ) -> Surface:
        """A spline that approximates f, refined until it meets the tolerance.

        f(x, y) -> (layers, ...) on arrays. tolerance : the largest error of a value (layer
        unit) and of a gradient (layer unit/map unit) at points that the spline was not
        fitted to. gradient(x, y) -> (2, layers, ...), if known; otherwise finite differences of
        f are used.
        smoothing : standard deviation, map units, of a Gaussian that f is convolved with,
        which makes any function smooth enough. Then the tolerance and the gradient are not
        used, and ``fit.smoothing`` reports the change that the smoothing makes.
        Raises FitError where f is not smooth enough, InputError where the scale of the
        smoothing needs too many samples.
        """
        require_positive(tolerance=tolerance)
        rectangle = as_bounds(bounds)
        scale = _scale_of(smoothing, rectangle)
        if scale > 0.0:
            fitted = fit_smoothed(f, rectangle, scale)
        else:
            fitted = fit_function(f, rectangle, tolerance, gradient)
        made = make_layers(len(fitted.spline.weights), names, units, weights)
        fit = Fit(
            "bicubic spline of a function, {} x {} samples".format(*fitted.samples),
            fitted.value_error,
            fitted.gradient_error,
            fitted.smoothing,
        )
        surface = cls(fitted.spline, made, rectangle, fit, fitted.resolution)
        return surface.with_weights({layer.name: layer.weight for layer in made})

    @classmethod
    def from_expression(
        cls,
        expressions: str | Sequence[str],
        bounds: Sequence[float] | Array,
        tolerance: float = 1e-6,
        *,
        smoothing: float | None = None,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        weights: Sequence[float] | None = None,
    ) -> Surface:
        """As ``from_function``, for SymPy expressions in x1 and x2, one for each layer.

        The gradients that the fit is checked against are exact.
        """
        require_packages("Surface.from_expression", "sympy")
        from .expressions import compile_expressions

        listed = [expressions] if isinstance(expressions, str) else list(expressions)
        function, gradient = compile_expressions(listed)
        return cls.from_function(
            function,
            bounds,
            tolerance,
            gradient=gradient,
            smoothing=smoothing,
            names=names,
            units=units,
            weights=weights,
        )

    def with_weights(self, weights: Mapping[str, float]) -> Surface:
        """The same surface with the weights of some layers changed."""
        known = {layer.name for layer in (*self.layers, *self.costs)}
        for name, weight in weights.items():
            if name not in known:
                raise InputError(f"layer {name!r} is not known; there are {sorted(known)}")
            require_not_negative(**{f"the weight of {name}": weight})
        layers, costs = (
            tuple(
                replace(layer, weight=float(weights.get(layer.name, layer.weight))) for layer in k
            )
            for k in (self.layers, self.costs)
        )
        data: Peaks | Spline = self.data._replace(weights=weights_of(layers))
        logs = self.cost_data
        if logs is not None:
            logs = logs._replace(weights=weights_of(costs, "cost"))
        if costs and isinstance(data, Spline):
            from .costs import cost_cells

            data = with_costs(data, logs, cost_cells(self.cost_cells, costs))
        return replace(self, data=data, layers=layers, costs=costs, cost_data=logs)

    # Values and derivatives

    @property
    def unit(self) -> str:
        """Unit of lengths on the plane; empty where it is not known."""
        return self.unit_of_axes if self.georeference is None else self.georeference.unit

    @property
    def cells(self) -> Cells | None:
        """The cells of the map, else of the spline; None for exact peaks."""
        if self.native is not None:
            x, y = self.native.plane.centres()
            return Cells(float(x[0]), float(y[0]), *self.native.plane.sides)
        if not is_spline(self.data):
            return None
        return Cells(self.data.x0, self.data.y0, self.data.dx, self.data.dy)

    def _points(self, points: npt.ArrayLike) -> tuple[Array, tuple[int, ...]]:
        array = as_points(points)
        if self.bounds is not None and not (inside := self.bounds.contains(array)).all():
            x, y = array[~inside][0]
            raise OutsideSurfaceError(
                f"({x:.10g}, {y:.10g}) is outside the surface, {self.bounds}; "
                "check the axis order or the CRS"
            )
        return np.ascontiguousarray(array.reshape(-1, 2)), array.shape[:-1]

    def _jets(self, points: npt.ArrayLike) -> Array:
        flat, shape = self._points(points)
        jets = np.empty((len(flat), len(self.layers), 6))
        fill_jets(self.data, flat, jets)
        return jets.reshape(*shape, len(self.layers), 6)

    def values(self, points: npt.ArrayLike) -> Array:
        """Points (..., 2), map units -> (..., layers), in the layers' units."""
        flat, shape = self._points(points)
        values = np.empty((len(flat), len(self.layers)))
        fill_values(self.data, flat, values)
        return values.reshape(*shape, len(self.layers))

    def gradients(self, points: npt.ArrayLike) -> Array:
        """Points (..., 2) -> (..., layers, 2), layer units/map unit."""
        return self._jets(points)[..., 1:3]

    def hessians(self, points: npt.ArrayLike) -> Array:
        """Points (..., 2) -> (..., layers, 2, 2), layer units/map unit^2."""
        return self._jets(points)[..., [[3, 4], [4, 5]]]

    def cost(self, points: npt.ArrayLike) -> Array:
        """Points (..., 2), map units -> (...): the cost, which multiplies lengths there.

        On a side between cells of a cost raster it is the lower one.
        """
        smooth = np.exp(self.log_cost_jets(points)[..., 0])
        if self.cost_cells is None:
            return np.asarray(smooth)
        flat, _ = self._points(points)
        fill_cell_costs(self.data, flat, costs := np.empty(len(flat)))
        return np.asarray(smooth * costs.reshape(smooth.shape))

    def log_cost_jets(self, points: npt.ArrayLike) -> Array:
        """Points (..., 2) -> (..., 6): log of the smooth cost, and its derivatives.

        These are d/dx1, d/dx2 and the second derivatives.
        """
        flat, shape = self._points(points)
        jets = np.zeros((len(flat), 6))
        if self.cost_data is not None:
            fill_log_costs(self.data, flat, jets)
        return jets.reshape(*shape, 6)

    def cost_values(self, points: npt.ArrayLike) -> Array:
        """Points (..., 2) -> (..., costs): the value of each cost layer, without its weight."""
        flat, shape = self._points(points)
        if not self.costs:
            return np.empty((*shape, 0))
        from .costs import cost_values_at

        values = cost_values_at(self.data, self.costs, self.cost_data, self.cost_cells, flat)
        return values.reshape(*shape, len(self.costs))

    @property
    def least_cost(self) -> float:
        """The cost is nowhere below this; 1 without cost layers."""
        return self.data.floor if is_spline(self.data) else 1.0

    @cached_property
    def typical_cost(self) -> float:
        """The geometric mean of the cost."""
        return typical_cost(self.data)

    def lift(self, points: npt.ArrayLike) -> Array:
        """Points (..., 2) -> (..., n): the points of R^n above them, layers weighted."""
        array = as_points(points)
        return np.concatenate([array, self.values(array) * self.data.weights], axis=-1)

    def __repr__(self) -> str:
        domain = "the whole plane" if self.bounds is None else str(self.bounds)
        layers = ", ".join(map(str, (*self.layers, *self.costs)))
        return f"Surface({layers}; {domain}; {self.fit})"
