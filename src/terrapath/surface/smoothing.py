"""Gaussian smoothing with a stated length scale, and the change that it makes measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import dst, idst

from ..errors import InputError
from ..validation import Array, Bounds, require_not_negative

FEATURES_PER_SCALE = 2.0  # a resolution of half a standard deviation, as for Gaussian peaks


@dataclass(frozen=True)
class Smoothing:
    """A smoothing and the change that it made at the samples, layer by layer."""

    scale: float  # standard deviation of the Gaussian, map units
    largest_change: tuple[float, ...]  # of each layer, in its unit
    rms_change: tuple[float, ...]

    @classmethod
    def measured(cls, scale: float, before: Array, after: Array) -> Smoothing:
        """Compare values (layers, ...) with the smoothed ones."""
        change = (after - before).reshape(len(before), -1)
        largest = np.abs(change).max(axis=1)
        rms = np.sqrt(np.square(change).mean(axis=1))
        return cls(scale, tuple(map(float, largest)), tuple(map(float, rms)))

    def __str__(self) -> str:
        largest, rms = (
            ", ".join(f"{value:.2g}" for value in changes)
            for changes in (self.largest_change, self.rms_change)
        )
        return f"smoothed over {self.scale:g}, change at most {largest}, rms {rms}"


def check_scale(smoothing: float | None, bounds: Bounds) -> float:
    """The scale of a smoothing, map units; 0 for none.

    Raises InputError where it is not finite, below 0 or larger than the map.
    """
    if smoothing is None:
        return 0.0
    require_not_negative(smoothing=smoothing)
    side = min(bounds.width, bounds.height)
    if smoothing > side:
        raise InputError(
            f"smoothing={smoothing:g} is larger than the map's shorter side, {side:g}; "
            "it is a standard deviation in map units"
        )
    return float(smoothing)


def _smooth_axis(values: Array, scale: float, axis: int) -> Array:
    """Smooth along one axis; scale in samples.

    The line from the first sample to the last is taken off, and what remains is a sum of
    sines, each damped as a Gaussian damps it. So the values are continued beyond both ends
    by odd reflection: f(end + t) = 2 f(end) - f(end - t). Any scale is exact, also one below
    the spacing.
    """
    f = np.moveaxis(values, axis, -1)
    count = f.shape[-1]
    line = f[..., :1] + (f[..., -1:] - f[..., :1]) * np.linspace(0.0, 1.0, count)
    frequencies = np.pi * np.arange(1, count - 1) / (count - 1)
    damping = np.exp(-0.5 * (scale * frequencies) ** 2)
    smoothed = line.copy()
    smoothed[..., 1:-1] += idst(damping * dst((f - line)[..., 1:-1], type=1), type=1)
    return np.moveaxis(smoothed, -1, axis)


def smooth(values: Array, dx: float, dy: float, scale: float) -> Array:
    """Values (layers, ny, nx) on a uniform grid, convolved with a Gaussian.

    dx, dy : spacing; scale : standard deviation, all in map units. Beyond the edge the
    values are continued by odd reflection, so a plane stays a plane up to the edge, and the
    edge itself is smoothed only along itself.
    """
    return np.ascontiguousarray(_smooth_axis(_smooth_axis(values, scale / dx, 2), scale / dy, 1))
