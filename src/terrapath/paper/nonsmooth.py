"""A question that the paper leaves open: surfaces with edges, smoothed over ever smaller scales.

Three sharp surfaces can be unrolled into the plane, so their geodesics are known in closed form: a
cone, a square pyramid and a step. Each is smoothed, the shortest path on the smoothed surface is
found, and its length is compared with that on the sharp surface.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..geodesics.refinement import shortest_polyline
from ..surface import Surface, metric
from ..surface.fitting import Function
from ..validation import Array, Point

REGION = (-5.0, -5.0, 5.0, 5.0)
SCALES = (0.4, 0.2, 0.1, 0.05)  # map units
PIECES = (32, 64, 128, 256, 512)  # of the path, from coarse to fine

# Maps polar coordinates around an apex from the plane to the unrolled sheet, or back:
# angle (m,) -> factor on the radius (m,), new angle (m,).
Turn = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class SharpSurface:
    """A height with edges, and the exact shortest path between two points on it."""

    name: str
    height: Function
    true_length: float  # map units
    true_path: Callable[[Array], Array]  # shares (m,) of the path -> points (m, 2), map units


@dataclass(frozen=True)
class SmoothedPath:
    """The shortest path on a smoothed surface, compared with that on the sharp one."""

    surface: str
    scale: float  # map units
    largest_change: float  # of the height
    rms_change: float  # root mean square, of the height
    length: float  # of the path found, under the smoothed surface's h, map units
    true_length: float  # of the sharp surface's geodesic

    @property
    def relative_error(self) -> float:
        """(length - true length) / true length."""
        return (self.length - self.true_length) / self.true_length


# Sharp surfaces


def _around_apex(
    name: str, height: Function, unroll: Turn, roll: Turn, start: Point, goal: Point
) -> SharpSurface:
    """A surface that can be unrolled around its apex into a flat sheet of less than a full turn.

    The geodesic is the straight line on the sheet. It never meets the apex: on one side of it the
    angle between start and goal is less than half a turn on the sheet.
    """
    a, b = complex(*start), complex(*goal)
    angles = np.angle(a) + np.array([0.0, np.angle(b / a)])
    factors, turns = unroll(angles)
    first, last = factors * np.abs([a, b]) * np.exp(1j * (turns - turns[0]))

    def path(shares: Array) -> Array:
        on_sheet = first + shares * (last - first)
        factor, angle = roll(turns[0] + np.angle(on_sheet))
        points = factor * np.abs(on_sheet) * np.exp(1j * angle)
        return np.column_stack([points.real, points.imag])

    return SharpSurface(name, height, float(abs(last - first)), path)


def cone(
    start: Point = (-3.0, -1.0), goal: Point = (3.0, 0.0), *, top: float = 3.0, slope: float = 1.0
) -> SharpSurface:
    """The cone z = top - slope * r.

    On the sheet, radii are larger by the factor sqrt(1 + slope^2), and angles smaller by the same.
    """
    stretch = math.hypot(1.0, slope)
    return _around_apex(
        "cone",
        lambda x, y: top - slope * np.hypot(x, y),
        lambda angle: (np.full_like(angle, stretch), angle / stretch),
        lambda angle: (np.full_like(angle, 1.0 / stretch), angle * stretch),
        start,
        goal,
    )


def _face_by_face(face: float, new_face: float, stretch: float) -> Turn:
    """Map each face to one with another angle at the apex, stretched along its middle line."""

    def turn(angle: Array) -> tuple[Array, Array]:
        k = np.round(angle / face)
        along, across = stretch * np.cos(angle - k * face), np.sin(angle - k * face)
        return np.hypot(along, across), k * new_face + np.arctan2(across, along)

    return turn


def pyramid(
    start: Point = (-3.0, -1.0), goal: Point = (3.0, 0.0), *, top: float = 3.0, slope: float = 1.0
) -> SharpSurface:
    """The square pyramid z = top - slope * max(|x1|, |x2|), unrolled face by face."""
    stretch = math.hypot(1.0, slope)
    face, unfolded = 0.5 * math.pi, 2.0 * math.atan(1.0 / stretch)
    return _around_apex(
        "pyramid",
        lambda x, y: top - slope * np.maximum(np.abs(x), np.abs(y)),
        _face_by_face(face, unfolded, stretch),
        _face_by_face(unfolded, face, 1.0 / stretch),
        start,
        goal,
    )


def step(
    start: Point = (-3.0, -2.0), goal: Point = (3.0, 2.0), *, height: float = 2.0
) -> SharpSurface:
    """A vertical cliff along x1 = 0, from 0 up to the height; the start lies below it.

    The path climbs the cliff. On the sheet the cliff is a strip as wide as it is high.
    """
    first, last = np.array(start), np.array([goal[0] + height, goal[1]])

    def path(shares: Array) -> Array:
        x, y = (first + shares[:, None] * (last - first)).T
        return np.column_stack([np.minimum(x, 0.0) + np.maximum(x - height, 0.0), y])

    return SharpSurface(
        "step",
        lambda x, y: height * np.heaviside(x, 0.5) + 0.0 * y,
        math.dist(first, last),
        path,
    )


# Shortest paths on the smoothed surfaces


def smoothed_path(sharp: SharpSurface, scale: float) -> SmoothedPath:
    """Smooth the surface, and find the shortest path near the geodesic of the sharp one."""
    surface = Surface.from_function(sharp.height, REGION, smoothing=scale)
    guess = sharp.true_path(np.linspace(0.0, 1.0, PIECES[0] + 1))
    path = shortest_polyline(surface, guess, PIECES)
    smoothing = surface.fit.smoothing
    assert smoothing is not None
    return SmoothedPath(
        sharp.name,
        scale,
        smoothing.largest_change[0],
        smoothing.rms_change[0],
        metric.curve_length(surface, path),
        sharp.true_length,
    )


def smoothing_convergence(
    surfaces: Iterable[SharpSurface] | None = None, scales: Sequence[float] = SCALES
) -> list[SmoothedPath]:
    """Path lengths on smoothed surfaces and on the sharp ones, for each scale.

    surfaces : by default the cone, the pyramid and the step. scales : map units.
    """
    chosen = (cone(), pyramid(), step()) if surfaces is None else surfaces
    return [smoothed_path(sharp, scale) for sharp in chosen for scale in scales]


def by_surface(found: Iterable[SmoothedPath]) -> dict[str, list[SmoothedPath]]:
    """The paths of each surface, in the order in which they were found."""
    groups: dict[str, list[SmoothedPath]] = {}
    for row in found:
        groups.setdefault(row.surface, []).append(row)
    return groups


def observed_order(scales: Sequence[float], errors: Sequence[float]) -> float:
    """The power of the scale by which the errors fall: the slope on logarithmic axes."""
    return float(np.polyfit(np.log(scales), np.log(np.abs(errors)), 1)[0])
