"""Proof that no path exists: two points in different parts of the free space.

Errors are on one side only. Points are called separated only where that holds despite all
rounding. Where there is a doubt, or a proof would take too long, they are not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from .._kernels.space import free_space as kernels
from ..surface import Mask
from ..surface.bounds import Bounds
from ..validation import Array, Point
from .lattice import Lattice

Cells: TypeAlias = npt.NDArray[np.bool_]
Indices: TypeAlias = npt.NDArray[np.intp]
Lines: TypeAlias = npt.NDArray[np.object_]  # (m,) shapely.LineString

# A strip of cells inside the bounds is left out where it is thinner than this share of the margin
# that kernels add to blocked cells: no path fits there.
SLIVER = 0.5

# Walls that do not touch, but come nearer than this share of the largest coordinate, leave a doubt.
# Rounding moves the points where walls cross by less than a hundredth of that.
DOUBT = 2.0**-45

# Where walls have more corners than this, no proof is tried: it would take seconds.
MOST_CORNERS = 30_000

# Before a proof is tried, a path is looked for on a lattice with this many nodes a side.
WITNESS_NODES = 65


def separated(
    bounds: Bounds, space: kernels.Space, masks: Iterable[Mask], walls: Lines, a: Point, b: Point
) -> bool:
    """Is it proven that no path inside the bounds leads from a to b, two free points?

    space : all obstacles, to test segments against. masks : the masks among them. walls : lines,
    each of which lies wholly in one of the other obstacles.
    """
    if _are_free(space, np.array([a]), np.array([b])).all():
        return False
    sliver = SLIVER * space.mask_frames[:, 4].min(initial=1.0)
    windows = [_Window.of(mask, bounds, sliver) for mask in merged_masks(masks)]
    if any(window.separates(a, b) for window in windows):
        return True
    if len(walls) == 0 and len(windows) < 2:
        return False
    if _joined_on_lattice(bounds, space, a, b):
        return False
    outlines = np.concatenate([np.empty((0, 2, 2)), *(window.outline() for window in windows)])
    if shapely.count_coordinates(walls) + 2 * len(outlines) > MOST_CORNERS:
        return False
    walls = np.concatenate([walls, shapely.linestrings(outlines)])
    return _walls_separate(bounds, walls, a, b)


# Masks


def merged_masks(masks: Iterable[Mask]) -> list[Mask]:
    """Masks, with those on the same grid merged into one."""
    merged: dict[tuple[bytes, bytes], Mask] = {}
    for mask in masks:
        grid = (mask.x.tobytes(), mask.y.tobytes())
        blocked = mask.blocked | merged[grid].blocked if grid in merged else mask.blocked
        merged[grid] = Mask(blocked, mask.x, mask.y)
    return list(merged.values())


@dataclass(frozen=True)
class _Axis:
    """The cells of one axis of a mask within the bounds; -1 and n are all cells beyond the mask."""

    origin: float  # lower border of cell 0
    size: float  # of a cell, map units
    first: int
    last: int
    low: float  # of the bounds
    high: float
    sliver: float  # the thickest strip that is left out, a share of a cell

    @classmethod
    def of(cls, centres: Array, size: float, low: float, high: float, sliver: float) -> _Axis:
        origin, count = float(centres[0]) - 0.5 * size, len(centres)
        first = min(max(math.floor((low - origin) / size + sliver), -1), count)
        last = min(max(math.ceil((high - origin) / size - sliver) - 1, first), count)
        return cls(origin, size, first, last, low, high, sliver)

    def cell(self, x: float) -> int:
        """The index, counted from ``first``, of the cell that x lies in."""
        index = math.floor((x - self.origin) / self.size)
        return min(max(index, self.first), self.last) - self.first

    def borders(self) -> Array:
        """The borders of the cells; those within rounding of the bounds are put onto them."""
        lines = self.origin + self.size * np.arange(self.first, self.last + 2, dtype=np.float64)
        for edge in (self.low, self.high):
            lines[np.abs(lines - edge) <= self.sliver * self.size] = edge
        return lines


@dataclass(frozen=True, eq=False)
class _Window:
    """The part of a mask within the bounds; beyond the mask nothing is blocked."""

    blocked: Cells
    x: _Axis
    y: _Axis

    @classmethod
    def of(cls, mask: Mask, bounds: Bounds, sliver: float) -> _Window:
        dx, dy = mask.spacing
        x = _Axis.of(mask.x, dx, bounds.x1_min, bounds.x1_max, sliver)
        y = _Axis.of(mask.y, dy, bounds.x2_min, bounds.x2_max, sliver)
        padded = np.pad(mask.blocked, 1)
        return cls(padded[y.first + 1 : y.last + 2, x.first + 1 : x.last + 2], x, y)

    def separates(self, a: Point, b: Point) -> bool:
        """Do blocked cells alone separate a from b?

        Blocked cells are closed, so a path leads from one free cell to another only through a side.
        """
        if not self.blocked.any():
            return False
        from scipy import ndimage

        parts, _ = ndimage.label(~self.blocked)
        part_of_a, part_of_b = (parts[self.y.cell(y), self.x.cell(x)] for x, y in (a, b))
        # A free point lies in a blocked cell, whose part is 0, only by rounding.
        return bool(part_of_a != part_of_b and part_of_a > 0 and part_of_b > 0)

    def outline(self) -> Array:
        """(m, 2, 2): the borders between blocked and free cells, each straight run one segment."""
        x, y = self.x.borders(), self.y.borders()
        row, first, last = runs(self.blocked)
        along_x = np.column_stack([x[first], y[row], x[last], y[row]])
        column, first, last = runs(self.blocked.T)
        along_y = np.column_stack([x[column], y[first], x[column], y[last]])
        return np.concatenate([along_x, along_y]).reshape(-1, 2, 2)


def runs(blocked: Cells) -> tuple[Indices, Indices, Indices]:
    """Straight borders between rows: which border, and the first and last corner of each run."""
    rows = np.pad(blocked, ((1, 1), (0, 0)))
    border = np.pad(rows[1:] != rows[:-1], ((0, 0), (1, 1)))
    which, first = np.nonzero(border[:, 1:] & ~border[:, :-1])
    _, last = np.nonzero(border[:, :-1] & ~border[:, 1:])
    return which, first, last


# A path on a coarse lattice


def _joined_on_lattice(bounds: Bounds, space: kernels.Space, a: Point, b: Point) -> bool:
    """Is there a free path from a to b along the lines of a coarse lattice?"""
    lattice = Lattice(bounds, WITNESS_NODES, WITNESS_NODES)
    nodes = lattice.points
    # In the picture every other row and column holds nodes; those between hold the edges.
    picture = np.zeros((2 * lattice.ny - 1, 2 * lattice.nx - 1), np.bool_)
    picture[::2, ::2] = True
    picture[::2, 1::2] = _are_free(space, nodes[:, :-1], nodes[:, 1:])
    picture[1::2, ::2] = _are_free(space, nodes[:-1], nodes[1:])
    from scipy import ndimage

    parts, _ = ndimage.label(picture)
    reached = []
    for x, y in (a, b):
        i = min(int((x - bounds.x1_min) / lattice.dx), lattice.nx - 2)
        j = min(int((y - bounds.x2_min) / lattice.dy), lattice.ny - 2)
        corners = nodes[j : j + 2, i : i + 2]
        free = _are_free(space, np.broadcast_to((x, y), corners.shape), corners)
        reached.append(parts[::2, ::2][j : j + 2, i : i + 2][free])
    return bool(np.isin(*reached).any())


def _are_free(space: kernels.Space, a: Array, b: Array) -> Cells:
    """Segments a-b, each (..., 2) -> (...) bool."""
    free = np.empty(a.shape[:-1], np.uint8)
    flat = (np.ascontiguousarray(ends).reshape(-1, 2) for ends in (a, b))
    kernels.fill_free(space, *flat, free.reshape(-1))
    return free.astype(np.bool_)


# Walls


def _walls_separate(bounds: Bounds, walls: Lines, a: Point, b: Point) -> bool:
    """Do the walls, together with the edge of the bounds, separate a from b?

    Walls cut the bounds into faces, and a ring of walls separates points in different faces. But
    rounding moves the points where walls cross, so it might close a gap between walls that do not
    touch. Where a gap along the ring is that narrow, or a or b is that near to a wall, there is
    no proof.
    """
    walls = shapely.remove_repeated_points(walls[shapely.intersects(walls, shapely.box(*bounds))])
    if len(walls) == 0:
        return False
    narrow = DOUBT * np.abs([*shapely.total_bounds(walls), *bounds]).max()
    if shapely.dwithin(walls, shapely.points([[a], [b]]), 16.0 * narrow).any():
        return False
    # A free point on the edge of the bounds is moved inside. No wall is in between.
    low, high = np.array(bounds[:2]) + 4.0 * narrow, np.array(bounds[2:]) - 4.0 * narrow
    walls = np.append(walls, shapely.box(*bounds).exterior)
    ring = _ring_between(walls, np.clip(a, low, high), np.clip(b, low, high))
    return ring is not None and not _any_narrow_gap(walls, ring, narrow)


def _ring_between(walls: Lines, a: Array, b: Array) -> shapely.LinearRing | None:
    """The ring on the border of a's face that has b on its other side; None if there is none."""
    try:
        faces = shapely.polygonize([shapely.node(shapely.multilinestrings(walls))])
    except shapely.errors.GEOSException:  # walls that cross too often within rounding
        return None
    parts = shapely.get_parts(faces)
    around_a = parts[shapely.contains_xy(parts, *a)]
    if len(around_a) != 1:
        return None
    exterior, *holes = shapely.get_rings(around_a)
    if not shapely.intersects_xy(shapely.polygons(exterior), *b):
        return exterior
    around_b = [hole for hole in holes if shapely.contains_xy(shapely.polygons(hole), *b)]
    return around_b[0] if around_b else None


def _any_narrow_gap(walls: Lines, ring: shapely.LinearRing, narrow: float) -> bool:
    """Do two pieces of wall along the ring come nearer than ``narrow`` without touching?"""
    corners, wall = shapely.get_coordinates(walls, return_index=True)
    pieces = shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1))
    pieces = pieces[wall[1:] == wall[:-1]]
    shapely.prepare(ring)
    pieces = pieces[shapely.dwithin(ring, pieces, narrow)]
    one, other = shapely.STRtree(pieces).query(pieces, predicate="dwithin", distance=narrow)
    return not shapely.intersects(pieces[one], pieces[other]).all()
