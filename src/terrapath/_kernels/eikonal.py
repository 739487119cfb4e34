"""The eikonal equation grad u^T h^-1 grad u = 1 on a lattice, by single-pass fast marching.

Selling's algorithm writes h^-1 as a sum of three rank-one tensors along lattice vectors,
h^-1 = sum_k rho_k e_k e_k^T with rho_k >= 0, whatever the anisotropy. Then

    sum_k rho_k max(0, u(x) - u(x + e_k), u(x) - u(x - e_k))^2 = 1

is monotone and causal, so that each node is settled once, in the order of its value
(Mirebeau 2014, FM-LBR; Mirebeau 2019, Riemannian fast-marching with Voronoi's first
reduction). Nodes are numbered j * nx + i, and all lattice vectors are in nodes, so that
the metric comes in per node: h11 dx^2, h12 dx dy, h22 dy^2.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiler import inner_kernel, kernel
from .free_space import segment_is_free
from .lengths import chord
from .surfaces import Metric, metric_at

DIRECTIONS = 3

# Bits of a node's links: the neighbour on side 2 k + (0: +e_k, 1: -e_k) may be used; so may
# the one after it (shifted by SECOND); the node lies in the source's window.
SECOND = 6
ALL_SIDES = (1 << 6) - 1
ALL_LINKS = (1 << 12) - 1
WINDOW = 1 << 12

# The stencil of a node.
NODE = np.dtype(
    [
        ("x0", np.int16),  # e_0 and e_1, in nodes; e_2 = -e_0 - e_1
        ("y0", np.int16),
        ("x1", np.int16),
        ("y1", np.int16),
        ("rho0", np.float32),
        ("rho1", np.float32),
        ("rho2", np.float32),
        ("links", np.uint16),
        ("padding", np.uint16),
        ("after", np.int32),  # the next node of the same bucket, -1 where none
        ("before", np.int32),  # the one before; -2 - bucket at the head of a bucket's list
    ]
)


class Readers(NamedTuple):
    """Which nodes have a node in their stencils: entries[first[n]:first[n + 1]].

    An entry is 8 times the reader's number plus the side on which it reads the node.
    """

    first: np.ndarray  # (n + 1,) int32
    entries: np.ndarray  # uint32


class Source(NamedTuple):
    """A model v of the distance near the source, on a window of nodes.

    Differences are taken of u - v, which is smooth where u is not (additive factoring).
    """

    row: int  # of the window's first node
    column: int
    model: np.ndarray  # (rows, columns) float64: v, NaN where it does not hold
    slope_x: np.ndarray  # (rows, columns) float64: dv/di, per node
    slope_y: np.ndarray


class Front(NamedTuple):
    """Values, and the queue of nodes that have a trial value.

    A calendar queue (Brown 1988): a node is listed in the bucket of its trial value, modulo
    the number of buckets, and the least of the current bucket is searched for. With a node
    or two a bucket that is several times faster than a heap, and as exact.
    """

    u: np.ndarray  # (n,) float64: values of settled nodes, infinite elsewhere
    trial: np.ndarray  # (n,) float64: values of queued nodes, infinite before that
    heads: np.ndarray  # (buckets,) int32: first node of each bucket, -1 where none
    days_per_unit: float  # 1 / width of a bucket
    counters: np.ndarray  # (2,) int64: QUEUED, DAY


# Places in Front.counters.
QUEUED = 0  # nodes in the queue
DAY = 1  # number of the current bucket, not reduced


# The queue


# Days are whole numbers of 64 bits; a value that is farther away waits for this one.
LAST_DAY = 2.0**62


@inner_kernel
def day_of(front, value):
    return int(min(value * front.days_per_unit, LAST_DAY))


@inner_kernel
def enqueue(nodes, front, n, value):
    # A second-order value can be a little above what follows from it: that is due at once.
    day = max(day_of(front, value), front.counters[DAY])
    bucket = day & (front.heads.shape[0] - 1)
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
    """The node with the least trial value of a day, -1 where there is none."""
    lowest, best = math.inf, -1
    n = front.heads[day & (front.heads.shape[0] - 1)]
    while n >= 0:
        value = front.trial[n]
        if value < lowest and day_of(front, value) <= day:
            lowest, best = value, n
        n = nodes[n].after
    return best


@inner_kernel
def least(nodes, front):
    """The node with the least trial value; the queue must not be empty."""
    day = front.counters[DAY]
    last = day + front.heads.shape[0]
    n = least_of_day(nodes, front, day)
    while n < 0:
        day += 1
        if day == last:  # nothing in a whole round: do not walk through empty days
            day = earliest_day(nodes, front)
        n = least_of_day(nodes, front, day)
    front.counters[DAY] = day
    return n


# Stencils


@inner_kernel
def dot(d, ax, ay, bx, by):
    """a^T D b."""
    return d.h11 * ax * bx + d.h12 * (ax * by + ay * bx) + d.h22 * ay * by


# Superbase flips: some log2 of the anisotropy are needed.
MOST_FLIPS = 200


class Superbase(NamedTuple):
    """Lattice vectors b_0, b_1 of a basis; b_2 = -b_0 - b_1 completes the superbase."""

    x0: int
    y0: int
    x1: int
    y1: int


@inner_kernel
def obtuse_superbase(d, b):
    """The D-obtuse superbase that Selling's algorithm makes of b.

    A neighbour's superbase is mostly right already.
    """
    x0, y0, x1, y1 = b.x0, b.y0, b.x1, b.y1
    for _ in range(MOST_FLIPS):
        x2, y2 = -x0 - x1, -y0 - y1
        if dot(d, x0, y0, x1, y1) > 0.0:
            x0, y0, x1, y1 = x1, y1, -x0, -y0
        elif dot(d, x1, y1, x2, y2) > 0.0:
            x0, y0, x1, y1 = -x1, -y1, x2, y2
        elif dot(d, x2, y2, x0, y0) > 0.0:
            x1, y1 = -x2, -y2
        else:
            break
    return Superbase(x0, y0, x1, y1)


@inner_kernel
def inverse(h):
    """The tensor h^-1."""
    determinant = h.h11 * h.h22 - h.h12 * h.h12
    return Metric(h.h22 / determinant, -h.h12 / determinant, h.h11 / determinant)


@inner_kernel
def is_inside(grid, i, j):
    return 0 <= i < grid.nx and 0 <= j < grid.ny


@inner_kernel
def side_links(grid, i, j, ex, ey, rho, side):
    """The bits of a direction for its neighbours inside the lattice."""
    links = 0
    if rho > 0.0:
        if is_inside(grid, i + ex, j + ey):
            links |= 1 << side
        if is_inside(grid, i - ex, j - ey):
            links |= 2 << side
        if is_inside(grid, i + 2 * ex, j + 2 * ey):
            links |= 1 << side + SECOND
        if is_inside(grid, i - 2 * ex, j - 2 * ey):
            links |= 2 << side + SECOND
    return links


@inner_kernel
def lay_stencil(grid, i, j, h, b, nodes):
    """Lay the stencil of node (i, j), where h is the metric per node.

    b is the superbase to start from; the one that was found is returned.
    """
    d = inverse(h)
    b = obtuse_superbase(d, b)
    x2, y2 = -b.x0 - b.x1, -b.y0 - b.y1
    node = nodes[j * grid.nx + i]
    # e_k is b_k turned by a right angle. What does not fit in 16 bits leads off the lattice.
    node.x0, node.y0, node.x1, node.y1 = -b.y0, b.x0, -b.y1, b.x1
    node.rho0 = max(-dot(d, b.x1, b.y1, x2, y2), 0.0)
    node.rho1 = max(-dot(d, x2, y2, b.x0, b.y0), 0.0)
    node.rho2 = max(-dot(d, b.x0, b.y0, b.x1, b.y1), 0.0)
    links = side_links(grid, i, j, -b.y0, b.x0, node.rho0, 0)
    links |= side_links(grid, i, j, -b.y1, b.x1, node.rho1, 2)
    node.links = links | side_links(grid, i, j, -y2, x2, node.rho2, 4)
    return b


@inner_kernel
def per_node(h, grid):
    """The metric h in units of nodes."""
    return Metric(h.h11 * grid.dx * grid.dx, h.h12 * grid.dx * grid.dy, h.h22 * grid.dy * grid.dy)


@kernel
def lay_surface_stencils(surface, grid, nodes):
    """Stencils of a surface's metric at all nodes of a lattice."""
    b = Superbase(1, 0, 0, 1)
    for j in range(grid.ny):
        y = grid.y0 + j * grid.dy
        for i in range(grid.nx):
            h = metric_at(surface, grid.x0 + i * grid.dx, y)
            b = lay_stencil(grid, i, j, per_node(h, grid), b, nodes)


