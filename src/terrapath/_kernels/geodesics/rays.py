"""Rays: geodesics followed from their start, to a length or to where they leave the bounds.

The method is the embedded Runge-Kutta method 8(5, 3) of Dormand and Prince. Its two error
estimates are combined as by Hairer, Norsett and Wanner (1993, section II.10).
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from ..compiler import allocating_kernel, inner_kernel, kernel
from .equation import State, derivative, unit_state


class Tableau(NamedTuple):
    """An explicit Runge-Kutta method. As arguments, because Numba cannot cache such constants."""

    a: np.ndarray  # (stages, stages) float64
    b: np.ndarray  # (stages,)
    e3: np.ndarray  # (stages + 1,): error estimates of order 3 and 5
    e5: np.ndarray


@cache
def dormand_prince():
    """SciPy's tableau of order 8. It is imported here, because the import takes long."""
    from scipy.integrate import DOP853

    return Tableau(*map(np.ascontiguousarray, (DOP853.A, DOP853.B, DOP853.E3, DOP853.E5)))


_SAFETY, _LEAST_FACTOR, _MOST_FACTOR = 0.9, 0.2, 6.0

# The shortest step, as a share of the arc length so far plus the unit of length. Closer rows would
# differ by rounding alone, and no curve could be drawn through them.
_NOWHERE = 1e-15

# How a ray ended.
REACHED = 0
LEFT = 1  # it left the bounds
EXHAUSTED = 2  # out of steps: the surface is too rough, or not finite


@inner_kernel
def advanced(s, h, weights, slopes, count):
    """s + h times the weighted sum of the first ``count`` slopes."""
    x, y, vx, vy, j, dj = s.x, s.y, s.vx, s.vy, s.j, s.dj
    for k in range(count):
        w = h * weights[k]
        x += w * slopes[k, 0]
        y += w * slopes[k, 1]
        vx += w * slopes[k, 2]
        vy += w * slopes[k, 3]
        j += w * slopes[k, 4]
        dj += w * slopes[k, 5]
    return State(x, y, vx, vy, j, dj)


@inner_kernel
def store(slopes, k, d):
    slopes[k, 0], slopes[k, 1], slopes[k, 2] = d.x, d.y, d.vx
    slopes[k, 3], slopes[k, 4], slopes[k, 5] = d.vy, d.j, d.dj


@kernel
def runge_kutta_step(surface, tableau, s, h, slopes):
    """One step of length h; slopes[0] must hold the derivative at s, and all are filled."""
    stages = tableau.b.shape[0]
    for k in range(1, stages):
        store(slopes, k, derivative(surface, advanced(s, h, tableau.a[k], slopes, k)))
    end = advanced(s, h, tableau.b, slopes, stages)
    store(slopes, stages, derivative(surface, end))
    return end


@inner_kernel
def estimate(slopes, weights, scale, component):
    total = 0.0
    for k in range(weights.shape[0]):
        total += weights[k] * slopes[k, component]
    return total / scale


@kernel
def error_norm(tableau, h, s, end, slopes, unit, tolerance):
    """Estimated error over the tolerance: a step is accepted up to 1.

    Errors of positions are relative to ``unit``, a length that suits the surface. Velocities have
    unit length. Errors of the Jacobi field, which may grow exponentially, are relative to it.
    """
    field = 1.0 + max(abs(s.dj), abs(end.dj), abs(s.j) / unit, abs(end.j) / unit)
    fifth, third = 0.0, 0.0
    for component in range(6):
        scale = tolerance
        if component >= 4:
            scale *= field
        if component in (0, 1, 4):
            scale *= unit
        fifth += estimate(slopes, tableau.e5, scale, component) ** 2
        third += estimate(slopes, tableau.e3, scale, component) ** 2
    if fifth == 0.0 and third == 0.0:
        return 0.0
    return abs(h) * fifth / math.sqrt((fifth + 0.01 * third) * 6.0)


@inner_kernel
def is_inside(bounds, x, y):
    return bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]


@inner_kernel
def is_inside_at(bounds, a, b, h, t):
    """Is the cubic Hermite curve of the step from a to b inside at a share t of it?"""
    p, q = (1.0 + 2.0 * t) * (1.0 - t) ** 2, t * t * (3.0 - 2.0 * t)
    u, v = h * t * (1.0 - t) ** 2, h * t * t * (t - 1.0)
    x = p * a.x + q * b.x + u * a.vx + v * b.vx
    y = p * a.y + q * b.y + u * a.vy + v * b.vy
    return is_inside(bounds, x, y)


