"""Ground with known costs of travel: tilted planes, peaks, and a slow quadrature beside them."""

from itertools import pairwise

import numpy as np
import shapely
from scipy.integrate import quad

import terrapath as tp

SIDE = 1000.0
PEAKS = [[(120.0, 4e-5, 350.0, 400.0), (-90.0, 3e-5, 700.0, 650.0), (60.0, 9e-5, 500.0, 800.0)]]
BOUNDS = (0.0, 0.0, SIDE, SIDE)
ENDS = (100.0, 150.0), (900.0, 850.0)
WALL = shapely.box(480.0, 300.0, 520.0, 700.0)
# The pace that makes the value of a path its length.
SLOPE = tp.travel.from_function(lambda m: np.sqrt(1.0 + m * m), unit="m", beyond="switchbacks")


def plane(gradient, along=0.0, cost=None):
    """A plane that rises by these grades along x1 and x2; a cost is the same everywhere."""
    axis = np.linspace(0.0, SIDE, 6)
    x, y = np.meshgrid(axis, axis)
    layers, kinds = [gradient * x + along * y], ["rise"]
    if cost is not None:
        layers, kinds = [*layers, np.full_like(x, cost)], ["rise", "cost"]
    return tp.Surface.from_grid(np.array(layers), axis, axis, kinds=kinds)


def hills(factor=1.0):
    """Exact peaks."""
    (layer,) = PEAKS
    return tp.Surface.from_peaks([[(factor * a, *rest) for a, *rest in layer]])


def heading(degrees, size=400.0):
    """Start and goal of a straight line through the middle of the planes."""
    step = 0.5 * size * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    middle = np.array([0.5 * SIDE, 0.5 * SIDE])
    return tuple(middle - step), tuple(middle + step)


def ways_round_the_wall(problem):
    """On a plane, the values of the shortest paths south and north of ``WALL``."""
    start, goal = problem.start, problem.goal
    west, south, east, north = np.add(WALL.bounds, [-1e-5, -1e-5, 1e-5, 1e-5])
    values = []
    for y in (south, north):
        bends = sorted([(west, y), (east, y)], reverse=start > goal)
        stops = pairwise([start, *bends, goal])
        values.append(sum(problem.between(a, b).chord for a, b in stops))
    return values


def slow_value(surface, model, points):
    """The integral of c |v| P(grad z . v / |v|) along a polyline, by SciPy, with kinks found."""
    return sum(_slow_segment(surface, model, a, b) for a, b in pairwise(points))


def _slow_segment(surface, model, a, b):
    size = np.hypot(*(b - a))
    unit = (b - a) / size

    def grade(t):
        return surface.gradients(a + np.multiply.outer(t, b - a))[..., 0, :] @ unit

    def cost(t):
        return size * model(grade(t)) * surface.cost(a + t * (b - a))

    t = np.linspace(0.0, 1.0, 2001)
    marks = [*model.pace.kinks, *model.pace.knots[[0, -1]]]
    crossings = [
        _root(lambda s, k=k: grade(s) - k, t[i], t[i + 1])
        for k in marks
        for i in np.flatnonzero(np.diff(np.sign(grade(t) - k)))
    ]
    cuts = np.unique([0.0, *crossings, 1.0])
    parts = pairwise(cuts)
    return sum(quad(cost, *part, epsabs=0.0, epsrel=1e-11, limit=200)[0] for part in parts)


def _root(f, low, high):
    for _ in range(80):
        middle = 0.5 * (low + high)
        if np.sign(f(middle)) == np.sign(f(low)):
            low = middle
        else:
            high = middle
    return low
