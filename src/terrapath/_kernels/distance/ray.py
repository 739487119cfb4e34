"""What a nearly straight path of several pieces costs, which bends as a whole and in its halves."""

from ..compiler import inner_kernel, kernel
from ..vec4 import larger, sqrt, where_above
from .ground import flat, piece, place_at, plus_rise, read, zero

# The slope across is measured this far on either side, as a share of the length.
ACROSS = 0.25


@inner_kernel
def inside(ground, x, y):
    """A place, moved onto the samples."""
    return (
        min(max(x, 0.0), ground.heights.shape[2] - 1.0),
        min(max(y, 0.0), ground.heights.shape[1] - 1.0),
    )


@inner_kernel
def gain_by_bending(ground, x0, y0, x2, y2):
    """What a path between two places saves, beside its halves, by bending as a whole."""
    dx, dy = x2 - x0, y2 - y0
    x1, y1 = 0.5 * (x0 + x2), 0.5 * (y0 + y2)
    lx, ly = inside(ground, x1 + ACROSS * dy, y1 - ACROSS * dx)
    rx, ry = inside(ground, x1 - ACROSS * dy, y1 + ACROSS * dx)
    p0, p1, p2 = place_at(ground, x0, y0), place_at(ground, x1, y1), place_at(ground, x2, y2)
    left, right = place_at(ground, lx, ly), place_at(ground, rx, ry)
    wx, wy = 0.5 * (rx - lx), 0.5 * (ry - ly)
    lift = flat(zero(ground), dx * ground.dx, dy * ground.dy, wx * ground.dx, wy * ground.dy)
    for layer in range(ground.heights.shape[0]):
        z = ground.heights
        w = 0.5 * (read(ground, z, layer, right) - read(ground, z, layer, left))
        z0, z1 = read(ground, z, layer, p0), read(ground, z, layer, p1)
        lift = plus_rise(lift, z0, z1, read(ground, z, layer, p2), w)
    both = lift.dw - lift.dv * lift.vw / lift.vv
    across = lift.ww - lift.vw * lift.vw / lift.vv
    sag = lift.dd - lift.dv * lift.dv / lift.vv
    halves = larger(sqrt(lift.first) + sqrt(lift.second) - sqrt(lift.vv), 0.0)
    share = both * both / (across * sag)
    gain = ground.floor * halves * where_above(1.0, share, share, 1.0)
    return where_above(across, 0.0, where_above(sag, 0.0, gain, 0.0), 0.0)


@inner_kernel
def ray(ground, x, y, dx, dy):
    """The cost of the nearly straight path from (x, y) to (x, y) + d, in samples."""
    count = 1
    while ground.reach * count < max(abs(dx), abs(dy)) - 1e-9:
        count *= 2
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
def fill_rays(ground, x, y, places, costs):
    """The cost of the nearly straight path from (x, y) to each of the places (m, 2), in samples."""
    for m in range(places.shape[0]):
        dx, dy = places[m, 0] - x, places[m, 1] - y
        costs[m] = ray(ground, x, y, dx, dy) if dx != 0.0 or dy != 0.0 else 0.0
