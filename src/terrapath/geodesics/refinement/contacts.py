"""Pulling a path taut among obstacles.

A path is a polyline. Each of its points is free, or slides along a wall, or is held by a corner
that the path bends round. Newton's method finds where the points should move. While it moves, the
path is stopped by the first corner that it meets, which then holds it, and points stop at the walls
that they meet. So the path never jumps over an obstacle. When it no longer moves, it is released
from corners and walls that pull it instead of pushing it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import shapely

from ..._kernels.geodesics import contacts as kernels
from ..._kernels.geodesics.newton import Strand
from ..._kernels.geodesics.paced import PacedStrand
from ..._kernels.travel.priced import is_directed
from ..._support.watching import MustStop, never
from ...space.free_space import Indices
from ...surface import Surface
from ...validation import Array
from .newton import lift, lower
from .paced import forces_of, softened
from .walls import SLACK, Surroundings

NONE = -1
MOST_ROUNDS = 1500
# A corner is released at most this often. The last piece before a disc is long, and the error of
# its direction can make the corner seem to pull; after its release it is met again at once.
MOST_RELEASES = 3
# A contact that pulls is released where the path turns by more than this at it, radians.
LEAST_PULL = 1e-6
# The cosine of an angle above a right angle. A taut path turns by a right angle at most where it
# bends round a corner; one that turns by more goes there and back.
TURNED_BACK = -0.1
TINY = 1e-300
# A point this near to a corner's place, as a share of the clearance, is at it.
AT_CORNER = 0.05


@dataclass(frozen=True)
class Band:
    """A polyline, and what holds each of its points.

    points : (m, 2), map units. bends : (m,), the corner that a point is at, or NONE.
    walls : (m, 2), the walls that a point touches, or NONE.
    """

    points: Array
    bends: Indices
    walls: Indices

    @classmethod
    def free(cls, points: Array) -> Band:
        """A polyline that touches nothing."""
        return cls(points, np.full(len(points), NONE), np.full((len(points), 2), NONE))

    @property
    def is_held(self) -> npt.NDArray[np.bool_]:
        """(m,), which points may not move: both ends, and points at corners."""
        held = np.asarray(self.bends != NONE)
        held[[0, -1]] = True
        return held

    def inserted(self, before: Indices, points: Array, bends: Indices | int) -> Band:
        """The band with further points, each in front of the point of index ``before``."""
        return Band(
            np.insert(self.points, before, points, axis=0),
            np.insert(self.bends, before, bends),
            np.insert(self.walls, before, np.full((len(before), 2), NONE), axis=0),
        )

    def chosen(self, which: slice | Indices | npt.NDArray[np.bool_]) -> Band:
        """The band with only some of its points."""
        return Band(self.points[which], self.bends[which], self.walls[which])


def subdivided(band: Band, longest: float) -> Band:
    """The band cut into pieces of at most a length on the plane, map units."""
    sizes = np.hypot(*np.diff(band.points, axis=0).T)
    cuts = np.maximum(np.ceil(sizes / longest - 1e-9), 1).astype(int) - 1
    at = np.repeat(np.arange(len(sizes)), cuts)
    if len(at) == 0:
        return band
    first = np.repeat(np.cumsum(cuts) - cuts, cuts)
    within = ((np.arange(1, len(at) + 1) - first) / (cuts[at] + 1))[:, None]
    places = (1.0 - within) * band.points[at] + within * band.points[at + 1]
    finer = band.inserted(at + 1, places, NONE)
    # A piece along one wall stays on it.
    shared = band.walls[at, 0] == band.walls[at + 1, 0]
    finer.walls[at + 1 + np.arange(len(at)), 0] = np.where(shared, band.walls[at, 0], NONE)
    return finer


def _directions(points: Array) -> Array:
    """Unit vectors along the pieces. (m, 2) -> (m - 1, 2)."""
    steps = np.diff(points, axis=0)
    return np.asarray(steps / np.maximum(np.hypot(*steps.T), TINY)[:, None])


def adopted(around: Surroundings, band: Band) -> Band:
    """The band with the points that lie at corners held by them."""
    if len(around.corners) == 0:
        return band
    reach = AT_CORNER * float(around.clearance.min())
    near, corner = shapely.STRtree(shapely.points(around.corners)).query_nearest(
        shapely.points(band.points), max_distance=reach, all_matches=False
    )
    free = ~band.is_held[near]
    near, corner = near[free], corner[free]
    points, bends = band.points.copy(), band.bends.copy()
    points[near], bends[near] = around.corners[corner], corner
    return replace(band, points=points, bends=bends)


def projectors(around: Surroundings, band: Band) -> Array:
    """(m - 2, 2, 2), the projectors onto the moves that each inner point may make."""
    allowed = np.zeros((len(band.points), 2, 2))
    allowed[:, 0, 0] = allowed[:, 1, 1] = 1.0
    sliding = np.flatnonzero(band.walls[:, 0] != NONE)
    normals = around.walls.normals[band.walls[sliding, 0]]
    allowed[sliding] -= normals[:, :, None] * normals[:, None, :]
    allowed[band.is_held | (band.walls[:, 1] != NONE)] = 0.0
    return allowed[1:-1]


# Moving


def advanced(around: Surroundings, band: Band, target: Array) -> tuple[Band, Indices]:
    """The band moved towards a target (m, 2), as far as obstacles let it.

    Points stop at the walls that they meet. The part between two held points stops where it first
    meets a corner, which then holds it. Also returned are the indices of the points in front of
    which these corners were inserted.
    """
    moves = target - band.points
    hits = _stop_at_walls(around, band.points, moves)
    times, corners = np.empty(len(moves) - 1), np.empty(len(moves) - 1, np.int64)
    kernels.fill_corners(around.walls, band.points, moves, band.bends, times, corners)
    if times.min() > 1.0 and (hits == NONE).all():
        return replace(band, points=target), np.empty(0, np.int64)
    stretch = np.cumsum(band.is_held) - 1
    ends = np.full(stretch[-1] + 1, np.inf)
    np.minimum.at(ends, stretch[:-1], times)
    points = band.points + np.minimum(ends, 1.0)[stretch][:, None] * moves
    arrived = (hits != NONE) & (ends[stretch] > 1.0)
    walls = band.walls.copy()
    order = (walls[arrived, 0] != NONE).astype(int)
    walls[np.flatnonzero(arrived), order] = hits[arrived]
    moved = replace(band, points=points, walls=walls)
    met = np.flatnonzero((times == ends[stretch[:-1]]) & (times <= 1.0))
    at = met[np.unique(stretch[met], return_index=True)[1]]  # one in each part
    return moved.inserted(at + 1, around.corners[corners[at]], corners[at]), at + 1


def _stop_at_walls(around: Surroundings, points: Array, moves: Array) -> Indices:
    """The wall that each point meets, or NONE. The moves are changed: they end at these walls."""
    times, hits = np.empty(len(moves)), np.empty(len(moves), np.int64)
    kernels.fill_walls(around.walls, points, moves, times, hits)
    met = hits != NONE
    slack = SLACK * around.clearance[hits[met], None] * around.walls.normals[hits[met]]
    moves[met] = times[met, None] * moves[met] + slack
    return hits


# Releasing


def _forces(path: Strand) -> Array:
    """(m - 2, 2), minus the derivative of the length by each inner point, divided by the cost."""
    chords, costs = path.chords, np.sqrt(path.stiffness)
    sizes = np.linalg.norm(chords, axis=1)
    pulls = np.diff(costs[:, None] * chords / np.maximum(sizes, TINY)[:, None], axis=0)
    slopes = path.jets[1:-1, :, 1:3] * path.weights[:, None]
    shares = sizes / costs
    drift = 0.25 * (shares[1:] + shares[:-1])[:, None] * path.costs[1:-1, 1:3]
    force = pulls[:, :2] + np.einsum("mk,mka->ma", pulls[:, 2:], slopes) - drift
    return np.asarray(force / np.sqrt(path.costs[1:-1, :1]))


def outwards(around: Surroundings, band: Band) -> Array:
    """(m - 2, 2), at corners unit vectors across the path, away from the obstacle; 0 elsewhere."""
    along = _directions(band.points)
    mean = along[1:] + along[:-1]
    left = np.column_stack([-mean[:, 1], mean[:, 0]]) / np.maximum(np.hypot(*mean.T), TINY)[:, None]
    off = np.zeros_like(left)
    bent = band.bends[1:-1] != NONE
    corners = band.bends[1:-1][bent]
    off[bent] = around.corners[corners] - around.walls.corners[corners]
    return np.asarray(np.sign((off * left).sum(axis=1))[:, None] * left)


def loosened(
    around: Surroundings, band: Band, path: Strand | PacedStrand, releases: dict[int, int]
) -> Band | None:
    """The band without the contacts that pull at the path; None where there are none.

    path : the band, lifted. releases : how often each corner was released before; it is updated.
    """
    force = forces_of(path) if isinstance(path, PacedStrand) else _forces(path)
    pull = (force * outwards(around, band)).sum(axis=1)
    along = _directions(band.points)
    turns_back = (along[1:] * along[:-1]).sum(axis=1) < TURNED_BACK
    pulling = np.zeros(len(band.points), bool)
    pulling[1:-1] = (band.bends[1:-1] != NONE) & ((pull > LEAST_PULL) | turns_back)
    for k in np.flatnonzero(pulling).tolist():
        corner = int(band.bends[k])
        releases[corner] = releases.get(corner, 0) + 1
        pulling[k] = releases[corner] <= MOST_RELEASES
    walls = band.walls.copy()
    for which in (1, 0):
        touching = np.flatnonzero(band.walls[1:-1, which] != NONE)
        normals = around.walls.normals[band.walls[1 + touching, which]]
        off = (force[touching] * normals).sum(axis=1) > LEAST_PULL
        walls[1 + touching[off], which] = NONE
    only_second = (walls[:, 0] == NONE) & (walls[:, 1] != NONE)
    walls[only_second] = walls[only_second][:, ::-1]
    if not pulling.any() and (walls == band.walls).all():
        return None
    return replace(band, bends=np.where(pulling, NONE, band.bends), walls=walls)


def _without_loops(band: Band) -> Band:
    """The band without parts that lead from a corner back to it and are not held in between."""
    held = np.flatnonzero(band.is_held)
    again = (band.bends[held[1:]] == band.bends[held[:-1]]) & (band.bends[held[1:]] != NONE)
    if not again.any():
        return band
    kept = np.ones(len(band.points), bool)
    for first, last in zip(held[:-1][again], held[1:][again], strict=True):
        kept[first + 1 : last + 1] = False
    return band.chosen(kept)


def _slid_off(around: Surroundings, band: Band) -> Band:
    """The band with points free again that slid beyond the end of their wall."""
    touching = np.flatnonzero(band.walls[:, 0] != NONE)
    if len(touching) == 0:
        return band
    edges = around.walls.edges[band.walls[touching, 0]]
    along, offset = edges[:, 2:] - edges[:, :2], band.points[touching] - edges[:, :2]
    within = (along * offset).sum(axis=1) / (along**2).sum(axis=1)
    off = touching[(within < 0.0) | (within > 1.0)]
    if len(off) == 0:
        return band
    walls = band.walls.copy()
    walls[off] = NONE
    return replace(band, walls=walls)


def tightened(
    surface: Surface, around: Surroundings, band: Band, must_stop: MustStop = never
) -> Band:
    """The band pulled taut: no move that obstacles allow shortens it.

    Where it must stop, the band as far as it is pulled.
    """
    for ground in softened(surface) if is_directed(surface.data) else (surface,):
        band = _tightened(ground, around, band, must_stop)
    return band


def _tightened(surface: Surface, around: Surroundings, band: Band, must_stop: MustStop) -> Band:
    releases: dict[int, int] = {}
    path = None
    for _ in range(MOST_ROUNDS):
        if must_stop():
            break
        if path is None or path.points is not band.points:
            path = lift(surface, band.points)
        found = lower(surface, path, projectors(around, band))
        if found is None:
            shorter = _without_loops(band)
            if shorter is not band:
                band = shorter
                continue
            looser = loosened(around, band, path.strand, releases)
            if looser is None:
                break
            band = looser
            continue
        band, _ = advanced(around, band, found.points)
        band, path = _slid_off(around, band), found
    return band
