"""The tree of RRT*-R: Algorithms 1 to 3 of the paper, with edges pruned by the chord.

What the paper leaves open, and what is done here: Algorithm 3 as printed never updates
Cost(v_new) after it changes v_min; that update is meant, and made. The goal joins the
tree as a vertex as soon as one extension can reach it, and from then on is rewired like
any other. An edge is as long as Line-R says but never shorter than its chord: both
estimate its true length, and the chord is never above it.
"""

import math
from typing import NamedTuple

import numpy as np

from .buckets import Buckets, nearest, put, rebuild, within
from .compiler import inner_kernel, kernel
from .free_space import segment_is_free
from .lengths import composite_boole
from .surfaces import Metric, metric_at, value_at

# Places in Tree.counters.
VERTICES = 0  # vertices in the tree
GOAL = 1  # the goal's vertex, -1 until it is in the tree
SAMPLES = 2  # samples drawn
CONSIDERED = 3  # edges considered
PRUNED = 4  # edges that the chord ruled out
INTEGRATED = 5  # edges measured by Line-R
CHECKED = 6  # edges tested against obstacles
REWIRED = 7  # edges replaced by a better one
LAID_OUT = 8  # vertices when the buckets were last laid out
COUNTERS = 9


# A vertex: all that its neighbours read of it lies in one or two cache lines.
VERTEX = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("h11", np.float64),  # the metric at the vertex
        ("h12", np.float64),
        ("h22", np.float64),
        ("cost", np.float64),  # length from the start
        ("edge", np.float64),  # length of the edge from the parent
        ("parent", np.int32),  # -1 at the start
        ("child", np.int32),  # first child, -1 where none
        ("sibling", np.int32),  # next child of the same parent
        ("next", np.int32),  # next vertex of the same bucket
    ]
)

# A candidate edge between the newest vertex and one near it.
CANDIDATE = np.dtype(
    [
        ("chord", np.float64),
        ("cost", np.float64),  # of the other vertex, before this extension
        ("length", np.float64),  # negative where not yet measured
        ("vertex", np.int32),
        ("free", np.int32),  # 1 free, 0 blocked, -1 not yet tested
    ]
)


class Tree(NamedTuple):
    """The tree and its workspace; all arrays are filled in place."""

    vertices: np.ndarray  # (n,) VERTEX
    lifted: np.ndarray  # (n, layers) float64: weighted layer values
    counters: np.ndarray  # (COUNTERS,) int64
    buckets: Buckets
    near: np.ndarray  # (n,) CANDIDATE: workspace
    stack: np.ndarray  # (n,) int32: workspace


class Options(NamedTuple):
    """What the planner was asked for."""

    x0: float  # bounds
    y0: float
    x1: float
    y1: float
    goal_x: float
    goal_y: float
    step: float
    radius: float  # the near radius is radius * sqrt(area * log(n) / n), at most the step
    goal_bias: float
    panel: float  # longest stretch that one application of the rule measures
    riemannian: bool  # edges measured by Line-R; otherwise by the chord
    prune: bool
    informed: bool


# Measuring edges


@inner_kernel
def chord_between(tree, a, b):
    """Chord between two vertices."""
    dx = tree.vertices[a].x - tree.vertices[b].x
    dy = tree.vertices[a].y - tree.vertices[b].y
    total = dx * dx + dy * dy
    for layer in range(tree.lifted.shape[1]):
        rise = tree.lifted[a, layer] - tree.lifted[b, layer]
        total += rise * rise
    return math.sqrt(total)


@kernel
def edge_length(surface, vertices, a, b, panel):
    """Length of the edge between two vertices by Line-R, in panels."""
    p, q = vertices[a], vertices[b]
    hp, hq = Metric(p.h11, p.h12, p.h22), Metric(q.h11, q.h12, q.h22)
    panels = max(math.ceil(math.hypot(q.x - p.x, q.y - p.y) / panel), 1)
    return composite_boole(surface, p.x, p.y, hp, q.x, q.y, hq, panels)


