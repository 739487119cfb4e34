"""Proofs about a function u, box by box, for lower bounds.

M, the norm, is a number such that u / M grows along a path by no more than the path's length.
``certificates/claims.py`` says what follows. The checker uses this, and no planner does.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..surface.surfaces import floor_of
from .potentials import parts_over, potential_over
from .surface_models import Box, cut_at_knots, layer_over, times_squared_cost
from .taylor import (
    constant,
    cross,
    keep,
    kept,
    minus,
    plus,
    polynomial,
    spread,
    times,
    times_number,
)

# What is proven of a box


class Facts(NamedTuple):
    """What is proven of one box."""

    norm: float  # at least the square of the dual norm of du anywhere in the box
    sample: float  # its largest value at nine points, without the models' remainders
    least: float  # at most that largest value, remainders included
    lowest: float  # at most u anywhere in the box
    chord: float  # at most the chord from anywhere in the box to the goal, times the least cost


@inner_kernel
def outside(low, high, value):
    """Distance of a value from an interval."""
    return max(low - value, value - high, 0.0)


class Ratio(NamedTuple):
    """The largest ratio of two models at nine points."""

    likely: float  # of their polynomials
    least: float  # at most the true one


@inner_kernel
def largest_ratio(top, bottom):
    """The largest top / bottom at the corners, the middles of the sides and the centre."""
    likely, least = 0.0, 0.0
    for m in range(9):
        p, q = m % 3 - 1.0, m // 3 - 1.0
        above, below = polynomial(top, p, q), polynomial(bottom, p, q)
        likely = max(likely, above / below)
        least = max(least, (above - top.r) / (below + bottom.r))
    return Ratio(likely, least)


@inner_kernel
def planar_distance(box, goal):
    """Distance of a box from the goal on the plane."""
    east = outside(box.x - box.a, box.x + box.a, goal[0])
    north = outside(box.y - box.b, box.y + box.b, goal[1])
    return math.hypot(east, north)


@kernel
def facts_of_part(surface, potential, goal, i, j, box, part, work):
    """What is proven of a piece of u over a box inside cell (i, j) and one piece of the surface.

    With slopes g_k of the weighted layers, h = c^2 H, H = I + sum g_k g_k^T and

        c^2 |du|_h^2 det H = |du|^2 + sum_k (du x g_k)^2,
        det H = 1 + sum_k |g_k|^2 + sum_{k<l} (g_k x g_l)^2.

    goal (2 + layers,) is the goal's lifted point; work (2 layers, 11).
    """
    u = potential_over(potential, i, j, box, part)
    top = plus(times(u.slope_x, u.slope_x), times(u.slope_y, u.slope_y))
    bottom = constant(1.0)
    chord = planar_distance(box, goal) ** 2
    for k in range(surface.weights.shape[0]):
        f = layer_over(surface, k, box)
        keep(work, 2 * k, f.slope_x)
        keep(work, 2 * k + 1, f.slope_y)
        twist = cross(u.slope_x, u.slope_y, f.slope_x, f.slope_y)
        top = plus(top, times(twist, twist))
        bottom = plus(bottom, times(f.slope_x, f.slope_x))
        bottom = plus(bottom, times(f.slope_y, f.slope_y))
        for m in range(k):
            twist = cross(f.slope_x, f.slope_y, kept(work, 2 * m), kept(work, 2 * m + 1))
            bottom = plus(bottom, times(twist, twist))
        reach = spread(f.value)
        chord += outside(f.value.c00 - reach, f.value.c00 + reach, goal[2 + k]) ** 2
    bottom = times_squared_cost(surface, box, bottom)
    middle = top.c00 / bottom.c00
    excess = minus(top, times_number(bottom, middle))
    floor = floor_of(surface)
    least = max(bottom.c00 - spread(bottom), floor * floor)
    ratio = largest_ratio(top, bottom)
    return Facts(
        middle + (abs(excess.c00) + spread(excess)) / least,
        ratio.likely,
        ratio.least,
        u.value.c00 - spread(u.value),
        floor * math.sqrt(chord),
    )


@kernel
def facts_of_box(surface, potential, goal, i, j, box, work):
    """What is proven of a box inside cell (i, j) and inside one piece of the surface."""
    parts = parts_over(potential, i, j, box)
    facts = facts_of_part(surface, potential, goal, i, j, box, parts.first, work)
    if parts.last == parts.first:
        return facts
    other = facts_of_part(surface, potential, goal, i, j, box, parts.last, work)
    # A comparison with NaN is False, and then nothing may be proven.
    norm = facts.norm if facts.norm >= other.norm else other.norm
    return Facts(
        norm if norm < math.inf else math.inf,
        max(facts.sample, other.sample),
        max(facts.least, other.least),
        min(facts.lowest, other.lowest),
        facts.chord,
    )


# What the cells need


class Need(NamedTuple):
    """The M that a box needs. An M is enough for a box where no path through it can refute it."""

    proven: float  # this is enough
    likely: float  # this is enough at nine points
    slope: float  # the dual norm at those points
    least: float  # no M below this is enough, but for what the chord says of smaller boxes


@inner_kernel
def need_of_box(facts, horizon):
    """The least M that is enough for a box.

    Either the dual norm of du is at most M everywhere in the box. Or everywhere in it, u / M and
    the chord to the goal add up to at least horizon / M, so that no path through it is shorter.
    """
    # Where something overflowed, and may be NaN, nothing is proven.
    slope = math.sqrt(max(facts.norm, 0.0)) if facts.norm < math.inf else math.inf
    likely = math.sqrt(max(facts.sample, 0.0)) if facts.sample < math.inf else math.inf
    short = horizon - facts.lowest
    by_chord = math.inf
    if short <= 0.0:
        by_chord = 0.0
    elif short < math.inf and 0.0 < facts.chord < math.inf:
        by_chord = short / facts.chord
    least = min(math.sqrt(max(facts.least, 0.0)), by_chord)
    return Need(min(slope, by_chord), min(likely, by_chord), likely, least)


class Cutting(NamedTuple):
    """Workspace for the pieces of a cell."""

    x: np.ndarray
    y: np.ndarray
    work: np.ndarray  # (2 layers, 11)
    boxes: np.ndarray  # (3 DEPTH + 1, 5): centre, half widths, depth of boxes still to do


@inner_kernel
def piece(cutting, p, q):
    """The box of one piece of a cell that is cut at the surface's knots."""
    return Box(
        0.5 * (cutting.x[p] + cutting.x[p + 1]),
        0.5 * (cutting.y[q] + cutting.y[q + 1]),
        0.5 * (cutting.x[p + 1] - cutting.x[p]),
        0.5 * (cutting.y[q + 1] - cutting.y[q]),
    )


