"""The shortest path among obstacles by brute force: an all-pairs visibility graph."""

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

# Points around each corner; one of them lies beside every line that bends round the corner.
AROUND = 8
MOST_SEGMENTS = 200_000


def shortest_by_all_pairs(obstacles, start, goal, bounds, away, h=None):
    """Length of the shortest free path through points that are ``away`` from corners.

    A path is free where shapely finds it disjoint from the union of all obstacles, closed sets.
    h : a constant metric. The result is an upper bound on the shortest path, too long by a few
    ``away`` for each bend; infinite where there is no path.
    """
    union = shapely.union_all(list(obstacles))
    shapely.prepare(union)
    points = np.concatenate([[start, goal], _beside_corners(union, obstacles, bounds, away)])
    a, b = _free_pairs(union, points)
    step = points[a] - points[b]
    lengths = np.sqrt(np.einsum("mi,ij,mj->m", step, np.eye(2) if h is None else h, step))
    graph = coo_matrix((lengths, (a, b)), shape=(len(points), len(points))).tocsr()
    return dijkstra(graph, directed=False, indices=0)[1]


def _beside_corners(union, obstacles, bounds, away):
    given = [shapely.get_coordinates(geometry) for geometry in (union, list(obstacles))]
    corners = np.unique(np.concatenate(given), axis=0)
    angles = 0.1 + np.arange(AROUND) * (2.0 * np.pi / AROUND)
    ring = away * np.column_stack([np.cos(angles), np.sin(angles)])
    points = (corners[:, None] + ring).reshape(-1, 2)
    points = points[((points >= bounds[:2]) & (points <= bounds[2:])).all(axis=1)]
    return points[~shapely.intersects_xy(union, *points.T)]


def _free_pairs(union, points):
    a, b = np.triu_indices(len(points), 1)
    free = np.empty(len(a), bool)
    for k in range(0, len(a), MOST_SEGMENTS):
        part = slice(k, k + MOST_SEGMENTS)
        segments = shapely.linestrings(np.stack([points[a[part]], points[b[part]]], axis=1))
        free[part] = ~shapely.intersects(union, segments)
    return a[free], b[free]
