"""What a short straight piece of a path costs, with what a path saves by bending a little.

A piece v has a lift in R^n: its rise in every layer comes after its two planar parts. Two rules
with one and two chords give Richardson's value (4 C_2 - C_1) / 3, which is never below C_1, the
chord. The shortest path between both ends is not straight: where the lift sags by d below its
chord, a shift along w, across the piece, takes away the share

    <d, w>^2 / (|d|^2 |w|^2)

of what the sag adds; d and w are taken without their parts along v. For one layer with grade m
and the slope g across, (1 + m^2) / (1 + m^2 + g^2) of it is left.
"""

from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel
from ..dispatch import per_class
from ..surface.cells import CostCells, any_cells, clamped, mean_in_cells
from ..vec4 import any_above, four, four_entries, larger, sqrt, where_above


class Ground(NamedTuple):
    """Heights and costs at samples of a surface, 2 ``pieces`` times as dense as nodes."""

    heights: np.ndarray  # (layers, rows, columns) float64: weighted, map units
    costs: np.ndarray  # (0 or 1, rows, columns) float64
    dx: float  # distance of samples, map units
    dy: float
    pieces: int  # an edge between neighbouring nodes is cut into so many; a piece has 3 samples
    reach: float  # a longer line is cut into pieces of at most this, in samples
    floor: float  # a lower bound on the costs
    cells: CostCells  # costs that are constant in cells, in samples


class FourGrounds(NamedTuple):
    """The ground as it is seen from four nodes: in place of a sample, kernels get four, each as
    far from its node as that sample is from the first.

    All that kernels ask for must be on the samples, for each of the nodes, and no costs constant in
    cells.
    """

    heights: np.ndarray  # as of Ground
    costs: np.ndarray
    dx: float
    dy: float
    pieces: int
    reach: float
    floor: float
    cells: CostCells
    second: int  # the numbers of the other nodes' samples, less that of the first
    third: int
    fourth: int


class Lift(NamedTuple):
    """Sums over all coordinates of products: of a piece v, its halves, its sag d, and w across."""

    vv: float
    first: float  # the first half, squared
    second: float
    dd: float
    dv: float
    dw: float
    vw: float
    ww: float


class Costs(NamedTuple):
    """The cost at the beginning, middle and end of a piece, and its difference along w."""

    begin: float
    middle: float
    end: float
    across: float


# A path gains by bending to cheaper ground, but the formula holds for small gains only.
MOST_SAVED = 0.05

# Where the sag's square is at most this share of the chord's, the two halves are longer than the
# chord by 2 |d|^2 / |v|, with a relative error of about this share.
SLIGHT = 1e-4


@inner_kernel
def seen_from(g, second, third, fourth):
    """The ground as it is seen from four nodes."""
    return FourGrounds(
        g.heights, g.costs, g.dx, g.dy, g.pieces, g.reach, g.floor, g.cells, second, third, fourth
    )


@inner_kernel
def sample_of_one(ground, values, layer, j, i):
    return values[layer, j, i]


@inner_kernel
def samples_of_four(ground, values, layer, j, i):
    return four_entries(values, layer, j, i, ground.second, ground.third, ground.fourth)


@inner_kernel
def zero_of_one(ground):
    return 0.0


@inner_kernel
def zero_of_four(ground):
    return four(0.0, 0.0, 0.0, 0.0)


@per_class({Ground: sample_of_one, FourGrounds: samples_of_four})
def sample(ground, values, layer, j, i):
    """A layer of ``heights`` or ``costs`` at sample (i, j); of the first of four nodes."""


@per_class({Ground: zero_of_one, FourGrounds: zero_of_four})
def zero(ground):
    """The number 0 where sums begin."""


@inner_kernel
def flat(zero, vx, vy, wx, wy):
    """The sums over the two coordinates of the plane."""
    vv = zero + (vx * vx + vy * vy)
    vw, ww = zero + (vx * wx + vy * wy), zero + (wx * wx + wy * wy)
    return Lift(vv, 0.25 * vv, 0.25 * vv, zero, zero, zero, vw, ww)


@inner_kernel
def plus_rise(lift, z0, z1, z2, w):
    """The sums with one more layer: heights along the piece, and the rise along w."""
    v, a, b, d = z2 - z0, z1 - z0, z2 - z1, z1 - 0.5 * (z0 + z2)
    return Lift(
        lift.vv + v * v,
        lift.first + a * a,
        lift.second + b * b,
        lift.dd + d * d,
        lift.dv + d * v,
        lift.dw + d * w,
        lift.vw + v * w,
        lift.ww + w * w,
    )