@kernel
def lay_tensor_stencils(tensors, grid, nodes):
    """Stencils of a metric that is given at all nodes: tensors (ny, nx, 3), h11, h12, h22."""
    b = Superbase(1, 0, 0, 1)
    for j in range(grid.ny):
        for i in range(grid.nx):
            h = Metric(tensors[j, i, 0], tensors[j, i, 1], tensors[j, i, 2])
            b = lay_stencil(grid, i, j, per_node(h, grid), b, nodes)


class Steps(NamedTuple):
    """e_0, e_1 and e_2 as differences of node numbers."""

    s0: int
    s1: int
    s2: int


@inner_kernel
def steps_of(node, nx):
    s0 = node.y0 * nx + node.x0
    s1 = node.y1 * nx + node.x1
    return Steps(s0, s1, -s0 - s1)


class Vector(NamedTuple):
    """A lattice vector."""

    x: int
    y: int


@inner_kernel
def vector_of(node, side):
    """The lattice vector to the neighbour on a side."""
    x, y = np.int64(node.x0), np.int64(node.y0)
    if side >= 4:
        x, y = -x - node.x1, -y - node.y1
    elif side >= 2:
        x, y = np.int64(node.x1), np.int64(node.y1)
    return Vector(-x, -y) if side & 1 else Vector(x, y)


