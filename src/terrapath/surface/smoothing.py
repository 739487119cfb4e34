"""Gaussian smoothing with a given length scale, and the size of the change that it makes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .._support.memory import blocks
from ..errors import InputError
from ..validation import Array, require_not_negative
from .bounds import Bounds

FEATURES_PER_SCALE = 2.0  # a resolution of half a standard deviation, as for Gaussian peaks
SLOPE_ERROR = 0.01  # rms slope that rounded heights may leave: 1 %, half a degree


@dataclass(frozen=True)
class Smoothing:
    """A smoothing and the change that it made at the samples, layer by layer."""

    scale: float  # standard deviation of the Gaussian, map units
    largest_change: tuple[float, ...]  # of each layer, in its unit
    rms_change: tuple[float, ...]

    @classmethod
    def measured(cls, scale: float, before: Array, after: Array) -> Smoothing:
        """Compare values (layers, ...) with the smoothed ones."""
        meter = ChangeMeter(len(before))
        meter.add(after - before)
        return meter.smoothing(scale)

    def resolution(self, spacing: float) -> float:
        """The size of the smallest features for samples with this spacing, map units."""
        return max(spacing, self.scale / FEATURES_PER_SCALE)

    def __str__(self) -> str:
        largest, rms = (
            ", ".join(f"{value:.2g}" for value in changes)
            for changes in (self.largest_change, self.rms_change)
        )
        return f"smoothed over {self.scale:g}, change at most {largest}, rms {rms}"


class ChangeMeter:
    """The largest and the rms change of each layer, block by block."""

    def __init__(self, layers: int) -> None:
        self._largest = np.zeros(layers)
        self._squares = np.zeros(layers)
        self._count = 0

    def add(self, change: Array) -> None:
        """Add the changes (layers, ...) at more samples."""
        flat = change.reshape(len(self._largest), -1)
        np.maximum(self._largest, np.abs(flat).max(axis=1), out=self._largest)
        self._squares += np.square(flat).sum(axis=1)
        self._count += flat.shape[1]

    def smoothing(self, scale: float) -> Smoothing:
        """The smoothing, with the changes that were added."""
        rms = np.sqrt(self._squares / self._count)
        return Smoothing(scale, tuple(self._largest.tolist()), tuple(rms.tolist()))


def scale_for_step(step: float, cell: float) -> float:
    """The least smoothing, map units, that heights rounded to a step need; 0 for none.

    Rounding is noise of variance step^2/12 in each cell. After smoothing with a Gaussian of
    standard deviation s its rms slope along each axis is step/sqrt(12) * cell / (s^2 sqrt(8 pi)).
    The s that makes this 1 % is chosen. If it is below half a cell, the spline needs no smoothing.
    """
    noise = step / math.sqrt(12.0)
    scale = math.sqrt(noise * cell / (SLOPE_ERROR * math.sqrt(8.0 * math.pi)))
    return scale if scale >= 0.5 * cell else 0.0


def check_scale(smoothing: float, bounds: Bounds) -> float:
    """The scale of a smoothing, map units.

    Raises InputError where it is not finite, below 0 or larger than the map.
    """
    require_not_negative(smoothing=smoothing)
    side = min(bounds.width, bounds.height)
    if smoothing > side:
        raise InputError(
            f"smoothing={smoothing:g} is larger than the map's shorter side, {side:g}; "
            "it is a standard deviation in map units"
        )
    return float(smoothing)


def _smooth_lines(f: Array, scale: float) -> Array:
    """Lines f (..., count) smoothed along the last axis; scale in samples.

    The straight line from the first sample to the last is subtracted. The rest is a sum of
    sines, and each is damped as a Gaussian damps it. This extends the values beyond both ends
    by odd reflection: f(end + t) = 2 f(end) - f(end - t). It is exact for any scale, also for one
    below the spacing.
    """
    from scipy.fft import dst, idst

    count = f.shape[-1]
    line = f[..., :1] + (f[..., -1:] - f[..., :1]) * np.linspace(0.0, 1.0, count)
    frequencies = np.pi * np.arange(1, count - 1) / (count - 1)
    damping = np.exp(-0.5 * (scale * frequencies) ** 2)
    smoothed = line.copy()
    smoothed[..., 1:-1] += idst(damping * dst((f - line)[..., 1:-1], type=1), type=1)
    return smoothed


def smooth_in_place(values: Array, dx: float, dy: float, scale: float) -> None:
    """As ``smooth``, but changes the values (layers, ny, nx) in place, block by block."""
    for layer in values:
        for rows in blocks(*layer.shape):
            layer[rows] = _smooth_lines(layer[rows], scale / dx)
        for columns in blocks(layer.shape[1], layer.shape[0]):
            layer[:, columns] = _smooth_lines(layer[:, columns].T, scale / dy).T


def smooth(values: Array, dx: float, dy: float, scale: float) -> Array:
    """Values (layers, ny, nx) on a uniform grid, convolved with a Gaussian.

    dx, dy : spacing; scale : standard deviation, all in map units. Beyond the edge the
    values are extended by odd reflection. So a plane stays a plane up to the edge, and the
    edge is smoothed only along its own direction.
    """
    smoothed = np.array(values, dtype=np.float64, order="C")
    smooth_in_place(smoothed, dx, dy, scale)
    return smoothed
