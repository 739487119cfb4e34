"""The values of four nodes by Bellman's principle: the least of u(y) + C(y, x) over places y.

These are on the segments beside the edge of each node that offers least.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..surface.cells import any_cells, mean_in_cells
from ..vec4 import any_above, four, larger, sqrt, where_above
from .bellman import bend_of
from .ground import Costs, bent, costed, flat, place_at, plus_rise, read, smooth_floor
from .quartet import (
    ACROSS_X,
    ACROSS_Y,
    ARRIVAL,
    AT_A,
    AT_B,
    AT_NODE,
    BEND,
    BETWEEN,
    CHORD,
    FROM_X,
    FROM_Y,
    HALF_A,
    HALF_B,
    LEFT,
    RIGHT,
    WAY_X,
    WAY_Y,
    ends_of,
    fill_row,
    place_node,
    read_edge,
    read_side,
    row,
    segments_of,
)
from .ray import ray
from .segments import (
    Segment,
    best_place,
    fall_along,
    first_where_above,
    is_wide,
    near_on,
    size,
    value_on,
)
from .star import X, Y, index

# Where second differences of tau would change a step by more than a share they are not used.
MOST_CORRECTED = 0.03


class Choice(NamedTuple):
    """The segments that values come through, and the places on these."""

    segment: Segment
    t: np.ndarray  # (4,); 0 where the value comes along the edge
    on_left: np.ndarray  # (4,): above 0 where the segment is on the left


@inner_kernel
def better_side(end, right, left):
    """The places of the least values on the segments on both sides of four edges."""
    fall_r, fall_l = fall_along(end, right), fall_along(end, left)
    segment = first_where_above(fall_r, 0.0, right, left)
    t = where_above(fall_r + fall_l, 0.0, best_place(end, segment), 0.0)
    on_left = where_above(fall_r, 0.0, 0.0, fall_l)
    both = where_above(fall_r, 0.0, fall_l, 0.0)
    if any_above(both, 0.0):
        other = where_above(both, 0.0, best_place(end, left), 0.0)
        gain = value_on(end, segment, t) - value_on(end, left, other)
        gain = where_above(other, 0.0, where_above(t, 0.0, gain, 1.0), 0.0)
        segment, t = first_where_above(gain, 0.0, left, segment), where_above(gain, 0.0, other, t)
        on_left = where_above(gain, 0.0, 1.0, on_left)
    return Choice(segment, t, on_left)


# From the places chosen to the nodes


@inner_kernel
def read_way(medium, state, quartet, m, t):
    """Fill column m with the way to a node from the place t, above 0, between its neighbours."""
    node, table = quartet.nodes[m], quartet.table
    a, b = index(node.a), index(node.b)
    ex, ey = X[b] - X[a], Y[b] - Y[a]
    x, y = X[a] + t * ex, Y[a] + t * ey
    table[0, WAY_X, m], table[0, WAY_Y, m] = x, y
    table[0, ACROSS_X, m], table[0, ACROSS_Y, m] = ex, ey
    table[0, FROM_X, m], table[0, FROM_Y, m] = node.x + x, node.y + y
    table[0, BEND, m] = bend_of(medium, state, node, node.a, node.b)


@inner_kernel
def read_triangle(medium, samples, node, table, m):
    """Fill column m with the samples of a layer on a node's triangle."""
    at = node.at
    a, b = medium.half_steps[index(node.a)], medium.half_steps[index(node.b)]
    table[0, AT_A, m], table[0, AT_B, m] = samples[index(at + 2 * a)], samples[index(at + 2 * b)]
    table[0, AT_NODE, m], table[0, BETWEEN, m] = samples[index(at)], samples[index(at + a + b)]
    table[0, HALF_A, m], table[0, HALF_B, m] = samples[index(at + a)], samples[index(at + b)]


