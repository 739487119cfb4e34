"""The tree of RRT*-R: Algorithms 1 to 3 of the paper, with edges pruned by the chord.

What the paper leaves open, and what is done here: Algorithm 3 as printed never updates
Cost(v_new) after it changes v_min; the update is clearly meant, and is made here. The goal joins
the tree as a vertex as soon as one extension can reach it, and is then rewired like any other
vertex. The length of an edge is max(Line-R, chord): both estimate its true length, and the chord
is never above it. An informed tree begins with a path, its first branch. Where that is shorter, it
joins a new vertex to its parent's parent.
"""

import math

from ..compiler import inner_kernel, kernel
from .buckets import lay_out, nearest, put, resize, squared_distance, within
from .candidates import (
    candidate_is_free,
    candidate_length,
    is_ruled_out,
    measure_chord,
    measure_chords,
    onward_chord,
)
from .sampling import distance_to_goal, is_beside_path, near_radius, sample
from .tree import (
    CONSIDERED,
    COST,
    GOAL,
    LAID_OUT,
    PRUNED,
    REWIRED,
    SAMPLES,
    VERTICES,
    X,
    Y,
    adopt,
    pass_on_cost,
    place,
    plant,
    release,
    renumber,
)

# Growing the tree

# Side of a bucket, in near radii.
SIDE = 0.35


@inner_kernel
def nearest_of(tree, count):
    """The index of the nearest candidate; of several, the vertex with the lowest number."""
    best = 0
    for k in range(1, count):
        squared, least = tree.near[k].squared, tree.near[best].squared
        is_first = tree.near[k].vertex < tree.near[best].vertex
        if squared < least or (squared == least and is_first):
            best = k
    return best


@kernel
def steer(tree, options, x, y):
    """The nearest vertex, and the point at most a step from it towards (x, y)."""
    origin = nearest(tree.buckets, tree.places, x, y)
    ox, oy = tree.places[origin, X], tree.places[origin, Y]
    distance = math.hypot(x - ox, y - oy)
    if distance > options.step:
        x = min(max(ox + (x - ox) * (options.step / distance), options.x0), options.x1)
        y = min(max(oy + (y - oy) * (options.step / distance), options.y0), options.y1)
    return origin, x, y


@kernel
def find_near(tree, options, radius, x, y):
    """Collect the candidates near the new point; return its x and y, their count, the nearest.

    Where vertices are within the radius, which is at most a step, the nearest is one of them.
    Otherwise the new point is steered towards from the nearest vertex of the tree, which then is
    always a candidate.
    """
    count = within(tree.buckets, tree.places, x, y, radius, tree.near)
    if count > 0:
        return x, y, count, nearest_of(tree, count)
    origin, x, y = steer(tree, options, x, y)
    count = within(tree.buckets, tree.places, x, y, radius, tree.near)
    for k in range(count):
        if tree.near[k].vertex == origin:
            return x, y, count, k
    tree.near[count].vertex = origin
    tree.near[count].squared = squared_distance(tree.places, origin, x, y)
    return x, y, count + 1, count


@kernel
def choose_parent(surface, space, tree, options, new, count, promising):
    """Make the candidate through which the new vertex is cheapest to reach its parent.

    False where no candidate's length is finite, as on ground too steep for floating point.

    The most promising candidate is tried first. An edge is measured only where the candidate's
    cost plus the chord is less than the best cost so far. No edge is shorter than its chord, so
    this changes nothing but the time taken.
    """
    best, pruned = -1, 0
    least = math.inf
    for turn in range(-1, count):
        k = promising if turn == -1 else turn
        if turn == promising:
            continue
        come = tree.near[k].cost
        if is_ruled_out(surface, tree, options, new, k, False, come, least):
            pruned += 1
            continue
        length = candidate_length(surface, tree, options, new, k, False)
        if come + length < least and candidate_is_free(space, tree, new, k):
            best, least = k, come + length
    tree.counters[PRUNED] += pruned
    if best < 0:
        return False
    adopt(tree, tree.near[best].vertex, new, tree.near[best].length)
    return True


