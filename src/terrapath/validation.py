"""Checks of arguments, made once: arrays get their type and layout here, options are checked."""

from __future__ import annotations

import math
import numbers
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import TypeGuard

import numpy as np
import numpy.typing as npt

from .errors import InputError, MapError

Array = npt.NDArray[np.float64]
Point = tuple[float, float]
PointLike = Sequence[float] | Array  # (x1, x2), not checked yet


def as_array(values: npt.ArrayLike, name: str, *, shape: tuple[int | None, ...]) -> Array:
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


def as_point(value: PointLike, name: str) -> Point:
    """One finite point of the plane."""
    try:
        x, y = (float(coordinate) for coordinate in value)
    except (TypeError, ValueError):
        raise InputError(f"{name}={value!r} is not a point; give (x1, x2), two numbers") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise InputError(f"{name}=({x:g}, {y:g}) is not finite; give two finite numbers")
    return x, y


def as_points(points: npt.ArrayLike, name: str = "points") -> Array:
    """Finite points (..., 2); the leading axes are kept."""
    array = np.asarray(points)
    if array.ndim == 0 or array.shape[-1] != 2:
        raise InputError(f"{name} has shape {array.shape}; the last axis must be (x1, x2)")
    flat = as_array(array.reshape(-1, 2), name, shape=(None, 2))
    return flat.reshape(array.shape)


def _describe(value: object) -> str:
    return repr(value) if not isinstance(value, float) else f"{value:g}"


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def _is_whole(value: object) -> TypeGuard[int]:
    return _is_number(value) and isinstance(value, numbers.Integral)


def require_positive(**values: object) -> None:
    """Raise InputError unless each value is a finite number above 0."""
    for name, value in values.items():
        if not (_is_number(value) and math.isfinite(value) and value > 0):
            raise InputError(f"{name}={_describe(value)} must be a finite number above 0")


def require_not_negative(**values: object) -> None:
    """Raise InputError unless each value is a finite number, 0 or above."""
    for name, value in values.items():
        if not (_is_number(value) and math.isfinite(value) and value >= 0):
            raise InputError(f"{name}={_describe(value)} must be a finite number, 0 or above")


def require_fraction(**values: object) -> None:
    """Raise InputError unless each value lies in [0, 1]."""
    for name, value in values.items():
        if not (_is_number(value) and 0 <= value <= 1):
            raise InputError(f"{name}={_describe(value)} must lie between 0 and 1")


def require_count(most: int = 2**31 - 3, **values: object) -> None:
    """Raise InputError unless each value is an integer from 1 to ``most``."""
    for name, value in values.items():
        if not (_is_whole(value) and 1 <= value <= most):
            raise InputError(f"{name}={_describe(value)} must be a whole number from 1 to {most:,}")


def require_bool(**values: object) -> None:
    """Raise InputError unless each value is True or False."""
    for name, value in values.items():
        if not isinstance(value, bool):
            raise InputError(f"{name}={value!r} must be True or False")


def require_seed(seed: object) -> None:
    """Raise InputError unless a seed is an integer, 0 or above."""
    if not (_is_whole(seed) and seed >= 0):
        raise InputError(f"seed={_describe(seed)} must be a whole number, 0 or above")


def require_choice(choices: tuple[str, ...], **values: object) -> None:
    """Raise InputError unless each value is one of the choices."""
    for name, value in values.items():
        if value not in choices:
            raise InputError(f"{name}={value!r} is not known; choose one of {', '.join(choices)}")


def require_no_pipe(path: Path) -> None:
    """Raise MapError for a pipe or a device, which would be waited for, or read without an end."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return  # whoever opens it says why it cannot be
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise MapError(
            f"{path} is a pipe or a device, and no file; write what comes out of it to a file first"
        )


def is_there(path: Path) -> bool:
    """Is there a file or a folder? False also for a name that none can have."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False
