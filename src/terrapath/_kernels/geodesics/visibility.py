"""A* over the corners of obstacles: the shortest path on flat ground.

A shortest path is taut: it touches an obstacle where it bends, and bends round it. So a corner is
reached only by a line that does not enter the obstacle there, and left only on the obstacle's side
of the line that it was reached by. Both are asked before it is tested whether a line is free.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import kernel
from ..space.free_space import segment_is_free
from .sight import ALONG_X, ALONG_Y, BEFORE_X, BEFORE_Y, CLEARANCE, X, Y, look

RUNNING, FOUND, EXHAUSTED = 0, 1, 2

# ``Search.slot`` of a corner that was not reached, and of one whose shortest path is known.
UNSEEN, DONE = -1, -2

# A line may turn to the wrong side by this share of its length, and by some clearances of the
# corner, because it begins and ends at such a distance from the walls.
TURN_SLACK = 1e-9
CLEARANCES = 2.0
# Corners nearer to one another than this share of their clearance are the same place.
SAME_PLACE = 0.01
# The sector that is looked into is wider by this, radians: near by, rounding turns lines.
WIDENED = 0.1


class Search(NamedTuple):
    """The start is the last corner but one, the goal the last. All arrays are filled in place."""

    cost: np.ndarray  # (n,) float64: of the shortest path known from the start
    parent: np.ndarray  # (n,) int64: the corner before, -1 at the start
    key: np.ndarray  # (n,) float64: cost plus the straight line to the goal
    slot: np.ndarray  # (n,) int64: where each corner is in the heap
    heap: np.ndarray  # (n,) int64
    size: np.ndarray  # (1,) int64: of the heap


# The heap


@kernel
def put(search, slot, corner):
    search.heap[slot] = corner
    search.slot[corner] = slot


@kernel
def rise(search, corner):
    """Move a corner up in the heap, to where its key belongs."""
    slot = search.slot[corner]
    while slot > 0:
        above = search.heap[(slot - 1) // 2]
        if search.key[above] <= search.key[corner]:
            break
        put(search, slot, above)
        slot = (slot - 1) // 2
    put(search, slot, corner)


@kernel
def sink(search, corner):
    """Put a corner at the top of the heap, and move it down to where its key belongs."""
    slot, size = 0, search.size[0]
    while 2 * slot + 1 < size:
        child = 2 * slot + 1
        if child + 1 < size and search.key[search.heap[child + 1]] < search.key[search.heap[child]]:
            child += 1
        below = search.heap[child]
        if search.key[corner] <= search.key[below]:
            break
        put(search, slot, below)
        slot = child
    put(search, slot, corner)


@kernel
def pop(search):
    """The corner with the least key; its shortest path is known now."""
    corner = search.heap[0]
    search.slot[corner] = DONE
    search.size[0] -= 1
    last = search.heap[search.size[0]]
    if last != corner:
        sink(search, last)
    return corner


@kernel
def push(search, corner, cost, parent, key):
    """Note a shorter path to a corner."""
    search.cost[corner], search.parent[corner], search.key[corner] = cost, parent, key
    if search.slot[corner] == UNSEEN:
        search.slot[corner] = search.size[0]
        search.size[0] += 1
    rise(search, corner)


# Taut lines


@kernel
def cross(ax, ay, bx, by):
    return ax * by - ay * bx


@kernel
def distance(scene, a, b):
    """Between two corners, under the metric."""
    dx = scene.corners[b, X] - scene.corners[a, X]
    dy = scene.corners[b, Y] - scene.corners[a, Y]
    h = scene.metric
    return math.sqrt(h[0] * dx * dx + 2.0 * h[1] * dx * dy + h[2] * dy * dy)


@kernel
def is_tangent(corners, c, dx, dy, slack):
    """Does a line along (dx, dy) through a corner stay out of the obstacle there?"""
    after = cross(corners[c, BEFORE_X], corners[c, BEFORE_Y], dx, dy)
    before = cross(dx, dy, corners[c, ALONG_X], corners[c, ALONG_Y])
    return min(after, before) >= -slack or max(after, before) <= slack


@kernel
def is_forward(corners, c, dx, dy):
    """Is a corner reached along its walls, with the obstacle to the left?"""
    x = corners[c, BEFORE_X] + corners[c, ALONG_X]
    y = corners[c, BEFORE_Y] + corners[c, ALONG_Y]
    return x * dx + y * dy > 0.0


@kernel
def bends_round(corners, c, px, py, dx, dy, slack):
    """Does a path that reaches a corner along (px, py), of length 1, leave it tautly along d?"""
    turn = cross(px, py, dx, dy)
    if is_forward(corners, c, px, py):
        beyond = cross(dx, dy, corners[c, ALONG_X], corners[c, ALONG_Y])
        return min(turn, beyond) >= -slack
    beyond = cross(corners[c, BEFORE_X], corners[c, BEFORE_Y], dx, dy)
    return max(turn, beyond) <= slack


@kernel
def sector(corners, c, px, py):
    """The directions in which a taut path may leave a corner: an angle and a width, radians."""
    if is_forward(corners, c, px, py):
        fx, fy, tx, ty = px, py, corners[c, ALONG_X], corners[c, ALONG_Y]
    else:
        fx, fy, tx, ty = -corners[c, BEFORE_X], -corners[c, BEFORE_Y], px, py
    width = max(math.atan2(cross(fx, fy, tx, ty), fx * tx + fy * ty), 0.0)
    return math.atan2(fy, fx) - WIDENED, width + 2.0 * WIDENED


# The search


@kernel
def consider(scene, search, c, other, px, py):
    """Go on from a corner, reached along (px, py), to another where that is shorter and taut.

    (px, py) is 0 where all directions are open.
    """
    corners, length = scene.corners, distance(scene, c, other)
    cost = search.cost[c] + length
    if search.slot[other] == DONE or cost >= search.cost[other]:
        return
    ax, ay, bx, by = corners[c, X], corners[c, Y], corners[other, X], corners[other, Y]
    dx, dy = bx - ax, by - ay
    size = math.hypot(dx, dy)
    if size < SAME_PLACE * corners[other, CLEARANCE]:
        return
    turning = TURN_SLACK * size
    if not is_tangent(corners, other, dx, dy, turning + CLEARANCES * corners[other, CLEARANCE]):
        return
    slack = turning + CLEARANCES * corners[c, CLEARANCE]
    if (px != 0.0 or py != 0.0) and not bends_round(corners, c, px, py, dx, dy, slack):
        return
    if segment_is_free(scene.space, ax, ay, bx, by):
        goal = corners.shape[0] - 1
        push(search, other, cost, c, cost + distance(scene, other, goal))


@kernel
def heading(corners, c, parent):
    """The direction, of length 1, in which a corner is reached; 0 at the start.

    Also 0 where the start is so near that it may be nearer to the obstacle than the corner is.
    """
    start = corners.shape[0] - 2
    if c == start:
        return 0.0, 0.0
    px, py = corners[c, X] - corners[parent, X], corners[c, Y] - corners[parent, Y]
    size = math.hypot(px, py)
    if parent == start and size <= CLEARANCES * corners[c, CLEARANCE]:
        return 0.0, 0.0
    return px / size, py / size


@kernel
def expand(scene, search, view, c):
    """Look from a corner to the others, and go where it is worth it."""
    corners, goal = scene.corners, scene.corners.shape[0] - 1
    x, y, angle, width = corners[c, X], corners[c, Y], 0.0, 2.0 * math.pi
    px, py = heading(corners, c, search.parent[c])
    if px != 0.0 or py != 0.0:
        angle, width = sector(corners, c, px, py)
    for k in range(look(scene, view, c, x, y, angle, width)):
        consider(scene, search, c, view.found[k], px, py)
    # So near, the goal may lie in any direction.
    if math.hypot(corners[goal, X] - x, corners[goal, Y] - y) <= CLEARANCES * corners[c, CLEARANCE]:
        consider(scene, search, c, goal, px, py)


@kernel
def advance(scene, search, view, steps):
    """Settle so many corners, unless the search ends before; returns how it stands."""
    goal = scene.corners.shape[0] - 1
    for _ in range(steps):
        if search.size[0] == 0:
            return EXHAUSTED
        corner = pop(search)
        if corner == goal:
            return FOUND
        expand(scene, search, view, corner)
    return RUNNING