@inner_kernel
def rho_of(node, side):
    """The weight of a side's direction."""
    if side >= 4:
        return np.float64(node.rho2)
    return np.float64(node.rho1) if side >= 2 else np.float64(node.rho0)


@inner_kernel
def blocked_side(space, grid, n, vector, links, side):
    """The bits of one side whose segments, one or two vectors long, are not free."""
    x, y = grid.x0 + n % grid.nx * grid.dx, grid.y0 + n // grid.nx * grid.dy
    dx, dy = vector.x * grid.dx, vector.y * grid.dy
    one, two = 1 << side, 1 << side + SECOND
    if links & two and segment_is_free(space, x, y, x + 2.0 * dx, y + 2.0 * dy):
        return 0
    if links & one and segment_is_free(space, x, y, x + dx, y + dy):
        return two
    return one | two


@kernel
def cut_links(space, grid, nodes):
    """Take away the links of all nodes that cross or touch an obstacle."""
    for n in range(nodes.shape[0]):
        node = nodes[n]
        links = np.int64(node.links)
        for side in range(6):
            if links >> side & 1:
                links &= ~blocked_side(space, grid, n, vector_of(node, side), links, side)
        node.links = links


@kernel
def block_nodes(grid, blocked, nodes):
    """Take away all links to blocked nodes, blocked (ny nx,) uint8."""
    for n in range(nodes.shape[0]):
        node = nodes[n]
        links = np.int64(node.links)
        for side in range(6):
            if links >> side & 1:
                vector = vector_of(node, side)
                step = vector.y * grid.nx + vector.x
                if blocked[n] or blocked[n + step]:
                    links &= ~(1 << side | 1 << side + SECOND)
                elif links >> side + SECOND & 1 and blocked[n + 2 * step]:
                    links &= ~(1 << side + SECOND)
        node.links = links


@kernel
def shrink_metric(nodes, factors):
    """Multiply all lengths at each node by a factor (n,)."""
    for n in range(nodes.shape[0]):
        scale = 1.0 / (factors[n] * factors[n])
        nodes[n].rho0 *= scale
        nodes[n].rho1 *= scale
        nodes[n].rho2 *= scale


@kernel
def count_readers(nodes, nx, first):
    """Count into first[m + 1] the nodes that have m in their stencils."""
    for n in range(nodes.shape[0]):
        node = nodes[n]
        for side in range(6):
            if node.links >> side & 1:
                vector = vector_of(node, side)
                first[n + vector.y * nx + vector.x + 1] += 1


@kernel
def list_readers(nodes, nx, first, entries):
    """Fill in the entries; ``first`` holds where each list begins, and is moved to its end."""
    for n in range(nodes.shape[0]):
        node = nodes[n]
        for side in range(6):
            if node.links >> side & 1:
                vector = vector_of(node, side)
                neighbour = n + vector.y * nx + vector.x
                entries[first[neighbour]] = 8 * n + side
                first[neighbour] += 1


# The scheme


