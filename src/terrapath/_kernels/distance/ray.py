"""What a nearly straight path of several pieces costs, which bends as a whole and in its halves."""

from typing import NamedTuple

from ..compiler import inner_kernel, kernel
from ..vec4 import larger, sqrt, where_above
from .ground import (
    Place,
    across,
    cost_between,
    flat,
    piece,
    place_at,
    plus_rise,
    read,
    tilt_along,
    zero,
)

# The slope across is measured this far on either side, as a share of the length.
ACROSS = 0.25


@inner_kernel
def inside(ground, x, y):
    """A place, moved onto the samples."""
    return (
        min(max(x, 0.0), ground.heights.shape[2] - 1.0),
        min(max(y, 0.0), ground.heights.shape[1] - 1.0),
    )


class Sides(NamedTuple):
    """Places on both sides of a path's middle, and half of the vector between them."""

    left: Place
    right: Place
    wx: float
    wy: float


@inner_kernel
def sides_of(ground, x, y, dx, dy):
    """The places beside (x, y) across d."""
    lx, ly = inside(ground, x + ACROSS * dy, y - ACROSS * dx)
    rx, ry = inside(ground, x - ACROSS * dy, y + ACROSS * dx)
    left, right = place_at(ground, lx, ly), place_at(ground, rx, ry)
    return Sides(left, right, 0.5 * (rx - lx), 0.5 * (ry - ly))


@inner_kernel
def rise_across(ground, layer, sides):
    z = ground.heights
    return 0.5 * (read(ground, z, layer, sides.right) - read(ground, z, layer, sides.left))


@inner_kernel
def gain_of(ground, lift):
    """What a path with a lift saves, beside its halves, by bending as a whole."""
    both = lift.dw - lift.dv * lift.vw / lift.vv
    across = lift.ww - lift.vw * lift.vw / lift.vv
    sag = lift.dd - lift.dv * lift.dv / lift.vv
    halves = larger(sqrt(lift.first) + sqrt(lift.second) - sqrt(lift.vv), 0.0)
    share = both * both / (across * sag)
    gain = ground.floor * halves * where_above(1.0, share, share, 1.0)
    return where_above(across, 0.0, where_above(sag, 0.0, gain, 0.0), 0.0)


@inner_kernel
def gain_by_bending(ground, x0, y0, x2, y2):
    """What a path between two places saves, beside its halves, by bending as a whole."""
    dx, dy = x2 - x0, y2 - y0
    x1, y1, z = 0.5 * (x0 + x2), 0.5 * (y0 + y2), ground.heights
    p0, p1, p2 = place_at(ground, x0, y0), place_at(ground, x1, y1), place_at(ground, x2, y2)
    s = sides_of(ground, x1, y1, dx, dy)
    lift = flat(zero(ground), dx * ground.dx, dy * ground.dy, s.wx * ground.dx, s.wy * ground.dy)
    for layer in range(z.shape[0]):
        z0, z1 = read(ground, z, layer, p0), read(ground, z, layer, p1)
        z2, w = read(ground, z, layer, p2), rise_across(ground, layer, s)
        lift = plus_rise(lift, z0, z1, z2, w)
    return gain_of(ground, lift)


@inner_kernel
def two_pieces(ground, x, y, dx, dy):
    """The cost of the nearly straight path from (x, y) to (x, y) + d, in two pieces."""
    hx, hy, z = 0.5 * dx, 0.5 * dy, ground.heights
    p0, p4 = place_at(ground, x, y), place_at(ground, x + dx, y + dy)
    p1, p2 = place_at(ground, x + 0.5 * hx, y + 0.5 * hy), place_at(ground, x + hx, y + hy)
    p3, s = place_at(ground, x + 1.5 * hx, y + 1.5 * hy), sides_of(ground, x + hx, y + hy, dx, dy)
    a, b = across(ground, hx, hy), across(ground, hx, hy)
    whole = flat(zero(ground), dx * ground.dx, dy * ground.dy, s.wx * ground.dx, s.wy * ground.dy)
    for layer in range(z.shape[0]):
        z0, z2 = read(ground, z, layer, p0), read(ground, z, layer, p2)
        z1, z4 = tilt_along(ground, z, layer, p1, -hy, hx), read(ground, z, layer, p4)
        z3 = tilt_along(ground, z, layer, p3, -hy, hx)
        a = plus_rise(a, z0, z1.value, z2, z1.slope)
        b = plus_rise(b, z2, z3.value, z4, z3.slope)
        whole = plus_rise(whole, z0, z2, z4, rise_across(ground, layer, s))
    first = cost_between(ground, a, p0, p1, p2, hx, hy)
    return first + cost_between(ground, b, p2, p3, p4, hx, hy) - gain_of(ground, whole)


@inner_kernel
def many_pieces(ground, x, y, dx, dy, count):
    """The cost of the nearly straight path from (x, y) to (x, y) + d, in so many pieces."""
    cost = zero(ground)
    for k in range(count):
        a, b = k / count, (k + 1) / count
        cost = cost + piece(ground, x + a * dx, y + a * dy, x + b * dx, y + b * dy)
    while count > 1:
        count //= 2
        for k in range(count):
            a, b = k / count, (k + 1) / count
            gain = gain_by_bending(ground, x + a * dx, y + a * dy, x + b * dx, y + b * dy)
            cost = cost - gain
    return cost


@kernel
def ray(ground, x, y, dx, dy):
    """The cost of the nearly straight path from (x, y) to (x, y) + d, in samples."""
    longest = max(abs(dx), abs(dy)) - 1e-9
    if ground.reach < longest <= 2.0 * ground.reach:
        return two_pieces(ground, x, y, dx, dy)
    count = 1
    while ground.reach * count < longest:
        count *= 2
    return many_pieces(ground, x, y, dx, dy, count)


@kernel
def fill_rays(ground, x, y, places, costs):
    """The cost of the nearly straight path from (x, y) to each of the places (m, 2), in samples."""
    for m in range(places.shape[0]):
        dx, dy = places[m, 0] - x, places[m, 1] - y
        costs[m] = ray(ground, x, y, dx, dy) if dx != 0.0 or dy != 0.0 else 0.0
