"""A growing planar point set in square buckets: nearest point, points within a radius.

The points are rows whose first two entries are x and y. From time to time all points are sorted
into the buckets: then they are numbered bucket by bucket, row by row, so that the points of
neighbouring buckets lie together in memory. Points that are added later are in a linked list of
their bucket.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel


class Buckets(NamedTuple):
    """The points of each bucket. All arrays are filled in place."""

    first: np.ndarray  # (capacity + 1,) int32: points first[c]:first[c + 1] are in bucket c
    head: np.ndarray  # (capacity,) int32: first of the later points of each bucket, -1 if none
    next: np.ndarray  # (n,) int32: next of the later points of the same bucket
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
def squared_distance(points, p, x, y):
    dx, dy = points[p, 0] - x, points[p, 1] - y
    return dx * dx + dy * dy


@kernel
def put(buckets, points, p):
    """Add a point to its bucket."""
    cell = row_of(buckets, points[p, 1]) * buckets.shape[0] + column_of(buckets, points[p, 0])
    buckets.next[p] = buckets.head[cell]
    buckets.head[cell] = p


@kernel
def resize(buckets, width, height, side):
    """Empty buckets of the given side, or the smallest ones that the arrays can hold."""
    most = buckets.head.shape[0]
    side = max(side, math.sqrt(2.0 * width * height / most), 2.0 * max(width, height) / most)
    buckets.frame[2] = side
    buckets.shape[0] = max(int(width / side), 1)
    buckets.shape[1] = max(int(height / side), 1)
    buckets.head[: buckets.shape[0] * buckets.shape[1]] = -1


@kernel
def lay_out(buckets, points, count, numbers):
    """Sort the first ``count`` points, at least one, into empty buckets.

    numbers (count,) is filled with the new number of each point. Point 0 keeps its number: it
    is outside the order, in the linked list of its bucket.
    """
    for p in range(count):
        put(buckets, points, p)
    number = 1
    for cell in range(buckets.shape[0] * buckets.shape[1]):
        buckets.first[cell] = number
        p = buckets.head[cell]
        buckets.head[cell] = -1
        while p >= 0:
            if p > 0:
                numbers[p] = number
                number += 1
            p = buckets.next[p]
    buckets.first[buckets.shape[0] * buckets.shape[1]] = number
    numbers[0] = 0
    put(buckets, points, 0)


@inner_kernel
def note(points, p, x, y, limit, found, count):
    """Note a point, but count it only where it is near enough. No branch is faster than one."""
    found[count].vertex = p
    found[count].squared = squared_distance(points, p, x, y)
    return count + (found[count].squared <= limit)


@kernel
def within(buckets, points, x, y, radius, found):
    """Note the points at most ``radius`` from (x, y); return how many there are.

    found : records with the fields ``vertex`` and ``squared``, the distance squared, one more
    than there are points.
    """
    count = 0
    limit = radius * radius
    left, right = column_of(buckets, x - radius), column_of(buckets, x + radius)
    for row in range(row_of(buckets, y - radius), row_of(buckets, y + radius) + 1):
        low, high = row * buckets.shape[0] + left, row * buckets.shape[0] + right
        for p in range(buckets.first[low], buckets.first[high + 1]):
            count = note(points, p, x, y, limit, found, count)
        for cell in range(low, high + 1):
            p = buckets.head[cell]
            while p >= 0:
                count = note(points, p, x, y, limit, found, count)
                p = buckets.next[p]
    return count


@inner_kernel
def nearer(points, p, x, y, best):
    """The nearer of p and ``best`` (-1: none yet); of two as near, the lower number."""
    if best < 0:
        return p
    squared, limit = squared_distance(points, p, x, y), squared_distance(points, best, x, y)
    return p if squared < limit or (squared == limit and p < best) else best


@kernel
def nearest_in_row(buckets, points, x, y, row, left, right, best):
    """The nearest of ``best`` and the points in some buckets of one row."""
    low, high = row * buckets.shape[0] + left, row * buckets.shape[0] + right
    for p in range(buckets.first[low], buckets.first[high + 1]):
        best = nearer(points, p, x, y, best)
    for cell in range(low, high + 1):
        p = buckets.head[cell]
        while p >= 0:
            best = nearer(points, p, x, y, best)
            p = buckets.next[p]
    return best


@kernel
def nearest(buckets, points, x, y):
    """The point nearest to (x, y), of several the lowest number; the set must not be empty.

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
        if best >= 0 and squared_distance(points, best, x, y) <= reach * reach:
            break
    return best