@inner_kernel
def solve_upwind(a0, a1, a2, w0, w1, w2):
    """The u with sum_k w_k max(0, u - a_k)^2 = 1; infinite a_k take no part."""
    if a1 < a0:
        a0, a1, w0, w1 = a1, a0, w1, w0
    if a2 < a0:
        a0, a2, w0, w2 = a2, a0, w2, w0
    if a2 < a1:
        a1, a2, w1, w2 = a2, a1, w2, w1
    # Relative to a0: the squares of large values would lose what makes the difference.
    d1, d2 = a1 - a0, a2 - a0
    if w0 * d1 * d1 >= 1.0:
        return a0 + 1.0 / math.sqrt(w0)
    w, b, c = w0 + w1, w1 * d1, w1 * d1 * d1
    if w0 * d2 * d2 + w1 * (d2 - d1) * (d2 - d1) < 1.0:
        w, b, c = w + w2, b + w2 * d2, c + w2 * d2 * d2
    return a0 + (b + math.sqrt(max(b * b - w * (c - 1.0), 0.0))) / w


@inner_kernel
def nearest(u, links, n, step, side):
    """The smaller settled value of the two sides of a direction, infinite where there is none."""
    a = math.inf
    if links >> side & 1:
        a = u[n + step]
    if links >> side & 2:
        a = min(a, u[n - step])
    return a


@inner_kernel
def first_order(u, node, nx, n):
    """The value of a node by first-order differences to settled neighbours."""
    s = steps_of(node, nx)
    if node.links & ALL_SIDES == ALL_SIDES:
        a0 = min(u[n + s.s0], u[n - s.s0])
        a1 = min(u[n + s.s1], u[n - s.s1])
        a2 = min(u[n + s.s2], u[n - s.s2])
    else:
        a0 = nearest(u, node.links, n, s.s0, 0)
        a1 = nearest(u, node.links, n, s.s1, 2)
        a2 = nearest(u, node.links, n, s.s2, 4)
    return solve_upwind(
        a0, a1, a2, np.float64(node.rho0), np.float64(node.rho1), np.float64(node.rho2)
    )


# Second-order differences are used where the second difference is at most this share of the
# first one: past that the field is not smooth there (Mirebeau and Portegies 2019).
SMOOTH = 0.5


class Difference(NamedTuple):
    """w (u - a)^2 stands for the squared derivative along a direction."""

    a: float
    w: float


@inner_kernel
def difference(trial, near, far, rho):
    """The difference along a direction, of second order where the field is smooth there.

    3/2 (u - (4 u_1 - u_2) / 3) replaces u - u_1; near is u_1 and far u_2, infinite where
    they may not be used.
    """
    slope = trial - near
    is_smooth = (far < near) & (abs(slope - (near - far)) <= SMOOTH * slope)
    a = (4.0 * near - far) / 3.0 if is_smooth else near
    w = 2.25 * rho if is_smooth else rho
    return Difference(a, w)


@inner_kernel
def plain_difference(u, trial, n, step, rho):
    """``difference`` where all neighbours may be used."""
    ahead, behind = u[n + step], u[n - step]
    upwind = step if ahead < behind else -step
    return difference(trial, min(ahead, behind), u[n + 2 * upwind], rho)


class Upwind(NamedTuple):
    """The sign of a neighbour's vector, the values there and behind, infinite where unusable."""

    sign: int
    near: float
    far: float


@inner_kernel
def upwind(u, links, n, step, side):
    """The settled neighbour with the smaller value on a direction."""
    ahead, behind, far, sign = math.inf, math.inf, math.inf, 1
    if links >> side & 1:
        ahead = u[n + step]
    if links >> side & 2:
        behind = u[n - step]
    if behind < ahead:
        ahead, side, sign = behind, side + 1, -1
    if links >> (side + SECOND) & 1:
        far = u[n + 2 * sign * step]
    return Upwind(sign, ahead, far)


@inner_kernel
def linked_difference(u, trial, links, n, step, side, rho):
    """``difference`` where the links tell which neighbours may be used."""
    found = upwind(u, links, n, step, side)
    return difference(trial, found.near, found.far, rho)


@inner_kernel
def model_at(source, row, column):
    """The model v at a place of the window, NaN outside."""
    if 0 <= row < source.model.shape[0] and 0 <= column < source.model.shape[1]:
        return source.model[row, column]
    return math.nan


