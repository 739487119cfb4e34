"""Lengths of segments: Line-R, the chord, and adaptive quadrature."""

import math

import numpy as np

from .compiler import allocating_kernel, inner_kernel, kernel
from .four import four, sqrt, total
from .surfaces import floor_of, speed_at, speeds_inside, spot_at, value_at


@inner_kernel
def norm(h, dx, dy):
    """Length sqrt(h(v, v)) of the vector v = (dx, dy)."""
    return sqrt(h.h11 * (dx * dx) + h.h12 * (2.0 * dx * dy) + h.h22 * (dy * dy))


@inner_kernel
def composite_boole(surface, ax, ay, dx, dy, ends, panels):
    """Line-R with the segment cut into equal panels; ``panels = 1`` is Algorithm 1.

    ends : |v|_h of one panel's way v = (dx, dy) at both ends of the segment, summed: a tree
    knows the metric at its nodes.
    """
    length = 7.0 / 90.0 * ends
    weights = four(16.0 / 45.0, 2.0 / 15.0, 16.0 / 45.0, 0.0)
    for k in range(panels):
        x, y = ax + k * dx, ay + k * dy
        if k > 0:
            length += 7.0 / 45.0 * speed_at(surface, x, y, dx, dy)
        length += total(weights * speeds_inside(surface, x, y, dx, dy))
    return length


@inner_kernel
def line_r(surface, ax, ay, bx, by):
    """Length of the segment a-b under h by the 5-point Newton-Cotes rule (Algorithm 1)."""
    dx, dy = bx - ax, by - ay
    ends = speed_at(surface, ax, ay, dx, dy) + speed_at(surface, bx, by, dx, dy)
    return composite_boole(surface, ax, ay, dx, dy, ends, 1)


@kernel
def chord(surface, ax, ay, bx, by):
    """Euclidean distance in R^n between the lifted points, times the least cost.

    Never above the geodesic distance.
    """
    total = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
    a, b = spot_at(surface, ax, ay), spot_at(surface, bx, by)
    for layer in range(surface.weights.shape[0]):
        rise = value_at(surface, layer, b) - value_at(surface, layer, a)
        total += (surface.weights[layer] * rise) ** 2
    return floor_of(surface) * math.sqrt(total)


def _symmetric(half, sign):
    """The 15 entries of a symmetric (or antisymmetric) rule from its first 8."""
    return np.concatenate([half, sign * np.array(half[-2::-1])])


# Gauss-Kronrod nodes on [-1, 1] with the 15-point weights, and the 7-point weights of
# every other node (QUADPACK, Piessens et al. 1983).
_NODES = _symmetric(
    [
        -0.991455371120812639206854697526329,
        -0.949107912342758524526189684047851,
        -0.864864423359769072789712788640926,
        -0.741531185599394439863864773280788,
        -0.586087235467691130294144691693270,
        -0.405845151377397166906606412076961,
        -0.207784955007898467600689403773245,
        0.0,
    ],
    -1.0,
)
_KRONROD = _symmetric(
    [
        0.022935322010529224963732008058970,
        0.063092092629978553290700663189204,
        0.104790010322250183839876322541518,
        0.140653259715525918745189590510238,
        0.169004726639267902826583426598550,
        0.190350578064785409913256402421014,
        0.204432940075298892414161999234649,
        0.209482141084727828012999174891714,
    ],
    1.0,
)
_GAUSS = _symmetric(
    [
        0.0,
        0.129484966168869693270611432679082,
        0.0,
        0.279705391489276667901467771423780,
        0.0,
        0.381830050505118944950369775488975,
        0.0,
        0.417959183673469387755102040816327,
    ],
    1.0,
)


@kernel
def gauss_kronrod(surface, ax, ay, dx, dy, low, high):
    """The integral of |v|_h over t in [low, high] for r(t) = a + t v, and its error estimate."""
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    kronrod, gauss = 0.0, 0.0
    for k in range(15):
        t = centre + half * _NODES[k]
        s = speed_at(surface, ax + t * dx, ay + t * dy, dx, dy)
        kronrod += _KRONROD[k] * s
        gauss += _GAUSS[k] * s
    return half * kronrod, abs(half * (kronrod - gauss))


# The shortest piece that is halved no more: far below any feature of a surface.
_LEVELS = 40
_SHORTEST = 0.5**_LEVELS


@allocating_kernel
def piece_length(surface, ax, ay, dx, dy, low, high, tolerance):
    """The integral of |v|_h over t in [low, high] by adaptive bisection.

    Pieces are halved until each one's error estimate is under ``tolerance`` times the
    whole. The estimate is that of the 7-point rule, so the 15-point value that is summed
    is better still.
    """
    pending = np.empty(_LEVELS + 1)
    shortest = _SHORTEST * (high - low)
    depth, total = 0, 0.0
    value, error = gauss_kronrod(surface, ax, ay, dx, dy, low, high)
    allowed = tolerance * value
    while True:
        if not error > allowed or high - low <= shortest:
            total += value
            if depth == 0:
                return total
            depth -= 1
            low, high = high, pending[depth]
        else:
            pending[depth] = high
            depth += 1
            high = 0.5 * (low + high)
        value, error = gauss_kronrod(surface, ax, ay, dx, dy, low, high)


@kernel
def segment_length(surface, ax, ay, bx, by, longest, tolerance):
    """True length of the segment a-b under h.

    It is cut into pieces of at most ``longest`` on the plane, few enough of the surface's
    features long that no feature falls between the nodes of the first rule unseen.
    """
    dx, dy = bx - ax, by - ay
    pieces = max(math.ceil(math.hypot(dx, dy) / longest), 1)
    total = 0.0
    for k in range(pieces):
        low, high = k / pieces, (k + 1) / pieces
        total += piece_length(surface, ax, ay, dx, dy, low, high, tolerance)
    return total


# Many segments at once


@kernel
def fill_line_r(surface, a, b, lengths):
    for m in range(a.shape[0]):
        lengths[m] = line_r(surface, a[m, 0], a[m, 1], b[m, 0], b[m, 1])


@kernel
def fill_chords(surface, a, b, lengths):
    for m in range(a.shape[0]):
        lengths[m] = chord(surface, a[m, 0], a[m, 1], b[m, 0], b[m, 1])


@kernel
def fill_segment_lengths(surface, a, b, longest, tolerance, lengths):
    for m in range(a.shape[0]):
        ax, ay, bx, by = a[m, 0], a[m, 1], b[m, 0], b[m, 1]
        lengths[m] = segment_length(surface, ax, ay, bx, by, longest, tolerance)
