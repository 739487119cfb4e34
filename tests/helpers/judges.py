"""Judges of paths and distances that share no code with the package.

Surfaces, quadrature, search and geometry are NumPy's, SciPy's and shapely's. Only costs between
samples are the package's own definition (an interpolating spline would not be), so they are asked
of ``surface.cost_values``, and what ground is too steep of ``problem.constraints.steep``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

NODES, SHARES = np.polynomial.legendre.leggauss(10)
NODES, SHARES = 0.5 * (NODES + 1.0), 0.5 * SHARES  # on [0, 1]

# A segment that keeps this share of a cell away from all obstacles is free beyond doubt.
CLEARANCE = 1e-6

MOVES = {
    8: [(1, 0), (1, 1), (0, 1), (-1, 1)],
    16: [(1, 0), (1, 1), (0, 1), (-1, 1), (2, 1), (1, 2), (-1, 2), (-2, 1)],
}


# The ground


class Ground:
    """Weighted heights over the plane: the bicubic spline through the samples, by FITPACK.

    x : (nx,), y : (ny,), uniform. heights : (ny, nx). cost : (m, 2) -> (m,), a factor on lengths.
    Its ends are not-a-knot, as the package documents of its own. Places become columns and rows
    first, so that large coordinates cost no digits.
    """

    def __init__(
        self,
        x: np.ndarray,
        y: np.ndarray,
        heights: np.ndarray,
        weight: float = 1.0,
        cost: Callable[[np.ndarray], np.ndarray] | None = None,
        least_cost: float = 1.0,
    ) -> None:
        self.x, self.y, self.weight, self.cost, self.least_cost = x, y, weight, cost, least_cost
        self.cell = np.array([np.ptp(x) / (len(x) - 1), np.ptp(y) / (len(y) - 1)])
        self.origin = np.array([x[0], y[0]])
        rows, columns = np.arange(len(y), dtype=float), np.arange(len(x), dtype=float)
        self._spline = RectBivariateSpline(rows, columns, heights - heights.mean(), s=0)

    def places(self, points: np.ndarray) -> np.ndarray:
        """(m, 2): columns and rows, as real numbers."""
        return (points - self.origin) / self.cell

    def heights(self, points: np.ndarray) -> np.ndarray:
        """(m,): weighted heights above their mean."""
        u, v = self.places(points).T
        return self.weight * self._spline.ev(v, u)

    def slopes(self, points: np.ndarray) -> np.ndarray:
        """(m, 2): gradients of the weighted heights."""
        u, v = self.places(points).T
        along = self._spline.ev(v, u, dy=1), self._spline.ev(v, u, dx=1)
        return self.weight * np.column_stack(along) / self.cell

    def speeds(self, points: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """(m,): lengths of the tangents above moves (m, 2), times the cost."""
        rises = (self.slopes(points) * moves).sum(axis=1)
        speeds = np.sqrt((moves**2).sum(axis=1) + rises**2)
        return speeds if self.cost is None else speeds * self.cost(points)


def chord(ground: Ground, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(m,): Euclidean distances in space, times the least cost: no path is shorter."""
    rises = ground.heights(np.atleast_2d(b)) - ground.heights(np.atleast_2d(a))
    flat = np.hypot(*(np.atleast_2d(b) - np.atleast_2d(a)).T)
    return ground.least_cost * np.hypot(flat, rises)


# The true value of a path


