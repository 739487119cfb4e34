"""Holes, that is cells without data: small holes are filled and become free.

Into large ones the ground is continued, so that a spline does not oscillate beside them.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt

from .._support.memory import blocks
from ..errors import MapError
from ..validation import Array
from .neighbours import bilinear, grown

Cells = npt.NDArray[np.bool_]

RINGS = 8  # the slope at a hole's edge is continued over this many cells
DAMPING = 0.8  # factor of the slope from ring to ring, so that the ground levels off
LARGEST_HOLE = 250_000  # cells of a hole that is filled: a sparse system with so many unknowns


def missing_cells(values: Array) -> Cells:
    """Cells (ny, nx) that are not finite."""
    missing = np.empty(values.shape, dtype=bool)
    for rows in blocks(*values.shape):
        np.logical_not(np.isfinite(values[rows]), out=missing[rows])
    return missing


# Large holes, which stay blocked


def _carry_on(values: Array, known: Cells, damping: float) -> Cells:
    """Give the cells next to known ones values that continue the slope; returns these cells.

    From each known neighbour n with a known m behind it: f(n) + damping (f(n) - f(m)).
    On a plane, with no damping, that is exact.
    """
    ring: Cells = grown(known) & ~known
    row, column = np.nonzero(ring)
    sums, weights = np.zeros((2, len(row))), np.zeros((2, len(row)))
    for dy, dx in product((-1, 0, 1), repeat=2):
        if dy == dx == 0:
            continue
        near, near_known = _at(values, known, row + dy, column + dx)
        far, far_known = _at(values, known, row + 2 * dy, column + 2 * dx)
        weight = near_known / float(dy * dy + dx * dx)
        slopes = np.where(near_known & far_known, near + damping * (near - far), 0.0)
        sums[0] += weight * far_known * slopes
        weights[0] += weight * far_known
        sums[1] += weight * near
        weights[1] += weight
    kind = (weights[0] == 0.0).astype(int)  # without a slope, the neighbours' mean
    entries = np.arange(len(row))
    values[row, column] = sums[kind, entries] / weights[kind, entries]
    return ring


def _at(
    values: Array, known: Cells, row: npt.NDArray[np.intp], column: npt.NDArray[np.intp]
) -> tuple[Array, Cells]:
    """Values at cells, 0 where unknown or off the grid, and which are known."""
    inside = (row >= 0) & (row < known.shape[0]) & (column >= 0) & (column < known.shape[1])
    row, column = np.where(inside, row, 0), np.where(inside, column, 0)
    is_known = inside & known[row, column]
    return np.where(is_known, values[row, column], 0.0), is_known


def _coarser(values: Array, known: Cells) -> tuple[Array, Cells]:
    """Means over the known cells of each 2 x 2 block, and whether a block has any."""
    rows, columns = (-(-size // 2) for size in known.shape)
    sums, counts = np.zeros((rows, columns)), np.zeros((rows, columns))
    for dy, dx in product((0, 1), repeat=2):
        part, some = values[dy::2, dx::2], known[dy::2, dx::2]
        sums[: part.shape[0], : part.shape[1]] += np.where(some, part, 0.0)
        counts[: part.shape[0], : part.shape[1]] += some
    return sums / np.maximum(counts, 1.0), counts > 0.0


def _fill_from_coarser(values: Array, known: Cells) -> None:
    """Fill unknown cells smoothly from means over larger and larger blocks (push and pull)."""
    if known.all():
        return
    coarse, coarse_known = _coarser(values, known)
    _fill_from_coarser(coarse, coarse_known)
    for rows in blocks(*known.shape):
        row, column = np.nonzero(~known[rows])
        at_row, at_column = np.stack([row + rows.start, column]) * 0.5 - 0.25
        values[rows][row, column] = bilinear(coarse, at_row, at_column)


def continue_into_holes(values: Array, missing: Cells) -> None:
    """Give missing cells of values (ny, nx), in place, values without steps and creases.

    The slope at the edge of a hole is continued and fades. Farther inside, the values are means
    of the ground around. At least one cell must be known.
    """
    if not missing.any():
        return
    known = ~missing
    for ring in range(RINGS):
        known |= _carry_on(values, known, 1.0 if ring == 0 else DAMPING)
        if known.all():
            return
    _fill_from_coarser(values, known)


# Small holes, which are filled and become free


def _small_holes(missing: Cells, dx: float, dy: float, size: float) -> Cells:
    """Cells of the holes whose longer side is no more than ``size``.

    Cells that touch at a corner belong to one hole. Cells that reach the map's edge are no hole.
    """
    from scipy.ndimage import find_objects, label

    labels, _ = label(missing, np.ones((3, 3)))
    chosen = np.zeros_like(missing)
    for number, (rows, columns) in enumerate(find_objects(labels), start=1):
        height, width = rows.stop - rows.start, columns.stop - columns.start
        at_edge = (
            rows.start == 0
            or columns.start == 0
            or rows.stop == missing.shape[0]
            or columns.stop == missing.shape[1]
        )
        if at_edge or max(height * dy, width * dx) > size * (1.0 + 1e-9):
            continue
        hole = labels[rows, columns] == number
        if hole.sum() > LARGEST_HOLE:
            raise MapError(
                f"fill_holes={size:g} asks to fill a hole of {hole.sum():,} cells; no more than "
                f"{LARGEST_HOLE:,} are filled; lower it, or read the map coarser (decimate)"
            )
        chosen[rows, columns] |= hole
    return chosen


def _stencils(dx: float, dy: float) -> list[list[tuple[int, int, float]]]:
    """Second differences as (row, column, weight); a thin plate has the least sum of squares."""
    x, y, xy = 1.0 / dx**2, 1.0 / dy**2, np.sqrt(2.0) / (dx * dy)
    return [
        [(0, -1, x), (0, 0, -2.0 * x), (0, 1, x)],
        [(-1, 0, y), (0, 0, -2.0 * y), (1, 0, y)],
        [(0, 0, xy), (0, 1, -xy), (1, 0, -xy), (1, 1, xy)],
    ]


def _equations(
    values: Array, usable: Cells, holes: Cells, stencil: list[tuple[int, int, float]]
) -> tuple[Array, npt.NDArray[np.intp], npt.NDArray[np.intp], Array]:
    """The equations of one second difference at all places where it touches a hole.

    Returns the right-hand sides; and the row, the column and the value of each matrix entry.
    """
    unknown = np.flatnonzero(holes)
    row, column = np.unravel_index(unknown, holes.shape)
    around = [np.stack([row - dy, column - dx], axis=1) for dy, dx, _ in stencil]
    places = np.unique(np.concatenate(around), axis=0)
    whole = np.ones(len(places), dtype=bool)
    for dy, dx, _ in stencil:
        whole &= _at(values, usable, places[:, 0] + dy, places[:, 1] + dx)[1]
    places = places[whole]
    right = np.zeros(len(places))
    rows, columns, entries = [], [], []
    for dy, dx, weight in stencil:
        y, x = places[:, 0] + dy, places[:, 1] + dx
        in_hole = holes[y, x]
        right[~in_hole] -= weight * values[y[~in_hole], x[~in_hole]]
        rows.append(np.flatnonzero(in_hole))
        columns.append(np.searchsorted(unknown, y[in_hole] * holes.shape[1] + x[in_hole]))
        entries.append(np.full(int(in_hole.sum()), weight))
    return right, np.concatenate(rows), np.concatenate(columns), np.concatenate(entries)


def fill_small_holes(values: Array, missing: Cells, dx: float, dy: float, size: float) -> None:
    """Fill small holes of values (ny, nx) by a thin plate; both arrays are changed in place.

    dx, dy : the cells' sides; size : the longest side of a hole that is filled, map units.
    Of all surfaces that continue the ground around it, the plate bends least; a plane stays a
    plane.
    Raises MapError where a hole has too many cells.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    holes = _small_holes(missing, dx, dy, size)
    if not holes.any():
        return
    usable = holes | ~missing
    rows, columns, entries, rights = [], [], [], []
    count = 0
    for stencil in _stencils(1.0, dy / dx):
        right, row, column, entry = _equations(values, usable, holes, stencil)
        rows.append(row + count)
        columns.append(column)
        entries.append(entry)
        rights.append(right)
        count += len(right)
    places = (np.concatenate(rows), np.concatenate(columns))
    matrix = coo_matrix((np.concatenate(entries), places), (count, int(holes.sum()))).tocsr()
    normal = (matrix.T @ matrix).tocsc()
    values[holes] = spsolve(normal, matrix.T @ np.concatenate(rights))
    missing &= ~holes
