"""The outline of free space: straight walls, and the corners that a taut path bends round.

Obstacles are closed sets, so a path must not touch them. Every outline is moved outwards by a tiny
clearance, and a taut path runs along the moved outline. Discs are replaced by polygons around them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..._kernels.geodesics import contacts as kernels
from ..._kernels.space import free_space as grids
from ..._support.watching import MustStop, never
from ...space.free_space import FreeSpace, Indices, cell_margin, index_grid, listed
from ...surface import Mask
from ...surface.bounds import Bounds
from ...validation import Array

# Walls stand behind the points where a path touches them by this share of the clearance.
SLACK = 0.01
# At a corner walls are extended by this share of what would make them meet.
SHORTENED = 0.98
# Free space itself widens the cells of masks; walls stand away from them by twice that, and more.
CELL_MARGINS = 2.0
# Sides of the polygons that replace discs; they grow by a factor of four.
FEWEST_SIDES, MOST_SIDES = 64, 4096
# The distance between a path and what it touches, as a share of the region's side.
CLEARANCE = 1e-8
# And at least this share of the largest coordinate, so that it is far above rounding.
LEAST_CLEARANCE = 2.0**-46

# A corner turns by more than this, radians.
LEAST_TURN = 1e-9


@dataclass(frozen=True)
class Outline:
    """Walls and corners, not yet indexed.

    edges : (e, 4), the walls. normals : (e, 2), of length 1, towards free ground. clearance : (e,),
    of each wall. corners : (c, 2), where a path bends. tips : (c, 2), points just behind the
    corners, which no segment may touch. All in map units.
    """

    edges: Array
    normals: Array
    clearance: Array
    corners: Array
    tips: Array

    @classmethod
    def joined(cls, parts: Sequence[Outline]) -> Outline:
        """One outline with all walls and corners of several, in their order."""
        names = ("edges", "normals", "clearance", "corners", "tips")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class Surroundings:
    """All that a path can run into.

    walls : for moving paths. space : the same walls, for testing segments. corners : (c, 2), where
    a path bends. clearance : (e,), of each wall. discs : (c + 1,), the disc that each corner
    belongs to, or -1; the last entry is -1, for the index NONE. wall_discs : (e + 1,), the same for
    walls. sides : (discs,), of the polygon around each disc. sags : (discs + 1,), by how much that
    polygon is wider than its disc where a path may pass between the two, which it only does where
    there are as many sides as there may be; 0 elsewhere, and for the index NONE.
    """

    walls: kernels.Walls
    space: grids.Space
    corners: Array
    clearance: Array
    discs: Indices
    wall_discs: Indices
    sides: Indices
    sags: Array

    @property
    def strips(self) -> Array:
        """(e,), the width of the strip between each wall and its obstacle, map units."""
        return np.asarray((1.0 - SLACK) * self.clearance + self.sags[self.wall_discs[:-1]])


def _ring(points: Array, clearance: float) -> Outline:
    """The outline of a ring (n, 2) with free ground to its right.

    A corner that turns by more than a right angle is cut off. Otherwise the corner of a spike would
    lie far from its tip.
    """
    ahead = np.roll(points, -1, axis=0) - points
    points = points[(ahead != 0.0).any(axis=1)]
    ahead = np.roll(points, -1, axis=0) - points
    along = ahead / np.hypot(*ahead.T)[:, None]
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    before, normals_before = np.roll(along, 1, axis=0), np.roll(normals, 1, axis=0)
    cross = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
    turn = np.arctan2(cross, (before * along).sum(axis=1))
    turn[turn < LEAST_TURN - math.pi] = math.pi  # the end of a line
    is_corner = turn > LEAST_TURN
    is_cut = turn > 0.5 * math.pi + LEAST_TURN
    reach = np.where(is_corner, np.tan(np.where(is_cut, 0.25, 0.5) * turn), 0.0)
    arriving = normals_before + reach[:, None] * before
    leaving = normals - reach[:, None] * along
    both = np.stack([arriving, leaving], axis=1)
    chosen = np.column_stack([is_corner, is_cut])
    outwards = both[chosen]
    at = np.repeat(points, 2, axis=0).reshape(-1, 2, 2)[chosen]
    longer = SHORTENED * clearance * reach
    moved = (1.0 - SLACK) * clearance * normals
    first = points + moved - longer[:, None] * along
    last = points + ahead + moved + np.roll(longer, -1)[:, None] * along
    return Outline(
        np.hstack([first, last]),
        normals,
        np.full(len(points), clearance),
        at + clearance * outwards,
        at + (1.0 - SLACK) * clearance * outwards,
    )


def _rings(geometry: BaseGeometry) -> list[Array]:
    """The rings (n, 2) of a geometry, not closed, with free ground to their right."""
    if isinstance(geometry, shapely.Polygon):
        turned = shapely.orient_polygons(geometry)
        return [shapely.get_coordinates(ring)[:-1] for ring in (turned.exterior, *turned.interiors)]
    there = shapely.get_coordinates(geometry)
    return [np.concatenate([there, there[-2:0:-1]])]


def _disc(x: float, y: float, radius: float, sides: int) -> Array:
    """The regular polygon around a disc. That with four times the sides lies inside this one."""
    angles = (np.arange(sides) + 0.5) * (2.0 * math.pi / sides)
    reach = radius / math.cos(math.pi / sides)
    return np.column_stack([x + reach * np.cos(angles), y + reach * np.sin(angles)])


def _mask(mask: Mask, clearance: float) -> Outline:
    """The outline of a mask's blocked cells."""
    dx, dy = mask.spacing
    blocked = np.pad(mask.blocked, 1)
    node_x = mask.x[0] - 0.5 * dx + dx * np.arange(mask.blocked.shape[1] + 1)
    node_y = mask.y[0] - 0.5 * dy + dy * np.arange(mask.blocked.shape[0] + 1)
    quarters = (blocked[:-1, :-1], blocked[:-1, 1:], blocked[1:, :-1], blocked[1:, 1:])
    is_corner = np.asarray(sum(quarter.view(np.uint8) for quarter in quarters)) == 1
    outward = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    j, i = np.nonzero(is_corner)
    outwards = outward[np.argmax([quarter[j, i] for quarter in quarters], axis=0)]
    corners = np.column_stack([node_x[i], node_y[j]])
    edges, normals = [], []
    for below, above, step, normal in (
        # Walls along x1 with free ground above or below, then along x2 to the right or left.
        (blocked[:-1, 1:-1], blocked[1:, 1:-1], (0, 1), (0.0, 1.0)),
        (blocked[1:-1, :-1], blocked[1:-1, 1:], (1, 0), (1.0, 0.0)),
    ):
        for walls, sign in ((below & ~above, 1.0), (above & ~below, -1.0)):
            j, i = np.nonzero(walls)
            first, last = (j, i), (j + step[0], i + step[1])
            a, b = (np.column_stack([node_x[i], node_y[j]]) for j, i in (first, last))
            along = (b - a) / np.hypot(*(b - a).T)[:, None]
            longer = SHORTENED * clearance * along
            out = sign * np.array(normal)
            a = a + (1.0 - SLACK) * clearance * out - is_corner[first][:, None] * longer
            b = b + (1.0 - SLACK) * clearance * out + is_corner[last][:, None] * longer
            edges.append(np.hstack([a, b]))
            normals.append(np.broadcast_to(out, a.shape))
    joined = np.concatenate(edges)
    return Outline(
        joined,
        np.concatenate(normals),
        np.full(len(joined), clearance),
        corners + clearance * outwards,
        corners + (1.0 - SLACK) * clearance * outwards,
    )