def _cuts(places: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Shares in [0, 1] at which a segment crosses lines of knots, its ends among them."""
    shares = [np.array([0.0, 1.0])]
    for start, move in zip(places, moves, strict=True):
        low, high = sorted((start, start + move))
        lines = np.arange(math.ceil(low), math.floor(high) + 1)
        if move != 0.0:
            shares.append((lines - start) / move)
    return np.unique(np.clip(np.concatenate(shares), 0.0, 1.0))


def _pieces(ground: Ground, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins and moves (m, 2) of a polyline's segments, cut where the spline's pieces meet."""
    places, starts, moves = ground.places(points), [], []
    for k in range(len(points) - 1):
        shares = _cuts(places[k], places[k + 1] - places[k])
        move = points[k + 1] - points[k]
        starts.append(points[k] + shares[:-1, None] * move)
        moves.append(np.diff(shares)[:, None] * move)
    return np.concatenate(starts), np.concatenate(moves)


def _gauss(ground: Ground, starts: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """(m,): lengths of pieces by Gauss's rule of ten points."""
    points = starts[:, None] + NODES[:, None] * moves[:, None]
    speeds = ground.speeds(points.reshape(-1, 2), np.repeat(moves, len(NODES), axis=0))
    return speeds.reshape(-1, len(NODES)) @ SHARES


def value_of(ground: Ground, points: np.ndarray, tolerance: float = 1e-10) -> float:
    """The true value of a polyline (m, 2): Gauss's rule, halved until two levels agree."""
    if len(points) < 2:
        return 0.0
    starts, moves = _pieces(ground, np.asarray(points, float))
    whole = _gauss(ground, starts, moves)
    total, scale = 0.0, whole.sum()
    for _ in range(50):
        starts, moves = np.concatenate([starts, starts + 0.5 * moves]), np.tile(0.5 * moves, (2, 1))
        halves = _gauss(ground, starts, moves)
        both = halves[: len(whole)] + halves[len(whole) :]
        good = np.abs(both - whole) <= tolerance * both + 1e-14 * scale
        total += both[good].sum()
        keep = np.tile(~good, 2)
        starts, moves, whole = starts[keep], moves[keep], halves[keep]
        if len(whole) == 0:
            break
    return float(total + whole.sum())


# Obstacles


def boxes_of(blocked: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The squares of a mask's blocked cells, shapely polygons. x, y : centres of cells."""
    rows, columns = np.nonzero(blocked)
    dx, dy = np.ptp(x) / (len(x) - 1), np.ptp(y) / (len(y) - 1)
    low = np.column_stack([x[0] + dx * (columns - 0.5), y[0] + dy * (rows - 0.5)])
    high = np.column_stack([x[0] + dx * (columns + 0.5), y[0] + dy * (rows + 0.5)])
    return shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])


def united(parts: Sequence[shapely.Geometry]) -> shapely.Geometry:
    """All obstacles as one prepared geometry."""
    whole = shapely.union_all(np.asarray(parts, object))
    shapely.prepare(whole)
    return whole


def touches(parts: Sequence[shapely.Geometry], points: np.ndarray) -> float | None:
    """How long a path (m, 2) runs within obstacles; 0 for a touch alone, None for none.

    Of the parts themselves, because a union moves corners by rounding.
    """
    if len(parts) == 0:
        return None
    line = shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0])
    tree = shapely.STRtree(np.asarray(parts, object))
    hit = tree.query(line, predicate="intersects")
    if len(hit) == 0:
        return None
    return float(shapely.length(shapely.intersection(line, tree.geometries[hit])).sum())


def are_clear(walls: shapely.Geometry, a: np.ndarray, b: np.ndarray, gap: float) -> np.ndarray:
    """(m,): do segments a-b (m, 2) keep away from obstacles by more than a gap?"""
    if walls.is_empty:
        return np.ones(len(a), bool)
    return ~shapely.dwithin(walls, shapely.linestrings(np.stack([a, b], axis=1)), gap)


# Search on the samples themselves


@dataclass(frozen=True)
class Reach:
    """Shortest distances from a start over the graph of a map's samples.

    points : (n, 2), the last two are the start and the goal. distances : (n,), infinite where not
    reached. parents : (n,).
    """

    points: np.ndarray
    distances: np.ndarray
    parents: np.ndarray

    @property
    def found(self) -> bool:
        """Does a path lead to the goal?"""
        return bool(np.isfinite(self.distances[-1]))

    def path(self) -> np.ndarray:
        """(m, 2): the path to the goal."""
        nodes = [len(self.points) - 1]
        while self.parents[nodes[-1]] >= 0:
            nodes.append(self.parents[nodes[-1]])
        return self.points[nodes[::-1]]


def _node_links(ny: int, nx: int, neighbours: int) -> np.ndarray:
    """(m, 2): pairs of nodes of a grid, each once."""
    number, links = np.arange(ny * nx).reshape(ny, nx), []
    for i, j in MOVES[neighbours]:
        a = number[: ny - j, max(-i, 0) : nx - max(i, 0)]
        b = number[j:, max(i, 0) : nx - max(-i, 0)]
        links.append(np.column_stack([a.ravel(), b.ravel()]))
    return np.concatenate(links)


def _end_links(ground: Ground, points: np.ndarray) -> np.ndarray:
    """(m, 2): the start and the goal, each with the nodes at most 1.5 cells away, and together."""
    places, count = ground.places(points), len(points) - 2
    links = [
        (end, node)
        for end in (count, count + 1)
        for node in np.flatnonzero((np.abs(places[:count] - places[end]) <= 1.5).all(axis=1))
    ]
    together = bool((np.abs(places[-1] - places[-2]) <= 1.5).all())
    return np.array([*links, *[(count, count + 1)] * together], int).reshape(-1, 2)