@kernel
def share_outside(bounds, a, b, h):
    """A share of the step from a to b at which it is outside; -1 where it never is.

    The end is tested, and the points where the step turns back in x or in y.
    """
    turn = 2.0
    if a.vx * b.vx < 0.0:
        t = a.vx / (a.vx - b.vx)
        if not is_inside_at(bounds, a, b, h, t):
            turn = t
    if a.vy * b.vy < 0.0:
        t = a.vy / (a.vy - b.vy)
        if t < turn and not is_inside_at(bounds, a, b, h, t):
            turn = t
    if turn < 1.0:
        return turn
    return -1.0 if is_inside(bounds, b.x, b.y) else 1.0


@kernel
def share_until_exit(bounds, a, b, h, outside):
    """The share of the step from a to b at which its cubic Hermite curve leaves the bounds."""
    low, high = 0.0, outside
    for _ in range(50):
        t = 0.5 * (low + high)
        if is_inside_at(bounds, a, b, h, t):
            low = t
        else:
            high = t
    return low


@inner_kernel
def record(rows, k, length, s):
    rows[k, 0], rows[k, 1], rows[k, 2] = length, s.x, s.y
    rows[k, 3], rows[k, 4], rows[k, 5], rows[k, 6] = s.vx, s.vy, s.j, s.dj


@inner_kernel
def overshoot(bounds, s):
    """About the arc length since a state left the bounds; negative while it is inside."""
    most = -math.inf
    if s.vx != 0.0:
        edge = bounds[2] if s.vx > 0.0 else bounds[0]
        most = max(most, (s.x - edge) / s.vx)
    if s.vy != 0.0:
        edge = bounds[3] if s.vy > 0.0 else bounds[1]
        most = max(most, (s.y - edge) / s.vy)
    return most


@kernel
def step_to_edge(surface, tableau, bounds, s, end, h, outside, slopes):
    """The part of a step that ends on the edge of the bounds: its length and its end."""
    part = h * share_until_exit(bounds, s, end, h, outside)
    for _ in range(4):  # Newton's method; the cubic Hermite curve was the first guess
        end = runge_kutta_step(surface, tableau, s, part, slopes)
        part = max(part - overshoot(bounds, end), 0.0)
    x = min(max(end.x, bounds[0]), bounds[2])
    y = min(max(end.y, bounds[1]), bounds[3])
    return part, State(x, y, end.vx, end.vy, end.j, end.dj)


@allocating_kernel
def trace(surface, tableau, bounds, x, y, angle, length, longest_step, unit, tolerance, rows):
    """Follow the geodesic that leaves (x, y) at an angle over a length, or to the bounds.

    rows (capacity, 7) is filled with arc length, position, velocity and Jacobi field at every
    accepted step, the ends included; there is one where the ray leaves the bounds at once.
    Returns (rows filled, how it ended).
    """
    slopes = np.empty((tableau.b.shape[0] + 1, 6))
    s = unit_state(surface, x, y, angle)
    record(rows, 0, 0.0, s)
    store(slopes, 0, derivative(surface, s))
    done, count = 0.0, 1
    h = min(longest_step, length)
    for _ in range(4 * rows.shape[0]):
        if done >= length:
            return count, REACHED
        if count == rows.shape[0]:
            break
        last = done + h >= length * (1.0 - 1e-14)
        if last:
            h = length - done
        end = runge_kutta_step(surface, tableau, s, h, slopes)
        error = error_norm(tableau, h, s, end, slopes, unit, tolerance)
        if not error <= 1.0:  # also where it is NaN
            shrink = _SAFETY * error**-0.125 if error < math.inf else _LEAST_FACTOR
            h *= max(shrink, _LEAST_FACTOR)
            continue
        outside = share_outside(bounds, s, end, h)
        if outside >= 0.0:
            part, end = step_to_edge(surface, tableau, bounds, s, end, h, outside, slopes)
            if not part > _NOWHERE * (done + unit):  # it is on the edge and leads outwards
                return count, LEFT
            record(rows, count, done + part, end)
            return count + 1, LEFT
        done = length if last else done + h
        s = end
        record(rows, count, done, s)
        count += 1
        for component in range(6):
            slopes[0, component] = slopes[slopes.shape[0] - 1, component]
        grow = _MOST_FACTOR if error == 0.0 else _SAFETY * error**-0.125
        h = min(h * min(max(grow, _LEAST_FACTOR), _MOST_FACTOR), longest_step)
    return count, EXHAUSTED
