"""Slow, obvious oracles for the planners: formulas, brute force and exact geometry.

Nothing here calls a kernel. Surfaces are lists of layers, each a list of Gaussian peaks
(amplitude, falloff, x1, x2), evaluated straight from the formula.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
import shapely
from scipy.integrate import quad

from oracles import algorithm_1

# Those with the options of a tree: samples, step, seed and goal bias.
TREE_PLANNERS = ["rrt", "rrt-star", "rrt-star-r"]

Peak = tuple[float, float, float, float]
Layers = Sequence[Sequence[Peak]]
Point = tuple[float, float]


def same_tree(a, b) -> bool:
    """Have two solutions the same tree, bit by bit?"""
    names = ("points", "parents", "costs")
    return all(np.array_equal(getattr(a.tree, name), getattr(b.tree, name)) for name in names)


# The surface


def lifted(layers: Layers, x: float, y: float) -> list[float]:
    """The point of R^n above (x, y)."""
    heights = [
        sum(a * math.exp(-f * ((x - cx) ** 2 + (y - cy) ** 2)) for a, f, cx, cy in layer)
        for layer in layers
    ]
    return [x, y, *heights]


def speed(layers: Layers, x: float, y: float, dx: float, dy: float) -> float:
    """|ds(v)| in R^n for v = (dx, dy): sqrt(h(v, v)), without writing h down."""
    total = dx * dx + dy * dy
    for layer in layers:
        rise = 0.0
        for a, f, cx, cy in layer:
            value = a * math.exp(-f * ((x - cx) ** 2 + (y - cy) ** 2))
            rise += -2.0 * f * ((x - cx) * dx + (y - cy) * dy) * value
        total += rise * rise
    return math.sqrt(total)


def chord(layers: Layers, a: Point, b: Point) -> float:
    """Euclidean distance in R^n."""
    return math.dist(lifted(layers, *a), lifted(layers, *b))


def line_r(layers: Layers, a: Point, b: Point, panel: float) -> float:
    """Algorithm 1 on each of the equal pieces of a-b that are at most ``panel`` long."""
    pieces = max(math.ceil(math.dist(a, b) / panel), 1)
    ends = [
        (a[0] + k / pieces * (b[0] - a[0]), a[1] + k / pieces * (b[1] - a[1]))
        for k in range(pieces + 1)
    ]
    total = 0.0
    for p, q in pairwise(ends):
        dx, dy = q[0] - p[0], q[1] - p[1]
        total += algorithm_1(lambda x, y, dx=dx, dy=dy: speed(layers, x, y, dx, dy), p, q)
    return total


def polyline_length(layers: Layers, points: np.ndarray) -> float:
    """True length of a polyline on the surface, by QUADPACK on the formula."""
    total = 0.0
    for (ax, ay), (bx, by) in pairwise(points):
        dx, dy = bx - ax, by - ay

        def integrand(t: float, ax=ax, ay=ay, dx=dx, dy=dy) -> float:
            return speed(layers, ax + t * dx, ay + t * dy, dx, dy)

        total += quad(integrand, 0.0, 1.0, epsabs=0.0, epsrel=1e-11, limit=400)[0]
    return total


# RRT*-R


@dataclass
class PlainTree:
    """RRT*-R as a reader of Algorithms 1 to 3 would write it down."""

    layers: Layers
    start: Point
    goal: Point
    bounds: tuple[float, float, float, float]
    step: float
    radius_factor: float
    goal_bias: float
    panel: float
    blocked: Callable[[Point, Point], bool] = lambda a, b: False
    points: list[Point] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    edges: list[float] = field(default_factory=list)
    goal_vertex: int | None = None

    def __post_init__(self) -> None:
        self.points.append(self.start)
        self.parents.append(-1)
        self.edges.append(0.0)

    def cost(self, vertex: int) -> float:
        """Cost(v): the edges from the start added up, in that order."""
        way = []
        while vertex >= 0:
            way.append(self.edges[vertex])
            vertex = self.parents[vertex]
        total = 0.0
        for edge in reversed(way):
            total += edge
        return total

    def edge_length(self, a: Point, b: Point) -> float:
        """Line-R, but never below the chord."""
        return max(line_r(self.layers, a, b, self.panel), chord(self.layers, a, b))

    def radius(self) -> float:
        """Karaman and Frazzoli (2011), theorem 38, d = 2; the unit ball's area is pi."""
        n = max(len(self.points), 2)
        x0, y0, x1, y1 = self.bounds
        least = 2.0 * (1.0 + 1.0 / 2.0) ** (1.0 / 2.0) * math.sqrt((x1 - x0) * (y1 - y0) / math.pi)
        return min(self.step, self.radius_factor * least * math.sqrt(math.log(n) / n))

    def extend(self, target: Point) -> bool:
        """Algorithm 3, with Cost(v_new) updated when v_min changes.

        Extend maps the tree G to G', so Cost(v_near) is that in G: what is rewired does not
        depend on the order in which the near vertices are visited.
        """
        distances = [math.dist(target, point) for point in self.points]
        nearest = int(np.argmin(distances))
        if distances[nearest] == 0.0:
            return False
        origin, new = self.points[nearest], target
        if distances[nearest] > self.step:
            share = self.step / distances[nearest]
            new = (
                origin[0] + share * (target[0] - origin[0]),
                origin[1] + share * (target[1] - origin[1]),
            )
        if self.blocked(origin, new):
            return False
        radius = self.radius()
        near = [v for v, point in enumerate(self.points) if math.dist(point, new) <= radius]
        near = sorted({*near, nearest})
        lengths = {v: self.edge_length(new, self.points[v]) for v in near}
        open_ = [v for v in near if not self.blocked(self.points[v], new)]
        costs = {v: self.cost(v) for v in near}
        parent = min(open_, key=lambda v: costs[v] + lengths[v])
        self.points.append(new)
        self.parents.append(parent)
        self.edges.append(lengths[parent])
        added = len(self.points) - 1
        come = costs[parent] + lengths[parent]
        for v in open_:
            if v != parent and come + lengths[v] < costs[v]:
                self.parents[v] = added
                self.edges[v] = lengths[v]
        return True

    def sample(self, draw: np.ndarray) -> None:
        """Algorithm 2's loop body for one row of three uniform numbers."""
        x0, y0, x1, y1 = self.bounds
        target = (x0 + draw[1] * (x1 - x0), y0 + draw[2] * (y1 - y0))
        if self.goal_vertex is None and draw[0] < self.goal_bias:
            target = self.goal
        if self.extend(target) and self.goal_vertex is None:
            if 0.0 < math.dist(self.points[-1], self.goal) <= self.step:
                self.extend(self.goal)
            if self.points[-1] == self.goal:
                self.goal_vertex = len(self.points) - 1


# Flat ground with obstacles


def visibility_length(
    start: Point,
    goal: Point,
    polygons: Sequence[shapely.Polygon],
    bounds: tuple[float, float, float, float],
) -> float:
    """Length of the shortest path around polygons on flat ground, exactly.

    A shortest path bends at corners of obstacles alone, so it is a path of the graph whose
    vertices are all corners and whose edges are all segments that enter no obstacle.
    """
    ground = shapely.union_all(polygons)
    corners = shapely.get_coordinates(ground)
    inside = (corners >= bounds[:2]).all(axis=1) & (corners <= bounds[2:]).all(axis=1)
    nodes = sorted({start, goal, *map(tuple, corners[inside].tolist())})
    shapely.prepare(ground)
    graph = nx.Graph()
    for a, b in combinations(nodes, 2):
        # DE-9IM: the segment's inside and the obstacles' inside share nothing.
        if shapely.relate_pattern(shapely.LineString([a, b]), ground, "F********"):
            graph.add_edge(a, b, weight=math.dist(a, b))
    return float(nx.dijkstra_path_length(graph, start, goal))