@inner_kernel
def candidate_length(surface, tree, options, new, k):
    """Length of the k-th candidate edge as the planner believes it, measured at most once."""
    candidate = tree.near[k]
    if candidate.length < 0.0:
        candidate.length = candidate.chord
        if options.riemannian:
            tree.counters[INTEGRATED] += 1
            line_r = edge_length(surface, tree.vertices, new, candidate.vertex, options.panel)
            candidate.length = max(line_r, candidate.chord)
    return candidate.length


@inner_kernel
def candidate_is_free(space, tree, new, k):
    """Does the k-th candidate edge stay in free space? Tested at most once."""
    candidate = tree.near[k]
    if candidate.free < 0:
        tree.counters[CHECKED] += 1
        p, q = tree.vertices[new], tree.vertices[candidate.vertex]
        candidate.free = segment_is_free(space, p.x, p.y, q.x, q.y)
    return candidate.free == 1


# Growing the tree


@kernel
def place(surface, tree, new, x, y):
    """Write a vertex's position and what is cached with it; it is not yet in the tree."""
    vertex = tree.vertices[new]
    vertex.x = x
    vertex.y = y
    for layer in range(tree.lifted.shape[1]):
        tree.lifted[new, layer] = surface.weights[layer] * value_at(surface, layer, x, y)
    h = metric_at(surface, x, y)
    vertex.h11 = h.h11
    vertex.h12 = h.h12
    vertex.h22 = h.h22
    vertex.child = -1


@kernel
def adopt(vertices, parent, child, edge):
    """Hang a vertex below a parent."""
    vertex = vertices[child]
    vertex.parent = parent
    vertex.edge = edge
    vertex.cost = vertices[parent].cost + edge
    vertex.sibling = vertices[parent].child
    vertices[parent].child = child


@kernel
def release(vertices, child):
    """Take a vertex from its parent's children."""
    parent = vertices[vertices[child].parent]
    if parent.child == child:
        parent.child = vertices[child].sibling
        return
    elder = parent.child
    while vertices[elder].sibling != child:
        elder = vertices[elder].sibling
    vertices[elder].sibling = vertices[child].sibling


@kernel
def pass_on_cost(vertices, stack, root):
    """Recompute the cost of everything below a vertex."""
    stack[0] = root
    count = 1
    while count > 0:
        count -= 1
        cost = vertices[stack[count]].cost
        child = vertices[stack[count]].child
        while child >= 0:
            vertices[child].cost = cost + vertices[child].edge
            stack[count] = child
            count += 1
            child = vertices[child].sibling


@inner_kernel
def distance_to_goal(tree, options, vertex):
    """Planar distance."""
    return math.hypot(
        tree.vertices[vertex].x - options.goal_x, tree.vertices[vertex].y - options.goal_y
    )


@inner_kernel
def area_to_search(tree, options):
    """The bounds' area, or that of the ellipse which holds all better paths if it is smaller.

    A path of length c stays where the planar distances to start and goal, which are at
    most the chords, sum to at most c.
    """
    area = (options.x1 - options.x0) * (options.y1 - options.y0)
    if options.informed and tree.counters[GOAL] >= 0:
        longest = tree.vertices[tree.counters[GOAL]].cost
        focal = distance_to_goal(tree, options, 0)
        area = min(area, 0.25 * math.pi * longest * math.sqrt(max(longest**2 - focal**2, 0.0)))
    return area


@inner_kernel
def near_radius(tree, options, vertices):
    """min(step, radius * sqrt(area * log n / n)) (Karaman and Frazzoli 2011, d = 2)."""
    n = max(vertices, 2)
    area = area_to_search(tree, options)
    return min(options.step, options.radius * math.sqrt(area * math.log(n) / n))


@kernel
def find_near(tree, new, radius, nearest_vertex):
    """Collect the vertices near the new one, the nearest always among them; return how many."""
    x, y = tree.vertices[new].x, tree.vertices[new].y
    count = within(tree.buckets, tree.vertices, x, y, radius, tree.near)
    listed = False
    for k in range(count):
        listed = listed or tree.near[k].vertex == nearest_vertex
    if not listed:
        tree.near[count].vertex = nearest_vertex
        count += 1
    for k in range(count):
        candidate = tree.near[k]
        candidate.chord = chord_between(tree, new, candidate.vertex)
        candidate.cost = tree.vertices[candidate.vertex].cost
        candidate.length = -1.0
        # The nearest vertex's edge was tested before the new vertex was placed.
        candidate.free = 1 if candidate.vertex == nearest_vertex else -1
    return count