def _bounds(bounds: Bounds, clearance: float) -> Outline:
    """The outline of the bounds; a path may run exactly along their edge."""
    x0, y0, x1, y1 = bounds
    slack = SLACK * clearance
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    normals = np.array([(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)])
    edges = np.hstack([corners, np.roll(corners, -1, axis=0)]) - slack * np.tile(normals, 2)
    empty = np.empty((0, 2))
    return Outline(edges, normals, np.full(4, clearance), empty, empty)


def widest_clearance(space: FreeSpace) -> float:
    """How far from obstacles walls and corners stand where there is room, map units."""
    largest = float(np.abs(space.bounds).max())
    return max(CLEARANCE * space.bounds.side, LEAST_CLEARANCE * largest)


def _mask_clearance(space: FreeSpace, mask: Mask, clearance: float) -> float:
    return clearance + CELL_MARGINS * cell_margin(mask, space.bounds) * max(mask.spacing)


def corners_near(space: FreeSpace, points: Array, distance: float) -> tuple[Array, Array]:
    """Where paths bend round obstacles within a distance of a path (m, 2), and their own corners.

    Both (c, 2), map units; they are a clearance apart.
    """
    clearance, line = widest_clearance(space), shapely.linestrings(points)
    parts = [_mask(mask, _mask_clearance(space, mask, clearance)) for mask in space.masks]
    tree = shapely.STRtree(list(space.geometries))
    for k in tree.query(line, predicate="dwithin", distance=distance):
        parts += [_ring(ring, clearance) for ring in _rings(space.geometries[k])]
    for circle in space.circles:
        if shapely.dwithin(line, shapely.Point(circle.x1, circle.x2), circle.radius + distance):
            disc = _disc(circle.x1, circle.x2, circle.radius, FEWEST_SIDES)
            parts.append(_ring(disc, clearance))
    if not parts:
        return np.empty((0, 2)), np.empty((0, 2))
    bends = np.concatenate([part.corners for part in parts])
    tips = np.concatenate([part.tips for part in parts])
    near = shapely.dwithin(line, shapely.points(bends), distance)
    bends, tips = bends[near], tips[near]
    return bends, bends - (bends - tips) / SLACK