@kernel
def is_shorter(surface, space, tree, options, new, ancestor, spare):
    """Is the new vertex cheaper to reach directly from an ancestor, at most a step away?"""
    candidate, p = tree.near[spare], tree.places[new]
    candidate.vertex = ancestor
    candidate.squared = squared_distance(tree.places, ancestor, p[X], p[Y])
    if candidate.squared > options.step * options.step:
        return False
    measure_chord(surface, tree, new, spare)
    least = p[COST]
    tree.counters[CONSIDERED] += 1
    if is_ruled_out(surface, tree, options, new, spare, False, candidate.cost, least):
        tree.counters[PRUNED] += 1
        return False
    length = candidate_length(surface, tree, options, new, spare, False)
    return candidate.cost + length < least and candidate_is_free(space, tree, new, spare)


@kernel
def skip_parents(surface, space, tree, options, new, spare):
    """Make the parent's parent the new vertex's parent, and so on, as long as that is shorter.

    So paths have few bends even where the tree has few vertices (Jeong, Lee and Kim 2019).
    spare : the index of an unused candidate, for workspace.
    """
    ancestor = tree.links[tree.links[new].parent].parent
    while ancestor >= 0 and is_shorter(surface, space, tree, options, new, ancestor, spare):
        release(tree.links, new)
        adopt(tree, ancestor, new, tree.near[spare].length)
        ancestor = tree.links[ancestor].parent


@kernel
def rewire(surface, space, tree, options, new, count):
    """Make the new vertex the parent of candidates where that shortens the path to them.

    Costs are compared as they were before this extension, Cost in the graph G of Algorithm 3.
    Rewiring one candidate can shorten the path to another. That is ignored; otherwise the tree
    would depend on the order in which candidates are visited.
    """
    come, parent = tree.places[new, COST], tree.links[new].parent
    rewired, pruned = 0, 0
    for k in range(count):
        near = tree.near[k].vertex
        if near == parent:
            continue
        if is_ruled_out(surface, tree, options, new, k, True, come, tree.near[k].cost):
            pruned += 1
            continue
        length = candidate_length(surface, tree, options, new, k, True)
        if come + length < tree.near[k].cost and candidate_is_free(space, tree, new, k):
            release(tree.links, near)
            adopt(tree, new, near, length)
            tree.queue[rewired] = near
            rewired += 1
    pass_on_cost(tree, rewired)
    tree.counters[REWIRED] += rewired
    tree.counters[PRUNED] += pruned


@kernel
def refresh_buckets(tree, options, radius):
    """Sort the vertices into new buckets each time the tree has grown by half."""
    count = tree.counters[VERTICES]
    if 2 * count >= 3 * tree.counters[LAID_OUT]:
        width, height = options.x1 - options.x0, options.y1 - options.y0
        resize(tree.buckets, width, height, SIDE * radius)
        lay_out(tree.buckets, tree.places, count, tree.queue)
        renumber(tree, count, tree.queue)
        tree.counters[LAID_OUT] = count


# A sample beside the best path is left out where more than this many times log n of the tree's n
# vertices are within the near radius. Uniform samples alone make 13.5 log n with the default
# radius where none is left out. So a sample has O(log n) candidates, and no uniform one is
# left out.
CROWD = 30.0

# In a crowd a sample is still kept where it shortens the best path by this share. That can happen
# only so often, however large the tree: all of these gains together are no more than the path.
GAIN = 1e-7