@kernel
def factored_difference(source, nx, u, trial, node, n, side, rho):
    """``linked_difference`` of u - v, plus the derivative of the model v itself."""
    e = vector_of(node, side)
    found = upwind(u, node.links, n, e.y * nx + e.x, side)
    ex, ey = found.sign * e.x, found.sign * e.y
    row, column = n // nx - source.row, n % nx - source.column
    v0 = source.model[row, column]
    v1 = model_at(source, row + ey, column + ex)
    v2 = model_at(source, row + 2 * ey, column + 2 * ex)
    slope = ex * source.slope_x[row, column] + ey * source.slope_y[row, column]
    plain = difference(trial, found.near, found.far, rho)
    if plain.w > rho and not math.isnan(v2):
        return Difference(plain.a + (3.0 * v0 - 4.0 * v1 + v2 + 2.0 * slope) / 3.0, plain.w)
    if math.isnan(v1):
        return plain
    return Difference(found.near + slope + v0 - v1, np.float64(rho))


@inner_kernel
def second_order(u, trial, node, source, nx, n):
    """The value of a node whose first-order value is ``trial``, by second-order differences."""
    links = node.links
    r0, r1, r2 = np.float64(node.rho0), np.float64(node.rho1), np.float64(node.rho2)
    s = steps_of(node, nx)
    if links == ALL_LINKS:
        d0 = plain_difference(u, trial, n, s.s0, r0)
        d1 = plain_difference(u, trial, n, s.s1, r1)
        d2 = plain_difference(u, trial, n, s.s2, r2)
    elif links & WINDOW:
        d0 = factored_difference(source, nx, u, trial, node, n, 0, r0)
        d1 = factored_difference(source, nx, u, trial, node, n, 2, r1)
        d2 = factored_difference(source, nx, u, trial, node, n, 4, r2)
    else:
        d0 = linked_difference(u, trial, links, n, s.s0, 0, r0)
        d1 = linked_difference(u, trial, links, n, s.s1, 2, r1)
        d2 = linked_difference(u, trial, links, n, s.s2, 4, r2)
    return solve_upwind(d0.a, d1.a, d2.a, d0.w, d1.w, d2.w)


@inner_kernel
def offer(nodes, front, readers, nx, n):
    """Give every reader of a newly settled node a new trial value."""
    for m in range(readers.first[n], readers.first[n + 1]):
        entry = readers.entries[m]
        reader = entry >> 3
        if front.u[reader] < math.inf:
            continue
        if front.trial[reader] == math.inf:
            value = front.u[n] + 1.0 / math.sqrt(rho_of(nodes[reader], entry & 7))
            front.counters[QUEUED] += 1
            enqueue(nodes, front, reader, value)
            continue
        value = first_order(front.u, nodes[reader], nx, reader)
        if value < front.trial[reader]:
            dequeue(nodes, front, reader)
            enqueue(nodes, front, reader, value)


@kernel
def plant(nodes, front, readers, nx, seeds, values):
    """Settle the seeds at their values, and offer them to their readers."""
    for m in range(seeds.shape[0]):
        front.u[seeds[m]] = values[m]
    for m in range(seeds.shape[0]):
        offer(nodes, front, readers, nx, seeds[m])


@kernel
def march(nodes, front, readers, source, nx, most, limit):
    """Settle up to ``most`` nodes, none of a trial value above ``limit``; returns how many."""
    for settled in range(most):
        if front.counters[QUEUED] == 0:
            return settled
        n = least(nodes, front)
        trial = front.trial[n]
        if trial > limit:
            return settled
        dequeue(nodes, front, n)
        front.counters[QUEUED] -= 1
        front.u[n] = second_order(front.u, trial, nodes[n], source, nx, n)
        offer(nodes, front, readers, nx, n)
    return most


# The way back to the source


class Patch(NamedTuple):
    """The value of u at a point, and its slope per node."""

    value: float
    x: float
    y: float


@inner_kernel
def cubic(u):
    """Weights of the four nodes around u in [0, 1] by cubic convolution (Keys 1981)."""
    r = 1.0 - u
    return (
        -0.5 * u * r * r,
        1.0 + u * u * (1.5 * u - 2.5),
        1.0 + r * r * (1.5 * r - 2.5),
        -0.5 * r * u * u,
    )


@inner_kernel
def cubic_slope(u):
    """First derivatives of ``cubic``."""
    r = 1.0 - u
    return (
        -0.5 * r * (r - 2.0 * u),
        u * (4.5 * u - 5.0),
        r * (5.0 - 4.5 * r),
        0.5 * u * (u - 2.0 * r),
    )


