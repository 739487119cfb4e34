"""Obstacles on flat ground that paths must go around."""

import math

import numpy as np
import shapely

LAYOUTS = {
    "nothing": [],
    "box": [shapely.box(3.0, 2.0, 8.0, 7.0)],
    "corridor": [shapely.box(3.0, -2.0, 7.0, 6.8), shapely.box(3.0, 7.0, 7.0, 12.0)],
    "wall of boxes": [shapely.box(4.0, -1.5 + 1.6 * k, 5.5, -0.2 + 1.6 * k) for k in range(8)],
    "chicane": [shapely.box(2.0, -2.0, 3.0, 8.0), shapely.box(6.0, 1.0, 7.0, 12.0)],
    "horseshoe": [
        shapely.Polygon([(2, 2), (9, 2), (9, 9), (2, 9), (2, 8), (8, 8), (8, 3), (2, 3)])
    ],
    "courtyard": [
        shapely.box(6.0, 6.0, 10.9, 10.9)
        - shapely.box(7.0, 7.0, 10.4, 10.4)
        - shapely.box(9.0, 5.0, 9.8, 7.5)
    ],
    "triangles": [
        shapely.Polygon([(1, 4), (5, 1), (4.5, 5)]),
        shapely.Polygon([(5.5, 5), (9, 4), (7, 9)]),
        shapely.Polygon([(1, 7), (4, 6), (5, 10)]),
    ],
}


def star(x, y, radii, turn, hole):
    """A star-shaped polygon about (x, y); ``hole`` (0: none) is that share of it cut out."""
    angles = turn + 2.0 * math.pi * np.arange(len(radii)) / len(radii)
    ring = np.array(radii)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    centre = np.array([x, y])
    holes = [centre + hole * ring] if hole > 0.0 else []
    return shapely.Polygon(centre + ring, holes)
