"""What paths cost on a surface under a travel model: the surface with its pace, and the gauge."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from .._kernels.travel.paces import Pace, evaluate_jets
from .._kernels.travel.priced import Price, PricedPeaks, PricedSpline
from ..errors import InputError
from ..space.lattice import Lattice, Spacing
from ..surface import Surface, metric
from ..surface.bounds import Bounds
from ..surface.ground import Ground, ground_of, height_layer
from ..surface.layers import is_spline
from ..travel import TravelModel, by_name
from ..validation import Array, PointLike

# A pace this small, as a share of that of level ground, is none: it comes from rounding.
NOTHING = 1e-12
# Slopes are looked at in so many rows of a lattice at a time.
ROWS = 64


@dataclass(frozen=True, eq=False)
class Pricing:
    """A travel model on a surface.

    surface : the height at its true scale and the costs; what kernels ask of its data is the cost
    of travel, with the model's gauge taken off, so that it is above 0. ground : without costs.
    """

    model: TravelModel
    surface: Surface
    ground: Ground

    @classmethod
    def of(cls, surface: Surface, travel: object) -> Pricing:
        """A travel model, or one by its name, on a surface.

        Raises InputError where the surface or the model does not allow it.
        """
        model = by_name(travel) if isinstance(travel, str) else travel
        if not isinstance(model, TravelModel):
            raise InputError(
                f"travel={travel!r:.80} is no travel model; give one such as tp.travel.tobler()"
            )
        layer = _height_of(surface)
        ground = ground_of(surface)
        _require_pace(surface, model)
        return cls(model, _priced(surface, model, ground, layer), ground)

    @property
    def gauge(self) -> float:
        """What the gauge takes off for each unit of height of ``surface``, in the model's unit."""
        return self.model.gauge * self.ground.metres

    def rise(self, a: PointLike, b: PointLike) -> float:
        """How much higher b is than a, map units."""
        (low,), (high,) = self.surface.values(np.array([a, b], np.float64))
        return float(high - low) * float(self.surface.data.weights[0])

    def taken_off(self, a: PointLike, b: PointLike) -> float:
        """What the gauge takes off every path from a to b, in the model's unit."""
        return self.gauge * self.rise(a, b) if self.gauge else 0.0

    def gauged(self, points: Array) -> float:
        """What a path (m, 2) costs without that: above 0, to 1e-9 relative."""
        return metric.curve_length(self.surface, points)

    def value(self, points: Array) -> float:
        """What a path (m, 2) costs, in the model's unit."""
        return self.gauged(points) + self.taken_off(points[0], points[-1])

    def values(self, points: Array) -> Array:
        """(m,): what a path (m, 2) costs from its first point to each, in the model's unit."""
        steps = metric.segment_lengths(self.surface, points[:-1], points[1:])
        heights = self.surface.values(points)[:, 0] * self.surface.data.weights[0]
        return np.asarray(np.append(0.0, np.cumsum(steps)) + self.gauge * (heights - heights[0]))

    @cached_property
    def reversed(self) -> Pricing:
        """The way back: the same paths from their ends to their beginnings."""
        model = self.model.reversed()
        return Pricing(model, _with_pace(self.surface, model, self.ground), self.ground)

    def require_known(self, bounds: Bounds) -> None:
        """Raise InputError where the ground is steeper than what the model knows."""
        if self.model.beyond == "refuse":
            self.model.require_known(_steepest(self.ground, bounds))


def _height_of(surface: Surface) -> int:
    """Which layer is the height. Raises InputError for none, and for others that count."""
    height = height_layer(surface)
    if height is None:
        names = ", ".join(layer.name for layer in surface.layers)
        raise InputError(
            f"travel: the surface has no heights, but {names}; name the layer of heights 'height', "
            "or plan without a travel model"
        )
    others = [
        layer.name for k, layer in enumerate(surface.layers) if k != height and layer.weight != 0.0
    ]
    if others:
        raise InputError(
            f"travel: changes of the layer {others[0]!r} cost, which no travel model knows; make "
            "it a cost layer, whose value multiplies the pace, or give it the weight 0"
        )
    return height


