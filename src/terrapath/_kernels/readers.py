"""Readers: which nodes have a node in their stencils."""

from typing import NamedTuple

import numpy as np

from .compiler import inner_kernel, kernel
from .stencils import AROUND, EDGE, around, vector_of


class Readers(NamedTuple):
    """Which nodes have a node in their stencils: entries[first[n]:first[n + 1]].

    An entry is 8 times the reader's number plus the side on which it reads the node.
    """

    first: np.ndarray  # (n + 1,) int32
    entries: np.ndarray  # uint32


@kernel
def count_readers(nodes, nx, first):
    """Make first[m] the number of readers of all nodes before m."""
    for n in range(nodes.shape[0]):
        node = nodes[n]
        for side in range(6):
            if node.links >> side & 1:
                e = vector_of(node, side)
                first[n + e.y * nx + e.x + 1] += 1
        if node.around:
            for k in range(AROUND):
                if node.around >> k & 1:
                    first[n + around(k).y * nx + around(k).x + 1] += 1
    for n in range(nodes.shape[0]):
        first[n + 1] += first[n]


@inner_kernel
def note_reader(first, entries, m, n, side):
    """Node n reads node m on a side."""
    entries[first[m]] = 8 * n + side
    first[m] += 1


@kernel
def list_readers(nodes, nx, first, entries):
    """Fill in the entries."""
    for n in range(nodes.shape[0]):
        node = nodes[n]
        for side in range(6):
            if node.links >> side & 1:
                e = vector_of(node, side)
                note_reader(first, entries, n + e.y * nx + e.x, n, side)
        if node.around:
            for k in range(AROUND):
                if node.around >> k & 1:
                    e = around(k)
                    note_reader(first, entries, n + e.y * nx + e.x, n, EDGE)
    # Each list's beginning was moved to its end, where the next begins.
    for n in range(nodes.shape[0], 0, -1):
        first[n] = first[n - 1]
    first[0] = 0