@kernel
def shortens_path(surface, space, tree, options, new, radius, spare):
    """Is the best path shorter by GAIN through the new point, between two vertices near it?

    spare : the index of an unused candidate, for workspace.
    """
    vertex, p, candidate = tree.counters[GOAL], tree.places[new], tree.near[spare]
    gain = GAIN * tree.places[vertex, COST]
    most = -math.inf  # what the path to the new point must cost less than
    while vertex >= 0:
        squared = squared_distance(tree.places, vertex, p[X], p[Y])
        candidate.vertex, candidate.squared = vertex, squared
        vertex = tree.links[vertex].parent
        if squared > radius * radius:
            continue
        at_least = measure_chord(surface, tree, new, spare)
        if at_least >= most - gain and candidate.cost - onward_chord(surface, tree, spare) <= most:
            continue
        length = candidate_length(surface, tree, options, new, spare, False)
        if candidate_is_free(space, tree, new, spare):
            if candidate.cost + length < most - gain:
                return True
            on = candidate_length(surface, tree, options, new, spare, True)
            most = max(most, candidate.cost - on)
    return False


@kernel
def extend(surface, space, tree, options, x, y, is_beside):
    """Algorithm 3: steer from the nearest vertex towards (x, y). True where the tree grew.

    is_beside : the sample is one of those beside the best path, which a crowd leaves out.
    """
    new = tree.counters[VERTICES]
    radius = near_radius(tree, options)
    refresh_buckets(tree, options, radius)
    x, y, count, closest = find_near(tree, options, radius, x, y)
    if tree.near[closest].squared == 0.0:
        return False
    place(surface, tree, new, x, y)
    is_crowded = is_beside and count > CROWD * math.log(new)
    if is_crowded and not shortens_path(surface, space, tree, options, new, radius, count):
        return False
    promising = measure_chords(surface, tree, new, count)
    if promising < 0 or not candidate_is_free(space, tree, new, closest):
        return False
    tree.counters[CONSIDERED] += 2 * count - 1
    if not choose_parent(surface, space, tree, options, new, count, promising):
        return False
    if options.informed:
        skip_parents(surface, space, tree, options, new, count)
    rewire(surface, space, tree, options, new, count)
    put(tree.buckets, tree.places, new)
    tree.counters[VERTICES] = new + 1
    return True


@kernel
def join_goal(surface, space, tree, options):
    """Make the goal a vertex where the newest vertex is at most one step away from it."""
    newest = tree.counters[VERTICES] - 1
    if 0.0 < distance_to_goal(tree, options, newest) <= options.step:
        extend(surface, space, tree, options, options.goal_x, options.goal_y, False)
        newest = tree.counters[VERTICES] - 1
    if distance_to_goal(tree, options, newest) == 0.0:
        tree.counters[GOAL] = newest


@kernel
def hang_branch(surface, space, tree, options):
    """Make the points of the first branch vertices, each the child of the one before.

    It ends before an edge that is not free, or has no length in floating point.
    """
    for m in range(1, tree.branch.shape[0]):
        new = tree.counters[VERTICES]
        place(surface, tree, new, tree.branch[m, 0], tree.branch[m, 1])
        candidate, p = tree.near[0], tree.places[new]
        candidate.vertex = new - 1
        candidate.squared = squared_distance(tree.places, new - 1, p[X], p[Y])
        measure_chord(surface, tree, new, 0)
        length = candidate_length(surface, tree, options, new, 0, False)
        if not (length < math.inf and candidate_is_free(space, tree, new, 0)):
            return
        adopt(tree, new - 1, new, length)
        tree.counters[CONSIDERED] += 1
        tree.counters[VERTICES] = new + 1
        if distance_to_goal(tree, options, new) == 0.0:
            tree.counters[GOAL] = new


@kernel
def grow(surface, space, tree, options, draws):
    """Algorithm 2: draw len(draws) samples. draws (m, 3): uniform numbers in [0, 1).

    The first call makes the start the tree's first vertex, and hangs the first branch below it.
    """
    if tree.counters[VERTICES] == 0:
        plant(surface, tree, options)
        hang_branch(surface, space, tree, options)
    for m in range(draws.shape[0]):
        tree.counters[SAMPLES] += 1
        x, y, worthwhile = sample(surface, tree, options, draws[m])
        is_beside = is_beside_path(tree, options, draws[m])
        grew = worthwhile and extend(surface, space, tree, options, x, y, is_beside)
        if grew and tree.counters[GOAL] < 0:
            join_goal(surface, space, tree, options)