def _require_pace(surface: Surface, model: TravelModel) -> None:
    """Raise InputError for a pace below 0 where costs multiply it, so that no gauge mends it."""
    if model.gauge == 0.0 or not _has_costs(surface):
        return
    if _least(model) < 0.0:
        raise InputError(
            f"travel={model!r} has paces below 0, which a cost layer must not multiply: paths "
            "could gain without end; leave the cost layers out, or give regeneration=0"
        )


def _least(model: TravelModel) -> float:
    """No grade has a pace below this; minus infinity where steeper ground has ever lower ones."""
    level, tails = float(model.jets(0.0)[0]), model.pace.tails
    if tails[0, 0] > NOTHING * level or tails[1, 0] < -NOTHING * level:
        return -math.inf
    least = float(model.intercepts(np.clip(0.0, tails[0, 0], tails[1, 0])))
    return 0.0 if abs(least) < NOTHING * level else least


def _has_costs(surface: Surface) -> bool:
    return any(layer.weight != 0.0 for layer in surface.costs)


def _priced(surface: Surface, model: TravelModel, ground: Ground, layer: int) -> Surface:
    data, weights = surface.data, np.array([ground.height_scale])
    given = replace(surface.layers[layer], weight=ground.height_scale)
    if is_spline(data):
        coefficients = np.ascontiguousarray(data.coefficients[layer : layer + 1])
        data = data._replace(coefficients=coefficients, weights=weights)
    else:
        first, last = data.first[layer], data.first[layer + 1]
        data = type(data)(data.peaks[first:last], np.array([0, last - first]), weights)
    return _with_pace(replace(surface, data=data, layers=(given,)), model, ground)


def _with_pace(surface: Surface, model: TravelModel, ground: Ground) -> Surface:
    """The surface with the model's pace in its data."""
    used = model if _has_costs(surface) else model.gauged()
    least = max(_least(used) * (1.0 - NOTHING), 1e-100) * ground.metres
    pace, data = _scaled(used.pace, ground.metres), surface.data
    price = Price(pace, least, _jumps(pace), width=0.0, share=0.0)
    fields = data._asdict() | {"price": price}
    made = PricedSpline(**fields) if is_spline(data) else PricedPeaks(**fields)
    return replace(surface, data=cast("Any", made))


def _jumps(pace: Pace) -> Array:
    """(k,): by how much the slope of a pace grows at each of its kinks."""
    before, after = np.empty((2, len(pace.kinks), 3))
    evaluate_jets(pace, np.nextafter(pace.kinks, -np.inf), before)
    evaluate_jets(pace, pace.kinks, after)
    return np.ascontiguousarray(after[:, 1] - before[:, 1])


def _scaled(pace: Pace, factor: float) -> Pace:
    """A pace in which each grade costs so many times as much."""
    names = ("coefficients", "tails", "slopes", "intercepts")
    return pace._replace(**{name: factor * getattr(pace, name) for name in names})


def _steepest(ground: Ground, bounds: Bounds) -> float:
    """The steepest slope of the ground at samples within the bounds, rise over run."""
    size = metric.feature_size(ground.surface)
    spacing = Spacing(*(min(k, bounds.side / 100.0) for k in size))
    lattice = Lattice.spanning(bounds, spacing)
    return max(_steepest_of(ground, lattice, rows) for rows in _blocks(lattice.ny))


def _blocks(rows: int) -> Iterator[slice]:
    yield from (slice(first, first + ROWS) for first in range(0, rows, ROWS))


def _steepest_of(ground: Ground, lattice: Lattice, rows: slice) -> float:
    x, y = np.meshgrid(lattice.x, lattice.y[rows])
    gradients = ground.surface.gradients(np.stack([x, y], axis=-1))[..., 0, :]
    return ground.height_scale * float(np.hypot(gradients[..., 0], gradients[..., 1]).max())
