"""The tree that sampling planners grow: vertices in records, children in linked lists."""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..dtypes import record
from ..surface.lengths import composite_boole, length_in_cells, norm, segment_length
from ..surface.surfaces import (
    Metric,
    has_cells,
    plus_layer,
    slope_at,
    spot_at,
    squared_cost_at,
    times_cost,
)
from ..travel.paces import pace_along
from ..travel.priced import per_price
from .buckets import Buckets

# Places in Tree.counters.
VERTICES = 0  # vertices in the tree
GOAL = 1  # the goal's vertex, -1 until it is in the tree
SAMPLES = 2  # samples drawn
CONSIDERED = 3  # edges considered
PRUNED = 4  # edges that the chord ruled out
INTEGRATED = 5  # edges measured by Line-R
CHECKED = 6  # edges tested against obstacles
REWIRED = 7  # edges replaced by a better one
LAID_OUT = 8  # vertices when they were last sorted into the buckets
COUNTERS = 9


# Entries of a row of Tree.places: what the search for neighbours reads of a vertex.
X, Y = 0, 1
COST = 2  # length from the start
LIFTED = 3  # the first of the weighted layer values

# The metric tensor at a vertex: what measuring an edge reads of it. Under a pace the three numbers
# are the cost and the slopes along both axes.
TENSOR = record(*((name, np.float64) for name in ("h11", "h12", "h22")))

# A vertex's links to others. A new cost is passed on through many, so they are small records.
LINK = record(
    ("edge", np.float64),  # length of the edge from the parent
    ("parent", np.int32),  # -1 at the start
    ("child", np.int32),  # first child, -1 where none
    ("sibling", np.int32),  # next child of the same parent
    ("age", np.int32),  # how many vertices were in the tree before it
)

# A candidate edge between the newest vertex and one near it, in one direction or in both.
CANDIDATE = record(
    ("squared", np.float64),  # planar distance squared
    ("chord", np.float64),  # no path along the edge is shorter
    ("cost", np.float64),  # of the other vertex, before this extension
    ("length", np.float64),  # negative where not yet measured
    ("vertex", np.int32),
    ("free", np.int32),  # 1 free, 0 blocked, -1 not yet tested
    ("refined", np.int64),  # 1 where the chord is a sum of short ones
)


class Tree(NamedTuple):
    """The tree and its workspace; all arrays are filled in place.

    Vertices get new numbers each time they are sorted into the buckets, but the start is always 0.
    """

    places: np.ndarray  # (n, LIFTED + layers) float64: rows of X, Y, COST and LIFTED
    vertices: np.ndarray  # (n,) TENSOR
    links: np.ndarray  # (n,) LINK
    counters: np.ndarray  # (COUNTERS,) int64, 0 before the tree is planted
    buckets: Buckets
    floor: float  # no cost of the surface is below it
    least: float  # nor that of a step on the plane, as a share of its size
    branch: np.ndarray  # (m, 2) float64: the first branch, from start to goal; m = 0 for none
    near: np.ndarray  # (n,) or (2 n,) CANDIDATE: workspace; under a pace two directions
    queue: np.ndarray  # (n,) int32: workspace


class Options(NamedTuple):
    """The planner's options."""

    x0: float  # bounds
    y0: float
    x1: float
    y1: float
    start_x: float
    start_y: float
    goal_x: float
    goal_y: float
    step: float
    radius: float  # the near radius is radius * sqrt(area * log(n) / n), at most the step
    goal_bias: float
    panel: float  # longest piece that one application of a rule measures
    tolerance: float  # of an edge on rough ground, as a share of its length; 0 for Line-R
    riemannian: bool  # edges measured by Line-R; otherwise by the chord
    prune: bool
    informed: bool


@inner_kernel
def chord_between(surface, graph, a, b):
    """Chord from one vertex to another of any graph with ``places``, times the least cost."""
    p, q = graph.places[a], graph.places[b]
    dx, dy = p[X] - q[X], p[Y] - q[Y]
    return chord_over(surface, graph, a, b, dx * dx + dy * dy)


@inner_kernel
def metric_chord_over(surface, graph, a, b, squared):
    return graph.floor * math.sqrt(squared + squared_rise(graph, a, b))


@inner_kernel
def priced_chord_over(surface, graph, a, b, squared):
    rise = graph.places[b, LIFTED] - graph.places[a, LIFTED]
    return graph.floor * pace_along(surface.price.pace, math.sqrt(squared), rise)


@per_price(metric_chord_over, priced_chord_over)
def chord_over(surface, graph, a, b, squared):
    """Chord from one vertex to another whose squared planar distance is known."""


@inner_kernel
def squared_rise(graph, a, b):
    """The sum of the squared differences of the weighted layers between two vertices."""
    total = 0.0
    for entry in range(LIFTED, graph.places.shape[1]):
        rise = graph.places[a, entry] - graph.places[b, entry]
        total += rise * rise
    return total


@inner_kernel
def metric_survey(surface, graph, new, x, y):
    place, vertex = graph.places[new], graph.vertices[new]
    place[X], place[Y] = x, y
    spot, h = spot_at(surface, x, y), Metric(1.0, 0.0, 1.0)
    for layer in range(surface.weights.shape[0]):
        slope = slope_at(surface, layer, spot)
        place[LIFTED + layer] = surface.weights[layer] * slope.f
        h = plus_layer(h, surface.weights[layer], slope)
    h = times_cost(surface, spot, h)
    vertex.h11 = h.h11
    vertex.h12 = h.h12
    vertex.h22 = h.h22


