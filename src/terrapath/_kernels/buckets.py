"""A growing planar point set in square buckets: nearest point, points within a radius.

The points are records with the fields ``x``, ``y`` and ``next``, the next point of the
same bucket.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiler import inner_kernel, kernel


class Buckets(NamedTuple):
    """Linked lists of points, one per square bucket. All arrays are filled in place."""

    head: np.ndarray  # (capacity,) int32: first point of each bucket, -1 where empty
    frame: np.ndarray  # (3,) float64: x0, y0 and the side of a bucket
    shape: np.ndarray  # (2,) int64: columns, rows


@inner_kernel
def column_of(buckets, x):
    column = int((x - buckets.frame[0]) / buckets.frame[2])
    return min(max(column, 0), buckets.shape[0] - 1)


@inner_kernel
def row_of(buckets, y):
    row = int((y - buckets.frame[1]) / buckets.frame[2])
    return min(max(row, 0), buckets.shape[1] - 1)


@inner_kernel
def squared_distance(point, x, y):
    return (point.x - x) * (point.x - x) + (point.y - y) * (point.y - y)


@kernel
def put(buckets, points, p):
    """Add a point to its bucket."""
    point = points[p]
    cell = row_of(buckets, point.y) * buckets.shape[0] + column_of(buckets, point.x)
    point.next = buckets.head[cell]
    buckets.head[cell] = p


@kernel
def rebuild(buckets, points, count, width, height, side):
    """Lay out all points anew in buckets of the given side, or as small as there is room for."""
    room = buckets.head.shape[0]
    side = max(side, math.sqrt(2.0 * width * height / room), 2.0 * max(width, height) / room)
    buckets.frame[2] = side
    buckets.shape[0] = max(int(width / side), 1)
    buckets.shape[1] = max(int(height / side), 1)
    buckets.head[: buckets.shape[0] * buckets.shape[1]] = -1
    for p in range(count):
        put(buckets, points, p)


@kernel
def within(buckets, points, x, y, radius, found):
    """Note the points at most ``radius`` from (x, y) in ``found[...].vertex``; return how many."""
    count = 0
    limit = radius * radius
    first, last = column_of(buckets, x - radius), column_of(buckets, x + radius)
    for row in range(row_of(buckets, y - radius), row_of(buckets, y + radius) + 1):
        for cell in range(row * buckets.shape[0] + first, row * buckets.shape[0] + last + 1):
            p = buckets.head[cell]
            while p >= 0:
                if squared_distance(points[p], x, y) <= limit:
                    found[count].vertex = p
                    count += 1
                p = points[p].next
    return count


@kernel
def nearest_in_row(buckets, points, x, y, row, first, last, best):
    """The nearest of ``best`` and the points in some buckets of one row (-1: none yet)."""
    limit = math.inf
    if best >= 0:
        limit = squared_distance(points[best], x, y)
    for cell in range(row * buckets.shape[0] + first, row * buckets.shape[0] + last + 1):
        p = buckets.head[cell]
        while p >= 0:
            squared = squared_distance(points[p], x, y)
            if squared < limit or (squared == limit and p < best):
                best, limit = p, squared
            p = points[p].next
    return best


@kernel
def nearest(buckets, points, x, y):
    """The point nearest to (x, y), the first of several; the set must not be empty.

    Rings of buckets are searched outwards until none farther out can hold a nearer one.
    """
    column, row = column_of(buckets, x), row_of(buckets, y)
    columns, rows = buckets.shape[0], buckets.shape[1]
    best = -1
    for ring in range(max(columns, rows)):
        low, high = max(column - ring, 0), min(column + ring, columns - 1)
        for j in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            if j == row - ring or j == row + ring:
                best = nearest_in_row(buckets, points, x, y, j, low, high, best)
                continue
            if column - ring >= 0:
                best = nearest_in_row(buckets, points, x, y, j, low, low, best)
            if column + ring < columns:
                best = nearest_in_row(buckets, points, x, y, j, high, high, best)
        reach = ring * buckets.frame[2]
        if best >= 0 and squared_distance(points[best], x, y) <= reach * reach:
            break
    return best