@inner_kernel
def bent(lift):
    """The length of a piece as Richardson's value has it, less what bending across saves."""
    per = 1.0 / lift.vv
    chord, sag = sqrt(lift.vv), lift.dd - lift.dv * lift.dv * per
    across = lift.ww - lift.vw * lift.vw * per
    both = lift.dw - lift.dv * lift.vw * per
    left = where_above(across, 0.0, larger(sag - both * both / across, 0.0), sag)
    slightly = chord * (1.0 + 8.0 / 3.0 * left * per)
    if not any_above(lift.dd, SLIGHT * lift.vv):
        return slightly
    # The two halves are together at least as long as the chord, but for rounding.
    excess = larger(sqrt(lift.first) + sqrt(lift.second) - chord, 0.0)
    share = where_above(sag, 0.0, left / sag, 0.0)
    return where_above(lift.dd, SLIGHT * lift.vv, chord + 4.0 / 3.0 * excess * share, slightly)


@inner_kernel
def mean_cost(lift, c):
    """The mean of the cost along a piece, less what bending to cheaper ground saves."""
    a, b, one = sqrt(lift.first), sqrt(lift.second), sqrt(lift.vv)
    two = 0.5 * (a * (c.begin + c.middle) + b * (c.middle + c.end))
    mean = (4.0 * two - 0.5 * one * (c.begin + c.end)) / (4.0 * (a + b) - one)
    across = lift.ww - lift.vw * lift.vw / lift.vv
    slope = (c.across - (c.end - c.begin) * lift.vw / lift.vv) / c.middle
    saved = slope * slope / across * lift.vv / 24.0
    saved = where_above(MOST_SAVED, saved, saved, MOST_SAVED)
    return mean * (1.0 - where_above(across, 0.0, saved, 0.0))


@inner_kernel
def costed(ground, lift, length, c):
    """The cost of a piece of a length, by the smooth cost."""
    return larger(length * mean_cost(lift, c), smooth_floor(ground) * sqrt(lift.vv))


@inner_kernel
def smooth_floor(ground):
    """A lower bound on the smooth cost."""
    return ground.floor / ground.cells.least


@inner_kernel
def times_cells_of_one(ground, cost, x0, y0, x2, y2):
    if not any_cells(ground.cells):
        return cost
    return cost * mean_in_cells(ground.cells, x0, y0, x2, y2)


@inner_kernel
def times_no_cells(ground, cost, x0, y0, x2, y2):
    return cost


@per_class({Ground: times_cells_of_one, FourGrounds: times_no_cells})
def times_cells(ground, cost, x0, y0, x2, y2):
    """The cost of a piece between two places, in samples, times that of the cells it meets."""


# Pieces between samples


@inner_kernel
def sampled_piece(ground, i, j, ex, ey):
    """The cost of the piece from sample (i, j) to (i, j) + 2 e, e in samples."""
    rows, columns = ground.heights.shape[1], ground.heights.shape[2]
    i1, j1, i2, j2 = i + ex, j + ey, i + 2 * ex, j + 2 * ey
    il, ir = clamped(i1 + ey, columns), clamped(i1 - ey, columns)
    jl, jr = clamped(j1 - ex, rows), clamped(j1 + ex, rows)
    lift = flat(
        zero(ground),
        2.0 * ex * ground.dx,
        2.0 * ey * ground.dy,
        0.5 * (ir - il) * ground.dx,
        0.5 * (jr - jl) * ground.dy,
    )
    for layer in range(ground.heights.shape[0]):
        z = ground.heights
        z0, z1 = sample(ground, z, layer, j, i), sample(ground, z, layer, j1, i1)
        w = 0.5 * (sample(ground, z, layer, jr, ir) - sample(ground, z, layer, jl, il))
        lift = plus_rise(lift, z0, z1, sample(ground, z, layer, j2, i2), w)
    length = bent(lift)
    if ground.costs.shape[0] == 0:
        return times_cells(ground, length, i, j, i2, j2)
    c = ground.costs
    costs = Costs(
        sample(ground, c, 0, j, i),
        sample(ground, c, 0, j1, i1),
        sample(ground, c, 0, j2, i2),
        0.5 * (sample(ground, c, 0, jr, ir) - sample(ground, c, 0, jl, il)),
    )
    return times_cells(ground, costed(ground, lift, length, costs), i, j, i2, j2)


class Place(NamedTuple):
    """A place among the samples: the middle one of 3 x 3, their weights, and where it is there."""

    i: int
    j: int
    x0: float
    x1: float
    x2: float
    y0: float
    y1: float
    y2: float
    a: float
    b: float


