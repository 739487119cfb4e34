"""The tree that sampling planners grow: vertices in records, children in linked lists."""

import math
from typing import NamedTuple

import numpy as np

from .buckets import Buckets
from .compiler import inner_kernel, kernel
from .surfaces import metric_at, value_at

# Places in Tree.counters.
VERTICES = 0  # vertices in the tree
GOAL = 1  # the goal's vertex, -1 until it is in the tree
SAMPLES = 2  # samples drawn
CONSIDERED = 3  # edges considered
PRUNED = 4  # edges that the chord ruled out
INTEGRATED = 5  # edges measured by Line-R
CHECKED = 6  # edges tested against obstacles
REWIRED = 7  # edges replaced by a better one
LAID_OUT = 8  # vertices when the buckets were last laid out
COUNTERS = 9


# A vertex: all that its neighbours read of it lies in one or two cache lines.
VERTEX = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("h11", np.float64),  # the metric at the vertex
        ("h12", np.float64),
        ("h22", np.float64),
        ("cost", np.float64),  # length from the start
        ("edge", np.float64),  # length of the edge from the parent
        ("parent", np.int32),  # -1 at the start
        ("child", np.int32),  # first child, -1 where none
        ("sibling", np.int32),  # next child of the same parent
        ("next", np.int32),  # next vertex of the same bucket
    ]
)

# A candidate edge between the newest vertex and one near it.
CANDIDATE = np.dtype(
    [
        ("chord", np.float64),
        ("cost", np.float64),  # of the other vertex, before this extension
        ("length", np.float64),  # negative where not yet measured
        ("vertex", np.int32),
        ("free", np.int32),  # 1 free, 0 blocked, -1 not yet tested
    ]
)


class Tree(NamedTuple):
    """The tree and its workspace; all arrays are filled in place."""

    vertices: np.ndarray  # (n,) VERTEX
    lifted: np.ndarray  # (n, layers) float64: weighted layer values
    counters: np.ndarray  # (COUNTERS,) int64
    buckets: Buckets
    floor: float  # no cost of the surface is below it
    near: np.ndarray  # (n,) CANDIDATE: workspace
    stack: np.ndarray  # (n,) int32: workspace


class Options(NamedTuple):
    """What the planner was asked for."""

    x0: float  # bounds
    y0: float
    x1: float
    y1: float
    goal_x: float
    goal_y: float
    step: float
    radius: float  # the near radius is radius * sqrt(area * log(n) / n), at most the step
    goal_bias: float
    panel: float  # longest stretch that one application of the rule measures
    riemannian: bool  # edges measured by Line-R; otherwise by the chord
    prune: bool
    informed: bool


@inner_kernel
def chord_between(tree, a, b):
    """Chord between two vertices, times the least cost."""
    dx = tree.vertices[a].x - tree.vertices[b].x
    dy = tree.vertices[a].y - tree.vertices[b].y
    total = dx * dx + dy * dy
    for layer in range(tree.lifted.shape[1]):
        rise = tree.lifted[a, layer] - tree.lifted[b, layer]
        total += rise * rise
    return tree.floor * math.sqrt(total)


@inner_kernel
def survey(surface, graph, new, x, y):
    """Write a vertex's position and the surface above it; any graph's with ``lifted`` layers."""
    vertex = graph.vertices[new]
    vertex.x = x
    vertex.y = y
    for layer in range(graph.lifted.shape[1]):
        graph.lifted[new, layer] = surface.weights[layer] * value_at(surface, layer, x, y)
    h = metric_at(surface, x, y)
    vertex.h11 = h.h11
    vertex.h12 = h.h12
    vertex.h22 = h.h22


@kernel
def place(surface, tree, new, x, y):
    """Write a vertex's position and what is cached with it; it is not yet in the tree."""
    survey(surface, tree, new, x, y)
    tree.vertices[new].child = -1


@kernel
def plant(surface, tree, options, x, y):
    """Start the tree with one vertex."""
    place(surface, tree, 0, x, y)
    root = tree.vertices[0]
    root.cost = 0.0
    root.edge = 0.0
    root.parent = -1
    root.sibling = -1
    tree.buckets.frame[0] = options.x0
    tree.buckets.frame[1] = options.y0
    tree.counters[:] = 0
    tree.counters[GOAL] = -1
    tree.counters[VERTICES] = 1


@kernel
def adopt(vertices, parent, child, edge):
    """Hang a vertex below a parent."""
    vertex = vertices[child]
    vertex.parent = parent
    vertex.edge = edge
    vertex.cost = vertices[parent].cost + edge
    vertex.sibling = vertices[parent].child
    vertices[parent].child = child


@kernel
def release(vertices, child):
    """Take a vertex from its parent's children."""
    parent = vertices[vertices[child].parent]
    if parent.child == child:
        parent.child = vertices[child].sibling
        return
    elder = parent.child
    while vertices[elder].sibling != child:
        elder = vertices[elder].sibling
    vertices[elder].sibling = vertices[child].sibling


@kernel
def pass_on_cost(vertices, stack, root):
    """Recompute the cost of everything below a vertex."""
    stack[0] = root
    count = 1
    while count > 0:
        count -= 1
        cost = vertices[stack[count]].cost
        child = vertices[stack[count]].child
        while child >= 0:
            vertices[child].cost = cost + vertices[child].edge
            stack[count] = child
            count += 1
            child = vertices[child].sibling
