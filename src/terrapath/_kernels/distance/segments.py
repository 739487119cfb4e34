"""The place on the segment between two neighbours of a node that offers the least value."""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel


class End(NamedTuple):
    """The end a of a node's edge, where segments begin."""

    direction: np.int64
    aa: float  # of the lift from the node to a, squared
    ss: float  # of the lift from the source to a, squared
    near: float  # the chords from the node, and from the source
    far: float
    cost: float  # of the edge, per chord
    tau: float
    u: float


class Segment(NamedTuple):
    """The segment from the end a of an edge to the end b of the next, and a place on it.

    ae, ee, se : products of b - a with the lift from the node to a, itself, and the lift from the
    source to a.
    """

    direction: np.int64  # of the edge to b
    ae: float
    ee: float
    se: float
    cost: float  # of the edge to b, per chord
    tau: float  # of b
    t: float  # where least is offered; 0 where that is a, or where there is no segment


NO_SEGMENT = Segment(np.int64(-1), 0.0, 1.0, 0.0, 1.0, 1.0, 0.0)


@inner_kernel
def value_on(a, s, t):
    """The value offered from the place t of a segment: costs per chord, and tau, are linear."""
    c, tau = a.cost + t * (s.cost - a.cost), a.tau + t * (s.tau - a.tau)
    near = math.sqrt(max(a.aa + t * (2.0 * s.ae + t * s.ee), 0.0))
    far = math.sqrt(max(a.ss + t * (2.0 * s.se + t * s.ee), 0.0))
    return c * near + tau * far


# The least is at the beginning where t is no more than this.
LEAST_T = 1e-6

# A step of Newton's method that moves t by no more leaves out a share of the value of some 1e-12.
MOST_MOVED = 1e-3


@inner_kernel
def improved(a, s, t):
    """A step of Newton's method to the t of the least value.

    The value at a + t (b - a) is c times the chord to the node, plus tau times the chord from the
    source; c and tau are linear in t.
    """
    c_rise, tau_rise = s.cost - a.cost, s.tau - a.tau
    c, tau = a.cost + t * c_rise, a.tau + t * tau_rise
    near = math.sqrt(max(a.aa + t * (2.0 * s.ae + t * s.ee), 0.0))
    far = math.sqrt(max(a.ss + t * (2.0 * s.se + t * s.ee), 0.0))
    if not (near > 0.0 and far > 0.0):
        return t
    near_rise, far_rise = (s.ae + t * s.ee) / near, (s.se + t * s.ee) / far
    slope = c * near_rise + c_rise * near + tau * far_rise + tau_rise * far
    bend = c * (s.ee - near_rise * near_rise) / near + tau * (s.ee - far_rise * far_rise) / far
    bend += 2.0 * (c_rise * near_rise + tau_rise * far_rise)
    return min(max(t - slope / bend, 0.0), 1.0) if bend > 0.0 else t


@inner_kernel
def place_of_least(a, s, u):
    """The t of the place on a segment that offers least; 0 where that is its beginning.

    u : the value at the segment's end.
    """
    rise = (s.cost - a.cost) * a.near
    # By how much the value rises from the beginning on; at the source there is no such slope.
    if a.far > 0.0:
        start = a.tau * s.se / a.far + (s.tau - a.tau) * a.far + rise + a.cost * s.ae / a.near
        if start >= 0.0:
            return 0.0
    rise, c = rise + u - a.u, 0.5 * (a.cost + s.cost)
    room = c * c * s.ee - rise * rise
    t = 0.5
    if room > 0.0:
        across = max(a.aa - s.ae * s.ae / s.ee, 0.0)
        t = -s.ae / s.ee - rise * math.sqrt(across / (s.ee * room))
    first = min(max(t, 0.0), 1.0)
    t = improved(a, s, first)
    if abs(t - first) > MOST_MOVED:
        t = improved(a, s, t)
    return t if t > LEAST_T else 0.0
