"""The ground as people know it: height at its true scale, without weights and costs, in metres."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .._kernels.surface.cells import NO_CELLS
from .._kernels.surface.surfaces import Peaks, Spline
from .georeference import Georeference, metres_of
from .layers import Layer
from .surface import Surface

HEIGHT = "height"
NO_COSTS: dict[str, Any] = {"costs": (), "cost_data": None, "cost_cells": None}


class Ground(NamedTuple):
    """The ground under a surface.

    surface : the height alone, so that its lengths are those on the ground, in units of the plane.
    metres : in one unit of the plane; 1 where that is not known. unit : what a length on the plane
    times ``metres`` is in; empty where that is not known.
    """

    surface: Surface
    metres: float
    unit: str

    @property
    def height_scale(self) -> float:
        """Units of the plane in one unit of height; 0 where no layer is the height."""
        return float(self.surface.data.weights[0])


def height_layer(surface: Surface) -> int | None:
    """Which layer is the height; None where there is none.

    It is the layer named so, or else the first, unless its unit is known to be no length.
    """
    for k, layer in enumerate(surface.layers):
        if layer.name.casefold() == HEIGHT:
            return k
    unit = surface.layers[0].unit
    return 0 if not unit or metres_of(unit) is not None else None


def plane_metres(reference: Georeference | None) -> float | None:
    """Metres in one unit of the plane, from the CRS, because there are two kinds of feet."""
    if reference is None or not reference.crs.axis_info:
        return None
    return float(reference.crs.axis_info[0].unit_conversion_factor)


def _plane_metres(surface: Surface) -> float | None:
    """Metres in one unit of the plane; None where that is not known."""
    if surface.georeference is None:
        return metres_of(surface.unit_of_axes)
    return plane_metres(surface.georeference)


def height_scale(surface: Surface, layer: Layer) -> float:
    """Units of the plane in one unit of a layer of heights; 1 where either is not known."""
    if layer.unit == surface.unit:
        return 1.0
    height, plane = metres_of(layer.unit), _plane_metres(surface)
    return 1.0 if height is None or plane is None else height / plane


def height_metres(surface: Surface) -> float | None:
    """Metres in one unit of height; None where there is no height or its unit is not known."""
    k = height_layer(surface)
    if k is None:
        return None
    unit, plane = surface.layers[k].unit, _plane_metres(surface)
    return plane if plane is not None and unit == surface.unit else metres_of(unit)


def ground_of(surface: Surface) -> Ground:
    """The ground under a surface. A height without a unit is in the unit of the plane."""
    k, metres = height_layer(surface), _plane_metres(surface)
    unit = "m" if metres is not None else "" if k is None else surface.layers[k].unit
    if k is not None and not is_weighted(surface):
        return Ground(surface, metres or 1.0, unit)
    scale = 0.0 if k is None else height_scale(surface, surface.layers[k])
    layer = replace(surface.layers[k or 0], weight=scale)
    data = _alone(surface.data, k or 0, scale)
    alone = replace(surface, data=data, layers=(layer,), **NO_COSTS)
    return Ground(alone, metres or 1.0, unit)


def _alone(data: Peaks | Spline, layer: int, weight: float) -> Peaks | Spline:
    """The data of one layer with another weight, without costs."""
    weights = np.array([weight])
    if isinstance(data, Spline):
        coefficients = data.coefficients[layer : layer + 1]
        return data._replace(
            coefficients=coefficients,
            weights=weights,
            log_cost=data.log_cost[:0],
            cells=NO_CELLS,
            floor=1.0,
        )
    first, last = data.first[layer], data.first[layer + 1]
    return Peaks(data.peaks[first:last], np.array([0, last - first]), weights)


def is_weighted(surface: Surface) -> bool:
    """Are lengths under h others than on the ground, because of weights, layers or costs?"""
    height = height_layer(surface)
    true = [
        height_scale(surface, layer) if k == height else 0.0
        for k, layer in enumerate(surface.layers)
    ]
    weights = [layer.weight for layer in surface.layers]
    return weights != true or any(layer.weight != 0.0 for layer in surface.costs)


def value_unit(surface: Surface) -> str:
    """The unit of lengths under h: the plane's, "weighted" where they are not on the ground."""
    return f"weighted {surface.unit or 'units'}" if is_weighted(surface) else surface.unit


def quantity(surface: Surface) -> str:
    """What lengths under h are called: "distance", or "value" where they are not on the ground."""
    return "value" if is_weighted(surface) else "distance"
