"""The places on the segments between two neighbours of four nodes that offer the least values.

Everything here is of four nodes at once.
"""

from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel
from ..vec4 import any_above, four, larger, sqrt, where_above
from .star import ACUTE


class End(NamedTuple):
    """The ends a of an edge of each node, where segments begin."""

    aa: np.ndarray  # of the lift from the node to a, squared
    ss: np.ndarray  # of the lift from the source to a, squared
    near: np.ndarray  # the chords from the node, and from the source
    far: np.ndarray
    cost: np.ndarray  # of the edge, per chord
    tau: np.ndarray
    u: np.ndarray


class Segment(NamedTuple):
    """The segments from the ends a of edges to the ends b of the next edges.

    ae, ee, se : products of b - a with the lift from the node to a, itself, and the lift from the
    source to a.
    """

    exists: np.ndarray  # 1, or 0 where there is no segment
    ae: np.ndarray
    ee: np.ndarray
    se: np.ndarray
    cost: np.ndarray  # of the edge to b, per chord
    tau: np.ndarray  # of b
    u: np.ndarray


# The least is at the beginning where t is no more than this.
LEAST_T = 1e-6

# A step of Newton's method that moves t by no more leaves out a share of the value of some 1e-12.
MOST_MOVED = 1e-3

# Added to a chord that may be 0 and divides.
TINY = 1e-300


@inner_kernel
def smaller(a, b):
    return where_above(a, b, b, a)


@inner_kernel
def size(a):
    return larger(a, 0.0 - a)


@inner_kernel
def near_on(a, s, t):
    """The chord from the node to the place t, squared."""
    return larger(a.aa + t * (2.0 * s.ae + t * s.ee), 0.0)


@inner_kernel
def far_on(a, s, t):
    """The chord from the source to the place t, squared."""
    return larger(a.ss + t * (2.0 * s.se + t * s.ee), 0.0)


@inner_kernel
def value_on(a, s, t):
    """The value offered from the place t of a segment: costs per chord, and tau, are linear."""
    c, tau = a.cost + t * (s.cost - a.cost), a.tau + t * (s.tau - a.tau)
    return c * sqrt(near_on(a, s, t)) + tau * sqrt(far_on(a, s, t))


@inner_kernel
def improved(a, s, t):
    """A step of Newton's method to the t of the least value.

    The value at a + t (b - a) is c times the chord to the node, plus tau times the chord from the
    source; c and tau are linear in t.
    """
    c_rise, tau_rise = s.cost - a.cost, s.tau - a.tau
    c, tau = a.cost + t * c_rise, a.tau + t * tau_rise
    near, far = sqrt(near_on(a, s, t)) + TINY, sqrt(far_on(a, s, t)) + TINY
    near_rise, far_rise = (s.ae + t * s.ee) / near, (s.se + t * s.ee) / far
    slope = c * near_rise + c_rise * near + tau * far_rise + tau_rise * far
    bend = c * (s.ee - near_rise * near_rise) / near + tau * (s.ee - far_rise * far_rise) / far
    bend = bend + 2.0 * (c_rise * near_rise + tau_rise * far_rise)
    moved = t - slope / where_above(bend, 0.0, bend, 1.0)
    return where_above(bend, 0.0, smaller(larger(moved, 0.0), 1.0), t)


@inner_kernel
def fall_along(a, s):
    """By how much the value falls from the beginning of a segment on; 0 where it does not."""
    rise = (s.cost - a.cost) * a.near
    slope = a.tau * s.se / (a.far + TINY) + (s.tau - a.tau) * a.far + rise + a.cost * s.ae / a.near
    # At the source there is no such slope.
    fall = where_above(a.far, 0.0, 0.0 - slope, 1.0)
    return where_above(s.exists, 0.0, larger(fall, 0.0), 0.0)


@inner_kernel
def place_of_least(a, s):
    """The t of the place on a segment that offers least; 0 where that is its beginning."""
    rise, c = (s.cost - a.cost) * a.near + s.u - a.u, 0.5 * (a.cost + s.cost)
    room = s.ee * (c * c * s.ee - rise * rise)
    across = larger(a.aa - s.ae * s.ae / s.ee, 0.0)
    t = 0.0 - s.ae / s.ee - rise * sqrt(across / where_above(room, 0.0, room, 1.0))
    first = where_above(room, 0.0, smaller(larger(t, 0.0), 1.0), 0.5)
    t = improved(a, s, first)
    moved = size(t - first)
    if any_above(moved, MOST_MOVED):
        t = where_above(moved, MOST_MOVED, improved(a, s, t), t)
    return where_above(t, LEAST_T, t, 0.0)


@inner_kernel
def place_unfolded(a, s):
    """The t of the place where the straight line from the source to the node crosses a segment,
    when its sides are unfolded into one plane; 0 where that is its beginning.

    Where the angle is nearly flat the value has a sharp minimum, which Newton's method misses from
    afar. On planes it is here.
    """
    at_node, at_source = 0.0 - s.ae / s.ee, 0.0 - s.se / s.ee
    near = sqrt(larger(a.aa - s.ae * s.ae / s.ee, 0.0))
    far = sqrt(larger(a.ss - s.se * s.se / s.ee, 0.0))
    t = (at_node * far + at_source * near) / (near + far + TINY)
    t = smaller(larger(t, 0.0), 1.0)
    return where_above(t, LEAST_T, t, 0.0)


@inner_kernel
def is_wide(a, s):
    """1 where the angle between the edges to both ends of a segment is too wide, else 0."""
    both = larger(a.aa + s.ae, 0.0)
    limit = ACUTE * ACUTE * a.aa * (a.aa + 2.0 * s.ae + s.ee)
    return where_above(limit, both * both, 1.0, four(0.0, 0.0, 0.0, 0.0))


@inner_kernel
def best_place(a, s):
    """The t of the place on a segment that offers least, on wide ones too; 0 at its beginning."""
    t, wide = place_of_least(a, s), is_wide(a, s)
    if any_above(wide, 0.0):
        straight = place_unfolded(a, s)
        gain = value_on(a, s, t) - value_on(a, s, straight)
        t = where_above(where_above(wide, 0.0, gain, 0.0), 0.0, straight, t)
    return t


@inner_kernel
def first_where_above(x, limit, a, b):
    """The segments a where x is above the limit, else b."""
    return Segment(
        where_above(x, limit, a.exists, b.exists),
        where_above(x, limit, a.ae, b.ae),
        where_above(x, limit, a.ee, b.ee),
        where_above(x, limit, a.se, b.se),
        where_above(x, limit, a.cost, b.cost),
        where_above(x, limit, a.tau, b.tau),
        where_above(x, limit, a.u, b.u),
    )