@kernel
def most_promising(tree, count):
    """The candidate whose cost plus chord is least."""
    best = -1
    least = math.inf
    for k in range(count):
        bound = tree.near[k].cost + tree.near[k].chord
        if bound < least:
            best, least = k, bound
    return best


@kernel
def choose_parent(surface, space, tree, options, new, count):
    """Hang the new vertex below the candidate through which it is cheapest to reach.

    The most promising candidate is tried first. An edge whose cost-to-come plus chord
    cannot win is never integrated, and since no edge is shorter than its chord, that
    changes nothing but the time taken.
    """
    promising = most_promising(tree, count)
    best = -1
    least = math.inf
    for turn in range(-1, count):
        k = promising if turn == -1 else turn
        if turn == promising:
            continue
        come = tree.near[k].cost
        if options.prune and come + tree.near[k].chord >= least:
            tree.counters[PRUNED] += 1
            continue
        length = candidate_length(surface, tree, options, new, k)
        if come + length < least and candidate_is_free(space, tree, new, k):
            best, least = k, come + length
    adopt(tree.vertices, tree.near[best].vertex, new, tree.near[best].length)


@kernel
def rewire(surface, space, tree, options, new, count):
    """Hang candidates below the new vertex where that shortens their way.

    Costs are compared as they were before this extension, Cost in the graph G of Algorithm 3.
    Rewiring one candidate can shorten the way to another; looking at that would let the order
    in which the candidates are visited decide the tree.
    """
    come = tree.vertices[new].cost
    for k in range(count):
        near = tree.near[k].vertex
        if near == tree.vertices[new].parent:
            continue
        if options.prune and come + tree.near[k].chord >= tree.near[k].cost:
            tree.counters[PRUNED] += 1
            continue
        length = candidate_length(surface, tree, options, new, k)
        if come + length < tree.near[k].cost and candidate_is_free(space, tree, new, k):
            tree.counters[REWIRED] += 1
            release(tree.vertices, near)
            adopt(tree.vertices, new, near, length)
            pass_on_cost(tree.vertices, tree.stack, near)


@kernel
def refresh_buckets(tree, options):
    """Lay the buckets out anew each time the tree has grown fourfold."""
    count = tree.counters[VERTICES]
    if count >= 4 * tree.counters[LAID_OUT]:
        side = 0.5 * near_radius(tree, options, 2 * count)
        width, height = options.x1 - options.x0, options.y1 - options.y0
        rebuild(tree.buckets, tree.vertices, count, width, height, side)
        tree.counters[LAID_OUT] = count


@kernel
def extend(surface, space, tree, options, x, y):
    """Algorithm 3: steer from the nearest vertex towards (x, y). True where the tree grew."""
    refresh_buckets(tree, options)
    new = tree.counters[VERTICES]
    origin = nearest(tree.buckets, tree.vertices, x, y)
    ox, oy = tree.vertices[origin].x, tree.vertices[origin].y
    distance = math.hypot(x - ox, y - oy)
    if distance == 0.0:
        return False
    if distance > options.step:
        x = min(max(ox + (x - ox) * (options.step / distance), options.x0), options.x1)
        y = min(max(oy + (y - oy) * (options.step / distance), options.y0), options.y1)
    tree.counters[CHECKED] += 1
    if not segment_is_free(space, ox, oy, x, y):
        return False
    place(surface, tree, new, x, y)
    count = find_near(tree, new, near_radius(tree, options, new), origin)
    tree.counters[CONSIDERED] += 2 * count - 1
    choose_parent(surface, space, tree, options, new, count)
    rewire(surface, space, tree, options, new, count)
    put(tree.buckets, tree.vertices, new)
    tree.counters[VERTICES] = new + 1
    return True