# Half-way between two samples the quadratics around both differ, and rays lead there again and
# again. A place this near to it belongs to the upper sample, so that rounding does not choose.
MIDDLE = 0.5 + 1e-9


@inner_kernel
def place_at(ground, x, y):
    """The weights of the quadratic through the samples around (x, y), in samples."""
    i = min(max(int(x + MIDDLE), 1), ground.heights.shape[2] - 2)
    j = min(max(int(y + MIDDLE), 1), ground.heights.shape[1] - 2)
    a, b = x - i, y - j
    return Place(
        i,
        j,
        0.5 * a * (a - 1.0),
        1.0 - a * a,
        0.5 * a * (a + 1.0),
        0.5 * b * (b - 1.0),
        1.0 - b * b,
        0.5 * b * (b + 1.0),
        a,
        b,
    )


@inner_kernel
def row_at(ground, values, layer, j, p):
    middle = sample(ground, values, layer, j, p.i)
    if p.a == 0.0:
        return middle
    left = sample(ground, values, layer, j, p.i - 1)
    return p.x0 * left + p.x1 * middle + p.x2 * sample(ground, values, layer, j, p.i + 1)


@inner_kernel
def read(ground, values, layer, p):
    """A layer at a place."""
    middle = row_at(ground, values, layer, p.j, p)
    if p.b == 0.0:
        return middle
    below, above = (
        row_at(ground, values, layer, p.j - 1, p),
        row_at(ground, values, layer, p.j + 1, p),
    )
    return p.y0 * below + p.y1 * middle + p.y2 * above


class Tilt(NamedTuple):
    """A layer at a place, and its slope along a vector, per sample."""

    value: float
    slope: float


@inner_kernel
def row_and_run(ground, values, layer, j, p):
    """A layer at a place's column in row j, and its slope along x there."""
    left, middle = sample(ground, values, layer, j, p.i - 1), sample(ground, values, layer, j, p.i)
    right = sample(ground, values, layer, j, p.i + 1)
    return (
        p.x0 * left + p.x1 * middle + p.x2 * right,
        (p.a - 0.5) * left - 2.0 * p.a * middle + (p.a + 0.5) * right,
    )


@inner_kernel
def tilt_along(ground, values, layer, p, wx, wy):
    """A layer at a place, and its slope there along w."""
    below, run_below = row_and_run(ground, values, layer, p.j - 1, p)
    middle, run_middle = row_and_run(ground, values, layer, p.j, p)
    above, run_above = row_and_run(ground, values, layer, p.j + 1, p)
    run = p.y0 * run_below + p.y1 * run_middle + p.y2 * run_above
    rise = (p.b - 0.5) * below - 2.0 * p.b * middle + (p.b + 0.5) * above
    return Tilt(p.y0 * below + p.y1 * middle + p.y2 * above, wx * run + wy * rise)


@inner_kernel
def across(ground, dx, dy):
    """The sums of a piece d, in samples, and of w, a vector across it, over the plane."""
    return flat(zero(ground), dx * ground.dx, dy * ground.dy, -dy * ground.dx, dx * ground.dy)


@inner_kernel
def piece(ground, x0, y0, x2, y2):
    """The cost of a piece between any two places, in samples."""
    dx, dy = x2 - x0, y2 - y0
    p0, p2 = place_at(ground, x0, y0), place_at(ground, x2, y2)
    p1 = place_at(ground, 0.5 * (x0 + x2), 0.5 * (y0 + y2))
    lift, z = across(ground, dx, dy), ground.heights
    for layer in range(z.shape[0]):
        z1 = tilt_along(ground, z, layer, p1, -dy, dx)
        z0, z2 = read(ground, z, layer, p0), read(ground, z, layer, p2)
        lift = plus_rise(lift, z0, z1.value, z2, z1.slope)
    return cost_between(ground, lift, p0, p1, p2, dx, dy)


@inner_kernel
def cost_between(ground, lift, p0, p1, p2, dx, dy):
    """The cost of a piece d with a lift, from a place to the middle and on to the end."""
    length, c = bent(lift), ground.costs
    if c.shape[0] > 0:
        floor, c1 = smooth_floor(ground), tilt_along(ground, c, 0, p1, -dy, dx)
        costs = Costs(
            larger(read(ground, c, 0, p0), floor),
            larger(c1.value, floor),
            larger(read(ground, c, 0, p2), floor),
            c1.slope,
        )
        length = costed(ground, lift, length, costs)
    return times_cells(ground, length, p0.i + p0.a, p0.j + p0.b, p2.i + p2.a, p2.j + p2.b)
