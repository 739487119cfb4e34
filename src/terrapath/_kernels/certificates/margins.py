"""Proofs about the edge of a core, a block of cells around an end of all paths."""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import kernel
from .potentials import parts_over, potential_over
from .surface_models import Box, cut_at_knots, layer_over
from .taylor import Model, constant, minus, plus, spread, times_number


class Anchor(NamedTuple):
    """The start or the goal, and how far a nearby point p is from it at least.

    That is the lesser of ``floor`` times the chord and ``far``: near the anchor no cost is below
    the floor, and a path that leaves this neighbourhood is already ``far`` long.
    """

    lifted: np.ndarray  # (2 + layers,)
    floor: float
    far: float


@kernel
def margin_of_box(surface, potential, anchor, factor, i, j, box):
    """At most distance(anchor, p) + factor u(p) for any p of a box inside cell (i, j)."""
    parts = parts_over(potential, i, j, box)
    margin = margin_of_part(surface, potential, anchor, factor, i, j, box, parts.first)
    if parts.last == parts.first:
        return margin
    other = margin_of_part(surface, potential, anchor, factor, i, j, box, parts.last)
    return min(margin, other)


@kernel
def margin_of_part(surface, potential, anchor, factor, i, j, box, part):
    """The same for a piece of u.

    The chord is convex in R^n, so that it is nowhere below its tangent at the box's centre.
    """
    floor, end = anchor.floor, anchor.lifted
    east, north = box.x - end[0], box.y - end[1]
    squared = east * east + north * north
    for k in range(surface.weights.shape[0]):
        rise = layer_over(surface, k, box).value.c00 - end[2 + k]
        squared += rise * rise
    chord = math.sqrt(squared)
    total = times_number(potential_over(potential, i, j, box, part).value, factor)
    outside_margin = anchor.far + total.c00 - spread(total)
    if chord > 0.0:
        along_x, along_y = floor * box.a * east / chord, floor * box.b * north / chord
        tangent = Model(floor * chord, along_x, along_y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        total = plus(total, tangent)
        for k in range(surface.weights.shape[0]):
            value = layer_over(surface, k, box).value
            offset = minus(value, constant(value.c00))
            rise = value.c00 - end[2 + k]
            total = plus(total, times_number(offset, floor * rise / chord))
    margin = min(total.c00 - spread(total), outside_margin)
    # NaN where something overflowed.
    return margin if margin > -math.inf else -math.inf


# A cell's side on the core's edge is cut into this many parts.
PARTS = 8


@kernel
def margin_of_side(surface, potential, anchor, factor, i, j, axis, at, cutting):
    """The least margin along a side of cell (i, j): along ``axis``, at ``at`` on the other."""
    low = potential.x0 + i * potential.dx if axis == 0 else potential.y0 + j * potential.dy
    high = low + (potential.dx if axis == 0 else potential.dy)
    cuts = cutting.x if axis == 0 else cutting.y
    margin = math.inf
    for k in range(cut_at_knots(surface, axis, low, high, cuts)):
        half = 0.5 * (cuts[k + 1] - cuts[k]) / PARTS
        for m in range(PARTS):
            middle = cuts[k] + (2 * m + 1) * half
            box = Box(middle, at, half, 0.0) if axis == 0 else Box(at, middle, 0.0, half)
            margin = min(margin, margin_of_box(surface, potential, anchor, factor, i, j, box))
    return margin


@kernel
def margin_of_core(surface, potential, anchor, factor, i0, i1, j0, j1, cutting):
    """The least margin on the edge of the cells [i0, i1) x [j0, j1)."""
    margin = math.inf
    left, right = potential.x0 + i0 * potential.dx, potential.x0 + i1 * potential.dx
    bottom, top = potential.y0 + j0 * potential.dy, potential.y0 + j1 * potential.dy
    for i in range(i0, i1):
        for j, at in ((j0, bottom), (j1 - 1, top)):
            side = margin_of_side(surface, potential, anchor, factor, i, j, 0, at, cutting)
            margin = min(margin, side)
    for j in range(j0, j1):
        for i, at in ((i0, left), (i1 - 1, right)):
            side = margin_of_side(surface, potential, anchor, factor, i, j, 1, at, cutting)
            margin = min(margin, side)
    return margin
