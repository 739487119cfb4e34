"""Layers: the scalar fields over the plane that a surface is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import InputError
from ..validation import Array, require_choice, require_not_negative

Kind = Literal["rise", "cost"]


@dataclass(frozen=True)
class Layer:
    """One scalar field over the plane.

    The weight multiplies the layer where it becomes a coordinate of R^n: a change of
    one unit of the layer counts as ``weight`` map units of way. So it is with the kind "rise",
    whose changes cost. Of the kind "cost" the level costs: lengths are multiplied by the layer
    to the power of ``weight``.
    """

    name: str
    unit: str = ""
    weight: float = 1.0
    kind: Kind = "rise"

    def __str__(self) -> str:
        unit = f" [{self.unit}]" if self.unit else ""
        if self.kind == "cost":
            power = f" ^ {self.weight:g}" if self.weight != 1.0 else ""
            return f"cost {self.name}{unit}{power}"
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
    for name, weight, kind in zip(names, weights, kinds, strict=True):
        require_not_negative(**{f"the weight of {name}": weight})
        require_choice(("rise", "cost"), **{f"the kind of {name}": kind})
    return tuple(
        Layer(str(n), str(u), float(w), "cost" if k == "cost" else "rise")
        for n, u, w, k in zip(names, units, weights, kinds, strict=True)
    )


def weights_of(layers: Sequence[Layer]) -> Array:
    """(layers,): their weights."""
    return np.array([layer.weight for layer in layers])
