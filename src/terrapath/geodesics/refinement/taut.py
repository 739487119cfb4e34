"""The taut path among obstacles, from the first pull to the final points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..._support.watching import MustStop
from ...problem import Problem
from ...space.free_space import Circle, FreeSpace, Indices
from ...surface import Surface
from ...validation import Array
from .clear import is_clear, moved_clear
from .contacts import NONE, Band, adopted, advanced, outwards, subdivided, tightened
from .newton import correct, curve_through, placed_parameters, settle
from .walls import FEWEST_SIDES, MOST_SIDES, Surroundings, surroundings, widest_clearance

# Where obstacles leave no room for the widest clearance, a tenth of it is tried, and so on.
CLEARANCE_ATTEMPTS = 4

# Points that are nearer to one another than this, as a share of the region's side, are merged.
REPEATED = 1e-10

# Pieces of the polyline for each feature of the surface, stage by stage.
PIECES_PER_FEATURE = (2.0, 8.0)
PACED_PIECES_PER_FEATURE = (2.0, 8.0, 32.0)
MOST_PIECES = 4096
FEWEST_PIECES = 8  # of the path, and of each smooth stretch
# A piece shorter than this share of a feature is taken as straight.
STRAIGHT = 3e-3
SMOOTHING_ROUNDS = 10


def taut_paths(
    problem: Problem, points: Array, tolerance: float, must_stop: MustStop, is_near: bool = False
) -> Iterator[Array]:
    """Polylines (m, 2) from the one given towards the taut path; each is closer to it.

    is_near : is the one given nearly taut? Then it is not pulled in coarse pieces first.
    Where it must stop, the next one is as far as the path is pulled.
    """
    surface, space = problem.priced, problem.free_space
    cleared = _cleared(space, points, must_stop)
    if cleared is None:
        return
    around, points = cleared
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    band = Band.free(points)
    counts = PIECES_PER_FEATURE if problem.travel is None else PACED_PIECES_PER_FEATURE
    for pieces in counts[1 if is_near else 0 :]:
        longest = max(surface.resolution / pieces, length / MOST_PIECES)
        longest = min(longest, length / FEWEST_PIECES)
        band = adopted(around, subdivided(band, longest))
        band = tightened(surface, around, band, must_stop)
        while (finer := _with_finer_discs(space, around, band, must_stop)) is not None:
            around, band = finer
            band = tightened(surface, around, subdivided(band, longest), must_stop)
        band = _pruned(around, band)
        yield _tidied(problem, band.points)
    band = _smoothed(surface, around, band, must_stop)
    yield _tidied(problem, band.points)
    yield _tidied(problem, _placed(surface, around, band, tolerance, must_stop))


def _tidied(problem: Problem, points: Array) -> Array:
    """The points without repeated ones; those just outside the bounds are put on the edge."""
    apart = np.hypot(*np.diff(points, axis=0).T) > REPEATED * problem.bounds.side
    kept = np.concatenate([points[:1], points[1:-1][apart[:-1]], points[-1:]])
    x0, y0, x1, y1 = problem.bounds
    inside = np.clip(kept, (x0, y0), (x1, y1))
    return _with_ends(problem, inside)


def _with_ends(problem: Problem, points: Array) -> Array:
    """The path from the very start to the very goal, which may graze an obstacle.

    Where a segment to an end is not free, the point that the end was moved to is kept.
    """
    ends = np.array([[problem.start], [problem.goal]])
    joined = np.concatenate([ends[0], points[1:-1], ends[1]])
    free = problem.free_space.segments_are_free(joined[[0, -2]], joined[[1, -1]])
    first = points[:1] if not free[0] else points[:0]
    last = points[-1:] if not free[1] else points[:0]
    return np.concatenate([ends[0], first, points[1:-1], last, ends[1]])


# Discs


def _cleared(
    space: FreeSpace, points: Array, must_stop: MustStop
) -> tuple[Surroundings, Array] | None:
    """The surroundings of a path, and the path moved clear of what it grazes.

    The clearance is the largest one that the path keeps or can be moved to keep; None where even
    the smallest one leaves no room, or where it must stop.
    """
    widest = widest_clearance(space)
    for attempt in range(CLEARANCE_ATTEMPTS):
        clearance = widest * 0.1**attempt
        sides = np.array([_sides_clear_of(points, c, clearance) for c in space.circles], int)
        around = surroundings(space, clearance, sides, must_stop)
        if around is None:
            return None
        cleared = points if is_clear(around, points) else moved_clear(space, around, points)
        if cleared is not None:
            return around, cleared
    return None


def _sides_clear_of(points: Array, circle: Circle, clearance: float) -> int:
    """How many sides the coarsest polygon around a disc has that a polyline stays out of."""
    centre, radius = np.array([circle.x1, circle.x2]), circle.radius
    ahead, offset = np.diff(points, axis=0), centre - points[:-1]
    squared = np.maximum((ahead**2).sum(axis=1), 1e-300)
    within = np.clip((offset * ahead).sum(axis=1) / squared, 0.0, 1.0)
    nearest = float(np.hypot(*(within[:, None] * ahead - offset).T).min())
    sides = FEWEST_SIDES
    while sides < MOST_SIDES and nearest < (radius + clearance) / math.cos(math.pi / sides):
        sides *= 4
    return sides


def _with_finer_discs(
    space: FreeSpace, around: Surroundings, band: Band, must_stop: MustStop
) -> tuple[Surroundings, Band] | None:
    """Surroundings with four times the sides around the discs that the path bends round.

    A coarse corner is replaced by four that lie behind it, and the path is pulled onto them. None
    where no disc that the path touches can have more sides, or where it must stop.
    """
    band = _pruned(around, band)
    touched = np.unique(around.discs[band.bends])
    grown = touched[touched != NONE]
    grown = grown[around.sides[grown] < MOST_SIDES]
    if len(grown) == 0:
        return None
    sides = around.sides.copy()
    sides[grown] *= 4
    finer = surroundings(space, float(around.clearance[0]), sides, must_stop)
    if finer is None:
        return None
    plain = int((around.discs[:-1] == NONE).sum())
    old_first = plain + np.concatenate([[0], np.cumsum(around.sides)])
    new_first = plain + np.concatenate([[0], np.cumsum(sides)])
    discs = around.discs[band.bends]
    factors = np.where(discs != NONE, sides[discs] // around.sides[discs], 1)
    cut = np.repeat(np.arange(len(discs)), factors)
    within = np.arange(len(cut)) - np.repeat(np.cumsum(factors) - factors, factors)
    # A disc to the left is passed from corner to corner in their order.
    within = np.where(_is_left(around, band)[cut], within, factors[cut] - 1 - within)
    place = factors[cut] * (band.bends[cut] - old_first[discs[cut]]) + new_first[discs[cut]]
    bends = np.where(discs[cut] != NONE, place + within, band.bends[cut])
    wanted = replace(Band.free(band.points[cut]), bends=bends)
    return finer, _pulled_back(finer, wanted, np.where(discs[cut] != NONE, cut, NONE))


def _is_left(around: Surroundings, band: Band) -> npt.NDArray[np.bool_]:
    """(m,): do the obstacles that the path bends round lie to its left?"""
    left = np.zeros(len(band.points), bool)
    off, along = outwards(around, band), band.points[2:] - band.points[:-2]
    left[1:-1] = along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0] < 0.0
    return left


def _pulled_back(around: Surroundings, band: Band, groups: Indices) -> Band:
    """The band with points moved to the corners that they should be at.

    groups : (m,), the group that each point belongs to, or NONE. Every other group moves at a time,
    so that a group that is stopped does not keep the others from moving. Its points are then free.
    """
    for parity in (0, 1):
        moving = (groups != NONE) & (np.cumsum(np.diff(groups, prepend=NONE) != 0) % 2 == parity)
        target = np.where(moving[:, None], around.corners[band.bends], band.points)
        loose = replace(band, bends=np.where(moving, NONE, band.bends))
        moved, before = advanced(around, loose, target)
        groups = np.insert(groups, before, NONE)
        band = adopted(around, moved)
    return band


def _pruned(around: Surroundings, band: Band) -> Band:
    """The band without the points between neighbouring corners of a disc's polygon.

    Its sides are so short that the path between them is taken as straight.
    """
    held = np.flatnonzero(band.is_held)
    discs = around.discs[band.bends[held]]
    same = (discs[:-1] != NONE) & (discs[:-1] == discs[1:])
    apart = np.abs(np.diff(band.bends[held]))
    beside = (apart == 1) | (apart == around.sides[discs[:-1]] - 1) if same.any() else same
    kept = np.ones(len(band.points), bool)
    for first, last in zip(held[:-1][same & beside], held[1:][same & beside], strict=True):
        kept[first + 1 : last] = False
    return band.chosen(kept)


# The exact geodesics between the contacts


def _stretches(surface: Surface, around: Surroundings, band: Band) -> Iterator[tuple[Band, bool]]:
    """The band in parts that share their ends, and whether each one is to be a geodesic.

    The other parts run along walls and around discs; they are straight from point to point.
    """
    stops = np.flatnonzero(band.is_held | (band.walls[:, 0] != NONE))
    first, last = stops[:-1], stops[1:]
    on_one_wall = (band.walls[first, 0] != NONE) & (band.walls[first, 0] == band.walls[last, 0])
    discs = np.maximum(around.discs[band.bends], around.wall_discs[band.walls[:, 0]])
    on_one_disc = (discs[first] != NONE) & (discs[first] == discs[last])
    sizes = np.hypot(*(band.points[last] - band.points[first]).T)
    is_short = sizes < STRAIGHT * surface.resolution
    is_straight = (last - first == 1) & (on_one_wall | on_one_disc | is_short)
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(band.points, axis=0).T))])
    is_straight |= reached[first] == reached[last]
    begins = np.concatenate([[True], ~(is_straight[1:] & is_straight[:-1])])
    groups = np.append(first[begins], last[-1])
    for begin, end, straight in zip(groups[:-1], groups[1:], is_straight[begins], strict=True):
        yield band.chosen(slice(begin, end + 1)), not straight


def _joined(parts: list[Band]) -> Band:
    """One band from parts that share their ends."""
    kept = [parts[0], *(part.chosen(slice(1, None)) for part in parts[1:])]
    names = ("points", "bends", "walls")
    return Band(*(np.concatenate([getattr(part, name) for part in kept]) for name in names))


def _smoothed(surface: Surface, around: Surroundings, band: Band, must_stop: MustStop) -> Band:
    """The band with each part between contacts moved onto a geodesic.

    The error falls with the fourth power of the spacing of points. Where such a part meets another
    corner, the path is bent round that too, and pulled taut again.
    """
    for _ in range(SMOOTHING_ROUNDS):
        parts = [
            _smoothed_part(surface, around, part, must_stop)
            if is_geodesic and not must_stop()
            else part
            for part, is_geodesic in _stretches(surface, around, band)
        ]
        smoothed = _joined(parts)
        if (smoothed.bends != NONE).sum() == (band.bends != NONE).sum():
            return smoothed
        band = tightened(surface, around, smoothed, must_stop)
    return band


def _smoothed_part(surface: Surface, around: Surroundings, part: Band, must_stop: MustStop) -> Band:
    """A part between contacts, moved onto the geodesic between its ends."""
    pieces = len(part.points) - 1
    if math.isinf(surface.resolution):
        target = np.linspace(part.points[0], part.points[-1], pieces + 1)
        return advanced(around, part, target)[0]
    if pieces < FEWEST_PIECES:
        longest = float(np.hypot(*np.diff(part.points, axis=0).T).max())
        part = subdivided(part, longest * pieces / FEWEST_PIECES)
    settled = settle(surface, part.points, must_stop)
    corrected = correct(surface, settled)
    return advanced(around, part, settled if corrected is None else corrected)[0]


def _placed(
    surface: Surface, around: Surroundings, band: Band, tolerance: float, must_stop: MustStop
) -> Array:
    """The final points (m, 2), along the geodesics between contacts."""
    placed = [band.points[:1]]
    for part, is_geodesic in _stretches(surface, around, band):
        curved = is_geodesic and not must_stop()
        points = _placed_part(surface, around, part, tolerance) if curved else part.points
        placed.append(points[1:])
    return np.concatenate(placed)


def _placed_part(surface: Surface, around: Surroundings, part: Band, tolerance: float) -> Array:
    pieces = len(part.points) - 1
    if pieces < 2:
        return part.points
    if math.isinf(surface.resolution):
        return part.points[[0, -1]]
    curve = curve_through(part.points)
    at_vertices = np.linspace(0.0, 1.0, pieces + 1)
    parameters = np.union1d(at_vertices, placed_parameters(surface, curve, pieces, tolerance))
    before = np.column_stack([np.interp(parameters, at_vertices, axis) for axis in part.points.T])
    target = curve(parameters)
    target[[0, -1]] = part.points[[0, -1]]
    band = Band.free(before)
    band.bends[[0, -1]] = part.bends[[0, -1]]
    moved, _ = advanced(around, band, target)
    met_corner = len(moved.points) > len(target)
    return part.points if met_corner else moved.points
