"""What a march knows of the ground and of its nodes, and second differences between these.

Values are factored by the chord d from the source, u = d tau: on a segment between two neighbours
tau is linear and d exact. So no value is below the chord, planes are exact, and near the source
nothing special is needed. Where tau bends, its second differences make the scheme second order.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel
from ..dtypes import record
from ..space.free_space import segment_is_free
from .star import EAST, NORTH, X, Y, bits_of, direction_of, index


class Source(NamedTuple):
    """Where distances begin."""

    x: float  # in nodes
    y: float
    lift: np.ndarray  # (layers,) float64: the weighted heights, map units
    cost: float  # the cost there


class Medium(NamedTuple):
    """The lattice and all that a march needs to know of the ground."""

    ground: object  # Ground
    samples: np.ndarray  # (layers, samples) float64: its heights, row by row
    cost_samples: np.ndarray  # (0 or 1, samples) float64
    columns: int  # how many samples are in a row
    half_steps: np.ndarray  # (64,) int64: half of each direction as a difference of sample numbers
    stars: object  # Stars
    steps: np.ndarray  # (64,) int64: each direction as a difference of node numbers
    one_piece: np.ndarray  # (64,) uint8: is an edge along it a single piece?
    space: object  # Space
    grid: object  # Grid, of the nodes
    row_per_node: float  # 1 / nx
    has_obstacles: bool


# The value of a node, or the least that it was offered since, infinite before that; and its value
# over the chord, infinite where it was never settled.
VALUE = record(("u", np.float64), ("tau", np.float64))

# The rest of what is known of a node.
NODE = record(
    ("after", np.int32),  # the next node in the list of the same bucket, -1 where none
    ("before", np.int32),  # the node before it in that list; at the head, -2 - bucket
    ("best", np.int16),  # the direction of the edge that offers least, or SEED
    ("times", np.int16),  # how often it was settled, up to MOST_TIMES
    ("queued", np.int32),
)


class State(NamedTuple):
    """What is known of the nodes."""

    values: np.ndarray  # (n,) of VALUE
    nodes: np.ndarray  # (n,) of NODE
    quartet: object  # Quartet
    beside: object  # Quartet, for values that are looked at again


# Within this many nodes of the source second differences are not used.
CLOSE = 1.5


@inner_kernel
def value_at(state, n):
    """The value of a node, a record."""
    return state.values[index(n)]


@inner_kernel
def node_at(state, n):
    """What is known of a node beside its value, a record."""
    return state.nodes[index(n)]


@inner_kernel
def toward(medium, n, k):
    """The node that direction k leads to from node n."""
    return n + medium.steps[index(k)]


@inner_kernel
def row_of(medium, n):
    """The row of a node."""
    # A division of integers takes longer; the half keeps rounding away from whole numbers.
    return int((n + 0.5) * medium.row_per_node)


@inner_kernel
def sample_at(medium, i, j):
    """The number of the sample at the node in column i and row j."""
    return 2 * medium.ground.pieces * (j * medium.columns + i)


@inner_kernel
def sample_toward(medium, at, k):
    """The number of the sample at the node that direction k leads to; at : of that at the node."""
    return at + 2 * medium.half_steps[index(k)]


@inner_kernel
def height_at(medium, layer, at):
    """The weighted height at a sample."""
    return medium.samples[index(layer), index(at)]


@inner_kernel
def chord_of(medium, source, node):
    """The chord from the source to a node, without costs, map units."""
    x, y = node.x * medium.grid.dx, node.y * medium.grid.dy
    squared = x * x + y * y
    for layer in range(source.lift.shape[0]):
        rise = height_at(medium, layer, node.at) - source.lift[layer]
        squared += rise * rise
    return math.sqrt(squared)


@inner_kernel
def leads(medium, n, x, y):
    """Does an edge lead from node n to the one (x, y) away?"""
    direction = direction_of(x, y)
    return direction >= 0 and bits_of(medium.stars, n) >> direction & 1 == 1


@inner_kernel
def is_clear(medium, n, ka, kb):
    """May a path to n begin anywhere between the ends of two directions?"""
    if not medium.has_obstacles:
        return True
    a = toward(medium, n, ka)
    if leads(medium, a, EAST[kb] - EAST[ka], NORTH[kb] - NORTH[ka]):
        return True
    grid, b = medium.grid, toward(medium, n, kb)
    ax, ay = grid.x0 + a % grid.nx * grid.dx, grid.y0 + a // grid.nx * grid.dy
    bx, by = grid.x0 + b % grid.nx * grid.dx, grid.y0 + b // grid.nx * grid.dy
    return segment_is_free(medium.space, ax, ay, bx, by)


@inner_kernel
def is_close(node, x, y):
    """Is the node (x, y) away from this one within CLOSE nodes of the source?"""
    x, y = node.x + x, node.y + y
    return x * x + y * y <= CLOSE * CLOSE


@inner_kernel
def bend_beyond(medium, state, node, ka, kb):
    """The second difference of tau, at the end of ka, along the line from the end of kb; NaN where
    the node beyond on that line is unknown.
    """
    grid, ex, ey = medium.grid, EAST[ka] - EAST[kb], NORTH[ka] - NORTH[kb]
    x, y = EAST[ka] + ex, NORTH[ka] + ey
    if not (0 <= node.i + x < grid.nx and 0 <= node.j + y < grid.ny):
        return math.nan
    a, b = toward(medium, node.n, ka), toward(medium, node.n, kb)
    n = 2 * a - b
    if value_at(state, n).tau == math.inf or is_close(node, x, y):
        return math.nan
    if medium.has_obstacles and not leads(medium, a, ex, ey):
        return math.nan
    return value_at(state, n).tau - 2.0 * value_at(state, a).tau + value_at(state, b).tau


@inner_kernel
def bend_of(medium, state, node, ka, kb):
    """The second difference of tau along a segment: the smaller of those on its two sides."""
    if is_close(node, X[ka], Y[ka]) or is_close(node, X[kb], Y[kb]):
        return 0.0
    before = bend_beyond(medium, state, node, ka, kb)
    after = bend_beyond(medium, state, node, kb, ka)
    if math.isnan(before):
        return 0.0 if math.isnan(after) else after
    if math.isnan(after):
        return before
    if before * after <= 0.0:
        return 0.0
    return before if abs(before) < abs(after) else after
