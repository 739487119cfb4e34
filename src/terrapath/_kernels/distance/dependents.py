"""Dependents of a node: the nodes that have it in their stencils."""

from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from .stencils import AROUND, EDGE, around, vector_of


class Dependents(NamedTuple):
    """The dependents of node n are entries[first[n]:first[n + 1]].

    An entry is 8 times the dependent's number plus the side on which it reads node n.
    """

    first: np.ndarray  # (n + 1,) int32
    entries: np.ndarray  # uint32


@inner_kernel
def note_dependent(places, entries, m, n, side):
    """Enter node n, which reads node m on a side, as a dependent of m."""
    if entries.shape[0] > 0:
        entries[places[m]] = 8 * n + side
    places[m] += 1


@kernel
def note_dependents(nodes, nx, places, entries):
    """Enter the dependents of each node from places[node] on, and move that to their end.

    places (n,). Where ``entries`` is empty, dependents are only counted.
    """
    for n in range(nodes.shape[0]):
        node = nodes[n]
        for side in range(6):
            if node.links >> side & 1:
                e = vector_of(node, side)
                note_dependent(places, entries, n + e.y * nx + e.x, n, side)
        if node.around:
            for k in range(AROUND):
                if node.around >> k & 1:
                    e = around(k)
                    note_dependent(places, entries, n + e.y * nx + e.x, n, EDGE)
