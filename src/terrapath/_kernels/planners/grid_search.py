"""Dijkstra's algorithm and A* over the nodes of a lattice, with edges measured under h.

Start and goal rarely lie on a node, so they are two more vertices, joined to the nodes nearby.
As in the tree planners, the length of an edge is max(Line-R, chord). So the chord to the goal
is a consistent heuristic, and the first path that settles a vertex is its shortest.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..dtypes import record
from ..space.free_space import segment_is_free
from .tree import COST, TENSOR, X, Y, chord_between, edge_length, survey

# Places in Graph.counters.
OPEN = 0  # vertices in the heap
SETTLED = 1  # vertices whose shortest path is known
VERTICES = 2  # vertices to which an edge was considered
CONSIDERED = 3  # edges considered
PRUNED = 4  # edges that the chord ruled out
INTEGRATED = 5  # edges measured by Line-R
CHECKED = 6  # edges tested against obstacles
COUNTERS = 7

# The slot of a vertex that is not in the heap; the heap's own slots start at 1.
UNSEEN = 0
DONE = -1
WITHOUT_PATH = -2

# A vertex: its parent, its slot of the heap, and the metric tensor. The tensor comes last: Numba
# would take a record that only begins with a tensor for a tensor.
VERTEX = record(
    ("parent", np.int32),  # -1 at the start
    ("slot", np.int32),
    *TENSOR.descr,
)


# A slot of the heap.
ENTRY = record(("key", np.float64), ("vertex", np.int32))


class Nodes(NamedTuple):
    """Where the nodes lie and which vertices are joined. It does not change during the search."""

    x: np.ndarray  # (nx,) float64
    y: np.ndarray  # (ny,) float64
    offsets: np.ndarray  # (m, 2) int64: columns and rows from a node to its neighbours
    joins: np.ndarray  # (2, 4) int64: first and last column and row that start, goal are joined to


class Graph(NamedTuple):
    """The nodes row by row, then the start, then the goal. All arrays are filled in place.

    Few arrays, because passing each of them to a call costs time.
    """

    vertices: np.ndarray  # (nx * ny + 2,) VERTEX, zeros before an edge leads there
    places: np.ndarray  # (nx * ny + 2, LIFTED + layers) float64, as a tree's
    heap: np.ndarray  # (nx * ny + 3,) ENTRY: the open vertices, four children a slot, from slot 1
    counters: np.ndarray  # (COUNTERS,) int64
    floor: float  # no cost of the surface is below it


class Options(NamedTuple):
    """The planner's options."""

    panel: float  # longest stretch that one application of Line-R measures
    informed: bool  # A*: ordered by cost plus chord to the goal; otherwise by cost alone
    direct: bool  # the start is joined to the goal


# The heap


@kernel
def raise_to(vertices, heap, slot, vertex, key):
    """Put a vertex into an empty slot of the heap, or further up if its key is less."""
    while slot > 1:
        above = (slot + 2) // 4
        if heap[above].key <= key:
            break
        heap[slot] = heap[above]
        vertices[heap[slot].vertex].slot = slot
        slot = above
    heap[slot].key = key
    heap[slot].vertex = vertex
    vertices[vertex].slot = slot


@kernel
def empty_slot_below(vertices, heap, slot, key, last):
    """Move children with smaller keys up into an empty slot; return the slot left empty."""
    while True:
        first = 4 * slot - 2
        least = slot
        below = key
        for child in range(first, min(first + 3, last) + 1):
            if heap[child].key < below:
                least, below = child, heap[child].key
        if least == slot:
            return slot
        heap[slot] = heap[least]
        vertices[heap[slot].vertex].slot = slot
        slot = least


@kernel
def take_first(vertices, heap, last):
    """Take the vertex with the least key from a heap that is filled up to the slot ``last``."""
    first, vertex, key = int(heap[1].vertex), int(heap[last].vertex), heap[last].key
    slot = empty_slot_below(vertices, heap, 1, key, last - 1)
    raise_to(vertices, heap, slot, vertex, key)
    vertices[first].slot = DONE
    return first


# The search


@kernel
def place(surface, graph, v, x, y):
    """Write what is stored of a vertex's position; no path leads there yet."""
    survey(surface, graph, v, x, y)
    graph.places[v, COST] = math.inf
    vertex = graph.vertices[v]
    vertex.parent = -1
    vertex.slot = WITHOUT_PATH
    graph.counters[VERTICES] += 1


