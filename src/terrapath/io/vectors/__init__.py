"""Obstacles and areas from vector files, brought onto the plane that is planned in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ...errors import MapError, tell
from ...surface.bounds import Bounds
from .layers import VectorWarning, read_layers
from .plane import Plane, Where, placed


def read_obstacles(path: str | Path, where: Where) -> list[BaseGeometry]:
    """The geometries of a vector file on the plane that is planned in, one a feature.

    path : anything GDAL reads as vectors, in any CRS, all layers; or ``FILE:LAYER`` for one of
    them. where : the surface that is planned on, or its georeference, None for one without.
    Straight edges of the file stay right to a centimetre; third coordinates are dropped. Only
    what lies within a map's side of a surface is brought along.
    Polygons that cross themselves are repaired (RepairedWarning); features without geometry are
    left out, a file without CRS is taken to be in the map's own coordinates, and obstacles
    outside the map are told of (VectorWarning).
    Raises MapError with the file, the reason and the remedy.
    """
    source, plane = Path(path), Plane.of(where)
    layers = list(read_layers(source))
    found = [shape for layer in layers for shape in placed(layer, plane)]
    if plane.bounds is not None:
        _tell_of_outsiders(source, found, sum(len(layer.shapes) for layer in layers), plane.bounds)
    return found


def read_area(path: str | Path, where: Where) -> BaseGeometry:
    """The polygons of a vector file, as one area on the plane; otherwise as ``read_obstacles``.

    Raises MapError, too, where the file holds something else than polygons, or the area lies
    outside the map.
    """
    source, plane = Path(path), Plane.of(where)
    found: list[BaseGeometry] = []
    for layer in read_layers(source):
        for number, shape in zip(layer.numbers, layer.shapes, strict=True):
            if shape.geom_type not in {"Polygon", "MultiPolygon"}:
                raise MapError(
                    f"{layer.label}: feature {number} is a {shape.geom_type}, which bounds no "
                    "area; give polygons"
                )
        found += placed(layer, plane)
    area = shapely.union_all(found)
    if area.is_empty or (plane.bounds and not shapely.intersects(area, shapely.box(*plane.bounds))):
        raise MapError(f"{source}: the area lies outside the map; check its CRS and the axis order")
    return area


def _tell_of_outsiders(
    source: Path, shapes: list[BaseGeometry], count: int, bounds: Bounds
) -> None:
    """Where some of the file's obstacles touch no place on the map."""
    frame = shapely.box(*bounds)
    shapely.prepare(frame)
    inside = int(shapely.intersects(frame, np.array(shapes, np.object_)).sum())
    if inside == 0:
        told = "all obstacles lie outside the map; check the file's CRS and its axis order"
        tell(VectorWarning(f"{source}: {told}"))
    elif inside < count:
        told = f"{count - inside} of {count} obstacles lie outside the map"
        tell(VectorWarning(f"{source}: {told}"))
