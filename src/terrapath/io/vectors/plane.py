"""Transforms a layer from its CRS to the planning plane, and keeps straight edges accurate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import shapely
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError
from shapely.geometry.base import BaseGeometry

from ...errors import InputError, MapError, VectorWarning, tell
from ...space.free_space import POINTS, Geometries, outlines, simple_parts
from ...surface import Surface
from ...surface.bounds import Bounds
from ...surface.georeference import Georeference
from ...validation import Array
from .layers import (
    Layer,
    quietly,
    reason_of,
    repaired,
    require_places,
    with_extent,
)

# The projection bends a straight edge of the file. It is followed to this distance, metres.
TOLERANCE = 0.01
MOST_ROUNDS = 12
MOST_CORNERS = 20_000_000
# The shares of an edge at which its bend is measured: no bend is small at both.
PLACES = (0.3, 0.6)

# Geometries are kept up to this far around the map, as a share of the map's longer side.
MARGIN = 1.0

# Formats that always declare WGS 84, even where the coordinates are on another body.
EARTHLY_FORMATS = ("GeoJSON", "GeoJSONSeq", "KML", "LIBKML")

Where: TypeAlias = Surface | Georeference | None
Move: TypeAlias = Callable[[Array], Array]


@dataclass(frozen=True)
class Plane:
    """The planning plane: its georeference and the bounds of the map, where they are known."""

    georeference: Georeference | None
    bounds: Bounds | None

    @classmethod
    def of(cls, where: Where) -> Plane:
        """From a surface, a georeference or None."""
        if where is None or isinstance(where, Georeference):
            return cls(where, None)
        if isinstance(where, Surface):
            return cls(where.georeference, where.bounds)
        raise InputError(f"where={where!r} is neither a Surface nor a Georeference")

    def crs_of(self, layer: Layer) -> CRS | None:
        """The CRS of a layer; None where it is the plane's own, or where neither has one."""
        reference = self.georeference
        if reference is None:
            if layer.crs is not None:
                raise MapError(
                    f"{layer.label} is in {layer.crs.name}, but the map has no CRS; give the map "
                    "its CRS, or a file without one, in the map's coordinates"
                )
            return None
        crs = layer.crs
        if crs is None:
            crs = reference.map_crs
            text = f"{layer.label} has no CRS and is taken to be in the map's own coordinates"
            tell(VectorWarning(f"{text}, {crs.name}"))
        elif layer.driver in EARTHLY_FORMATS and not reference.is_earth and _is_wgs84(crs):
            crs = reference.crs.geodetic_crs or reference.map_crs
            text = f"{layer.label} cannot name another body than Earth"
            tell(VectorWarning(f"{text} and is taken as longitude and latitude of {crs.name}"))
        return None if crs == reference.crs else crs


def _is_wgs84(crs: CRS) -> bool:
    return bool(crs.is_geographic and crs.ellipsoid and crs.ellipsoid.name == "WGS 84")


def placed(layer: Layer, plane: Plane) -> list[BaseGeometry]:
    """The geometries of a layer, transformed to the plane."""
    crs = plane.crs_of(layer)
    if crs is None:
        return list(layer.shapes)
    assert plane.georeference is not None
    target = plane.georeference.crs
    try:
        transformer = Transformer.from_crs(crs, target, always_xy=True)
        region = None if plane.bounds is None else _region(transformer, plane.bounds)
    except ProjError as error:
        raise MapError(
            f"{layer.label} is in {crs.name}, which cannot be brought onto {target.name}: "
            f"{reason_of(error)}"
        ) from None

    def move(corners: Array) -> Array:
        return np.column_stack(transformer.transform(corners[:, 0], corners[:, 1]))

    metres = target.axis_info[0].unit_conversion_factor if target.axis_info else 1.0
    with quietly(Path(layer.label)):
        near = layer if region is None else _clipped(layer, region)
        near = _with_more_corners(near, move, TOLERANCE / metres)
        layer = replace(near, shapes=np.asarray(shapely.transform(near.shapes, move)))
    require_places(
        layer,
        f"a place that {target.name} does not reach; check the file's CRS, or cut out the part "
        "around the map",
    )
    return list(repaired(layer).shapes)