class Crossing(NamedTuple):
    """Samples on the line from t between two neighbours to a node."""

    end: np.ndarray  # (4,): at the node
    begin: np.ndarray
    middle: np.ndarray
    across: np.ndarray  # the slope along the segment between the neighbours


@inner_kernel
def on_triangles(table, t):
    """The quadratic through the corners of four triangles and the middles of their sides."""
    za, zb, ma, mb = row(table, AT_A), row(table, AT_B), row(table, HALF_A), row(table, HALF_B)
    sag = row(table, BETWEEN) - 0.5 * (za + zb)
    return Crossing(
        row(table, AT_NODE),
        za + t * (zb - za) + 4.0 * t * (1.0 - t) * sag,
        ma + t * (mb - ma) + t * (1.0 - t) * sag,
        2.0 * (mb - ma) + 2.0 * (1.0 - 2.0 * t) * sag,
    )


class Arrival(NamedTuple):
    """A path to a node: what it costs, and the chord from the source to where it begins."""

    cost: float
    chord: float


@inner_kernel
def in_triangles(medium, source, quartet, count, t):
    """The paths to four nodes, in one piece each."""
    ground, grid, nodes, table = medium.ground, medium.grid, quartet.nodes, quartet.table
    x, y = row(table, WAY_X) * grid.dx, row(table, WAY_Y) * grid.dy
    wx, wy = row(table, ACROSS_X) * grid.dx, row(table, ACROSS_Y) * grid.dy
    sx, sy = row(table, FROM_X) * grid.dx, row(table, FROM_Y) * grid.dy
    lift, squared = flat(four(0.0, 0.0, 0.0, 0.0), x, y, wx, wy), sx * sx + sy * sy
    for layer in range(source.lift.shape[0]):
        samples = medium.samples[layer]
        for m in range(count):
            if t[m] > 0.0:
                read_triangle(medium, samples, nodes[m], table, m)
        z = on_triangles(table, t)
        lift = plus_rise(lift, z.end, z.middle, z.begin, z.across)
        rise = z.begin - source.lift[layer]
        squared = squared + rise * rise
    cost = bent(lift)
    if ground.costs.shape[0] > 0:
        cost = in_costs(medium, quartet, count, t, lift, cost)
    return Arrival(cost, sqrt(squared))


@inner_kernel
def in_costs(medium, quartet, count, t, lift, length):
    """The costs of pieces of four lengths in triangles, by the smooth cost."""
    ground, samples, floor = medium.ground, medium.cost_samples[0], smooth_floor(medium.ground)
    for m in range(count):
        read_triangle(medium, samples, quartet.nodes[m], quartet.table, m)
    c = on_triangles(quartet.table, t)
    begin, middle = larger(c.begin, floor), larger(c.middle, floor)
    return costed(ground, lift, length, Costs(c.end, middle, begin, c.across))


@inner_kernel
def along_ray(medium, source, node, x, y):
    """The straight path to a node from the place (x, y) away, in nodes, piece by piece."""
    ground, per = medium.ground, 2.0 * medium.ground.pieces
    cost = ray(ground, per * node.i, per * node.j, per * x, per * y)
    dx, dy = (node.x + x) * medium.grid.dx, (node.y + y) * medium.grid.dy
    place = place_at(ground, per * (node.i + x), per * (node.j + y))
    squared = dx * dx + dy * dy
    for layer in range(source.lift.shape[0]):
        rise = read(ground, ground.heights, layer, place) - source.lift[layer]
        squared += rise * rise
    return Arrival(cost, math.sqrt(squared))


@inner_kernel
def read_arrival(medium, source, node, table, m):
    """Mend the arrival in column m: in a triangle with cells, or by a ray of several pieces."""
    x, y = table[0, WAY_X, m], table[0, WAY_Y, m]
    if not (medium.one_piece[node.a] and medium.one_piece[node.b]):
        arrival = along_ray(medium, source, node, x, y)
        table[0, ARRIVAL, m], table[0, CHORD, m] = arrival.cost, arrival.chord
    elif any_cells(medium.ground.cells):
        per = 2.0 * medium.ground.pieces
        i, j = per * node.i, per * node.j
        mean = mean_in_cells(medium.ground.cells, i, j, i + per * x, j + per * y)
        table[0, ARRIVAL, m] *= mean


