"""Checks at the boundary: arrays are laid out and options checked once, here."""

from __future__ import annotations

import math
import numbers
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .errors import InputError

Array = npt.NDArray[np.float64]


class Bounds(NamedTuple):
    """A rectangle of the plane, in map units; its edge belongs to it."""

    x1_min: float
    x2_min: float
    x1_max: float
    x2_max: float

    @property
    def width(self) -> float:
        """Extent along x1, map units."""
        return self.x1_max - self.x1_min

    @property
    def height(self) -> float:
        """Extent along x2, map units."""
        return self.x2_max - self.x2_min

    @property
    def side(self) -> float:
        """Side of the square that is as large, map units."""
        return math.sqrt(self.width * self.height)

    def widened(self, margin: float) -> Bounds:
        """With so much more on every side, map units."""
        low, high = (self.x1_min - margin, self.x2_min - margin), (self.x1_max, self.x2_max)
        return Bounds(*low, *(edge + margin for edge in high))

    def contains(self, points: Array) -> npt.NDArray[np.bool_]:
        """Points (..., 2) -> (...) bool."""
        x, y = points[..., 0], points[..., 1]
        inside = (x >= self.x1_min) & (x <= self.x1_max) & (y >= self.x2_min) & (y <= self.x2_max)
        return np.asarray(inside)

    def encloses(self, other: Bounds) -> bool:
        """Does the other rectangle lie wholly in this one?"""
        return bool(self.contains(np.array([other[:2], other[2:]])).all())

    def __str__(self) -> str:
        return (
            f"x1 in [{self.x1_min:.10g}, {self.x1_max:.10g}], "
            f"x2 in [{self.x2_min:.10g}, {self.x2_max:.10g}]"
        )


def as_bounds(bounds: Any, name: str = "bounds") -> Bounds:
    """(x1_min, x2_min, x1_max, x2_max), finite and not empty."""
    try:
        result = Bounds(*(float(value) for value in bounds))
    except (TypeError, ValueError):
        raise InputError(
            f"{name}={bounds!r} is not a rectangle; give (x1_min, x2_min, x1_max, x2_max)"
        ) from None
    if not all(map(math.isfinite, result)):
        raise InputError(f"{name}={tuple(result)} is not finite; give four finite numbers")
    if not (result.width > 0.0 and result.height > 0.0):
        raise InputError(
            f"{name}={tuple(result)} is empty; "
            "the order is (x1_min, x2_min, x1_max, x2_max) with each minimum below its maximum"
        )
    return result


def as_array(values: Any, name: str, *, shape: tuple[int | None, ...]) -> Array:
    """A finite float64 array in C order; ``None`` in ``shape`` stands for any size."""
    try:
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        shown = " ".join(repr(values).split())
        raise InputError(f"{name} is not an array of numbers; got {shown:.60}") from None
    expected = "(" + ", ".join("*" if size is None else str(size) for size in shape) + ")"
    if array.ndim != len(shape) or any(
        size is not None and size != actual for size, actual in zip(shape, array.shape, strict=True)
    ):
        raise InputError(f"{name} has shape {array.shape}; {expected} is expected")
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))
        place = tuple(int(k) for k in bad[0])
        raise InputError(
            f"{name} holds {len(bad)} values that are not finite, the first {array[place]} at "
            f"index {place}; fill them or mark them as no-data before planning"
        )
    return array


def as_point(value: Any, name: str) -> tuple[float, float]:
    """One finite point of the plane."""
    try:
        x, y = (float(coordinate) for coordinate in value)
    except (TypeError, ValueError):
        raise InputError(f"{name}={value!r} is not a point; give (x1, x2), two numbers") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise InputError(f"{name}=({x:g}, {y:g}) is not finite; give two finite numbers")
    return x, y


def as_points(points: Any, name: str = "points") -> Array:
    """(..., 2) finite points; the leading axes are kept."""
    array = np.asarray(points)
    if array.ndim == 0 or array.shape[-1] != 2:
        raise InputError(f"{name} has shape {array.shape}; the last axis must be (x1, x2)")
    flat = as_array(array.reshape(-1, 2), name, shape=(None, 2))
    return flat.reshape(array.shape)


def _describe(value: Any) -> str:
    return repr(value) if not isinstance(value, float) else f"{value:g}"


def _is_number(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def _is_whole(value: Any) -> bool:
    return _is_number(value) and isinstance(value, numbers.Integral)


def require_positive(**values: Any) -> None:
    """Each value is a finite number above 0."""
    for name, value in values.items():
        if not (_is_number(value) and math.isfinite(value) and value > 0):
            raise InputError(f"{name}={_describe(value)} must be a finite number above 0")


def require_not_negative(**values: Any) -> None:
    """Each value is a finite number, 0 or above."""
    for name, value in values.items():
        if not (_is_number(value) and math.isfinite(value) and value >= 0):
            raise InputError(f"{name}={_describe(value)} must be a finite number, 0 or above")


def require_fraction(**values: Any) -> None:
    """Each value lies in [0, 1]."""
    for name, value in values.items():
        if not (_is_number(value) and 0 <= value <= 1):
            raise InputError(f"{name}={_describe(value)} must lie between 0 and 1")


def require_count(most: int = 2**31 - 3, **values: Any) -> None:
    """Each value is an integer from 1 to ``most``."""
    for name, value in values.items():
        if not (_is_whole(value) and 1 <= value <= most):
            raise InputError(f"{name}={_describe(value)} must be a whole number from 1 to {most:,}")


def require_bool(**values: Any) -> None:
    """Each value is True or False."""
    for name, value in values.items():
        if not isinstance(value, bool):
            raise InputError(f"{name}={value!r} must be True or False")


def require_seed(seed: Any) -> None:
    """A seed is an integer, 0 or above."""
    if not (_is_whole(seed) and seed >= 0):
        raise InputError(f"seed={_describe(seed)} must be a whole number, 0 or above")


def require_choice(choices: tuple[str, ...], **values: Any) -> None:
    """Each value is one of the known words."""
    for name, value in values.items():
        if value not in choices:
            raise InputError(f"{name}={value!r} is not known; choose one of {', '.join(choices)}")
