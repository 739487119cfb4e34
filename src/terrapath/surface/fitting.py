"""Fits B-splines to grids and functions, and measures the error of the fit."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from .._kernels.surface.cells import NO_CELLS
from .._kernels.surface.points import fill_jets, fill_values
from .._kernels.surface.surfaces import Spline
from .._kernels.surface.tridiagonal import solve_curvatures
from .._support.memory import blocks
from ..errors import FitError, InputError
from ..validation import Array
from .bounds import Bounds, uniform_spacing

if TYPE_CHECKING:
    from .smoothing import Smoothing

# From (x, y), arrays of one shape, to (layers, ...).
Function = Callable[[Array, Array], npt.ArrayLike]

# From (x, y), arrays of one shape, to (2, layers, ...): d/dx1 and d/dx2.
Gradient = Callable[[Array, Array], Array]

FIRST_SAMPLES = 33  # on a side of the coarsest grid that is tried
MOST_SAMPLES = 4097  # on a side of the finest grid
TEST_POINTS = 8192
DIFFERENCES_PER_CELL = 64.0  # finite differences that check gradients have this many steps a cell
SAFETY = 0.5  # errors must be this share of the tolerance: no test point finds the largest error
COARSE_TOLERANCE = 1e-3  # a grid shows a layer's shape to this share of the layer's range
MOST_RESAMPLING = 8  # how many times finer a non-uniform axis may become
SAMPLES_PER_SCALE = 8.0  # samples of a smoothed function in one length scale
LEAST_SMOOTHED_SAMPLES = 257  # on a side, for any scale: the function may have finer features


class GridFit(NamedTuple):
    """A spline through a grid."""

    spline: Spline
    value_error: float  # largest at the samples, before any smoothing
    smoothing: Smoothing | None


class FunctionFit(NamedTuple):
    """A spline that approximates a function, or a smoothed function."""

    spline: Spline
    samples: tuple[int, int]  # along x1 and x2
    value_error: float  # the largest found at points that it was not fitted to
    gradient_error: float | None  # None where it was not measured
    resolution: float  # map units: the spacing that shows the function's shape
    smoothing: Smoothing | None = None


@lru_cache(maxsize=16)
def _factors(count: int) -> tuple[Array, Array]:
    """D and the lower diagonal of L, where L D L^T has 4 on its diagonal and 1 beside it."""
    pivots = np.full(count, 4.0)
    for j in range(1, count):
        pivots[j] -= 1.0 / pivots[j - 1]
    return pivots, 1.0 / pivots


def _curvatures(f: Array) -> Array:
    """Second derivatives h^2 f'' (n, m) of the interpolating splines through columns f (n, m).

    At inner knots m_(j-1) + 4 m_j + m_(j+1) = 6 (f_(j-1) - 2 f_j + f_(j+1)). With not-a-knot
    ends m_0 = 2 m_1 - m_2, which makes m_1 the second difference itself; likewise at the other end.
    """
    m = np.empty(f.shape, order="F")
    inner = m[1:-1]
    np.subtract(f[2:], f[1:-1], out=inner)
    inner -= f[1:-1]
    inner += f[:-2]
    if len(right := m[2:-2]) > 0:
        right *= 6.0
        right[0] -= m[1]
        right[-1] -= m[-2]
        solve_curvatures(m.T, *_factors(len(right)))
    m[0], m[-1] = 2.0 * m[1] - m[2], 2.0 * m[-2] - m[-3]
    return m


def _to_coefficients(lines: Array) -> None:
    """Uniform cubic B-spline coefficients (n + 2, m), in place of values in lines[1:-1].

    The interpolating spline f has the coefficients c_j = f(x_j) - h^2/6 f''(x_j), and the
    outermost two follow from f(x_j) = (c_(j-1) + 4 c_j + c_(j+1)) / 6.
    """
    f = np.asfortranarray(lines[1:-1])
    inner = f - _curvatures(f) / 6.0
    lines[1:-1] = inner
    lines[0] = 6.0 * f[0] - 4.0 * inner[0] - inner[1]
    lines[-1] = 6.0 * f[-1] - 4.0 * inner[-1] - inner[-2]


def _padded(values: Array) -> Array:
    """Values (layers, ny, nx) with space around them for the outermost coefficients."""
    layers, ny, nx = values.shape
    padded = np.empty((layers, ny + 2, nx + 2))
    padded[:, 1:-1, 1:-1] = values
    return padded


def _spline_of(padded: Array, x: Array, y: Array, weights: Array) -> Spline:
    """The bicubic spline through the values in ``padded``, which become its coefficients."""
    for layer in padded:
        for rows in blocks(layer.shape[0], layer.shape[1]):
            # The space above and below holds no values yet.
            kept = slice(max(rows.start, 1), min(rows.stop, layer.shape[0] - 1))
            if kept.start < kept.stop:
                _to_coefficients(layer[kept].T)
        for columns in blocks(layer.shape[1], layer.shape[0]):
            _to_coefficients(layer[:, columns])
    dx, dy = (x[-1] - x[0]) / (len(x) - 1), (y[-1] - y[0]) / (len(y) - 1)
    place = (float(x[0]), float(y[0]), float(dx), float(dy))
    return Spline(padded, weights, *place, np.empty((0, 0, 0)), NO_CELLS, floor=1.0)


def interpolate(values: Array, x: Array, y: Array, weights: Array) -> Spline:
    """The bicubic spline through values (layers, ny, nx) on a uniform grid."""
    return _spline_of(_padded(values), x, y, weights)


def _resample(values: Array, x: Array, axis: int, linear: bool) -> tuple[Array, Array]:
    """Resample a non-uniform axis to a uniform one, with its finest step.

    By a cubic spline, or linearly; linear values stay within the range of the samples.
    """
    if uniform_spacing(x) is not None:
        return values, x
    count = int(np.ceil((x[-1] - x[0]) / np.diff(x).min())) + 1
    if count > MOST_RESAMPLING * len(x):
        raise InputError(
            f"the grid's steps differ by a factor of over {MOST_RESAMPLING} "
            f"({np.diff(x).min():g} to {np.diff(x).max():g}); resample it to equal steps first"
        )
    from scipy.interpolate import CubicSpline, make_interp_spline

    uniform = np.linspace(x[0], x[-1], count)
    curve = make_interp_spline(x, values, 1, axis=axis) if linear else CubicSpline(x, values, axis)
    return curve(uniform), uniform


def _at_samples(spline: Spline, x: Array, y: Array) -> Array:
    """The spline's values (layers, ny, nx) on a grid."""
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    values = np.empty((len(points), len(spline.weights)))
    fill_values(spline, points, values)
    return values.T.reshape(-1, len(y), len(x))


