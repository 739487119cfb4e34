"""The metric h on the plane, and the lengths of segments and curves under it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .._kernels.surface import lengths
from .._kernels.surface.points import fill_metric
from .._kernels.surface.surfaces import Peaks, Spline
from ..errors import InputError
from ..validation import Array, as_points
from . import Surface
from .bounds import Bounds
from .layers import cells_within

# Relative tolerance of a true length; the promised accuracy is 1e-9.
QUADRATURE_TOLERANCE = 1e-12

# Quadrature starts with pieces that are as long as this many of the surface's smallest features.
FEATURES_PER_PIECE = 4.0

# Ground is rough where a rule of seven points over this many of its features is wrong by more than
# this share, in the mean of so many probes. Real terrain exaggerated ten times is 2e-3 to 1e-2, the
# paper's scenes are below 2e-4.
FEATURES_PER_PROBE, ROUGH, PROBES = 4.0, 3e-4, 256


class EdgeRule(NamedTuple):
    """How the edges of a tree are measured.

    features : of the surface in one piece of an edge, at most. tolerance : pieces are halved until
    two rules agree to this share; 0 for one application of Line-R to each piece. wrong : the rule
    will do where no more than this share of edges is off by more than ``RIGHT``.
    """

    features: float
    tolerance: float
    wrong: float


# The cheapest comes first: the paper's Line-R, which is off by more on up to a fiftieth of the
# edges of its own scenes, then two adaptive rules at two to five times the price. A half and a
# little, so that rounding does not decide how many pieces a step has.
EDGE_RULES = (
    EdgeRule(4.0, 0.0, wrong=0.03),
    EdgeRule(2.0, 1e-3, wrong=0.01),
    EdgeRule(0.5 + 1e-9, 1e-4, wrong=1.0),
)
LINE_R, *_, FINEST = EDGE_RULES
RIGHT = 1e-3

# A surface is flat where its weighted slopes, and the logarithm of its cost, change by no more than
# this. Lengths change by no more than that, relative.
FLATNESS = 1e-7


def metric_tensor(surface: Surface, points: npt.ArrayLike) -> Array:
    """The metric h = c^2 (I + sum_k w_k^2 grad x_k grad x_k^T); c is the cost, 1 without costs.

    points : (..., 2), map units. Returns (..., 2, 2), without unit.
    Raises OutsideSurfaceError where a point is off the surface. Source: paper, section 3.2.
    """
    flat, shape = surface._points(points)
    tensors = np.empty((len(flat), 2, 2))
    fill_metric(surface.data, flat, tensors)
    return tensors.reshape(*shape, 2, 2)


def determinant(surface: Surface, points: npt.ArrayLike) -> Array:
    """The determinant d = det h, the squared ratio of area on the surface to area on the plane.

    Costs multiply it by c^4. points : (..., 2), map units. Returns (...), without unit.
    Source: paper, section 3.2.
    """
    h = metric_tensor(surface, points)
    return np.asarray(h[..., 0, 0] * h[..., 1, 1] - h[..., 0, 1] ** 2)


def inverse_metric_tensor(surface: Surface, points: npt.ArrayLike) -> Array:
    """The inverse h^-1, as the adjugate of h over d. Costs multiply it by c^-2.

    points : (..., 2), map units. Returns (..., 2, 2), without unit. Source: paper, section 3.2.
    """
    h = metric_tensor(surface, points)
    d = h[..., 0, 0] * h[..., 1, 1] - h[..., 0, 1] ** 2
    adjugate = np.empty_like(h)
    adjugate[..., 0, 0], adjugate[..., 1, 1] = h[..., 1, 1], h[..., 0, 0]
    adjugate[..., 0, 1] = adjugate[..., 1, 0] = -h[..., 0, 1]
    return np.asarray(adjugate / d[..., None, None])


def _measure(
    kernel: Callable[..., None],
    surface: Surface,
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    *options: float,
) -> Array:
    """Run a kernel over segments a-b, each (..., 2), broadcast against one another."""
    start, end = as_points(a, "a"), as_points(b, "b")
    try:
        start, end = np.broadcast_arrays(start, end)
    except ValueError:
        raise InputError(
            f"a has shape {start.shape} and b {end.shape}; they do not fit one another"
        ) from None
    flat_start, shape = surface._points(start)
    flat_end, _ = surface._points(end)
    measured = np.empty(len(flat_start))
    kernel(surface.data, flat_start, flat_end, *options, measured)
    return measured.reshape(shape)


def line_r(surface: Surface, a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Length of the segments a-b under h by the 5-point Newton-Cotes (Boole) rule.

    a, b : (..., 2), map units. Returns (...), map units; exact for integrands of degree 5,
    and an estimate, which can fall below the truth, for others. Source: paper, Algorithm 1.
    """
    return _measure(lengths.fill_line_r, surface, a, b)


