"""Dependents: which nodes have a node in their stencils."""

from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from .stencils import AROUND, EDGE, around, vector_of


class Dependents(NamedTuple):
    """Which nodes have a node in their stencils: entries[first[n]:first[n + 1]].

    An entry is 8 times the dependent's number plus the side on which it reads the node.
    """

    first: np.ndarray  # (n + 1,) int32
    entries: np.ndarray  # uint32


@inner_kernel
def note_dependent(places, entries, m, n, side):
    """Node n reads node m on a side."""
    if entries.shape[0] > 0:
        entries[places[m]] = 8 * n + side
    places[m] += 1


@kernel
def note_dependents(nodes, nx, places, entries):
    """Enter each node's dependents from places[node] on, which moves to their end.

    places (n,). Where there are no entries yet, dependents are only counted.
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
