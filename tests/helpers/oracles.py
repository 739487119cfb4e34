"""Slow, obvious results that the fast kernels are compared with."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import shapely
import sympy
from scipy.integrate import quad, solve_bvp, solve_ivp

from terrapath import FreeSpace
from terrapath.surface.bounds import Bounds

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


def algorithm_1(speed_at, v1, v2):
    """Algorithm 1 of the paper, line by line; speed_at(x1, x2): |v2 - v1| in h there."""
    r = []
    for k in range(5):
        x1 = k / 4 * v2[0] + (4 - k) / 4 * v1[0]
        x2 = k / 4 * v2[1] + (4 - k) / 4 * v1[1]
        r.append(speed_at(x1, x2))
    return 7 / 90 * r[0] + 16 / 45 * r[1] + 2 / 15 * r[2] + 16 / 45 * r[3] + 7 / 90 * r[4]


def line_r(gradients, v1, v2):
    """Algorithm 1 with h written down: gradients(x, y) -> (layers, 2), weighted."""
    v = np.subtract(v2, v1)

    def speed_at(x1, x2):
        h = np.eye(2) + sum(np.outer(row, row) for row in gradients(x1, x2))
        return math.sqrt(v @ h @ v)

    return algorithm_1(speed_at, v1, v2)


def great_circle(radius, a, b):
    """On the sphere about the origin, between points of the plane."""
    p, q = (
        np.array([*point, math.sqrt(radius**2 - point[0] ** 2 - point[1] ** 2)]) for point in (a, b)
    )
    return radius * math.atan2(np.linalg.norm(np.cross(p, q)), p @ q)


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


# Geodesics


def _metric_jet_from_sympy(expressions, x, y):
    """h, its first and second derivatives at points, keyed by (i, j, *variables).

    SymPy differentiates the layers up to three times, Leibniz's rule their products.
    """
    variables = sympy.symbols("x1 x2", real=True)
    jet = {}
    for expression in map(sympy.sympify, expressions):
        orders = [(a, b) for a in range(4) for b in range(4 - a)]
        derived = [sympy.diff(expression, variables[0], a, variables[1], b) for a, b in orders]
        values = sympy.lambdify(variables, derived, "numpy")(x, y)
        f = {key: np.broadcast_to(v, np.shape(x)) for key, v in zip(orders, values, strict=True)}
        for i, j in itertools.product((0, 1), repeat=2):
            for order in range(3):
                for by in itertools.combinations_with_replacement((0, 1), order):
                    total = jet.get((i, j, *by), 0.0 if by else float(i == j))
                    for taken in itertools.product((False, True), repeat=order):
                        left = (i, *itertools.compress(by, taken))
                        right = (j, *itertools.compress(by, [not t for t in taken]))
                        keys = [(d.count(0), d.count(1)) for d in (left, right)]
                        total = total + f[keys[0]] * f[keys[1]]
                    jet[i, j, *by] = total
    return jet


def christoffel_from_sympy(expressions, x, y):
    """Gamma^k_ij = 1/2 h^kl (d_j h_il + d_i h_lj - d_l h_ij), the definition: (..., k, i, j)."""
    jet = _metric_jet_from_sympy(expressions, x, y)
    h = np.moveaxis(np.array([[jet[i, j] for j in (0, 1)] for i in (0, 1)]), (0, 1), (-2, -1))
    inverse = np.linalg.inv(h)
    symbols = np.zeros((*np.shape(x), 2, 2, 2))
    for k, i, j, m in itertools.product((0, 1), repeat=4):
        lowered = jet[i, m, j] + jet[m, j, i] - jet[i, j, m]
        symbols[..., k, i, j] += 0.5 * inverse[..., k, m] * lowered
    return symbols


def curvature_from_brioschi(expressions, x, y):
    """Gaussian curvature from E, F, G and their derivatives alone (Brioschi's formula)."""
    jet = _metric_jet_from_sympy(expressions, x, y)
    e, f, g = jet[0, 0], jet[0, 1], jet[1, 1]
    eu, ev, fu, fv = jet[0, 0, 0], jet[0, 0, 1], jet[0, 1, 0], jet[0, 1, 1]
    gu, gv = jet[1, 1, 0], jet[1, 1, 1]
    corner = -0.5 * jet[0, 0, 1, 1] + jet[0, 1, 0, 1] - 0.5 * jet[1, 1, 0, 0]
    zero = np.zeros_like(e)

    def determinant(rows):
        return np.linalg.det(np.moveaxis(np.array(rows), (0, 1), (-2, -1)))

    first = [[corner, 0.5 * eu, fu - 0.5 * ev], [fv - 0.5 * gu, e, f], [0.5 * gv, f, g]]
    second = [[zero, 0.5 * ev, 0.5 * gu], [0.5 * ev, e, f], [0.5 * gu, f, g]]
    return (determinant(first) - determinant(second)) / (e * g - f * f) ** 2


def peaks_jets(layers, weights=None):
    """jets(x, y) -> gradients (layers, 2, ...) and Hessians (layers, 2, 2, ...), weighted."""
    weights = [1.0] * len(layers) if weights is None else weights

    def jets(x, y):
        gradients = np.zeros((len(layers), 2, *np.shape(x)))
        hessians = np.zeros((len(layers), 2, 2, *np.shape(x)))
        for k, (weight, layer) in enumerate(zip(weights, layers, strict=True)):
            for a, falloff, cx, cy in layer:
                offset = np.array([x - cx, y - cy])
                value = weight * a * np.exp(-falloff * (offset**2).sum(axis=0))
                gradients[k] -= 2.0 * falloff * offset * value
                hessians[k] += 4.0 * falloff**2 * value * offset[:, None] * offset[None, :]
                hessians[k, 0, 0] -= 2.0 * falloff * value
                hessians[k, 1, 1] -= 2.0 * falloff * value
        return gradients, hessians

    return jets


def metric_of(gradients):
    """h (2, 2, ...) from weighted gradients (layers, 2, ...)."""
    h = np.einsum("ki...,kj...->ij...", gradients, gradients)
    h[0, 0] += 1.0
    h[1, 1] += 1.0
    return h


def _solve_2x2(h, b):
    d = h[0, 0] * h[1, 1] - h[0, 1] ** 2
    return np.array([h[1, 1] * b[0] - h[0, 1] * b[1], h[0, 0] * b[1] - h[0, 1] * b[0]]) / d


def planar_speed(jets, points, velocities):
    """|v|_h at points (m, 2)."""
    gradients, _ = jets(points[:, 0], points[:, 1])
    rises = np.einsum("kim,mi->km", gradients, velocities)
    return np.sqrt((velocities**2).sum(axis=1) + (rises**2).sum(axis=0))


def geodesic_by_hamilton(jets, start, angle, arc_lengths):
    """Positions (m, 2) at arc lengths, from Hamilton's equations for p = h v by DOP853.

    x' = h^-1 p, p' = sum_k (grad x_k . x') Hess x_k x': no Christoffel symbol, and no x''.
    """
    arc_lengths = np.asarray(arc_lengths, float)
    h = metric_of(jets(*map(float, start))[0])
    u = np.array([math.cos(angle), math.sin(angle)])
    momentum = h @ u / math.sqrt(u @ h @ u)

    def slope(_, state):
        gradients, hessians = jets(state[0], state[1])
        v = _solve_2x2(metric_of(gradients), state[2:])
        return np.concatenate([v, np.einsum("k,kij,j->i", gradients @ v, hessians, v)])

    initial = np.concatenate([np.asarray(start, float), momentum])
    span = (0.0, float(arc_lengths.max()))
    found = solve_ivp(
        slope, span, initial, method="DOP853", t_eval=arc_lengths, rtol=1e-12, atol=1e-13
    )
    assert found.success, found.message
    return found.y[:2].T


def geodesic_by_collocation(jets, guess, tolerance=1e-10, most_nodes=60_000):
    """Length of the geodesic between the ends of a guess (m, 2), by scipy's solve_bvp.

    Euler and Lagrange's equations of the energy on [0, 1], d/dt (h v) = 1/2 d_x h(v, v),
    so the speed is constant; the length is a quadrature over the collocation polynomials.
    Returns (length, positions as a function of t), or None where it does not converge.
    """
    steps = np.linalg.norm(np.diff(guess, axis=0), axis=1)
    t = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    state = np.concatenate([guess.T, np.gradient(guess, t, axis=0).T])

    def slope(_, y):
        gradients, hessians = jets(y[0], y[1])
        v = y[2:]
        rises = np.einsum("kim,im->km", gradients, v)
        turned = np.einsum("kijm,jm->kim", hessians, v)
        # d_l h(v, v) / 2 - (d_v h) v, from d_l h_ij = sum_k H_il g_j + g_i H_jl
        pull = np.einsum("km,kim->im", rises, turned)
        pull -= np.einsum("km,kim->im", np.einsum("kim,im->km", turned, v), gradients)
        pull -= np.einsum("km,kim->im", rises, turned)
        return np.concatenate([v, _solve_2x2(metric_of(gradients), pull)])

    def ends(a, b):
        return np.concatenate([a[:2] - guess[0], b[:2] - guess[-1]])

    found = solve_bvp(slope, ends, t, state, tol=tolerance, max_nodes=most_nodes)
    if not found.success:
        return None
    nodes, weights = np.polynomial.legendre.leggauss(6)
    widths = np.diff(found.x)
    places = found.x[:-1, None] + 0.5 * (1.0 + nodes) * widths[:, None]
    points = found.sol(places.ravel())
    velocities = found.sol(places.ravel(), 1)[:2].T
    speeds = planar_speed(jets, points[:2].T, velocities).reshape(places.shape)
    return float((0.5 * widths * (speeds @ weights)).sum()), lambda at: found.sol(at)[:2].T