def _region(transformer: Transformer, bounds: Bounds) -> Bounds | None:
    """The map and its surroundings as a rectangle in the file's CRS; None where it is none."""
    reach = MARGIN * max(bounds.width, bounds.height)
    x0, y0, x1, y1 = bounds
    low, high = (x0 - reach, y0 - reach), (x1 + reach, y1 + reach)
    found = transformer.transform_bounds(*low, *high, densify_pts=41, direction="INVERSE")
    region = Bounds(*found)
    if not np.isfinite(found).all() or region.width <= 0.0 or region.height <= 0.0:
        return None  # across the date line, or beyond where the projection holds
    return region


def _clipped(layer: Layer, region: Bounds) -> Layer:
    """The layer without what lies far from the map, where projections are not valid."""
    frame = shapely.box(*region)
    near = shapely.intersects(layer.shapes, frame)
    shapes, numbers = layer.shapes[near], layer.numbers[near]
    reaching = ~shapely.covered_by(shapes, frame)
    cut = shapely.intersection(shapes[reaching], frame)
    # A geometry that only touches the frame leaves points or lines there, far outside the map.
    same = shapely.get_dimensions(cut) == shapely.get_dimensions(shapes[reaching])
    shapes[reaching] = [
        with_extent(shape) if kept and shape.geom_type == "GeometryCollection" else shape
        for shape, kept in zip(cut, same, strict=True)
    ]
    kept = ~reaching
    kept[reaching] = same
    return replace(layer, shapes=shapes[kept], numbers=numbers[kept])


def _with_more_corners(layer: Layer, move: Move, tolerance: float) -> Layer:
    """The layer with enough corners that straight edges follow bent ones to the tolerance."""
    shapes = layer.shapes.copy()
    for _ in range(MOST_ROUNDS):
        longest = _longest_edges(shapes, move, tolerance)
        cut = np.flatnonzero(np.isfinite(longest))
        if len(cut) == 0:
            break
        if float((shapely.length(shapes[cut]) / longest[cut]).sum()) > MOST_CORNERS:
            raise MapError(
                f"{layer.label}: its edges bend so much on the plane that they need more than "
                f"{MOST_CORNERS:,} corners; cut out the part around the map"
            )
        shapes[cut] = shapely.segmentize(shapes[cut], longest[cut])
    return replace(layer, shapes=shapes)


def _longest_edges(shapes: Geometries, move: Move, tolerance: float) -> Array:
    """(m,): how long the edges of each shape may be; infinite where they are short enough."""
    parts, owners = simple_parts(shapes, np.arange(len(shapes)))
    is_point = np.isin(shapely.get_type_id(parts), POINTS)
    lines, which = outlines(parts[~is_point])
    owners = owners[~is_point][which]
    corners, line = shapely.get_coordinates(lines, return_index=True)
    same = line[1:] == line[:-1]
    a, b, owner = corners[:-1][same], corners[1:][same], owners[line[1:][same]]
    moved = move(corners)
    moved_a, moved_b = moved[:-1][same], moved[1:][same]
    bend = np.zeros(len(a))
    with np.errstate(invalid="ignore"):
        for t in PLACES:
            off = move(a + t * (b - a)) - (moved_a + t * (moved_b - moved_a))
            bend = np.maximum(bend, np.hypot(off[:, 0], off[:, 1]))
    bent = np.isfinite(bend) & (bend > tolerance)
    # A bend shrinks with the square of the edge's length.
    pieces = np.ceil(1.2 * np.sqrt(bend[bent] / tolerance))
    lengths = np.hypot(*(b - a)[bent].T) / np.maximum(pieces, 2.0)
    longest = np.full(len(shapes), np.inf)
    np.minimum.at(longest, owner[bent], lengths)
    return longest
