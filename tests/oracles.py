"""Slow, obvious answers that the fast kernels are held against."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import shapely
import sympy
from scipy.integrate import quad

from terrapath import FreeSpace
from terrapath.validation import Bounds

# Surfaces and the metric


def peaks_function(layers):
    """f(x, y) -> (layers, ...): sums of a * exp(-falloff * r^2), by the plain formula."""

    def f(x, y):
        x, y = np.asarray(x, float), np.asarray(y, float)
        return np.stack(
            [
                sum(
                    (a * np.exp(-falloff * ((x - cx) ** 2 + (y - cy) ** 2)))
                    for a, falloff, cx, cy in layer
                )
                for layer in layers
            ]
        )

    return f


def peaks_gradients(layers, weights=None):
    """g(x, y) -> (layers, 2) at one point, weighted: the peaks' derivatives written out."""
    weights = [1.0] * len(layers) if weights is None else weights

    def g(x, y):
        rows = []
        for weight, layer in zip(weights, layers, strict=True):
            along_x = along_y = 0.0
            for a, falloff, cx, cy in layer:
                value = a * math.exp(-falloff * ((x - cx) ** 2 + (y - cy) ** 2))
                along_x -= 2.0 * falloff * (x - cx) * value
                along_y -= 2.0 * falloff * (y - cy) * value
            rows.append([weight * along_x, weight * along_y])
        return np.array(rows)

    return g


def peaks_expressions(layers):
    """The layers as SymPy expressions in x1 and x2, the numbers taken to the last bit."""
    x1, x2 = sympy.symbols("x1 x2", real=True)
    return [
        sum(
            sympy.Float(a, 17)
            * sympy.exp(-sympy.Float(falloff, 17) * ((x1 - cx) ** 2 + (x2 - cy) ** 2))
            for a, falloff, cx, cy in layer
        )
        for layer in layers
    ]


def _evaluate(expression, x, y):
    x1, x2 = sympy.symbols("x1 x2", real=True)
    return np.broadcast_to(sympy.lambdify((x1, x2), expression, "numpy")(x, y), np.shape(x))


@functools.cache
def _peak_derivative(variables):
    x1, x2, a, falloff, cx, cy = symbols = sympy.symbols("x1 x2 a falloff cx cy", real=True)
    value = a * sympy.exp(-falloff * ((x1 - cx) ** 2 + (x2 - cy) ** 2))
    wanted = [{"x1": x1, "x2": x2}[name] for name in variables]
    return sympy.lambdify(symbols, sympy.diff(value, *wanted) if wanted else value, "numpy")


def peaks_derivative_from_sympy(layer, variables, x, y):
    """A derivative of one layer, such as ("x1", "x2") for the mixed second one, at points."""
    return sum(_peak_derivative(variables)(x, y, *peak) for peak in layer)


def metric_from_sympy(expressions, x, y):
    """h = J^T J, J the symbolic Jacobian of (x1, x2, x3, ..., xn): (..., 2, 2)."""
    x1, x2 = sympy.symbols("x1 x2", real=True)
    lifted = sympy.Matrix([x1, x2, *map(sympy.sympify, expressions)])
    jacobian = lifted.jacobian([x1, x2])
    h = jacobian.T * jacobian
    entries = [[_evaluate(h[i, j], x, y) for j in range(2)] for i in range(2)]
    return np.moveaxis(np.array(entries), (0, 1), (-2, -1))


def speed(gradients, point, step):
    """|d(lifted curve)/dt| for the planar velocity ``step`` at a point."""
    rises = gradients(*point) @ step
    return math.sqrt(step @ step + rises @ rises)


def exact_curve_length(gradients, points, pieces=8):
    """Length of the lifted polyline by QUADPACK; gradients(x, y) -> (layers, 2), weighted.

    Each segment is cut into pieces first, short enough to see every feature.
    """
    total = 0.0
    for a, b in itertools.pairwise(np.asarray(points, float)):
        for k in range(pieces):
            value, _ = quad(
                lambda t, a=a, b=b: speed(gradients, a + t * (b - a), b - a),
                k / pieces,
                (k + 1) / pieces,
                epsabs=1e-13,
                epsrel=1e-11,
                limit=400,
            )
            total += value
    return total


def line_r(gradients, v1, v2):
    """Algorithm 1 of the paper, line by line."""
    v1, v2 = np.asarray(v1, float), np.asarray(v2, float)
    r = []
    for k in range(5):
        x = k / 4 * v2 + (4 - k) / 4 * v1
        g = gradients(*x)
        h = np.eye(2) + sum(np.outer(row, row) for row in g)
        r.append(
            math.sqrt(sum(h[i, j] * (v2 - v1)[i] * (v2 - v1)[j] for i in (0, 1) for j in (0, 1)))
        )
    return 7 / 90 * r[0] + 16 / 45 * r[1] + 2 / 15 * r[2] + 16 / 45 * r[3] + 7 / 90 * r[4]


# Free space. a and b are (..., 2); a geometry is a closed set, a circle is (x, y, radius).


def segments_as_geometries(a, b):
    """Segments as shapely sees them; one of no length is a point."""
    a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    lines = shapely.linestrings(np.stack([a, b], axis=-2))
    return np.where((a == b).all(axis=-1), shapely.points(a), lines)


def clearance_by_shapely(geometries, circles, a, b):
    """Distance from the segments to the nearest obstacle, 0 where one is touched or entered."""
    segments = segments_as_geometries(a, b)
    distance = np.full(segments.shape, np.inf)
    for geometry in geometries:
        distance = np.minimum(distance, shapely.distance(geometry, segments))
    for x, y, radius in circles:
        away = shapely.distance(shapely.Point(x, y), segments) - radius
        distance = np.minimum(distance, np.maximum(away, 0.0))
    return distance


def segment_is_free_by_shapely(geometries, circles, a, b):
    """Do the closed segments share no point with any obstacle?"""
    segments = segments_as_geometries(a, b)
    hit = np.zeros(segments.shape, bool)
    for geometry in geometries:
        hit |= shapely.intersects(geometry, segments)
    for x, y, radius in circles:
        hit |= shapely.distance(shapely.Point(x, y), segments) <= radius
    return ~hit


def boxes_of_mask(mask):
    """The blocked cells of a mask as closed boxes around their centres."""
    dx, dy = mask.x[1] - mask.x[0], mask.y[1] - mask.y[0]
    return [
        shapely.box(mask.x[i] - dx / 2, mask.y[j] - dy / 2, mask.x[i] + dx / 2, mask.y[j] + dy / 2)
        for j, i in np.argwhere(mask.blocked)
    ]


def mask_is_free_by_shapely(mask, a, b):
    """Do the closed segments touch no blocked cell?"""
    return segment_is_free_by_shapely(boxes_of_mask(mask), [], a, b)


# Point sets


def nearest_by_force(x, y, at):
    """Index of the nearest point, the first of several."""
    return int(np.argmin((np.asarray(x) - at[0]) ** 2 + (np.asarray(y) - at[1]) ** 2))


def within_by_force(x, y, at, radius):
    """Indices of the points at most ``radius`` away."""
    squared = (np.asarray(x) - at[0]) ** 2 + (np.asarray(y) - at[1]) ** 2
    return set(np.flatnonzero(squared <= radius * radius).tolist())


def is_blocked(mask, place):
    """Does free space with this mask alone refuse the point?"""
    everywhere = Bounds(-1e9, -1e9, 1e9, 1e9)
    return FreeSpace(everywhere, [mask]).blocker(tuple(place)) is not None
