"""How fast lengths grow along a vector, at one point and at several points of a segment."""

import math

from ..compiler import inner_kernel
from ..dispatch import per_class
from ..travel.paces import pace_along
from ..travel.priced import PricedPeaks, per_price
from ..vec4 import four, fused, sqrt
from .surfaces import Peaks, Spline, slope_along, spot_at, squared_cost_at


@inner_kernel
def metric_speed(surface, x, y, vx, vy):
    spot = spot_at(surface, x, y)
    squared = 0.0 * x + (vx * vx + vy * vy)  # a number or four
    for layer in range(surface.weights.shape[0]):
        rise = surface.weights[layer] * slope_along(surface, layer, spot, vx, vy)
        squared = squared + rise * rise
    return sqrt(squared_cost_at(surface, spot) * squared)


@inner_kernel
def priced_speed(surface, x, y, vx, vy):
    spot = spot_at(surface, x, y)
    rise = surface.weights[0] * slope_along(surface, 0, spot, vx, vy)
    cost = pace_along(surface.price.pace, math.sqrt(vx * vx + vy * vy), rise)
    return sqrt(squared_cost_at(surface, spot)) * cost


@per_price(metric_speed, priced_speed)
def speed_at(surface, x, y, vx, vy):
    """What v = (vx, vy) costs, without costs in cells; c is the smooth cost.

    |v|_h = c (|v|^2 + sum_k (w_k dx_k(v))^2)^1/2, on ``Peaks`` also at four points at once. Under a
    pace F(x, v) = c |v| P(grad z . v / |v|).
    """


@inner_kernel
def peaks_speeds_along(surface, x, y, vx, vy, shares):
    return speed_at(surface, fused(shares, vx, x), fused(shares, vy, y), vx, vy)


@inner_kernel
def spline_speeds_along(surface, x, y, vx, vy, shares):
    return four(
        speed_at(surface, x + shares[0] * vx, y + shares[0] * vy, vx, vy),
        speed_at(surface, x + shares[1] * vx, y + shares[1] * vy, vx, vy),
        speed_at(surface, x + shares[2] * vx, y + shares[2] * vy, vx, vy),
        speed_at(surface, x + shares[3] * vx, y + shares[3] * vy, vx, vy),
    )


@per_class(
    {
        Peaks: peaks_speeds_along,
        Spline: spline_speeds_along,
        PricedPeaks: spline_speeds_along,
    }
)
def speeds_along(surface, x, y, vx, vy, shares):
    """The speed at four points of the segment from (x, y) to (x, y) + v, given as shares of it."""


@inner_kernel
def peaks_speeds_inside(surface, x, y, vx, vy):
    return peaks_speeds_along(surface, x, y, vx, vy, four(0.25, 0.5, 0.75, 1.0))


@inner_kernel
def spline_speeds_inside(surface, x, y, vx, vy):
    return four(
        speed_at(surface, x + 0.25 * vx, y + 0.25 * vy, vx, vy),
        speed_at(surface, x + 0.5 * vx, y + 0.5 * vy, vx, vy),
        speed_at(surface, x + 0.75 * vx, y + 0.75 * vy, vx, vy),
        0.0,
    )


@per_class(
    {
        Peaks: peaks_speeds_inside,
        Spline: spline_speeds_inside,
        PricedPeaks: spline_speeds_inside,
    }
)
def speeds_inside(surface, x, y, vx, vy):
    """The speed at a quarter, a half and three quarters of the segment from (x, y) to (x, y) + v.

    Four numbers are returned; ignore the last one.
    """
