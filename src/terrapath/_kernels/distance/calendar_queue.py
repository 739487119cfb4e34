"""The queue of fast marching: nodes that have a trial value, the one with the least first."""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..space.free_space import Grid


class Front(NamedTuple):
    """Values, and the queue of nodes that have a trial value.

    A calendar queue (Brown 1988). The values are divided into *days*, intervals of equal width.
    The nodes of a day are in the bucket whose number is the day modulo the number of buckets,
    and the least of the current day is searched for. With one or two nodes in a bucket that is
    several times faster than a heap, and as exact.

    ``u`` and ``trial`` may be one array, of the values of settled and of queued nodes.
    """

    u: np.ndarray  # (n,) float64: values of settled nodes, infinite elsewhere
    trial: np.ndarray  # (n,) float64: values of queued nodes, infinite before that
    heads: np.ndarray  # (buckets,) int32: first node of each bucket, -1 where none
    days_per_unit: float  # 1 / width of a day
    counters: np.ndarray  # (2,) int64: QUEUED, DAY


# The width of a typical day: this many spacings of nodes, divided by the nodes of a side.
BUCKET_SHARE = 4.0
BUCKETS = 2**14


def typical_day(grid: Grid, cost: float) -> float:
    """The width of a day in which one or two nodes are queued.

    cost : a typical factor on lengths.
    """
    return BUCKET_SHARE * math.sqrt(grid.dx * grid.dy) / max(grid.nx, grid.ny) * cost


def front_of(u: np.ndarray, trial: np.ndarray, width: float, values: np.ndarray) -> Front:
    """An empty queue of nodes, that begins on the day of the least of the values.

    u, trial : as of Front, infinite. width : of a day, map units. values : of the nodes that will
    be queued first, map units.
    """
    front = Front(
        u=u,
        trial=trial,
        heads=np.full(BUCKETS, -1, np.int32),
        days_per_unit=1.0 / width,
        counters=np.zeros(2, np.int64),
    )
    if len(values):
        front.counters[DAY] = int(values.min() / width)
    return front


# Places in Front.counters.
QUEUED = 0  # nodes in the queue
DAY = 1  # the current day

# Days are 64-bit integers; all greater values belong to this day.
LAST_DAY = 2.0**62


@inner_kernel
def day_of(front, value):
    return int(min(value * front.days_per_unit, LAST_DAY))


@inner_kernel
def list_of(front, value):
    """The bucket in which a value is listed from now on.

    A second-order value can be a little greater than a value that follows from it: that belongs to
    a day that has passed, so it is listed in the current one.
    """
    return max(day_of(front, value), front.counters[DAY]) & (front.heads.shape[0] - 1)


@inner_kernel
def enqueue(nodes, front, n, value):
    bucket = list_of(front, value)
    head = front.heads[bucket]
    front.trial[n] = value
    front.heads[bucket] = n
    node = nodes[n]
    node.after = head
    node.before = -2 - bucket
    if head >= 0:
        nodes[head].before = n


@inner_kernel
def dequeue(nodes, front, n):
    node = nodes[n]
    if node.after >= 0:
        nodes[node.after].before = node.before
    if node.before >= 0:
        nodes[node.before].after = node.after
    else:
        front.heads[-2 - node.before] = node.after


@kernel
def earliest_day(nodes, front):
    """The day of the least trial value of all."""
    lowest = math.inf
    for bucket in range(front.heads.shape[0]):
        n = front.heads[bucket]
        while n >= 0:
            lowest = min(lowest, front.trial[n])
            n = nodes[n].after
    return max(day_of(front, lowest), front.counters[DAY])


@inner_kernel
def least_of_day(nodes, front, day):
    """The node with the least trial value up to the end of a day, -1 where there is none."""
    lowest, best = math.inf, -1
    n = front.heads[day & (front.heads.shape[0] - 1)]
    while n >= 0:
        value = front.trial[n]
        if value < lowest and day_of(front, value) <= day:
            lowest, best = value, n
        n = nodes[n].after
    return best


@inner_kernel
def any_of_day(nodes, front, day):
    """A node with a trial value up to the end of a day, -1 where there is none."""
    n = front.heads[day & (front.heads.shape[0] - 1)]
    while n >= 0 and day_of(front, front.trial[n]) > day:
        n = nodes[n].after
    return n


@inner_kernel
def earliest(nodes, front, in_order):
    """A node of the earliest day, the one with the least value where they come in order; the
    queue must not be empty.
    """
    day = front.counters[DAY]
    last = day + front.heads.shape[0]
    n = least_of_day(nodes, front, day) if in_order else any_of_day(nodes, front, day)
    while n < 0:
        day += 1
        if day == last:  # no node in a whole round of buckets: skip the empty days
            day = earliest_day(nodes, front)
        n = least_of_day(nodes, front, day) if in_order else any_of_day(nodes, front, day)
    front.counters[DAY] = day
    return n