class Pieces(NamedTuple):
    """How many columns and rows of pieces a cell is cut into."""

    columns: int
    rows: int


@inner_kernel
def cut_cell(surface, potential, i, j, cutting):
    x, y = potential.x0 + i * potential.dx, potential.y0 + j * potential.dy
    return Pieces(
        cut_at_knots(surface, 0, x, x + potential.dx, cutting.x),
        cut_at_knots(surface, 1, y, y + potential.dy, cutting.y),
    )


@kernel
def need_of_cell(surface, potential, goal, horizon, i, j, cutting):
    """The M that cell (i, j) needs, by models over its pieces, which are not cut further."""
    pieces = cut_cell(surface, potential, i, j, cutting)
    proven, likely, slope, least = 0.0, 0.0, 0.0, 0.0
    for q in range(pieces.rows):
        for p in range(pieces.columns):
            box = piece(cutting, p, q)
            facts = facts_of_box(surface, potential, goal, i, j, box, cutting.work)
            need = need_of_box(facts, horizon)
            proven, likely = max(proven, need.proven), max(likely, need.likely)
            slope, least = max(slope, need.slope), max(least, need.least)
    return Need(proven, likely, slope, least)


# A box is cut in four where that could lower M by this share, or by the second one where M is
# wanted only roughly, and at most so often. Models of large boxes on rough ground are far above the
# truth, so what they find likely is no measure.
WORTHWHILE, ROUGHLY = 2e-5, 3e-4
DEPTH = 10


