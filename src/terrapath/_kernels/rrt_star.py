"""The tree of RRT*-R: Algorithms 1 to 3 of the paper, with edges pruned by the chord.

What the paper leaves open, and what is done here: Algorithm 3 as printed never updates
Cost(v_new) after it changes v_min; that update is meant, and made. The goal joins the
tree as a vertex as soon as one extension can reach it, and from then on is rewired like
any other. An edge is as long as Line-R says but never shorter than its chord: both
estimate its true length, and the chord is never above it.
"""

import math

from .buckets import nearest, put, rebuild, within
from .compiler import inner_kernel, kernel
from .free_space import segment_is_free
from .lengths import composite_boole
from .sampling import area_to_search, distance_to_goal, sample
from .surfaces import Metric
from .tree import (
    CHECKED,
    CONSIDERED,
    GOAL,
    INTEGRATED,
    LAID_OUT,
    PRUNED,
    REWIRED,
    SAMPLES,
    VERTICES,
    adopt,
    chord_between,
    pass_on_cost,
    place,
    release,
)

# Measuring edges


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

    False where no candidate's length is finite, as on ground too steep for floating point.

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
    if best < 0:
        return False
    adopt(tree.vertices, tree.near[best].vertex, new, tree.near[best].length)
    return True


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
    if not choose_parent(surface, space, tree, options, new, count):
        return False
    rewire(surface, space, tree, options, new, count)
    put(tree.buckets, tree.vertices, new)
    tree.counters[VERTICES] = new + 1
    return True


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
