"""Cost layers: smooth ones, and those that are constant in each cell of a grid, as rasters are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._kernels.surface.cells import NO_CELLS, ON_SIDE, CostCells
from .._kernels.surface.points import fill_values
from .._kernels.surface.surfaces import Peaks, Spline
from ..validation import Array
from .bounds import uniform_spacing
from .fitting import fit_grid
from .layers import Layer, limited, require_costs, weights_of, with_costs

if TYPE_CHECKING:
    from .surface import Surface


@dataclass(frozen=True, eq=False)
class CellLayers:
    """The values of cost layers in the cells of one grid, without the layers' weights.

    values : (layers, ny, nx), above 0. x0, y0 : the corner of the first cell. dx, dy : the cells'
    sides, map units. The outermost cells reach on beyond the grid's edge.
    """

    values: Array
    x0: float
    y0: float
    dx: float
    dy: float

    @classmethod
    def around(cls, values: Array, x: Array, y: Array) -> CellLayers:
        """Cells around samples (layers, ny, nx) at x (nx,), y (ny,).

        Where the steps are not equal, the cells are as small as the smallest step, and each has
        the value of the nearest sample.
        """
        for axis, places in ((2, x), (1, y)):
            if uniform_spacing(places) is None:
                values = values.take(_nearest(places, _equal_steps(places)), axis=axis)
        x, y = (at if uniform_spacing(at) is not None else _equal_steps(at) for at in (x, y))
        dx, dy = (float((at[-1] - at[0]) / (len(at) - 1)) for at in (x, y))
        corner = float(x[0]) - 0.5 * dx, float(y[0]) - 0.5 * dy
        return cls(np.ascontiguousarray(values), *corner, dx, dy)

    def weighted(self, weights: Array) -> CostCells:
        """The product of the layers, each to its weight, for kernels."""
        product = np.ones(self.values.shape[1:])
        for values, weight in zip(self.values, weights, strict=True):
            product *= values if weight == 1.0 else values**weight
        return CostCells(product, self.x0, self.y0, self.dx, self.dy, float(product.min()))

    def at(self, points: Array, product: Array) -> Array:
        """The layers' values (m, layers) at points (m, 2); product (ny, nx) is their product.

        On a side between cells, those of the cell where the product is lowest.
        """
        places = (points - (self.x0, self.y0)) / (self.dx, self.dy)
        last = np.array(product.shape)[::-1] - 1
        low, high = (
            np.clip(np.floor(places + shift).astype(int), 0, last) for shift in (-ON_SIDE, ON_SIDE)
        )
        columns = np.stack([low[:, 0], high[:, 0], low[:, 0], high[:, 0]])
        rows = np.stack([low[:, 1], low[:, 1], high[:, 1], high[:, 1]])
        chosen = product[rows, columns].argmin(axis=0), np.arange(len(points))
        return np.asarray(self.values[:, rows[chosen], columns[chosen]].T)


def cost_cells(cells: CellLayers | None, costs: Sequence[Layer]) -> CostCells:
    """The product of those cost layers that are constant in cells, for kernels."""
    return NO_CELLS if cells is None else cells.weighted(weights_of(costs, "cells"))


def fit_costs(
    values: Array, x: Array, y: Array, layers: Sequence[Layer], scale: float
) -> tuple[Spline | None, CellLayers | None]:
    """The cost layers among some layers: logarithms of the smooth ones, and those in cells.

    values : (layers, ny, nx), at x (nx,), y (ny,). scale : of the smoothing, map units.
    Raises InputError where a cost is not above 0.
    """
    logs = cells = None
    kinds = np.array([layer.kind for layer in layers])
    for layer, given in zip(layers, values, strict=True):
        if layer.kind != "rise":
            require_costs(given, x, y, layer.name)
    if (kinds == "cost").any():
        log_values, weights = np.log(values[kinds == "cost"]), weights_of(layers, "cost")
        logs = limited(fit_grid(log_values, x, y, weights, scale, linear=True).spline)
    if (kinds == "cells").any():
        cells = CellLayers.around(values[kinds == "cells"], x, y)
    return logs, cells


def cost_values_at(
    data: Peaks | Spline,
    costs: Sequence[Layer],
    logs: Spline | None,
    cells: CellLayers | None,
    points: Array,
) -> Array:
    """The values (m, costs) of the cost layers of a surface at points (m, 2), without weights."""
    values = np.empty((len(points), len(costs)))
    are_cells = np.array([layer.kind == "cells" for layer in costs], bool)
    if logs is not None:
        fill_values(logs, points, smooth := np.empty((len(points), int((~are_cells).sum()))))
        values[:, ~are_cells] = np.exp(smooth)
    if cells is not None and isinstance(data, Spline):
        values[:, are_cells] = cells.at(points, data.cells.costs)
    return values


def with_closed_cells(surface: Surface, closed: npt.NDArray[np.bool_]) -> Surface:
    """A surface whose closed cells (ny, nx), which no path can enter, cost as the dearest of all.

    So they lend no lower cost to their sides. Cells that were closed before are opened again, and
    ``cost_cells`` stays what was given.
    """
    assert isinstance(surface.data, Spline)
    cells = cost_cells(surface.cost_cells, surface.costs)
    costs = np.where(closed, cells.costs.max(), cells.costs)
    if np.array_equal(costs, surface.data.cells.costs):
        return surface
    cells = cells._replace(costs=costs, least=float(costs.min()))
    return replace(surface, data=with_costs(surface.data, surface.cost_data, cells))


def with_cells(surface: Surface, cells: CellLayers) -> Surface:
    """A surface with other values for its cost layers that are constant in cells."""
    assert isinstance(surface.data, Spline)
    data = with_costs(surface.data, surface.cost_data, cost_cells(cells, surface.costs))
    return replace(surface, data=data, cost_cells=cells)


def _equal_steps(places: Array) -> Array:
    """Places over the same range with equal steps, as small as the smallest."""
    count = int(np.ceil((places[-1] - places[0]) / np.diff(places).min() - 1e-9)) + 1
    return np.linspace(places[0], places[-1], count)


def _nearest(places: Array, at: Array) -> npt.NDArray[np.intp]:
    """For each of ``at``, the index of the nearest place."""
    return np.asarray(np.searchsorted(0.5 * (places[1:] + places[:-1]), at))
