"""The part of the plane to plan on: its bounds, and masks of blocked cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..validation import Array, Point, as_array


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
        """Side of the square of the same area, map units."""
        return math.sqrt(self.width * self.height)

    def widened(self, margin: float) -> Bounds:
        """The rectangle with a margin added on every side, map units."""
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

    def least_detour(self, window: Bounds, start: Point, goal: Point) -> float:
        """The least length of a path that leaves a window of this rectangle, map units.

        Such a path touches a side of the window. So it is at least as long as the straight line
        from the start to the mirror image of the goal at that side.
        """
        (x0, y0), (x1, y1), found = start, goal, math.inf
        # Differences first: far from the map's origin the sum of two places loses digits.
        for side in (window.x1_min, window.x1_max):
            if self.x1_min < side < self.x1_max:
                found = min(found, math.hypot((x0 - side) + (x1 - side), y1 - y0))
        for side in (window.x2_min, window.x2_max):
            if self.x2_min < side < self.x2_max:
                found = min(found, math.hypot(x1 - x0, (y0 - side) + (y1 - side)))
        return found

    def __str__(self) -> str:
        return (
            f"x1 in [{self.x1_min:.10g}, {self.x1_max:.10g}], "
            f"x2 in [{self.x2_min:.10g}, {self.x2_max:.10g}]"
        )


class Cells(NamedTuple):
    """Cells of a map or a mask: the centre of one of them, and their size, map units."""

    x: float
    y: float
    dx: float
    dy: float


def as_bounds(bounds: Sequence[float] | Array, name: str = "bounds") -> Bounds:
    """The rectangle (x1_min, x2_min, x1_max, x2_max), checked to be finite and not empty."""
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


def uniform_spacing(axis: Array) -> float | None:
    """The spacing of a uniform axis; None for an axis that is not uniform."""
    spacing = float((axis[-1] - axis[0]) / (len(axis) - 1))
    return spacing if np.allclose(np.diff(axis), spacing, rtol=1e-6, atol=0.0) else None


@dataclass(frozen=True, eq=False)
class Mask:
    """Cells that may not be entered; outside its grid a mask blocks nothing.

    blocked : (ny, nx) bool. x : (nx,), y : (ny,) cell centres, increasing and uniform,
    map units. A cell is closed: touching its border counts as entering it.
    """

    blocked: npt.NDArray[np.bool_]
    x: Array
    y: Array

    def __init__(self, blocked: npt.ArrayLike, x: npt.ArrayLike, y: npt.ArrayLike) -> None:
        cells = np.ascontiguousarray(blocked)
        if cells.dtype != np.bool_ or cells.ndim != 2 or min(cells.shape) < 2:
            raise InputError(
                f"blocked has type {cells.dtype} and shape {cells.shape}; "
                "a (ny, nx) bool array of at least 2 x 2 cells is expected"
            )
        object.__setattr__(self, "blocked", cells)
        for name, values, size in (("x", x, cells.shape[1]), ("y", y, cells.shape[0])):
            axis = as_array(values, name, shape=(size,))
            spacing = uniform_spacing(axis)
            if spacing is None or spacing <= 0.0:
                raise InputError(f"{name} of a mask must increase in equal steps")
            object.__setattr__(self, name, axis)

    @property
    def spacing(self) -> tuple[float, float]:
        """(dx, dy), map units."""
        dx = (self.x[-1] - self.x[0]) / (len(self.x) - 1)
        dy = (self.y[-1] - self.y[0]) / (len(self.y) - 1)
        return float(dx), float(dy)
