"""Where the next sample is drawn: everywhere, at the goal, or where better paths can be."""

import math

from ..compiler import inner_kernel, kernel
from ..surface.surfaces import spot_at, value_at
from ..travel.paces import pace_along
from ..travel.priced import per_price
from .buckets import squared_distance
from .tree import COST, GOAL, LIFTED, VERTICES, X, Y

# Share of the samples of an informed tree that are drawn near the best path. With half of them
# the tree has too few vertices elsewhere, and too often keeps to the first valley it found.
PATH_SHARE = 0.3


@inner_kernel
def distance_to_goal(tree, options, vertex):
    """Planar distance."""
    return math.hypot(
        tree.places[vertex, X] - options.goal_x, tree.places[vertex, Y] - options.goal_y
    )


@inner_kernel
def area_to_search(tree, options):
    """The area of the bounds, or of the ellipse that holds all better paths if that is less.

    A path of length c stays where the planar distances to start and goal sum to at most c over
    the least that a step on the plane costs.
    """
    area = (options.x1 - options.x0) * (options.y1 - options.y0)
    if options.informed and tree.counters[GOAL] >= 0:
        longest = tree.places[tree.counters[GOAL], COST] / tree.least
        focal = distance_to_goal(tree, options, 0)
        area = min(area, 0.25 * math.pi * longest * math.sqrt(max(longest**2 - focal**2, 0.0)))
    return area


@inner_kernel
def near_radius(tree, options):
    """min(step, radius * sqrt(area * log n / n)) (Karaman and Frazzoli 2011, d = 2)."""
    n = max(tree.counters[VERTICES], 2)
    area = area_to_search(tree, options)
    return min(options.step, options.radius * math.sqrt(area * math.log(n) / n))


@inner_kernel
def is_within_bounds(options, x, y):
    """Is (x, y) within the bounds? False where x or y is NaN."""
    return options.x0 <= x <= options.x1 and options.y0 <= y <= options.y1


@inner_kernel
def metric_chords(surface, tree, x, y, from_start, to_goal):
    goal, spot = tree.counters[GOAL], spot_at(surface, x, y)
    for layer in range(surface.weights.shape[0]):
        z = surface.weights[layer] * value_at(surface, layer, spot)
        from_start += (z - tree.places[0, LIFTED + layer]) ** 2
        to_goal += (z - tree.places[goal, LIFTED + layer]) ** 2
    return math.sqrt(from_start) + math.sqrt(to_goal)


@inner_kernel
def priced_chords(surface, tree, x, y, from_start, to_goal):
    z = surface.weights[0] * value_at(surface, 0, spot_at(surface, x, y))
    up, on = z - tree.places[0, LIFTED], tree.places[tree.counters[GOAL], LIFTED] - z
    to_here = pace_along(surface.price.pace, math.sqrt(from_start), up)
    return to_here + pace_along(surface.price.pace, math.sqrt(to_goal), on)


@per_price(metric_chords, priced_chords)
def chords_through(surface, tree, x, y, from_start, to_goal):
    """The chords from the start to (x, y) and on to the goal, at cost 1.

    from_start, to_goal : squared distances on the plane.
    """


@kernel
def can_improve(surface, tree, x, y):
    """Can a path through (x, y) be shorter than the best one, by the chords to start and goal?"""
    goal = tree.counters[GOAL]
    from_start = squared_distance(tree.places, 0, x, y)
    to_goal = squared_distance(tree.places, goal, x, y)
    if math.sqrt(from_start) + math.sqrt(to_goal) >= tree.places[goal, COST] / tree.least:
        return False
    least = chords_through(surface, tree, x, y, from_start, to_goal)
    return least < tree.places[goal, COST] / tree.floor


@inner_kernel
def point_of_ellipse(tree, options, u, v):
    """The point of the ellipse of better paths for (u, v) in the unit square, uniformly."""
    longest = tree.places[tree.counters[GOAL], COST] / tree.least
    ax, ay = tree.places[0, X], tree.places[0, Y]
    focal = distance_to_goal(tree, options, 0)
    width = math.sqrt(max(longest**2 - focal**2, 0.0))
    along = 0.5 * longest * math.sqrt(u) * math.cos(2.0 * math.pi * v)
    across = 0.5 * width * math.sqrt(u) * math.sin(2.0 * math.pi * v)
    ex, ey = (options.goal_x - ax) / focal, (options.goal_y - ay) / focal
    x = 0.5 * (ax + options.goal_x) + along * ex - across * ey
    y = 0.5 * (ay + options.goal_y) + along * ey + across * ex
    return x, y


@inner_kernel
def point_by_path(tree, options, share, offset):
    """A point near the best path, at right angles to it, after that share of its length.

    For an offset from -1 to 1 it is at most a near radius away. Its distances are of all scales:
    half of them are less than a 32nd of the radius.
    """
    vertex = tree.counters[GOAL]
    run = share * tree.places[vertex, COST]
    parent = tree.links[vertex].parent
    while tree.places[parent, COST] > run:
        vertex = parent
        parent = tree.links[vertex].parent
    p, q = tree.places[parent], tree.places[vertex]
    along = (run - p[COST]) / (q[COST] - p[COST])
    dx, dy = q[X] - p[X], q[Y] - p[Y]
    across = near_radius(tree, options) * offset**5 / math.hypot(dx, dy)
    return p[X] + along * dx - across * dy, p[Y] + along * dy + across * dx


@inner_kernel
def is_beside_path(tree, options, draw):
    """Is the sample of these uniform numbers (3,) one of those near the best path?"""
    return options.informed and tree.counters[GOAL] >= 0 and draw[0] < PATH_SHARE


@kernel
def sample(surface, tree, options, draw):
    """A point to extend towards, and whether it can improve the path.

    draw (3,): uniform numbers in [0, 1). Until the goal is in the tree, a share ``goal_bias``
    of the samples is the goal. After that, a share of the informed samples is drawn near the best
    path (Akgun and Stilman 2011), and the others in the ellipse that holds all better paths.
    Samples that the chord rules out are dropped (Gammell, Srinivasa and Barfoot 2014, with the
    chord in place of the distance).
    """
    width, height = options.x1 - options.x0, options.y1 - options.y0
    x, y = options.x0 + draw[1] * width, options.y0 + draw[2] * height
    if tree.counters[GOAL] < 0:
        if draw[0] < options.goal_bias:
            x, y = options.goal_x, options.goal_y
        return x, y, True
    if not options.informed:
        return x, y, True
    if is_beside_path(tree, options, draw):
        x, y = point_by_path(tree, options, draw[1], 2.0 * draw[2] - 1.0)
    elif area_to_search(tree, options) < width * height:
        x, y = point_of_ellipse(tree, options, draw[1], draw[2])
    return x, y, is_within_bounds(options, x, y) and can_improve(surface, tree, x, y)
