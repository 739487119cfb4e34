"""Geodesics of h: the equation's coefficients, rays, the exponential map and its derivative."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .._kernels.geodesics import equation as kernels, rays
from .._support.watching import MustStop, never
from ..errors import InputError
from ..surface import Surface
from ..surface.bounds import Bounds
from ..surface.metric import inverse_metric_tensor, metric_tensor
from ..validation import Array, PointLike, as_array, as_point, require_positive

# The largest error of a step: in positions, as a share of two features of the surface (that is 1 in
# the paper's scenes); in the unit speed; and in the Jacobi field, relative to itself.
TOLERANCE = 1e-11

# The most rows of a ray. A ray takes a few steps on smooth ground, and thousands on a rough raster.
MOST_STEPS = 200_000

EVERYWHERE = Bounds(-math.inf, -math.inf, math.inf, math.inf)


def christoffel_symbols(surface: Surface, points: npt.ArrayLike) -> Array:
    """Christoffel symbols of h at points.

    points : (..., 2), map units. Returns (..., 2, 2, 2), index order [k, i, j], 1/map unit.
    Raises OutsideSurfaceError where a point is off the surface. Source: paper, appendix 6.1.
    """
    flat, shape = surface._points(points)
    symbols = np.empty((len(flat), 2, 2, 2))
    kernels.fill_christoffel(surface.data, flat, symbols)
    return symbols.reshape(*shape, 2, 2, 2)


def gaussian_curvature(surface: Surface, points: npt.ArrayLike) -> Array:
    """Gaussian curvature of the surface above points (..., 2), 1/map unit^2.

    Returns (...). By the equation of Gauss, for any number of layers (do Carmo 1992, chapter 6).
    Raises OutsideSurfaceError where a point is off the surface.
    """
    flat, shape = surface._points(points)
    curvatures = np.empty(len(flat))
    kernels.fill_curvature(surface.data, flat, curvatures)
    return curvatures.reshape(shape)


def geodesic_acceleration(
    surface: Surface, points: npt.ArrayLike, velocities: npt.ArrayLike
) -> Array:
    """x'' = -h^-1 sum_k w_k^2 grad x_k (x'^T Hess x_k x') at points with velocities, (..., 2).

    It equals -Gamma(x', x') of the paper's appendix, without the Christoffel symbols. Let p be the
    slope of the logarithm of the cost, and H the metric without costs. The cost adds
    -2 (p . x') x' + H(x', x') H^-1 p. Returns (..., 2).
    """
    v = np.asarray(velocities, np.float64)
    gradients, hessians = surface.gradients(points), surface.hessians(points)
    bends = np.einsum("...i,...kij,...j->...k", v, hessians, v) * surface.data.weights**2
    pull = np.einsum("...k,...ki->...i", bends, gradients)
    squared_cost = surface.cost(points)[..., None, None] ** 2
    inverse = squared_cost * inverse_metric_tensor(surface, points)
    tensor = metric_tensor(surface, points) / squared_cost
    slope = surface.log_cost_jets(points)[..., 1:3]
    pull -= np.einsum("...i,...ij,...j->...", v, tensor, v)[..., None] * slope
    along = 2.0 * (slope * v).sum(-1)[..., None] * v
    return -np.asarray(np.einsum("...ij,...j->...i", inverse, pull) + along)


@dataclass(frozen=True, eq=False)
class Ray:
    """A geodesic of unit speed from a point, sampled at the integrator's steps.

    angle : at the start, radians on the plane. arc_length : (m,), map units. points : (m, 2),
    map units. velocities : (m, 2), of length 1 under h. jacobi : (m,), how far the point moves to
    the left of the ray, map units under h, per radian of the angle. jacobi_slope : (m,), its
    derivative by arc length. left_surface : did the ray end at the edge of the bounds?
    """

    angle: float
    arc_length: Array
    points: Array
    velocities: Array
    jacobi: Array
    jacobi_slope: Array
    left_surface: bool

    @property
    def length(self) -> float:
        """Arc length at the end, map units."""
        return float(self.arc_length[-1])

    @property
    def leaves_at_once(self) -> bool:
        """Does the ray start on the edge and lead outwards? Then it consists of its start alone."""
        return len(self.arc_length) == 1

    @property
    def position(self) -> Callable[..., Array]:
        """Position by arc length between the steps (cubic Hermite).

        Like SciPy's curves it also gives derivatives: ``position(s, 1)`` is the velocity.
        """
        from scipy.interpolate import CubicHermiteSpline, PPoly

        curve: Callable[..., Array]
        if self.leaves_at_once:
            curve = PPoly(np.stack([self.velocities, self.points]), [0.0, 1.0])
        else:
            curve = CubicHermiteSpline(self.arc_length, self.points, self.velocities)
        return curve

    @property
    def conjugate_points(self) -> Array:
        """Arc lengths of the points conjugate to the start, where the Jacobi field is 0."""
        from scipy.interpolate import CubicHermiteSpline

        if self.leaves_at_once:
            return np.empty(0)
        curve = CubicHermiteSpline(self.arc_length, self.jacobi, self.jacobi_slope)
        roots = curve.roots(extrapolate=False)
        return np.asarray(roots[roots > 1e-9 * self.length])


def trace_ray(
    surface: Surface,
    start: PointLike,
    angle: float,
    length: float,
    *,
    bounds: Bounds | None = None,
    longest_step: float | None = None,
    tolerance: float = TOLERANCE,
) -> Ray:
    """Follow the geodesic that leaves ``start`` at ``angle`` (radians on the plane).

    start : (x1, x2), map units. length : map units. bounds : the ray ends at their edge; by default
    the surface's. longest_step : the largest distance of samples, map units. tolerance : the
    largest error of a step.
    Raises InputError where the surface is too rough to follow the geodesic.
    Source: paper, appendix 6.1; Dormand and Prince 8(5, 3).
    """
    require_positive(length=length, tolerance=tolerance)
    x, y = surface._points(as_point(start, "start"))[0][0]
    if not math.isfinite(angle):
        raise InputError(f"angle={angle} is not finite; give radians")
    region = bounds or surface.bounds or EVERYWHERE
    if not region.contains(np.array([x, y])):
        raise InputError(f"start=({x:g}, {y:g}) is outside the bounds {region}")
    edges = np.array(region, np.float64)
    step = length / 8.0
    if longest_step is not None:
        require_positive(longest_step=longest_step)
        step = min(longest_step, length)
    unit = _length_unit(surface, length)
    rows = np.empty((256, 7))
    while True:
        count, ended = rays.trace(
            surface.data,
            rays.dormand_prince(),
            edges,
            x,
            y,
            float(angle),
            float(length),
            step,
            unit,
            tolerance,
            rows,
        )
        if ended != rays.EXHAUSTED:
            break
        if len(rows) >= MOST_STEPS or not np.isfinite(rows[:count]).all():
            raise InputError(
                f"the geodesic from ({x:g}, {y:g}) at angle={angle:g} cannot be followed past "
                f"arc length {rows[count - 1, 0]:g} with tolerance={tolerance:g}; raise the "
                "tolerance, or smooth the surface"
            )
        rows = np.empty((4 * len(rows), 7))
    s, points, velocities, j, dj = np.split(rows[:count].copy(), (1, 3, 5, 6), axis=1)
    left = ended == rays.LEFT
    return Ray(float(angle), s[:, 0], points, velocities, j[:, 0], dj[:, 0], left)


def _length_unit(surface: Surface, length: float) -> float:
    """The length that errors of positions are relative to, map units."""
    return min(2.0 * surface.resolution, length)


def exponential_map(
    surface: Surface, start: PointLike, vectors: npt.ArrayLike, *, tolerance: float = TOLERANCE
) -> Array:
    """Ends of the geodesics that leave ``start`` with the given velocities after unit time.

    start : (x1, x2), map units. vectors : (m, 2), map units, on the plane. tolerance : the
    largest error of a step. Returns (m, 2), map units.
    Raises InputError, which names the vector, where a geodesic leads over the surface's edge.
    """
    base = np.asarray(as_point(start, "start"))
    velocities = as_array(vectors, "vectors", shape=(None, 2))
    ends = np.empty_like(velocities)
    h = metric_tensor(surface, base)
    for k, vector in enumerate(velocities):
        length = math.sqrt(vector @ h @ vector)
        if length == 0.0:
            ends[k] = base
            continue
        ray = trace_ray(
            surface, base, math.atan2(vector[1], vector[0]), length, tolerance=tolerance
        )
        if ray.left_surface:
            raise InputError(
                f"vectors[{k}]={tuple(vector)} leads over the edge of the surface after "
                f"{ray.length:g} of {length:g}; shorten it"
            )
        ends[k] = ray.points[-1]
    return ends


@dataclass(frozen=True, eq=False)
class Geodesic:
    """A geodesic from start to goal.

    angle : at the start, radians on the plane. length : exact arc length, map units.
    points : (m, 2), map units. jacobi_at_goal : how far the end moves, map units per radian of the
    angle. conjugate_points : arc lengths, map units; a geodesic is locally shortest only where
    there are none.
    """

    angle: float
    length: float
    points: Array
    jacobi_at_goal: float
    conjugate_points: Array


def _normal(h: Array, v: Array) -> Array:
    """The unit vector to the left of the unit vector v, under h."""
    turned = np.array([-(h[0, 1] * v[0] + h[1, 1] * v[1]), h[0, 0] * v[0] + h[0, 1] * v[1]])
    return np.asarray(turned / math.sqrt(np.linalg.det(h)))


@dataclass(frozen=True)
class Miss:
    """Where a ray comes closest to a target."""

    ray: Ray
    arc_length: float  # map units
    distance: float  # from the target on the plane, map units
    side: float  # the distance with a sign: above 0 where the target lies to the left
    speed: float  # of the ray there, on the plane: map units per unit of arc length


SAMPLES_PER_STEP = 8


def closest_approach(ray: Ray, target: Sequence[float] | Array) -> Miss:
    """The point of a ray that is closest to a target on the plane."""
    curve = ray.position
    knots = ray.arc_length
    shares = np.linspace(0.0, 1.0, SAMPLES_PER_STEP, endpoint=False)
    s = np.append((knots[:-1, None] + shares * np.diff(knots)[:, None]).ravel(), knots[-1])
    offsets = np.asarray(target) - curve(s)
    k = int(np.argmin(np.hypot(*offsets.T)))
    best = s[k]
    if 0 < k < len(s) - 1:  # a step of the parabola through three squared distances
        left, middle, right = (offsets[k - 1 : k + 2] ** 2).sum(axis=1)
        h1, h2 = s[k] - s[k - 1], s[k + 1] - s[k]
        slope = (right - middle) / h2 * h1 + (middle - left) / h1 * h2
        bend = 2.0 * ((right - middle) / h2 - (middle - left) / h1)
        best = s[k] - slope / bend if bend > 0.0 else s[k]
        best = float(np.clip(best, s[k - 1], s[k + 1]))
    offset = np.asarray(target) - curve(best)
    v = curve(best, 1)
    side = v[0] * offset[1] - v[1] * offset[0]
    distance = float(np.hypot(*offset))
    return Miss(ray, float(best), distance, math.copysign(distance, side), float(np.hypot(*v)))


ATTEMPTS = 60
PATH_POINTS = 2048
POLISHING_STEPS = 4


@dataclass
class _Bracket:
    """Two angles; the geodesics at them pass the goal on different sides."""

    low: float
    high: float
    low_is_left: bool

    def halve(self, side: float, angle: float) -> None:
        """Replace the end whose ray passes the goal on the same side."""
        if (side > 0.0) == self.low_is_left:
            self.low = angle
        else:
            self.high = angle

    @property
    def middle(self) -> float:
        return 0.5 * (self.low + self.high)


def is_bracket(low: Miss, high: Miss) -> bool:
    """Do two neighbouring rays pass the target on different sides, near the same place?

    Rays may part, as on the two sides of a peak. Then the places where they come closest lie
    farther apart along the rays than across them.
    """
    apart = abs(low.arc_length - high.arc_length) * max(low.speed, high.speed)  # on the plane
    leaves = min(low.arc_length, high.arc_length) > 0.0  # some ray leads towards the target
    across = low.distance + high.distance
    return leaves and (low.side > 0.0) != (high.side > 0.0) and apart <= across


def hit(
    surface: Surface,
    start: PointLike,
    goal: PointLike,
    between: tuple[Miss, Miss],
    *,
    bounds: Bounds,
    tolerance: float = TOLERANCE,
    must_stop: MustStop = never,
) -> Geodesic | None:
    """The geodesic between two rays that ends exactly at the goal; None where none is found.

    start, goal : (x1, x2), map units. between : where two rays that pass the goal on different
    sides come closest to it. tolerance : the largest error of a step. It is Newton's method for
    angle and arc length, with the Jacobi field as the derivative. Where a step does not halve the
    error, or leads out of the bracket of angles, the bracket is halved instead.
    """
    low, high = between
    target = np.asarray(goal, np.float64)
    options: dict[str, Any] = {"bounds": bounds, "tolerance": tolerance}
    unit = _length_unit(surface, low.ray.length)
    accuracy = max(10.0 * tolerance * unit, 1e-14 * float(np.abs(target).max()))
    longest = 1.5 * max(low.arc_length, high.arc_length)
    bracket = _Bracket(low.ray.angle, high.ray.angle, low.side > 0.0)
    nearer = low if low.distance <= high.distance else high
    angle, length, last_error = nearer.ray.angle, nearer.arc_length, math.inf
    for _ in range(ATTEMPTS):
        ray = trace_ray(surface, start, angle, length, **options)
        turn, along, error = _newton_step(surface, ray, target)
        if error <= accuracy:
            return _geodesic(surface, start, target, angle, length, options)
        inside = bracket.low <= angle + turn <= bracket.high and 0.0 < length + along <= longest
        if inside and error <= 0.5 * last_error and not ray.left_surface:
            angle, length, last_error = angle + turn, length + along, error
            continue
        angle, last_error = bracket.middle, math.inf
        if must_stop() or not bracket.low < angle < bracket.high:
            return None
        miss = closest_approach(trace_ray(surface, start, angle, longest, **options), target)
        bracket.halve(miss.side, angle)
        length = miss.arc_length
    return None


def _newton_step(surface: Surface, ray: Ray, target: Array) -> tuple[float, float, float]:
    """The changes of angle and length that move a ray's end to a target, and the distance to it."""
    end, v, j = ray.points[-1], ray.velocities[-1], float(ray.jacobi[-1])
    offset = target - end
    h = metric_tensor(surface, end)
    along, across = float(offset @ h @ v), float(offset @ h @ _normal(h, v))
    turn = across / j if j != 0.0 else math.inf
    return turn, along, math.hypot(along, across)


def _geodesic(
    surface: Surface,
    start: PointLike,
    target: Array,
    angle: float,
    length: float,
    options: dict[str, Any],
) -> Geodesic:
    """The final geodesic, sampled for a path.

    It is followed in finer steps than those of the search. Where rays spread a thousandfold, the
    finer ray ends elsewhere by more than the tolerance. So Newton's method goes on with the finer
    steps.
    """
    for step in range(POLISHING_STEPS + 1):
        spacing = length / PATH_POINTS
        ray = trace_ray(surface, start, angle, length, longest_step=spacing, **options)
        turn, along, error = _newton_step(surface, ray, target)
        if step == POLISHING_STEPS or not math.isfinite(turn) or error < 1e-14 * length:
            break
        angle, length = angle + turn, length + along
    return Geodesic(angle, length, ray.points, float(ray.jacobi[-1]), ray.conjugate_points)