def chord(surface: Surface, a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Euclidean distance in R^n between lifted points: a lower bound on every path's length.

    a, b : (..., 2), map units. Returns (...), map units.
    """
    return _measure(lengths.fill_chords, surface, a, b)


def chord_through(surface: Surface, points: npt.ArrayLike) -> float:
    """A lower bound on every path through points (m, 2) in their order: the sum of the chords."""
    array = as_points(points)
    return float(chord(surface, array[:-1], array[1:]).sum())


def segment_lengths(
    surface: Surface,
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    tolerance: float = QUADRATURE_TOLERANCE,
) -> Array:
    """True lengths of the segments a-b under h, by adaptive quadrature to 1e-9 relative.

    a, b : (..., 2), map units. tolerance : by which two rules for a piece may differ, relative.
    Returns (...), map units. Source: paper, equation (3).
    """
    longest = FEATURES_PER_PIECE * surface.resolution
    return _measure(lengths.fill_segment_lengths, surface, a, b, longest, tolerance)


def curve_length(surface: Surface, points: npt.ArrayLike) -> float:
    """True length under h of the polyline through points (m, 2), map units.

    The same as the length of the lifted curve in R^n. Source: paper, equation (3).
    """
    array = as_points(points)
    if array.ndim != 2 or len(array) < 2:
        raise InputError(f"points has shape {array.shape}; a curve needs (m, 2) with m >= 2")
    return float(segment_lengths(surface, array[:-1], array[1:]).sum())


def _probes(bounds: Bounds, sizes: float | Array) -> tuple[Array, Array]:
    """The ends (PROBES, 2) of segments in all directions, spread evenly over the bounds.

    sizes : of segments, map units, or (PROBES, 1). They are cut off at the bounds.
    """
    k = np.arange(PROBES)[:, None]
    # Roberts' sequence (2018), and directions that turn by the golden angle.
    shares = (0.5 + k * [0.7548776662466927, 0.5698402909980532]) % 1.0
    angles, low, high = 2.399963229728653 * k, np.array(bounds[:2]), np.array(bounds[2:])
    a = low + shares * (high - low)
    return a, np.clip(a + sizes * np.hstack([np.cos(angles), np.sin(angles)]), low, high)


def is_rough(surface: Surface, bounds: Bounds) -> bool:
    """Do rules of a few points miss much of the surface within the bounds?

    Segments of a few features are measured by one rule each and by adaptive quadrature.
    """
    if math.isinf(surface.resolution):
        return False
    longest = FEATURES_PER_PROBE * surface.resolution
    a, b = _probes(bounds, longest)
    once, adaptive = np.empty(PROBES), np.empty(PROBES)
    lengths.fill_segment_lengths(surface.data, a, b, longest, math.inf, once)
    shortest = FINEST.features * surface.resolution
    lengths.fill_segment_lengths(surface.data, a, b, shortest, FINEST.tolerance, adaptive)
    return bool(np.abs(once - adaptive).sum() > ROUGH * adaptive.sum())


def is_flat(surface: Surface, bounds: Bounds) -> bool:
    """Is h the same in all of the bounds, but for costs that are constant in cells?"""
    data = surface.data
    return _peaks_are_flat(data) if isinstance(data, Peaks) else _spline_is_flat(data, bounds)


def _peaks_are_flat(data: Peaks) -> bool:
    weights = np.repeat(data.weights, np.diff(data.first))
    slopes = weights * np.abs(data.peaks[:, 0]) * np.sqrt(2.0 * data.peaks[:, 1] / math.e)
    return float(slopes.sum()) <= FLATNESS


def _spline_is_flat(data: Spline, bounds: Bounds) -> bool:
    """In a cell a slope lies between the differences of the coefficients around."""
    rows = cells_within(bounds.x2_min, bounds.x2_max, data.y0, data.dy, data.coefficients.shape[1])
    columns = cells_within(
        bounds.x1_min, bounds.x1_max, data.x0, data.dx, data.coefficients.shape[2]
    )
    layers, logs = data.coefficients[:, rows, columns], data.log_cost[:, rows, columns]
    along_x = np.ptp(np.diff(layers, axis=2), axis=(1, 2)) / data.dx
    along_y = np.ptp(np.diff(layers, axis=1), axis=(1, 2)) / data.dy
    change = math.hypot(*(data.weights * along_x), *(data.weights * along_y))
    return change <= FLATNESS and (logs.size == 0 or float(np.ptp(logs)) <= FLATNESS)


def _panelled(surface: Surface, a: Array, b: Array, panel: float) -> Array:
    """Line-R of segments (m, 2), each cut into equal panels."""
    if surface.cost_cells is not None:
        panel = math.inf  # there each cell has a rule of its own
    counts = np.maximum(np.ceil(np.hypot(*(b - a).T) / panel), 1.0).astype(np.int64)
    firsts = np.cumsum(counts) - counts
    places = (np.arange(counts.sum()) - np.repeat(firsts, counts))[:, None]
    steps, begins = np.repeat((b - a) / counts[:, None], counts, axis=0), np.repeat(a, counts, 0)
    panels = np.empty(len(places))
    starts = begins + places * steps
    lengths.fill_line_r(surface.data, starts, starts + steps, panels)
    return np.asarray(np.add.reduceat(panels, firsts))


def edge_rule(surface: Surface, bounds: Bounds, longest: float) -> EdgeRule:
    """The cheapest rule that will do for the edges of a tree.

    longest : edge, map units. Segments of up to that are measured by each rule and by quadrature.
    """
    if math.isinf(surface.resolution):
        return LINE_R
    shares = (0.5 + 0.6180339887498949 * np.arange(PROBES)) % 1.0  # the golden ratio
    a, b = _probes(bounds, np.asarray(longest * shares[:, None]))
    truth, measured = segment_lengths(surface, a, b), np.empty(PROBES)
    for rule in EDGE_RULES:
        panel = rule.features * surface.resolution
        if rule is LINE_R:
            measured = _panelled(surface, a, b, panel)
        else:
            lengths.fill_segment_lengths(surface.data, a, b, panel, rule.tolerance, measured)
        if (np.abs(measured - truth) > RIGHT * truth).mean() <= rule.wrong:
            break
    return rule


def feature_size(surface: Surface) -> tuple[float, float]:
    """The size of the surface's finest features along x1 and x2, map units."""
    cells, size = surface.cells, surface.resolution
    if cells is None or math.isinf(size):
        return size, size
    shorter = min(cells.dx, cells.dy)
    return size * (cells.dx / shorter), size * (cells.dy / shorter)
