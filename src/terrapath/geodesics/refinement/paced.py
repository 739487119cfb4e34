"""Pulling a path taut under a pace: strands, softened kinks, and where points are placed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..._kernels.geodesics.paced import COST, PIECE, PacedStrand
from ...surface import Surface
from ...surface.metric import segment_lengths
from ...validation import Array

# A kink is softened to these widths, in grades, one after another, from the path of the one before.
# So much of the length is added, too, as a share of the pace of level ground.
WIDTHS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
# Beside a kink each piece of a polyline costs more in proportion to its size. So many points as a
# smooth pace needs would not do, and are not asked for.
LEAST_TOLERANCE = 1e-6
# Pieces are measured this precisely, as a share, to see what halving them saves.
MEASURED = 1e-9
# In each round the pieces are halved that make up this share of what halving all would gain.
SHARE_OF_GAIN, MOST_ROUNDS = 0.9, 12


def softened(surface: Surface) -> tuple[Surface, ...]:
    """A surface with a pace, its kinks softened, less and less."""
    return tuple(with_width(surface, width) for width in WIDTHS)


def with_width(surface: Surface, width: float) -> Surface:
    """A surface with a pace whose kinks are so wide, in grades."""
    data: Any = surface.data
    level = float(np.interp(0.0, *_at_knots(data)))
    price = data.price._replace(width=width, share=width * level)
    return replace(surface, data=data._replace(price=price))


def _at_knots(data: Any) -> tuple[Array, Array]:
    """The knots of a pace, and about its values there."""
    pace = data.price.pace
    slopes, intercepts = pace.slopes[:, None], pace.intercepts[:, None]
    return pace.knots, np.asarray((intercepts + slopes * pace.knots).max(axis=0))


def paced_strand(surface: Surface, points: Array) -> PacedStrand:
    """A polyline (m, 2) with room for the surface along it."""
    data: Any = surface.data
    m = len(points)
    return PacedStrand(
        points,
        data.weights,
        np.empty((m, 1, 6)),
        np.empty((m, 6)),
        np.empty((m - 1, 3)),
        np.empty(m - 1),
        np.empty((m - 1, PIECE)),
        data.price,
    )


def chords_of(strand: PacedStrand) -> Array:
    """(m - 1,): the costs of the chords of a strand's pieces."""
    return np.asarray(np.sqrt(strand.stiffness) * strand.pieces[:, COST])


def forces_of(strand: PacedStrand) -> Array:
    """(m - 2, 2), minus the derivative of the cost by each inner point, over the mean pace."""
    slopes = strand.jets[:, 0, 1:3] * strand.weights[0]
    a, b = strand.pieces[:, 1, None], strand.pieces[:, 2, None]
    ahead, root = strand.pieces[:, 5:7], np.sqrt(strand.stiffness)[:, None]
    at_end, at_begin = root * (a * ahead + b * slopes[1:]), root * (a * ahead + b * slopes[:-1])
    shares = strand.pieces[:, COST, None] / root
    drift = 0.25 * (shares[1:] + shares[:-1]) * strand.costs[1:-1, 1:3]
    sizes = np.hypot(strand.chords[:, 0], strand.chords[:, 1]).sum()
    level = strand.pieces[:, COST].sum() / sizes
    force = at_begin[1:] - at_end[:-1] - drift
    return np.asarray(force / (level * np.sqrt(strand.costs[1:-1, :1])))


def split_parameters(
    surface: Surface,
    curve: Callable[[Array], Array],
    pieces: int,
    tolerance: float,
    most: int,
) -> Array:
    """The curve's parameters at the points of a polyline that costs hardly more than the curve.

    Pieces are halved until halving all would save no more than the tolerance, as a share, or there
    are ``most`` of them.
    """
    t = np.linspace(0.0, 1.0, max(min(pieces, most), 1) + 1)
    for _ in range(MOST_ROUNDS):
        between = 0.5 * (t[1:] + t[:-1])
        a, b, middle = curve(t[:-1]), curve(t[1:]), curve(between)
        whole, *parts = (
            segment_lengths(surface, *ends, MEASURED) for ends in ((a, b), (a, middle), (middle, b))
        )
        halves = parts[0] + parts[1]
        gains = np.maximum(whole - halves, 0.0)
        if gains.sum() <= max(tolerance, LEAST_TOLERANCE) * halves.sum() or len(t) > most:
            break
        order = np.argsort(-gains)
        needed = np.searchsorted(np.cumsum(gains[order]), SHARE_OF_GAIN * gains.sum()) + 1
        chosen = order[: min(int(needed), most + 1 - len(t))]
        if len(chosen) == 0:
            break
        t = np.sort(np.append(t, between[chosen]))
    return t
