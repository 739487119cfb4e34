"""Occupancy grids and their exact any-angle optima, by integers alone.

Cells have whole coordinates: cell (row j, column i) is the closed square from (i, j) to
(i + 1, j + 1). Here all coordinates are doubled, so that centres are whole numbers, too. A path may
touch blocked cells, but not pass between two that touch: the least upper bound of what free paths
cost is then the length of a shortest path through corners.
"""

import heapq
import itertools
import math

import numpy as np
import shapely

import terrapath as tp
from mazes import maze

KINDS = ("random", "rooms", "maze", "streets")


def grid_of(kind, random, side):
    """(side + 2, side + 2) bool, the blocked cells of a random grid with a wall around it.

    Doors and corridors are one cell wide.
    """
    makers = {"random": _scattered, "rooms": _rooms, "maze": _maze, "streets": _streets}
    return np.pad(makers[kind](random, side), 1, constant_values=True)


def _scattered(random, side):
    return random.uniform(size=(side, side)) < random.choice([0.1, 0.2, 0.33])


def _rooms(random, side):
    blocked = np.zeros((side, side), bool)
    size = int(random.integers(3, 6))
    blocked[size :: size + 1], blocked[:, size :: size + 1] = True, True
    for wall, room in itertools.product(range(size, side, size + 1), range(0, side, size + 1)):
        for place in random.integers(room, min(room + size, side), 2):
            if random.uniform() < 0.8:
                cell = (wall, place) if random.uniform() < 0.5 else (place, wall)
                blocked[cell] = False
    return blocked


def _maze(random, side):
    return maze(random, side, side)


def _streets(random, side):
    blocked = np.zeros((side, side), bool)
    for _ in range(side):
        j, i = random.integers(0, side, 2)
        height, width = random.integers(1, 5, 2)
        blocked[j : j + height, i : i + width] = True
    return blocked


def shortest(blocked, start, goal):
    """The shortest path between the centres of two cells (column, row); None where there is none.

    Returns it as (m, 2), in cells.
    """
    ends = [(2 * i + 1, 2 * j + 1) for i, j in (start, goal)]
    nodes = [*ends, *map(tuple, _corners(blocked))]
    walls = _Walls(blocked)
    costs, parents, heap, done = {0: 0.0}, {}, [(0.0, 0)], set()
    while heap:
        cost, node = heapq.heappop(heap)
        if node == 1:
            return _traced(nodes, parents) / 2.0
        if node in done:
            continue
        done.add(node)
        for other in range(1, len(nodes)):
            through = cost + math.dist(nodes[node], nodes[other])
            if through < costs.get(other, math.inf) and walls.let_see(nodes[node], nodes[other]):
                costs[other], parents[other] = through, node
                heapq.heappush(heap, (through, other))
    return None


def _traced(nodes, parents):
    found = [1]
    while found[-1] != 0:
        found.append(parents[found[-1]])
    return np.array([nodes[k] for k in reversed(found)], float)


def _quarters(blocked):
    """(rows + 1, columns + 1, 4): the cells around each corner, below and left first."""
    p = np.pad(blocked, 1)
    return np.stack([p[:-1, :-1], p[:-1, 1:], p[1:, :-1], p[1:, 1:]], axis=-1)


def _corners(blocked):
    """(m, 2), doubled: the corners that a shortest path may bend round."""
    j, i = np.nonzero(_quarters(blocked).sum(axis=-1) == 1)
    return 2 * np.column_stack([i, j])


class _Walls:
    """What hides one point from another."""

    def __init__(self, blocked):
        j, i = np.nonzero(blocked)
        self.low = 2 * np.column_stack([i, j])
        four = _quarters(blocked)
        crossed = (four[..., 0] & four[..., 3]) | (four[..., 1] & four[..., 2])
        j, i = np.nonzero(crossed & (four.sum(axis=-1) == 2))
        self.contacts = 2 * np.column_stack([i, j])
        across, along = blocked[:-1] & blocked[1:], blocked[:, :-1] & blocked[:, 1:]
        j, i = np.nonzero(across)
        self.shared = [2 * np.column_stack([i, j + 1])]
        j, i = np.nonzero(along)
        self.shared.append(2 * np.column_stack([i + 1, j]))

    def let_see(self, a, b):
        a, b = np.array(a), np.array(b)
        ahead, low, high = b - a, np.minimum(a, b), np.maximum(a, b)
        near = ((self.low < high) & (self.low + 2 > low)).all(axis=1)
        if near.any():
            steps = np.array([(0, 0), (2, 0), (0, 2), (2, 2)])
            away = self.low[near][:, None] + steps - a
            sides = ahead[0] * away[..., 1] - ahead[1] * away[..., 0]
            if ((sides.min(axis=1) < 0) & (sides.max(axis=1) > 0)).any():
                return False
        for axis, shared in enumerate(self.shared):  # along the side that two blocked cells share
            if a[1 - axis] == b[1 - axis]:
                on = shared[:, 1 - axis] == a[1 - axis]
                between = (shared[:, axis] < high[axis]) & (shared[:, axis] + 2 > low[axis])
                if (on & between).any():
                    return False
        away = self.contacts - a
        on = ahead[0] * away[:, 1] == ahead[1] * away[:, 0]
        return not (on & ((self.contacts >= low) & (self.contacts <= high)).all(axis=1)).any()


# The same grid as obstacles of each kind


def squares(blocked, origin=(0.0, 0.0), size=1.0):
    """The blocked cells as shapely boxes."""
    (x, y), (j, i) = origin, np.nonzero(blocked)
    return shapely.box(x + size * i, y + size * j, x + size * (i + 1), y + size * (j + 1))


def obstacles_of(blocked, origin=(0.0, 0.0), size=1.0):
    """By name: the cells as a mask, as the union of their squares, as squares one by one."""
    boxes = squares(blocked, origin, size)
    rows, columns = blocked.shape
    x = origin[0] + size * (np.arange(columns) + 0.5)
    y = origin[1] + size * (np.arange(rows) + 0.5)
    return {
        "mask": [tp.Mask(blocked, x, y)],
        "union": [shapely.union_all(boxes)],
        "squares": list(boxes),
    }


def far_ends(blocked, random):
    """Two free cells (column, row) that free sides of cells join, far from one another; or None."""
    from scipy import ndimage

    parts, count = ndimage.label(~blocked)
    if count == 0:
        return None
    sizes = ndimage.sum_labels(~blocked, parts, range(1, count + 1))
    j, i = np.nonzero(parts == 1 + int(np.argmax(sizes)))
    if len(j) < 2:
        return None
    picks = random.integers(0, len(j), (8, 2))
    apart = np.hypot(
        *(np.column_stack([i, j])[picks[:, 0]] - np.column_stack([i, j])[picks[:, 1]]).T
    )
    a, b = picks[int(np.argmax(apart))]
    return None if a == b else ((int(i[a]), int(j[a])), (int(i[b]), int(j[b])))
