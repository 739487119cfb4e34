"""The geodesic equation on the plane, with the Jacobi field along it.

A geodesic of unit speed leaves the start at some angle on the plane. The Jacobi field j says how
far its end moves, across the geodesic, per radian of that angle. It is 0 at the start, and
j'' + K j = 0 (do Carmo 1992, chapter 5), where K is the Gaussian curvature. Where j is 0 again,
the point is conjugate to the start.
"""

import math
from typing import NamedTuple

from ..compiler import inner_kernel, kernel
from ..surface.lengths import norm
from ..surface.surfaces import Jet, Metric, jet_at, log_cost_at, metric_at


class Frame(NamedTuple):
    """The metric at a point without cost layers, and inner products of the layers' derivatives.

    Sums run over the weighted layers: a_ijl = sum_k (d_i d_j x_k) (d_l x_k).
    """

    h: Metric
    log_cost: Jet
    a111: float
    a112: float
    a121: float
    a122: float
    a221: float
    a222: float
    hessians: float  # sum_k det Hess x_k


class Christoffel(NamedTuple):
    """Gamma^k_ij as g<k>_<ij>; symmetric in i and j (paper, appendix 6.1)."""

    g1_11: float
    g1_12: float
    g1_22: float
    g2_11: float
    g2_12: float
    g2_22: float


class State(NamedTuple):
    """A point of a geodesic: position, velocity, Jacobi field and its derivative."""

    x: float
    y: float
    vx: float
    vy: float
    j: float
    dj: float


@inner_kernel
def frame_at(surface, x, y):
    h11, h12, h22 = 1.0, 0.0, 1.0
    a111, a112, a121, a122, a221, a222 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    hessians = 0.0
    for layer in range(surface.weights.shape[0]):
        w = surface.weights[layer] * surface.weights[layer]
        jet = jet_at(surface, layer, x, y)
        h11 += w * jet.fx * jet.fx
        h12 += w * jet.fx * jet.fy
        h22 += w * jet.fy * jet.fy
        a111 += w * jet.fxx * jet.fx
        a112 += w * jet.fxx * jet.fy
        a121 += w * jet.fxy * jet.fx
        a122 += w * jet.fxy * jet.fy
        a221 += w * jet.fyy * jet.fx
        a222 += w * jet.fyy * jet.fy
        hessians += w * (jet.fxx * jet.fyy - jet.fxy * jet.fxy)
    h, log_cost = Metric(h11, h12, h22), log_cost_at(surface, x, y)
    return Frame(h, log_cost, a111, a112, a121, a122, a221, a222, hessians)


@inner_kernel
def christoffel(frame):
    """Gamma^k_ij = h^kl a_ijl, the appendix's eight symbols."""
    h = frame.h
    d = h.h11 * h.h22 - h.h12 * h.h12
    return Christoffel(
        (h.h22 * frame.a111 - h.h12 * frame.a112) / d,
        (h.h22 * frame.a121 - h.h12 * frame.a122) / d,
        (h.h22 * frame.a221 - h.h12 * frame.a222) / d,
        (h.h11 * frame.a112 - h.h12 * frame.a111) / d,
        (h.h11 * frame.a122 - h.h12 * frame.a121) / d,
        (h.h11 * frame.a222 - h.h12 * frame.a221) / d,
    )


@inner_kernel
def curvature(frame, g):
    """Gaussian curvature by the equation of Gauss.

    K d = <N s_11, N s_22> - |N s_12|^2, where N takes the normal part of the second derivatives.
    The Christoffel symbols give the tangential part; the rest is normal.
    """
    h = frame.h
    tangential = g.g1_11 * frame.a221 + g.g2_11 * frame.a222
    tangential -= g.g1_12 * frame.a121 + g.g2_12 * frame.a122
    return (frame.hessians - tangential) / (h.h11 * h.h22 - h.h12 * h.h12)