@kernel
def norm_of_box(surface, potential, goal, horizon, i, j, box, norm, share, cutting):
    """The least M, at least ``norm``, that is enough for a box, but for a share.

    It is cut where that helps.
    """
    boxes = cutting.boxes
    boxes[0, 0], boxes[0, 1], boxes[0, 2], boxes[0, 3], boxes[0, 4] = (
        box.x,
        box.y,
        box.a,
        box.b,
        0.0,
    )
    waiting = 1
    while waiting > 0:
        waiting -= 1
        x, y, a, b, depth = boxes[waiting]
        facts = facts_of_box(surface, potential, goal, i, j, Box(x, y, a, b), cutting.work)
        need = need_of_box(facts, horizon)
        if need.proven <= norm:
            continue
        if depth == DEPTH or need.proven <= (1.0 + share) * need.least:
            norm = need.proven
            continue
        for m in range(4):
            boxes[waiting, 0] = x + (m % 2 - 0.5) * a
            boxes[waiting, 1] = y + (m // 2 - 0.5) * b
            boxes[waiting, 2], boxes[waiting, 3] = 0.5 * a, 0.5 * b
            boxes[waiting, 4] = depth + 1.0
            waiting += 1
    return norm


@kernel
def norm_of_cell(surface, potential, goal, horizon, i, j, norm, share, cutting):
    """The least M, at least ``norm``, that is enough for cell (i, j), but for a share."""
    pieces = cut_cell(surface, potential, i, j, cutting)
    for q in range(pieces.rows):
        for p in range(pieces.columns):
            box = piece(cutting, p, q)
            norm = norm_of_box(surface, potential, goal, horizon, i, j, box, norm, share, cutting)
    return norm


@kernel
def sharpen_needs(surface, potential, goal, horizon, j, norm, cutting, needs):
    """Replace the needs of row j (nx,) that are above ``norm`` by roughly the least ones."""
    for i in range(needs.shape[0]):
        if needs[i] > norm:
            found = norm_of_cell(surface, potential, goal, horizon, i, j, norm, ROUGHLY, cutting)
            needs[i] = min(found, needs[i])


@kernel
def cheap_need(floor, potential, goal, horizon, i, j):
    """An M that is enough for cell (i, j), from u's coefficients and planar distance alone."""
    lowest = math.inf
    for q in range(4):
        for k in range(4):
            lowest = min(lowest, potential.coefficients[j + q, i + k])
    if lowest >= horizon:
        return 0.0
    half_x, half_y = 0.5 * potential.dx, 0.5 * potential.dy
    box = Box(
        potential.x0 + i * potential.dx + half_x,
        potential.y0 + j * potential.dy + half_y,
        half_x,
        half_y,
    )
    distance = floor * planar_distance(box, goal)
    return (horizon - lowest) / distance if distance > 0.0 else math.inf


@kernel
def fill_needs(
    surface, potential, goal, horizon, j, exempt, enough, cutting, proven, likely, slope
):
    """A rough M that is enough for each cell of row j; 0 where exempt.

    enough : where this M is proven to be enough, no lower one is looked for.
    """
    for i in range(proven.shape[1]):
        proven[j, i] = 0.0
        if not exempt[j, i]:
            proven[j, i] = cheap_need(floor_of(surface), potential, goal, horizon, i, j)
        likely[j, i], slope[j, i] = proven[j, i], 0.0
        if proven[j, i] > enough:
            need = need_of_cell(surface, potential, goal, horizon, i, j, cutting)
            proven[j, i] = min(proven[j, i], need.proven)
            likely[j, i] = min(proven[j, i], need.likely)
            slope[j, i] = need.slope


@kernel
def least_norm(surface, potential, goal, horizon, order, needs, norm, cutting):
    """The least M, at least ``norm``, that is enough for some cells.

    needs (ny, nx) : an M that is proven to be enough for each cell. order : numbers of the cells,
    the largest need first, so that the cells that decide M come first.
    """
    columns = needs.shape[1]
    for n in order:
        i, j = n % columns, n // columns
        if needs[j, i] <= norm:
            break
        found = norm_of_cell(surface, potential, goal, horizon, i, j, norm, WORTHWHILE, cutting)
        norm = min(found, needs[j, i])
    return norm