def reach(
    ground: Ground,
    walls: shapely.Geometry,
    start: Sequence[float],
    goal: Sequence[float],
    neighbours: int = 8,
) -> Reach:
    """Dijkstra's algorithm from a start over the samples of a map, by SciPy.

    Edges keep clear of obstacles, and are integrated finely.
    """
    grid = np.stack(np.meshgrid(ground.x, ground.y), axis=-1).reshape(-1, 2)
    points = np.concatenate([grid, [start, goal]])
    links = np.concatenate(
        [_node_links(len(ground.y), len(ground.x), neighbours), _end_links(ground, points)]
    )
    a, b = points[links[:, 0]], points[links[:, 1]]
    clear = are_clear(walls, a, b, CLEARANCE * ground.cell.min())
    links, a, b = links[clear], a[clear], b[clear]
    middle = 0.5 * (a + b)
    lengths = _gauss(ground, a, middle - a) + _gauss(ground, middle, b - middle)
    # SciPy takes an edge of no length for none.
    weights = np.maximum(lengths, 1e-300)
    graph = csr_array((weights, (links[:, 0], links[:, 1])), shape=(len(points),) * 2)
    found, parents = dijkstra(
        graph, directed=False, indices=len(points) - 2, return_predecessors=True
    )
    return Reach(points, found, parents)


# The exact shortest path among blocked cells of flat ground


def _corners(blocked: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners within a grid where a path may bend, the side of the obstacle there, and contacts.

    (m, 2) columns and rows of corners; (m, 2) signs; (k, 2) corners where two blocked cells meet
    at a corner alone, so that nothing passes. The first cell's outer corner is (0, 0).
    """
    around = {  # by the side of the corner on which the cell is
        (-1, -1): blocked[:-1, :-1],
        (1, -1): blocked[:-1, 1:],
        (-1, 1): blocked[1:, :-1],
        (1, 1): blocked[1:, 1:],
    }
    count = sum(cells.astype(int) for cells in around.values())
    places, sides = [], []
    for side, cells in around.items():
        rows, columns = np.nonzero((count == 1) & cells)
        places.append(np.column_stack([columns, rows]) + 1)
        sides.append(np.tile(side, (len(rows), 1)))
    rows, columns = np.nonzero((count == 2) & (around[-1, -1] == around[1, 1]))
    return np.concatenate(places), np.concatenate(sides), np.column_stack([columns, rows]) + 1


def _grazes(moves: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(m,): a straight line through a corner that does not enter its obstacle can be taut there."""
    return (moves * sides).prod(axis=1) <= 0.0


def _shrunk(blocked: np.ndarray, contacts: np.ndarray) -> shapely.Geometry:
    """The blocked cells, a little smaller, so that paths may run along them; contacts closed."""
    rows, columns = np.nonzero(blocked)
    cells = shapely.union_all(shapely.box(columns, rows, columns + 1, rows + 1))
    inner = shapely.buffer(cells, -1e-7, join_style="mitre")
    closed = shapely.box(*(contacts - 1e-6).T, *(contacts + 1e-6).T)
    whole = shapely.union_all([inner, *closed])
    shapely.prepare(whole)
    return whole


def exact_length(
    blocked: np.ndarray, start: Sequence[float], goal: Sequence[float], size: float = 1.0
) -> float:
    """The length that no path among closed blocked cells falls below, and that paths approach.

    start, goal : in cells, (column, row), (0, 0) the outer corner of the first cell. size : of a
    cell. Infinite where no path exists. A shortest path bends at corners alone, so it is one of
    the graph of visibility, of which only edges that are taut at both ends are looked at.
    """
    # What is beyond the grid is closed, too.
    walled = np.pad(blocked, 1, constant_values=True)
    corners, sides, contacts = _corners(walled)
    ends = np.array([start, goal], float) + 1.0
    points = np.concatenate([corners, ends])
    i, j = np.triu_indices(len(points), 1)
    moves, is_end = points[j] - points[i], np.arange(len(points)) >= len(corners)
    sides = np.concatenate([sides, [(0, 0), (0, 0)]])
    taut = (is_end[i] | _grazes(moves, sides[i])) & (is_end[j] | _grazes(moves, sides[j]))
    i, j = i[taut], j[taut]
    lines = shapely.linestrings(np.stack([points[i], points[j]], axis=1))
    seen = ~shapely.intersects(_shrunk(walled, contacts), lines)
    i, j = i[seen], j[seen]
    lengths = np.maximum(np.hypot(*(points[j] - points[i]).T), 1e-300)
    graph = csr_array((lengths, (i, j)), shape=(len(points),) * 2)
    return size * float(dijkstra(graph, directed=False, indices=len(points) - 2)[-1])