def _largest_error(spline: Spline, x: Array, y: Array, values: Array) -> float:
    """The largest difference from values (layers, ny, nx) at the samples."""
    return max(
        float(np.abs(_at_samples(spline, x, y[rows]) - values[:, rows]).max())
        for rows in blocks(len(y), len(x))
    )


def _change(scale: float, before: Spline, after: Spline, x: Array, y: Array) -> Smoothing:
    """How much smoothing changed the values at the samples."""
    from .smoothing import ChangeMeter

    change = ChangeMeter(len(before.weights))
    for rows in blocks(len(y), len(x)):
        change.add(_at_samples(after, x, y[rows]) - _at_samples(before, x, y[rows]))
    return change.smoothing(scale)


def fit_grid(
    values: Array, x: Array, y: Array, weights: Array, scale: float, *, linear: bool = False
) -> GridFit:
    """The spline through values (layers, ny, nx), smoothed where the scale is above 0.

    linear : resample unequal steps linearly, so that values at knots stay between the samples
    around them; a smooth curve would overshoot at a sharp edge.
    Large maps must fit into memory. Besides the values this needs one array of their size, or two
    where it smooths.
    """
    resampled, fine_x = _resample(values, x, 2, linear)
    resampled, fine_y = _resample(resampled, y, 1, linear)
    spline = interpolate(resampled, fine_x, fine_y, weights)
    error = _largest_error(spline, x, y, values)
    if scale == 0.0:
        return GridFit(spline, error, None)
    from .smoothing import smooth_in_place

    padded = _padded(resampled)
    smooth_in_place(padded[:, 1:-1, 1:-1], spline.dx, spline.dy, scale)
    smoothed = _spline_of(padded, fine_x, fine_y, weights)
    return GridFit(smoothed, error, _change(scale, spline, smoothed, x, y))