@kernel
def can_improve(surface, tree, x, y):
    """Could a path through (x, y) beat the best one? By the chord bound, in R^n."""
    goal = tree.counters[GOAL]
    a, b = tree.vertices[0], tree.vertices[goal]
    from_start = (x - a.x) * (x - a.x) + (y - a.y) * (y - a.y)
    to_goal = (x - b.x) * (x - b.x) + (y - b.y) * (y - b.y)
    if math.sqrt(from_start) + math.sqrt(to_goal) >= b.cost:
        return False
    for layer in range(tree.lifted.shape[1]):
        z = surface.weights[layer] * value_at(surface, layer, x, y)
        from_start += (z - tree.lifted[0, layer]) ** 2
        to_goal += (z - tree.lifted[goal, layer]) ** 2
    return math.sqrt(from_start) + math.sqrt(to_goal) < b.cost


@inner_kernel
def point_of_ellipse(tree, options, u, v):
    """The point of the ellipse of better paths for (u, v) in the unit square, uniformly."""
    longest = tree.vertices[tree.counters[GOAL]].cost
    ax, ay = tree.vertices[0].x, tree.vertices[0].y
    focal = distance_to_goal(tree, options, 0)
    width = math.sqrt(max(longest**2 - focal**2, 0.0))
    along = 0.5 * longest * math.sqrt(u) * math.cos(2.0 * math.pi * v)
    across = 0.5 * width * math.sqrt(u) * math.sin(2.0 * math.pi * v)
    ex, ey = (options.goal_x - ax) / focal, (options.goal_y - ay) / focal
    x = 0.5 * (ax + options.goal_x) + along * ex - across * ey
    y = 0.5 * (ay + options.goal_y) + along * ey + across * ex
    return x, y


@kernel
def sample(surface, tree, options, draw):
    """A point to extend towards, and whether it is worth it.

    draw (3,): uniform numbers in [0, 1). Until the goal is in the tree, a share
    ``goal_bias`` of the samples is the goal. From then on, informed samples come from the
    ellipse that holds all better paths, and those that the chord rules out are dropped
    (Gammell, Srinivasa and Barfoot 2014, with the chord in place of the distance).
    """
    width, height = options.x1 - options.x0, options.y1 - options.y0
    x, y = options.x0 + draw[1] * width, options.y0 + draw[2] * height
    if tree.counters[GOAL] < 0:
        if draw[0] < options.goal_bias:
            x, y = options.goal_x, options.goal_y
        return x, y, True
    if not options.informed:
        return x, y, True
    if area_to_search(tree, options) < width * height:
        x, y = point_of_ellipse(tree, options, draw[1], draw[2])
        if x < options.x0 or x > options.x1 or y < options.y0 or y > options.y1:
            return x, y, False
    return x, y, can_improve(surface, tree, x, y)


@kernel
def join_goal(surface, space, tree, options):
    """Make the goal a vertex where the newest vertex is one step away from it, or is it."""
    newest = tree.counters[VERTICES] - 1
    if 0.0 < distance_to_goal(tree, options, newest) <= options.step:
        extend(surface, space, tree, options, options.goal_x, options.goal_y)
        newest = tree.counters[VERTICES] - 1
    if distance_to_goal(tree, options, newest) == 0.0:
        tree.counters[GOAL] = newest


@kernel
def grow(surface, space, tree, options, draws):
    """Algorithm 2: draw len(draws) samples. draws (m, 3): uniform numbers in [0, 1)."""
    for m in range(draws.shape[0]):
        tree.counters[SAMPLES] += 1
        x, y, worthwhile = sample(surface, tree, options, draws[m])
        grew = worthwhile and extend(surface, space, tree, options, x, y)
        if grew and tree.counters[GOAL] < 0:
            join_goal(surface, space, tree, options)


@kernel
def plant(surface, tree, options, x, y):
    """Start the tree with one vertex."""
    place(surface, tree, 0, x, y)
    root = tree.vertices[0]
    root.cost = 0.0
    root.edge = 0.0
    root.parent = -1
    root.sibling = -1
    tree.buckets.frame[0] = options.x0
    tree.buckets.frame[1] = options.y0
    tree.counters[:] = 0
    tree.counters[GOAL] = -1
    tree.counters[VERTICES] = 1