@inner_kernel
def priced_survey(surface, graph, new, x, y):
    place, vertex = graph.places[new], graph.vertices[new]
    spot = spot_at(surface, x, y)
    slope, weight = slope_at(surface, 0, spot), surface.weights[0]
    place[X], place[Y], place[LIFTED] = x, y, weight * slope.f
    vertex.h11 = math.sqrt(squared_cost_at(surface, spot))
    vertex.h12, vertex.h22 = weight * slope.fx, weight * slope.fy


@per_price(metric_survey, priced_survey)
def survey(surface, graph, new, x, y):
    """Write a vertex's position, weighted layers and metric, in any graph with ``places``."""


@inner_kernel
def surveyed_norm(surface, vertex, dx, dy):
    return norm(vertex, dx, dy)


@inner_kernel
def surveyed_cost(surface, vertex, dx, dy):
    rise = vertex.h12 * dx + vertex.h22 * dy
    return vertex.h11 * pace_along(surface.price.pace, math.sqrt(dx * dx + dy * dy), rise)


@per_price(surveyed_norm, surveyed_cost)
def surveyed_speed(surface, vertex, dx, dy):
    """What (dx, dy) costs at a vertex."""


@kernel
def edge_length(surface, graph, a, b, panel):
    """Length of the edge from one vertex to another by Line-R, in panels, or cell by cell."""
    p, q = graph.places[a], graph.places[b]
    if has_cells(surface):
        return length_in_cells(surface, p[X], p[Y], q[X], q[Y])
    dx, dy = q[X] - p[X], q[Y] - p[Y]
    panels = max(math.ceil(math.sqrt(dx * dx + dy * dy) / panel), 1)
    dx, dy = dx / panels, dy / panels
    ends = surveyed_speed(surface, graph.vertices[a], dx, dy)
    ends += surveyed_speed(surface, graph.vertices[b], dx, dy)
    return composite_boole(surface, p[X], p[Y], dx, dy, ends, panels)


@kernel
def careful_length(surface, graph, options, a, b):
    """Length of the edge from one vertex to another: by Line-R, or on rough ground adaptively.

    There the nodes of Line-R would miss much; pieces are halved until two rules agree.
    """
    if options.tolerance == 0.0:
        return edge_length(surface, graph, a, b, options.panel)
    p, q = graph.places[a], graph.places[b]
    panel, tolerance = options.panel, options.tolerance
    return segment_length(surface, p[X], p[Y], q[X], q[Y], panel, tolerance)


@kernel
def place(surface, tree, new, x, y):
    """Write what is stored of a vertex's position; it is not in the tree yet."""
    survey(surface, tree, new, x, y)
    tree.links[new].child = -1
    tree.links[new].age = new


@kernel
def plant(surface, tree, options):
    """Make the start the tree's first vertex."""
    place(surface, tree, 0, options.start_x, options.start_y)
    tree.places[0, COST] = 0.0
    root = tree.links[0]
    root.edge = 0.0
    root.parent = -1
    root.sibling = -1
    tree.buckets.frame[0] = options.x0
    tree.buckets.frame[1] = options.y0
    tree.counters[GOAL] = -1
    tree.counters[VERTICES] = 1


@kernel
def adopt(tree, parent, child, edge):
    """Make a vertex the child of a parent."""
    link = tree.links[child]
    link.parent = parent
    link.edge = edge
    link.sibling = tree.links[parent].child
    tree.links[parent].child = child
    tree.places[child, COST] = tree.places[parent, COST] + edge


@kernel
def release(links, child):
    """Take a vertex from its parent's children."""
    parent = links[links[child].parent]
    if parent.child == child:
        parent.child = links[child].sibling
        return
    elder = parent.child
    while links[elder].sibling != child:
        elder = links[elder].sibling
    links[elder].sibling = links[child].sibling


@kernel
def pass_on_cost(tree, count):
    """Recompute the costs of all descendants of the first vertices of ``Tree.queue``.

    In a queue, vertices that follow one another have different parents, so the processor can
    fetch several at once. With a stack it would wait for each.
    """
    done = 0
    while done < count:
        parent = tree.queue[done]
        done += 1
        cost = tree.places[parent, COST]
        child = tree.links[parent].child
        while child >= 0:
            tree.places[child, COST] = cost + tree.links[child].edge
            tree.queue[count] = child
            count += 1
            child = tree.links[child].sibling


# Vertices near one another are read together. Sorted by age they would be far apart in memory,
# and most of the time would be spent on waiting for it.


@inner_kernel
def renamed(numbers, vertex):
    return numbers[vertex] if vertex >= 0 else vertex


@inner_kernel
def swap_records(records, p, q, spare):
    records[spare] = records[p]
    records[p] = records[q]
    records[q] = records[spare]


@inner_kernel
def swap(tree, p, q, spare):
    """Swap two vertices, with the help of a spare one."""
    swap_records(tree.vertices, p, q, spare)
    swap_records(tree.links, p, q, spare)
    for entry in range(tree.places.shape[1]):
        number = tree.places[p, entry]
        tree.places[p, entry] = tree.places[q, entry]
        tree.places[q, entry] = number


@kernel
def renumber(tree, count, numbers):
    """Give each of the first vertices its number in ``numbers`` (count,), which is overwritten."""
    for p in range(count):
        link = tree.links[p]
        link.parent = renamed(numbers, link.parent)
        link.child = renamed(numbers, link.child)
        link.sibling = renamed(numbers, link.sibling)
    tree.counters[GOAL] = renamed(numbers, tree.counters[GOAL])
    for p in range(count):
        while numbers[p] != p:
            q = numbers[p]
            swap(tree, p, q, count)
            numbers[p], numbers[q] = numbers[q], q
