"""The place on the segment between two neighbours of a node that offers the least value."""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel


class Segment(NamedTuple):
    """Products of the lifts a and b - a from the node, and of a from the source."""

    aa: float
    ae: float
    ee: float
    ss: float  # of a from the source, squared
    se: float  # its product with b - a


class Place(NamedTuple):
    """The value offered from the share t of a segment, which ends where a direction leads."""

    value: float
    direction: np.int64
    t: float


NOWHERE = Place(math.inf, np.int64(0), 0.0)


@inner_kernel
def value_on(g, t, ca, cb, ta, tb):
    """The value offered from the place t of a segment: costs per chord c, and tau, are linear."""
    c, tau = ca + t * (cb - ca), ta + t * (tb - ta)
    near = math.sqrt(max(g.aa + t * (2.0 * g.ae + t * g.ee), 0.0))
    far = math.sqrt(max(g.ss + t * (2.0 * g.se + t * g.ee), 0.0))
    return c * near + tau * far


# The least is at the beginning where t is no more than this.
LEAST_T = 1e-6


@inner_kernel
def improved(g, t, ca, cb, ta, tb):
    """A step of Newton's method to the t of the least value.

    The value at a + t (b - a) is c times the chord to the node, plus tau times the chord from the
    source; c and tau are linear in t.
    """
    c, tau = ca + t * (cb - ca), ta + t * (tb - ta)
    near = math.sqrt(max(g.aa + t * (2.0 * g.ae + t * g.ee), 0.0))
    far = math.sqrt(max(g.ss + t * (2.0 * g.se + t * g.ee), 0.0))
    if not (near > 0.0 and far > 0.0):
        return t
    near_rise, far_rise = (g.ae + t * g.ee) / near, (g.se + t * g.ee) / far
    slope = c * near_rise + (cb - ca) * near + tau * far_rise + (tb - ta) * far
    bend = c * (g.ee - near_rise * near_rise) / near + tau * (g.ee - far_rise * far_rise) / far
    bend += 2.0 * ((cb - ca) * near_rise + (tb - ta) * far_rise)
    return min(max(t - slope / bend, 0.0), 1.0) if bend > 0.0 else t


@inner_kernel
def place_of_least(g, ca, cb, ta, tb, ua, ub):
    """The t of the place on a segment that offers least; 0 where that is its beginning."""
    near, far, c = math.sqrt(g.aa), math.sqrt(g.ss), 0.5 * (ca + cb)
    rise = ub - ua + (cb - ca) * near
    # By how much the value rises from the beginning on; at the source there is no such slope.
    if far > 0.0:
        start = ta * g.se / far + (tb - ta) * far + (cb - ca) * near + ca * g.ae / near
        if start >= 0.0:
            return 0.0
    room = c * c * g.ee - rise * rise
    t = 0.5
    if room > 0.0:
        across = max(g.aa - g.ae * g.ae / g.ee, 0.0)
        t = -g.ae / g.ee - rise * math.sqrt(across / (g.ee * room))
    t = improved(g, min(max(t, 0.0), 1.0), ca, cb, ta, tb)
    return improved(g, t, ca, cb, ta, tb)