@kernel
def discover(surface, nodes, graph, node):
    """Place a node that an edge leads to for the first time."""
    columns = nodes.x.shape[0]
    place(surface, graph, node, nodes.x[node % columns], nodes.y[node // columns])


@kernel
def enter(surface, graph, options, v):
    """Put a vertex into the heap, or move it up where its cost is now less."""
    key = graph.places[v, COST]
    if options.informed:
        key += chord_between(surface, graph, v, graph.vertices.shape[0] - 1)
    slot = graph.vertices[v].slot
    if slot == WITHOUT_PATH:
        graph.counters[OPEN] += 1
        slot = graph.counters[OPEN]
    raise_to(graph.vertices, graph.heap, slot, v, key)


@kernel
def measure(surface, space, graph, options, u, v, chord):
    """Measure the edge u-v. Where the path to v is shorter through it, make u the parent of v."""
    origin, place = graph.places[u], graph.places[v]
    graph.counters[INTEGRATED] += 1
    length = max(edge_length(surface, graph, u, v, options.panel), chord)
    if not origin[COST] + length < place[COST]:
        return
    graph.counters[CHECKED] += 1
    if segment_is_free(space, origin[X], origin[Y], place[X], place[Y]):
        place[COST] = origin[COST] + length
        graph.vertices[v].parent = u
        enter(surface, graph, options, v)


@inner_kernel
def relax(surface, space, nodes, graph, options, u, v):
    """Make u the parent of v where the path to v is shorter through u.

    An edge is measured only where the cost of u plus the chord is less than the cost of v.
    """
    if graph.vertices[v].slot != DONE:
        if graph.vertices[v].slot == UNSEEN:
            discover(surface, nodes, graph, v)
        graph.counters[CONSIDERED] += 1
        chord = chord_between(surface, graph, u, v)
        if graph.places[u, COST] + chord < graph.places[v, COST]:
            measure(surface, space, graph, options, u, v, chord)
        else:
            graph.counters[PRUNED] += 1


@kernel
def relax_around_start(surface, space, nodes, graph, options, row):
    """Relax the edges from the start to the nodes of one row that it is joined to.

    The goal's edge comes after the last row; then the start is settled.
    """
    box, start = nodes.joins[0], graph.vertices.shape[0] - 2
    if row <= box[3]:
        for column in range(box[0], box[1] + 1):
            relax(surface, space, nodes, graph, options, start, row * nodes.x.shape[0] + column)
        return
    if options.direct:
        relax(surface, space, nodes, graph, options, start, start + 1)
    graph.counters[SETTLED] += 1


@kernel
def relax_around_node(surface, space, nodes, graph, options, u, goal):
    """Relax the edges from a node to its neighbours, and to the goal where the two are joined."""
    columns, rows = nodes.x.shape[0], nodes.y.shape[0]
    column, row = u % columns, u // columns
    for k in range(nodes.offsets.shape[0]):
        i, j = column + nodes.offsets[k, 0], row + nodes.offsets[k, 1]
        if 0 <= i < columns and 0 <= j < rows:
            relax(surface, space, nodes, graph, options, u, j * columns + i)
    box = nodes.joins[1]
    if box[0] <= column <= box[1] and box[2] <= row <= box[3]:
        relax(surface, space, nodes, graph, options, u, goal)


@kernel
def search(surface, space, nodes, graph, options, most):
    """Settle up to ``most`` vertices; stop early when the goal is settled or the heap is empty."""
    goal = graph.vertices.shape[0] - 1
    for _ in range(most):
        if graph.counters[OPEN] == 0 or graph.vertices[goal].slot == DONE:
            return
        u = take_first(graph.vertices, graph.heap, graph.counters[OPEN])
        graph.counters[OPEN] -= 1
        graph.counters[SETTLED] += 1
        if u != goal:
            relax_around_node(surface, space, nodes, graph, options, u, goal)


@kernel
def begin(surface, graph, start_x, start_y, goal_x, goal_y):
    """Place start and goal. The start is never in the heap: its edges are relaxed first of all."""
    goal = graph.vertices.shape[0] - 1
    place(surface, graph, goal, goal_x, goal_y)
    place(surface, graph, goal - 1, start_x, start_y)
    graph.places[goal - 1, COST] = 0.0
    graph.vertices[goal - 1].slot = DONE


@kernel
def any_node_is_near(space, nodes, box, x, y):
    """Does a free segment lead from (x, y) to a node of the box?"""
    for row in range(box[2], box[3] + 1):
        for column in range(box[0], box[1] + 1):
            if segment_is_free(space, x, y, nodes.x[column], nodes.y[row]):
                return True
    return False