@kernel
def interpolate(u, s, t):
    """The field u (ny, nx) and its slopes at column s and row t; infinite near unsettled nodes."""
    ny, nx = u.shape
    i = min(max(math.floor(s), 1), nx - 3)
    j = min(max(math.floor(t), 1), ny - 3)
    wx, wy, sx, sy = cubic(s - i), cubic(t - j), cubic_slope(s - i), cubic_slope(t - j)
    value, slope_x, slope_y = 0.0, 0.0, 0.0
    for q in range(4):
        row, row_slope = 0.0, 0.0
        for p in range(4):
            node = u[j + q - 1, i + p - 1]
            if node == math.inf:
                return Patch(math.inf, 0.0, 0.0)
            row += wx[p] * node
            row_slope += sx[p] * node
        value += wy[q] * row
        slope_x += wy[q] * row_slope
        slope_y += sy[q] * row
    return Patch(value, slope_x, slope_y)


@kernel
def fill_interpolated(grid, u, points, values):
    """The field at points (m, 2), infinite near unsettled nodes and outside the lattice."""
    for m in range(points.shape[0]):
        s = (points[m, 0] - grid.x0) / grid.dx
        t = (points[m, 1] - grid.y0) / grid.dy
        values[m] = math.inf
        if min(grid.nx, grid.ny) >= 4 and 0.0 <= s <= grid.nx - 1 and 0.0 <= t <= grid.ny - 1:
            values[m] = interpolate(u, s, t).value


@inner_kernel
def descent(surface, grid, u, x, y):
    """The unit vector on the plane of steepest descent under h; zero where there is none."""
    patch = interpolate(u, (x - grid.x0) / grid.dx, (y - grid.y0) / grid.dy)
    d = inverse(metric_at(surface, x, y))
    gx, gy = patch.x / grid.dx, patch.y / grid.dy
    vx, vy = -d.h11 * gx - d.h12 * gy, -d.h12 * gx - d.h22 * gy
    size = math.hypot(vx, vy)
    if patch.value == math.inf or size == 0.0:
        return 0.0, 0.0
    return vx / size, vy / size


@inner_kernel
def clamp(x, low, high):
    return min(max(x, low), high)


@kernel
def trace_descent(surface, grid, u, source_x, source_y, near, step, points):
    """Walk down the field from points[0] until ``near`` the source; returns how many points.

    Midpoint steps of the given length on the plane, kept on the lattice. Returns 0 where
    the walk meets unsettled nodes or does not arrive.
    """
    right, top = grid.x0 + (grid.nx - 1) * grid.dx, grid.y0 + (grid.ny - 1) * grid.dy
    x, y = points[0, 0], points[0, 1]
    for m in range(1, points.shape[0]):
        if math.hypot(x - source_x, y - source_y) <= near:
            return m
        vx, vy = descent(surface, grid, u, x, y)
        mx = clamp(x + 0.5 * step * vx, grid.x0, right)
        my = clamp(y + 0.5 * step * vy, grid.y0, top)
        vx, vy = descent(surface, grid, u, mx, my)
        if vx == 0.0 and vy == 0.0:
            return 0
        x, y = clamp(x + step * vx, grid.x0, right), clamp(y + step * vy, grid.y0, top)
        points[m, 0], points[m, 1] = x, y
    return 0


@kernel
def trace_links(surface, grid, nodes, u, n, trail):
    """Walk from node n down the links to a seed; returns how many nodes the trail has.

    Among the settled neighbours below, the one that is least with its chord added is next.
    """
    trail[0] = n
    for m in range(1, trail.shape[0]):
        best, lowest = -1, math.inf
        x, y = grid.x0 + n % grid.nx * grid.dx, grid.y0 + n // grid.nx * grid.dy
        for side in range(6):
            if nodes[n].links >> side & 1:
                e = vector_of(nodes[n], side)
                neighbour = n + e.y * grid.nx + e.x
                if u[neighbour] < u[n]:
                    length = chord(surface, x, y, x + e.x * grid.dx, y + e.y * grid.dy)
                    if u[neighbour] + length < lowest:
                        best, lowest = neighbour, u[neighbour] + length
        if best < 0:
            return m
        n = best
        trail[m] = n
    return trail.shape[0]
