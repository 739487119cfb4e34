"""Lengths of segments: Line-R, the chord, and adaptive quadrature."""

import math

import numpy as np

from ..compiler import inner_kernel, kernel
from ..travel.paces import hidden_bend, pace_along
from ..travel.priced import per_price
from ..vec4 import four, four_in_row, sqrt, total
from .speeds import speed_at, speeds_along, speeds_inside
from .surfaces import (
    Metric,
    floor_of,
    has_cells,
    slope_along,
    spot_at,
    squared_cost_at,
    stretch_at,
    value_at,
)

# Where Gauss' rule has its first node.
_NEAR = 0.5 - 0.5 * math.sqrt(0.6)


@inner_kernel
def norm(h, dx, dy):
    """Length sqrt(h(v, v)) of the vector v = (dx, dy)."""
    return sqrt(h.h11 * (dx * dx) + h.h12 * (2.0 * dx * dy) + h.h22 * (dy * dy))


@inner_kernel
def inverse(h):
    """The tensor h^-1."""
    determinant = h.h11 * h.h22 - h.h12 * h.h12
    return Metric(h.h22 / determinant, -h.h12 / determinant, h.h11 / determinant)


@inner_kernel
def composite_boole(surface, ax, ay, dx, dy, ends, panels):
    """Line-R with the segment cut into equal panels; ``panels = 1`` is Algorithm 1.

    ends : the sum of |v|_h at both ends of the segment, where v = (dx, dy) is one panel. It is
    passed in because a tree knows the metric at its vertices.
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
def gauss(surface, x, y, vx, vy):
    """The integral of |v|_h, with the smooth cost, from (x, y) to (x, y) + v by three points."""
    ends = speed_at(surface, x + _NEAR * vx, y + _NEAR * vy, vx, vy)
    ends += speed_at(surface, x + (1.0 - _NEAR) * vx, y + (1.0 - _NEAR) * vy, vx, vy)
    return (5.0 * ends + 8.0 * speed_at(surface, x + 0.5 * vx, y + 0.5 * vy, vx, vy)) / 18.0


@kernel
def length_in_cells(surface, ax, ay, bx, by):
    """Length of the segment a-b where costs are constant in cells: three points in each cell."""
    dx, dy = bx - ax, by - ay
    length, share = 0.0, 0.0
    while share < 1.0:
        here = stretch_at(surface, ax, ay, dx, dy, share)
        part = here.end - share
        x, y = ax + share * dx, ay + share * dy
        length += here.cost * gauss(surface, x, y, part * dx, part * dy)
        share = here.end
    return length


@inner_kernel
def line_r(surface, ax, ay, bx, by):
    """Length of the segment a-b under h by the 5-point Newton-Cotes rule (Algorithm 1).

    Where costs are constant in cells, by a rule of three points in each cell.
    """
    if has_cells(surface):
        return length_in_cells(surface, ax, ay, bx, by)
    dx, dy = bx - ax, by - ay
    ends = speed_at(surface, ax, ay, dx, dy) + speed_at(surface, bx, by, dx, dy)
    return composite_boole(surface, ax, ay, dx, dy, ends, 1)


@kernel
def metric_chord(surface, ax, ay, bx, by):
    total = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
    a, b = spot_at(surface, ax, ay), spot_at(surface, bx, by)
    for layer in range(surface.weights.shape[0]):
        rise = value_at(surface, layer, b) - value_at(surface, layer, a)
        total += (surface.weights[layer] * rise) ** 2
    return floor_of(surface) * math.sqrt(total)


@kernel
def priced_chord(surface, ax, ay, bx, by):
    a, b = spot_at(surface, ax, ay), spot_at(surface, bx, by)
    rise = surface.weights[0] * (value_at(surface, 0, b) - value_at(surface, 0, a))
    size = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    return floor_of(surface) * pace_along(surface.price.pace, size, rise)


@per_price(metric_chord, priced_chord)
def chord(surface, ax, ay, bx, by):
    """What no path from a to b costs less than.

    Euclidean distance in R^n between the lifted points, or the straight line of constant grade,
    times the least cost.
    """


@kernel
def chord_through(surface, ax, ay, bx, by, longest):
    """The sum of the chords of a segment's pieces, each at most ``longest`` on the plane.

    Never above the segment's length; on rough ground far nearer to it than the chord is.
    """
    pieces = max(math.ceil(math.hypot(bx - ax, by - ay) / longest), 1)
    dx, dy = (bx - ax) / pieces, (by - ay) / pieces
    length = 0.0
    for k in range(pieces):
        x, y = ax + k * dx, ay + k * dy
        length += chord(surface, x, y, x + dx, y + dy)
    return length


# Patterson's nested rules on [-1, 1] (1968) with 3, 7 and 15 points, exact for degrees 5, 11
# and 23. Each rule contains the nodes of the one before it. So short segments need only seven
# evaluations, and for others none of the seven is wasted. Listed is the lower half of the nodes;
# the weight of the node in the middle is halved.
_NODES = [
    *(-0.960491268708020283423507092629, -0.774596669241483377035853079956),
    *(-0.434243749346802558002071502845, 0.0),
    *(-0.993831963212755022208512841308, -0.888459232872256998890420167259),
    *(-0.621102946737226402940687443817, -0.223386686428966881628203986844),
]
_THREE = [0.0, 5.0 / 9.0, 0.0, 0.5 * 8.0 / 9.0, 0.0, 0.0, 0.0, 0.0]
_SEVEN = [
    *(0.104656226026467265193823857192, 0.268488089868333440728569280667),
    *(0.401397414775962222905051818618, 0.5 * 0.450916538658474142345110087046),
    *(0.0, 0.0, 0.0, 0.0),
]
_FIFTEEN = [
    *(0.051603282997079739696920120568, 0.134415255243784220359968764802),
    *(0.200628529376989021033931873331, 0.5 * 0.225510499798206687386422549156),
    *(0.017001719629940260339027417403, 0.092927195315124537685894226654),
    *(0.171511909136391380787353165020, 0.219156858401587496403693161644),
]
_RULES = np.array([_NODES, _THREE, _SEVEN, _FIFTEEN]).reshape(4, 2, 4)


@inner_kernel
def nothing_hidden(surface, x, y, vx, vy):
    return 0.0


@inner_kernel
def hidden_kink(surface, x, y, vx, vy):
    size = math.sqrt(vx * vx + vy * vy)
    if size == 0.0:
        return 0.0
    a, b = spot_at(surface, x - vx, y - vy), spot_at(surface, x + vx, y + vy)
    first = surface.weights[0] * slope_along(surface, 0, a, vx, vy) / size
    last = surface.weights[0] * slope_along(surface, 0, b, vx, vy) / size
    cost = sqrt(max(squared_cost_at(surface, a), squared_cost_at(surface, b)))
    return cost * size * hidden_bend(surface.price.pace, first, last)


@per_price(nothing_hidden, hidden_kink)
def hidden(surface, x, y, vx, vy):
    """What a kink of the pace between the grades at the ends may hide from all rules."""


@kernel
def integral(surface, x, y, vx, vy, tolerance):
    """The integral of |v|_h from (x, y) - v to (x, y) + v and an estimate of its error.

    The estimate is the error of the rule with fewer points, so the value is more accurate than
    that. Seven points are enough where their relative error estimate is within the tolerance.
    """
    three, seven, fifteen = 0.0, 0.0, 0.0
    doubt = hidden(surface, x, y, vx, vy)
    for k in range(2):
        if k == 1 and abs(seven - three) <= tolerance * seven:
            return seven, doubt
        nodes = four_in_row(_RULES, 0, k, 0)
        below = speeds_along(surface, x, y, vx, vy, nodes)
        speeds = below + speeds_along(surface, x, y, vx, vy, -1.0 * nodes)
        three += total(four_in_row(_RULES, 1, k, 0) * speeds)
        seven += total(four_in_row(_RULES, 2, k, 0) * speeds)
        fifteen += total(four_in_row(_RULES, 3, k, 0) * speeds)
    return fifteen, max(abs(fifteen - seven), doubt)


# Pieces are not halved beyond this number: they are far smaller than any feature of a surface.
_MOST_PIECES = 2**40


@kernel
def piece_length(surface, x, y, vx, vy, tolerance):
    """The integral of |v|_h from (x, y) to (x, y) + v, by adaptive bisection.

    Pieces are halved until each one's error estimate is under ``tolerance`` times the whole.
    """
    length, allowed = 0.0, 0.0
    k, pieces = 0, 1  # next is the k-th of so many equal pieces
    while k < pieces:
        share = 0.5 / pieces
        middle, wx, wy = (2 * k + 1) * share, share * vx, share * vy
        value, error = integral(surface, x + middle * vx, y + middle * vy, wx, wy, tolerance)
        if pieces == 1:
            allowed = tolerance * value
        if error > allowed and pieces < _MOST_PIECES:
            k, pieces = 2 * k, 2 * pieces
            continue
        length += value
        k += 1
        while k % 2 == 0 and pieces > 1:  # both halves are done
            k, pieces = k // 2, pieces // 2
    return length


@kernel
def smooth_length(surface, ax, ay, bx, by, longest, tolerance):
    """True length of the segment a-b under h, with the smooth cost.

    It is cut into pieces of at most ``longest`` on the plane. That must be only a few times the
    size of the surface's features, so that the nodes of the first rule miss none of them.
    """
    pieces = max(math.ceil(math.hypot(bx - ax, by - ay) / longest), 1)
    dx, dy = (bx - ax) / pieces, (by - ay) / pieces
    length = 0.0
    for k in range(pieces):
        length += piece_length(surface, ax + k * dx, ay + k * dy, dx, dy, tolerance)
    return length


@kernel
def segment_length(surface, ax, ay, bx, by, longest, tolerance):
    """True length of the segment a-b under h; see ``smooth_length``, which measures each cell."""
    if not has_cells(surface):
        return smooth_length(surface, ax, ay, bx, by, longest, tolerance)
    dx, dy = bx - ax, by - ay
    length, share = 0.0, 0.0
    while share < 1.0:
        here = stretch_at(surface, ax, ay, dx, dy, share)
        x0, y0, x1, y1 = ax + share * dx, ay + share * dy, ax + here.end * dx, ay + here.end * dy
        length += here.cost * smooth_length(surface, x0, y0, x1, y1, longest, tolerance)
        share = here.end
    return length


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
