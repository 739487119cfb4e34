"""A route in degrees, with enough points that straight lines between them follow it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...errors import MapError
from ...surface.georeference import Georeference
from ...surface.ground import plane_metres
from ...validation import Array

# Decimals of a degree: a tenth of a millimetre on Earth.
DECIMALS = 9
# A straight line of the plane is a curve in degrees. No chord of it may be farther off, metres.
LARGEST_SAG = 0.5
# Rounds of halving. Only a line through a pole needs more, and for it no number is enough.
ROUNDS = 12


class Part(NamedTuple):
    """A part of a route on one side of the antimeridian."""

    lonlat: Array  # (m, 2), degrees, longitude in [-180, 180]
    points: Array  # (m, 2), the same places on the plane, map units


def require_earth(path: Path, georeference: Georeference | None) -> None:
    """Raise MapError where the plane has no WGS 84 coordinates: GPX and KML allow no others."""
    if georeference is not None and georeference.is_earth:
        return
    where = "the map has no CRS" if georeference is None else f"{georeference.name} is not on Earth"
    kind = path.suffix[1:].upper()
    raise MapError(
        f"output={str(path)!r} cannot be written: {kind} holds places on Earth, and {where}; "
        "write .geojson, .gpkg or .csv instead"
    )


def in_degrees(reference: Georeference, points: Array) -> Array:
    """Plane (m, 2) -> longitude and latitude, degrees; MapError where a point has none."""
    lonlat = reference.to_lonlat(points)
    if not np.isfinite(lonlat).all():
        x, y = points[~np.isfinite(lonlat).all(axis=1)][0]
        raise MapError(
            f"({x:.10g}, {y:.10g}) has no longitude and latitude in {reference.name}; "
            "check the map's CRS"
        )
    return lonlat


def _unwrapped(lonlat: Array) -> Array:
    """The same places without jumps of 360 degrees at the antimeridian."""
    return np.column_stack([np.unwrap(lonlat[:, 0], period=360.0), lonlat[:, 1]])


def following(reference: Georeference, points: Array) -> Array:
    """The points, and more between them where a straight line in degrees is too far off."""
    metres = plane_metres(reference) or 1.0
    for _ in range(ROUNDS):
        lonlat = _unwrapped(in_degrees(reference, points))
        chords = reference.from_lonlat(0.5 * (lonlat[:-1] + lonlat[1:]))
        middles = 0.5 * (points[:-1] + points[1:])
        sag = metres * np.hypot(*(chords - middles).T)
        # Not written as sag > ..., so that NaN counts as too far off.
        too_far = np.flatnonzero(~(sag <= LARGEST_SAG))
        if len(too_far) == 0:
            break
        points = np.insert(points, too_far + 1, middles[too_far], axis=0)
    return points


def parts_in_degrees(reference: Georeference, points: Array) -> list[Part]:
    """A route in degrees, cut at the antimeridian (RFC 7946, section 3.1.9)."""
    points = following(reference, points)
    lonlat = _unwrapped(in_degrees(reference, points))
    places = np.column_stack([lonlat, points])
    turns = np.floor((places[:, 0] + 180.0) / 360.0)
    parts, current = [], [places[0]]
    for a, b, turn, next_turn in zip(places, places[1:], turns, turns[1:], strict=False):
        if next_turn != turn:
            meridian = 360.0 * max(turn, next_turn) - 180.0
            cut = a + (meridian - a[0]) / (b[0] - a[0]) * (b - a)
            parts.append((turn, [*current, cut]))
            current = [cut]
        current.append(b)
    parts.append((turns[-1], current))
    cut_parts = [_part(np.array(stretch), turn) for turn, stretch in parts]
    # A route that only touches the antimeridian leaves parts of no length.
    return [part for part in cut_parts if np.ptp(part.lonlat, axis=0).any()] or cut_parts[:1]


def _part(stretch: Array, turn: float) -> Part:
    lonlat = np.round(stretch[:, :2] - [360.0 * turn, 0.0], DECIMALS)
    lonlat[:, 0] = np.clip(lonlat[:, 0], -180.0, 180.0)
    return Part(lonlat, stretch[:, 2:])