def surroundings(
    space: FreeSpace, clearance: float, sides: Indices, must_stop: MustStop = never
) -> Surroundings | None:
    """All walls and corners of a free space. sides : (discs,), of the polygon around each disc.

    None where it must stop.
    """
    parts = [_bounds(space.bounds, clearance)]
    for geometry in space.geometries:
        if must_stop():
            return None
        parts += [_ring(ring, clearance) for ring in _rings(geometry)]
    for mask in space.masks:
        parts.append(_mask(mask, _mask_clearance(space, mask, clearance)))
    plain = Outline.joined(parts)
    for circle, count in zip(space.circles, sides, strict=True):
        ring = _disc(circle.x1, circle.x2, circle.radius, int(count))
        parts.append(_ring(ring, clearance))
    outline = Outline.joined(parts)
    owners, counts = [*range(-1, len(sides)), -1], [*sides, 1]
    return Surroundings(
        *_indexed(space.bounds, outline),
        outline.corners,
        outline.clearance,
        np.repeat(owners, [len(plain.corners), *counts]),
        np.repeat(owners, [len(plain.edges), *counts]),
        sides,
        _sags(space, sides),
    )


def _sags(space: FreeSpace, sides: Indices) -> Array:
    """(discs + 1,), as in ``Surroundings``."""
    radii = np.array([*(circle.radius for circle in space.circles), 0.0])
    wider = 1.0 / math.cos(math.pi / MOST_SIDES) - 1.0
    return np.where(np.append(sides, 0) == MOST_SIDES, wider * radii, 0.0)


def _indexed(bounds: Bounds, outline: Outline) -> tuple[kernels.Walls, grids.Space]:
    """Walls for moving paths, and the same walls as a space for testing segments."""
    grid = index_grid(bounds, len(outline.edges))
    edges = np.ascontiguousarray(outline.edges)
    tips = np.ascontiguousarray(outline.tips)
    edge_first, edge_ids = listed(grids.list_edges, grid, edges)
    corner_first, corner_ids = listed(grids.list_edges, grid, np.hstack([tips, tips]))
    normals = np.ascontiguousarray(outline.normals)
    outwards = outline.corners - outline.tips
    walls = kernels.Walls(
        grid, edges, normals, edge_first, edge_ids, tips, outwards, corner_first, corner_ids
    )
    space = grids.Space(
        grid,
        edges,
        edge_first,
        edge_ids,
        np.empty((0, 3)),
        np.zeros(len(edge_first), np.int64),
        np.empty(0, np.int64),
        np.empty((0, 5)),
        np.empty((0, 3), np.int64),
        np.empty(0, np.uint8),
    )
    return walls, space