def _require_finite(name: str, values: Array, x: Array, y: Array) -> None:
    """Raise InputError with the place where values (..., *x.shape) are not finite."""
    if np.isfinite(values).all():
        return
    place = tuple(np.argwhere(~np.isfinite(values))[0][values.ndim - x.ndim :])
    raise InputError(
        f"{name} is not finite at x1={x[place]:g}, x2={y[place]:g}; "
        "shrink the bounds to where it is defined"
    )


def _checked(f: Function, x: Array, y: Array) -> Array:
    """f(x, y) as (layers, ...); raises InputError with the place where it is not finite."""
    values = np.asarray(f(x, y), dtype=np.float64)
    if values.shape == x.shape:
        values = values[None]
    if values.ndim != x.ndim + 1 or values.shape[1:] != x.shape:
        raise InputError(
            f"f returned shape {values.shape} for arrays of shape {x.shape}; "
            "it must return (layers, ...) on arrays"
        )
    _require_finite("f", values, x, y)
    return values


def _difference_gradient(f: Function, step: float) -> Gradient:
    """Sixth-order central differences of f."""
    weights = {1: 3.0 / 4.0, 2: -3.0 / 20.0, 3: 1.0 / 60.0}  # of f(+k step) - f(-k step)

    def gradient(x: Array, y: Array) -> Array:
        along_x = sum(
            w * (_checked(f, x + k * step, y) - _checked(f, x - k * step, y))
            for k, w in weights.items()
        )
        along_y = sum(
            w * (_checked(f, x, y + k * step) - _checked(f, x, y - k * step))
            for k, w in weights.items()
        )
        return np.stack([along_x, along_y]) / step

    return gradient


def _exact_gradient(gradient: Gradient, layers: int) -> Gradient:
    """A user's gradient, with its result checked: (2, layers, ...), finite."""

    def checked(x: Array, y: Array) -> Array:
        slopes = np.asarray(gradient(x, y), dtype=np.float64)
        if slopes.shape == (2, *x.shape) and layers == 1:
            slopes = slopes[:, None]
        if slopes.shape != (2, layers, *x.shape):
            raise InputError(
                f"gradient returned shape {slopes.shape} for arrays of shape {x.shape}; "
                f"it must return {(2, layers, *x.shape)}: d/dx1 and d/dx2 of each layer"
            )
        _require_finite("gradient", slopes, x, y)
        return slopes

    return checked


def _test_points(bounds: Bounds, margin: float) -> tuple[Array, Array]:
    """Points that lie on no grid (Sobol, scrambled, seed 0) inside a margin, some on its edges."""
    from scipy.stats import qmc

    u, v = qmc.Sobol(2, seed=0).random(TEST_POINTS).T
    edge = TEST_POINTS // 32  # points on each edge, where splines are least accurate
    u[:edge], u[edge : 2 * edge] = 0.0, 1.0
    v[2 * edge : 3 * edge], v[3 * edge : 4 * edge] = 0.0, 1.0
    x = bounds.x1_min + margin + u * (bounds.width - 2.0 * margin)
    y = bounds.x2_min + margin + v * (bounds.height - 2.0 * margin)
    return x, y


