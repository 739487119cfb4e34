"""Candidate edges of a tree: between its newest vertex and the ones near it, there and back.

Under a pace an edge costs something else on the way back, so each direction has its own chord and
its own length. Under the metric both are one, and are measured once.
"""

import math

from ..compiler import inner_kernel, kernel
from ..space.free_space import segment_is_free
from ..surface.lengths import chord_through
from ..travel.priced import is_directed
from .tree import CHECKED, COST, INTEGRATED, X, Y, careful_length, chord_over


@inner_kernel
def ends_of(surface, new, vertex, onward):
    """From where to where an edge is measured. onward : it leads from the new vertex."""
    if onward or not is_directed(surface):
        return new, vertex
    return vertex, new


@inner_kernel
def edge_at(surface, tree, k, onward):
    """Where the k-th candidate edge is in ``Tree.near``: those from the new vertex come second."""
    if onward and is_directed(surface):
        return k + tree.places.shape[0]
    return k


@inner_kernel
def candidate_length(surface, tree, options, new, k, onward):
    """Length of the k-th candidate edge as the planner believes it, measured at most once."""
    candidate = tree.near[edge_at(surface, tree, k, onward)]
    if candidate.length < 0.0:
        candidate.length = candidate.chord
        if options.riemannian:
            tree.counters[INTEGRATED] += 1
            refine_chord(surface, tree, options, new, k, onward)
            a, b = ends_of(surface, new, candidate.vertex, onward)
            length = careful_length(surface, tree, options, a, b)
            candidate.length = max(length, candidate.chord)
    return candidate.length


@inner_kernel
def refine_chord(surface, tree, options, new, k, onward):
    """On rough ground replace the k-th candidate's chord by a sum of short ones, at most once."""
    candidate = tree.near[edge_at(surface, tree, k, onward)]
    if options.tolerance > 0.0 and candidate.refined == 0:
        a, b = ends_of(surface, new, candidate.vertex, onward)
        p, q = tree.places[a], tree.places[b]
        through = chord_through(surface, p[X], p[Y], q[X], q[Y], options.panel)
        candidate.chord = max(through, candidate.chord)
        candidate.refined = 1


@inner_kernel
def is_ruled_out(surface, tree, options, new, k, onward, come, limit):
    """Is a cost plus the chord of the k-th candidate edge no less than the limit?

    Always False for a tree that is not pruned.
    """
    if not options.prune:
        return False
    if come + tree.near[edge_at(surface, tree, k, onward)].chord >= limit:
        return True
    refine_chord(surface, tree, options, new, k, onward)
    return come + tree.near[edge_at(surface, tree, k, onward)].chord >= limit


@inner_kernel
def candidate_is_free(space, tree, new, k):
    """Does the k-th candidate edge stay in free space? Tested at most once."""
    candidate = tree.near[k]
    if candidate.free < 0:
        tree.counters[CHECKED] += 1
        p, q = tree.places[new], tree.places[candidate.vertex]
        candidate.free = segment_is_free(space, p[X], p[Y], q[X], q[Y])
    return candidate.free == 1


@inner_kernel
def begin_edge(surface, tree, new, k, onward):
    """Store the chord of the k-th candidate edge and the cost of its vertex."""
    vertex, squared = tree.near[k].vertex, tree.near[k].squared
    candidate = tree.near[edge_at(surface, tree, k, onward)]
    a, b = ends_of(surface, new, vertex, onward)
    candidate.vertex, candidate.squared = vertex, squared
    candidate.chord = chord_over(surface, tree, a, b, squared)
    candidate.cost = tree.places[vertex, COST]
    candidate.length = -1.0
    candidate.free = -1
    candidate.refined = 0


@inner_kernel
def measure_chord(surface, tree, new, k):
    """Store the k-th candidate's chords and cost; return the cost plus the chord from there.

    No path through it to the new vertex is shorter than this sum.
    """
    begin_edge(surface, tree, new, k, False)
    if is_directed(surface):
        begin_edge(surface, tree, new, k, True)
    return tree.near[k].cost + tree.near[k].chord


@inner_kernel
def onward_chord(surface, tree, k):
    """The chord of the k-th candidate edge from the new vertex."""
    return tree.near[edge_at(surface, tree, k, True)].chord


@kernel
def measure_chords(surface, tree, new, count):
    """Store the candidates' chords and costs; return the most promising candidate.

    That is the one whose cost plus chord is least.
    """
    promising = -1
    least = math.inf
    for k in range(count):
        at_least = measure_chord(surface, tree, new, k)
        if at_least < least:
            promising, least = k, at_least
    return promising
