"""Newton's method in the places where a path crosses the sides of cells of constant cost.

At the shortest path Snell's law holds: cost times the sine of the angle is the same on both sides.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_banded

from ..surface import Surface
from ..surface.metric import curve_length, segment_lengths
from ..validation import Array

# Differences are taken over this share of a side, and bends stay so far from the edge.
STEP = 1e-4
AT_EDGE = 2.0 * STEP
# A bend moves by no more than so many sides.
FARTHEST = 3.0
# Steps of Newton's method, and how often one is halved.
MOST_STEPS, MOST_HALVINGS = 20, 8
# It ends where a step shortens the path by no more than this share; one that moves bends one by one
# gains little, over and over, and ends it earlier.
GAIN, GAIN_ALONE = 1e-14, 1e-10
# Places this near to a side lie on it, as a share of the side. Bends are put on sides to rounding,
# so this is narrower than the kernels' ``ON_SIDE``, by which costs are read: a bend that may move
# along a side has the lower cost there.
ON_SIDE = 1e-9


def obeying_snell(surface: Surface, x: Array, y: Array, points: Array, first: int = 0) -> Array:
    """A path (m, 2) whose bends have moved along the sides of cells to where it is shortest.

    x (nx + 1,), y (ny + 1,) : where the sides are. Bends that are not on a side stay where they
    are. A bend may move on to the next sides of its line. first : the axis, 0 or 1, that bends at
    corners may move along.
    """
    along, low, high = _rooms(x, y, points, first)
    if not (low < high).any():
        return points
    length = curve_length(surface, points)
    for _ in range(MOST_STEPS):
        step = _newton_step(surface, points, along)
        taken, least = _together(surface, points, along, step, low, high, length), GAIN
        if taken is None:
            least = GAIN_ALONE
            # A bend at a corner, where the length is not smooth, must not hold up the others.
            taken = _one_by_one(surface, points, along, step, low, high)
        points, low, high = points + along * taken[:, None], low - taken, high - taken
        shorter = curve_length(surface, points)
        gain, length = length - shorter, shorter
        if gain <= least * length:
            break
    return points


def _together(
    surface: Surface, points: Array, along: Array, step: Array, low: Array, high: Array, most: float
) -> Array | None:
    """The share (m,) of a step of all bends with which the path is shorter than ``most``."""
    for halvings in range(MOST_HALVINGS):
        taken = np.clip(0.5**halvings * step, low, high)
        if curve_length(surface, points + along * taken[:, None]) < most:
            return np.asarray(taken)
    return None


def _one_by_one(
    surface: Surface, points: Array, along: Array, step: Array, low: Array, high: Array
) -> Array:
    """The steps (m,) of bends that shorten the path alone, of two neighbours one at most."""
    found = np.zeros(len(points))
    before, middle, after = points[:-2], points[1:-1], points[2:]
    known = segment_lengths(surface, before, middle) + segment_lengths(surface, middle, after)
    for halvings in range(MOST_HALVINGS):
        taken = np.clip(0.5**halvings * step, low, high)
        moved = (points + along * taken[:, None])[1:-1]
        length = segment_lengths(surface, before, moved) + segment_lengths(surface, moved, after)
        for k in (np.flatnonzero(length < known) + 1).tolist():
            if not found[k - 1 : k + 2].any():
                found[k] = taken[k]
    return found


def _rooms(x: Array, y: Array, points: Array, first: int) -> tuple[Array, Array, Array]:
    """For each point, the vector of its side (m, 2), and how far it may move, (m,) down and up.

    These are shares of the side; a point that may not move has the vector 0.
    """
    along, low, high = np.zeros_like(points), np.zeros(len(points)), np.zeros(len(points))
    (column, share_x), (row, share_y) = _place(x, points[:, 0]), _place(y, points[:, 1])
    for axis, places, k, share, across in (
        (0, x, column, share_x, share_y),
        (1, y, row, share_y, share_x),
    ):
        moves = _is_on_side(across)
        if axis != first:
            moves &= ~_is_on_side(share)
        moves[[0, -1]] = False
        # The cells at the edge are cut off, so the way there is no whole number of sides. It is not
        # gone to the end, because differences are taken on both sides of a bend.
        at, sides = points[:, axis], np.diff(places)[k]
        down, up = (places[0] - at) / sides + AT_EDGE, (places[-1] - at) / sides - AT_EDGE
        moves &= (down < 0.0) & (up > 0.0)
        along[moves, axis] = sides[moves]
        low[moves] = np.maximum(-FARTHEST, down[moves])
        high[moves] = np.minimum(FARTHEST, up[moves])
    return along, low, high


def _place(places: Array, at: Array) -> tuple[npt.NDArray[np.intp], Array]:
    """Between which two sides each place is, and its share of the way from one to the other."""
    k = np.clip(np.searchsorted(places, at, "right") - 1, 0, len(places) - 2)
    return k, (at - places[k]) / np.diff(places)[k]


def _is_on_side(share: Array) -> npt.NDArray[np.bool_]:
    return np.asarray(np.abs(share - np.rint(share)) <= ON_SIDE)


def _newton_step(surface: Surface, points: Array, along: Array) -> Array:
    """The step (m,) of all bends, as shares of their sides: a tridiagonal system."""
    still = np.asarray(~along.any(axis=1))
    lengths = np.empty((3, 3, len(points) - 1))
    for a in range(3):
        for b in range(3):
            begin = points[:-1] + (a - 1) * STEP * along[:-1]
            end = points[1:] + (b - 1) * STEP * along[1:]
            lengths[a, b] = segment_lengths(surface, begin, end)
    slope, bend = np.zeros(len(points)), np.zeros(len(points))
    slope[:-1] += (lengths[2, 1] - lengths[0, 1]) / (2.0 * STEP)
    slope[1:] += (lengths[1, 2] - lengths[1, 0]) / (2.0 * STEP)
    bend[:-1] += (lengths[2, 1] - 2.0 * lengths[1, 1] + lengths[0, 1]) / STEP**2
    bend[1:] += (lengths[1, 2] - 2.0 * lengths[1, 1] + lengths[1, 0]) / STEP**2
    both = lengths[2, 2] - lengths[2, 0] - lengths[0, 2] + lengths[0, 0]
    both = both / (4.0 * STEP**2)
    # Where the path runs straight along a side there is no curvature; a step there is short.
    least = 1e-3 * float(np.abs(bend).max(initial=0.0)) + 1e-300
    bend = np.where(still, 1.0, np.maximum(bend, least))
    slope[still] = 0.0
    both[still[:-1] | still[1:]] = 0.0
    banded = np.zeros((3, len(points)))
    banded[0, 1:], banded[1], banded[2, :-1] = both, bend, both
    return np.asarray(solve_banded((1, 1), banded, -slope))