def _errors(
    f: Function, gradient: Gradient | None, spline: Spline, bounds: Bounds
) -> tuple[Array, float]:
    """Largest errors at the test points: of the value of each layer, and of all gradients."""
    layers = len(spline.weights)
    step = min(spline.dx, spline.dy) / DIFFERENCES_PER_CELL
    if gradient is None:
        slope, margin = _difference_gradient(f, step), 3.0 * step
    else:
        slope, margin = _exact_gradient(gradient, layers), 0.0
    x, y = _test_points(bounds, margin)
    jets = np.empty((TEST_POINTS, layers, 6))
    fill_jets(spline, np.column_stack([x, y]), jets)
    value_errors: Array = np.abs(jets[..., 0].T - _checked(f, x, y)).max(axis=1)
    return value_errors, float(np.abs(jets[..., 1:3].T - slope(x, y)).max())


def fit_function(
    f: Function, bounds: Bounds, tolerance: float, gradient: Gradient | None
) -> FunctionFit:
    """Refine a grid until the spline has the values and gradients of f within the tolerance."""
    resolution: float | None = None
    samples = FIRST_SAMPLES
    while True:
        x = np.linspace(bounds.x1_min, bounds.x1_max, samples)
        y = np.linspace(bounds.x2_min, bounds.x2_max, samples)
        values = _checked(f, *np.meshgrid(x, y))
        spline = interpolate(values, x, y, np.ones(len(values)))
        value_errors, gradient_error = _errors(f, gradient, spline, bounds)
        worst, spacing = float(value_errors.max()), max(spline.dx, spline.dy)
        spread = values.max(axis=(1, 2)) - values.min(axis=(1, 2))
        # A layer that is constant except for rounding has no shape.
        coarse = np.maximum(COARSE_TOLERANCE * spread, SAFETY * tolerance)
        if resolution is None and (value_errors <= coarse).all():
            resolution = spacing
        if max(worst, gradient_error) <= SAFETY * tolerance:
            shape = (samples, samples)
            return FunctionFit(spline, shape, worst, gradient_error, resolution or spacing)
        if samples >= MOST_SAMPLES:
            raise FitError(
                f"tolerance={tolerance:g} is not met on {samples} x {samples} samples: "
                f"the value is off by up to {worst:.2g}, the gradient by up to "
                f"{gradient_error:.2g}; raise the tolerance, or where the function has an edge "
                "give the scale to smooth it over, smoothing=SCALE"
            )
        samples = 2 * samples - 1


def _axis_for(scale: float, start: float, end: float) -> Array:
    """Samples along one side, fine compared with the scale; the number of steps is even."""
    steps = 2 * math.ceil(0.5 * SAMPLES_PER_SCALE * (end - start) / scale)
    if steps + 1 > MOST_SAMPLES:
        least = SAMPLES_PER_SCALE * (end - start) / (MOST_SAMPLES - 1)
        raise InputError(
            f"smoothing={scale:g} needs {steps + 1} samples on a side of {end - start:g}, more "
            f"than {MOST_SAMPLES}; raise it to {1.01 * least:.3g}, or shrink the bounds"
        )
    return np.linspace(start, end, max(steps + 1, LEAST_SMOOTHED_SAMPLES))


def fit_smoothed(f: Function, bounds: Bounds, scale: float) -> FunctionFit:
    """The spline through the smoothed f; f is evaluated only within the bounds.

    The error is the difference from smoothing only every second sample. The spline through all
    samples is more accurate than that.
    """
    from .smoothing import FEATURES_PER_SCALE, Smoothing, smooth

    x = _axis_for(scale, bounds.x1_min, bounds.x1_max)
    y = _axis_for(scale, bounds.x2_min, bounds.x2_max)
    values = _checked(f, *np.meshgrid(x, y))
    dx, dy = bounds.width / (len(x) - 1), bounds.height / (len(y) - 1)
    smoothed = smooth(values, dx, dy, scale)
    coarse = smooth(values[:, ::2, ::2], 2.0 * dx, 2.0 * dy, scale)
    return FunctionFit(
        interpolate(smoothed, x, y, np.ones(len(values))),
        samples=(len(x), len(y)),
        value_error=float(np.abs(smoothed[:, ::2, ::2] - coarse).max()),
        gradient_error=None,
        resolution=scale / FEATURES_PER_SCALE,
        smoothing=Smoothing.measured(scale, values, smoothed),
    )