@inner_kernel
def costly_christoffel(frame, g):
    """The symbols of c^2 h from those of h, where p is log c.

    Gamma^k_ij + delta^k_i p_j + delta^k_j p_i - h_ij h^kl p_l (do Carmo 1992, chapter 8).
    """
    h, px, py = frame.h, frame.log_cost.fx, frame.log_cost.fy
    d = h.h11 * h.h22 - h.h12 * h.h12
    up_x, up_y = (h.h22 * px - h.h12 * py) / d, (h.h11 * py - h.h12 * px) / d
    return Christoffel(
        g.g1_11 + 2.0 * px - h.h11 * up_x,
        g.g1_12 + py - h.h12 * up_x,
        g.g1_22 - h.h22 * up_x,
        g.g2_11 - h.h11 * up_y,
        g.g2_12 + px - h.h12 * up_y,
        g.g2_22 + 2.0 * py - h.h22 * up_y,
    )


@inner_kernel
def costly_curvature(frame, g):
    """Gaussian curvature of c^2 h: (K - Laplacian of log c) / c^2."""
    h, p = frame.h, frame.log_cost
    pxx = p.fxx - g.g1_11 * p.fx - g.g2_11 * p.fy
    pxy = p.fxy - g.g1_12 * p.fx - g.g2_12 * p.fy
    pyy = p.fyy - g.g1_22 * p.fx - g.g2_22 * p.fy
    d = h.h11 * h.h22 - h.h12 * h.h12
    laplacian = (h.h22 * pxx - 2.0 * h.h12 * pxy + h.h11 * pyy) / d
    return math.exp(-2.0 * p.f) * (curvature(frame, g) - laplacian)


@inner_kernel
def derivative(surface, s):
    """d/ds of a state: x'' = -Gamma(v, v) (paper, appendix 6.1), j'' = -K j."""
    frame = frame_at(surface, s.x, s.y)
    plain = christoffel(frame)
    g = costly_christoffel(frame, plain)
    ax = -(g.g1_11 * s.vx * s.vx + 2.0 * g.g1_12 * s.vx * s.vy + g.g1_22 * s.vy * s.vy)
    ay = -(g.g2_11 * s.vx * s.vx + 2.0 * g.g2_12 * s.vx * s.vy + g.g2_22 * s.vy * s.vy)
    return State(s.vx, s.vy, ax, ay, s.dj, -costly_curvature(frame, plain) * s.j)


@inner_kernel
def unit_state(surface, x, y, angle):
    """The state at the start of the unit-speed geodesic that leaves at an angle on the plane.

    For each radian on the plane, the direction u turns under h by
    |du|_h sin / |u|_h = sqrt(d) / |u|_h^2. That is the first derivative of the Jacobi field.
    """
    h = metric_at(surface, x, y)
    dx, dy = math.cos(angle), math.sin(angle)
    speed = norm(h, dx, dy)
    turn = math.sqrt(h.h11 * h.h22 - h.h12 * h.h12) / (speed * speed)
    return State(x, y, dx / speed, dy / speed, 0.0, turn)


# Many points at once


@kernel
def fill_christoffel(surface, points, symbols):
    """Christoffel symbols (m, 2, 2, 2) at points, index order [k, i, j]."""
    for m in range(points.shape[0]):
        frame = frame_at(surface, points[m, 0], points[m, 1])
        g = costly_christoffel(frame, christoffel(frame))
        symbols[m, 0, 0, 0] = g.g1_11
        symbols[m, 0, 0, 1] = symbols[m, 0, 1, 0] = g.g1_12
        symbols[m, 0, 1, 1] = g.g1_22
        symbols[m, 1, 0, 0] = g.g2_11
        symbols[m, 1, 0, 1] = symbols[m, 1, 1, 0] = g.g2_12
        symbols[m, 1, 1, 1] = g.g2_22


@kernel
def fill_curvature(surface, points, curvatures):
    """Gaussian curvatures (m,) at points."""
    for m in range(points.shape[0]):
        frame = frame_at(surface, points[m, 0], points[m, 1])
        curvatures[m] = costly_curvature(frame, christoffel(frame))