@inner_kernel
def values_through(medium, state, source, quartet, count, end, choice):
    """The values of nodes through the places chosen."""
    t, s, table = choice.t, choice.segment, quartet.table
    for m in range(count):
        if t[m] > 0.0:
            read_way(medium, state, quartet, m, t[m])
    arrival = in_triangles(medium, source, quartet, count, t)
    fill_row(table, ARRIVAL, arrival.cost)
    fill_row(table, CHORD, arrival.chord)
    for m in range(count):
        if t[m] > 0.0:
            read_arrival(medium, source, quartet.nodes[m], table, m)
    cost, chord = row(table, ARRIVAL), row(table, CHORD)
    tau, bend = end.tau + t * (s.tau - end.tau), -0.5 * t * (1.0 - t) * row(table, BEND)
    much = size(bend) * chord - MOST_CORRECTED * cost
    tau = where_above(much, 0.0, tau, tau + bend)
    return cost + chord * larger(tau, medium.ground.floor)


@inner_kernel
def read_nodes(medium, state, source, quartet, count):
    for m in range(count):
        node = quartet.nodes[m]
        read_edge(medium, state, source, quartet, m)
        node.right = read_side(medium, state, source, quartet, m, -1)
        node.left = read_side(medium, state, source, quartet, m, 1)


@inner_kernel
def values_of(medium, state, source, quartet, count):
    """The values of so many nodes by the edges that offer least, or by segments beside these."""
    read_nodes(medium, state, source, quartet, count)
    end = ends_of(medium, quartet.table)
    right = segments_of(medium, end, quartet.table, RIGHT)
    choice = better_side(end, right, segments_of(medium, end, quartet.table, LEFT))
    for m in range(count):
        node = quartet.nodes[m]
        node.b = node.left if choice.on_left[m] > 0.0 else node.right
    along = end.u + end.cost * end.near
    value = values_through(medium, state, source, quartet, count, end, choice)
    return where_above(choice.t, 0.0, where_above(along, value, value, along), along)


@kernel
def value_beside(medium, state, source, n, k):
    """The value of node n by the segments beside its edge along k that are too wide.

    They lie far from the node, as the lifted ground has it. So they count only where the ground
    between is as even as the two edges say.
    """
    quartet = state.beside
    place_node(medium, source, quartet.nodes[0], n, k)
    place_node(medium, source, quartet.nodes[1], n, k)
    for m in range(2):
        read_edge(medium, state, source, quartet, m)
    quartet.nodes[0].b = read_side(medium, state, source, quartet, 0, -1)
    quartet.nodes[1].b = read_side(medium, state, source, quartet, 1, 1)
    for r in range(RIGHT, LEFT):
        quartet.table[0, r, 1] = quartet.table[0, r + LEFT - RIGHT, 1]
    end = ends_of(medium, quartet.table)
    segment = segments_of(medium, end, quartet.table, RIGHT)
    chosen = where_above(fall_along(end, segment), 0.0, is_wide(end, segment), 0.0)
    if not (chosen[0] > 0.0 or chosen[1] > 0.0):
        return math.inf
    t = where_above(chosen, 0.0, best_place(end, segment), 0.0)
    value = values_through(medium, state, source, quartet, 2, end, Choice(segment, t, t))
    apart = size(value - value_on(end, segment, t))
    step = sqrt(near_on(end, segment, t))
    value = where_above(apart, MOST_CORRECTED * end.cost * step, math.inf, value)
    value = where_above(t, 0.0, value, math.inf)
    return min(value[0], value[1])
