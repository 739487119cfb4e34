"""Obstacles and areas from vector files, on the planning plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ...errors import MapError, VectorWarning, tell
from ...surface.bounds import Bounds
from .layers import read_layers
from .plane import Plane, Where, placed


def read_obstacles(
    path: str | Path, where: Where, *, allow_external: bool = False
) -> list[BaseGeometry]:
    """The geometries of a vector file on the planning plane, one for each feature.

    path : a vector file that GDAL reads, in any CRS, for all its layers; or ``FILE:LAYER`` for one
    of them. where : the surface to plan on, or its georeference; None if it has none.
    Straight edges of the file are accurate to a centimetre; third coordinates are dropped. For a
    surface, only geometries within one side of the map around it are kept.
    Polygons that cross themselves are repaired (RepairedWarning). A VectorWarning tells of
    features without geometry, which are left out; of a file without a CRS, which is taken to be
    in the map's own coordinates; of obstacles outside the map; and of a file without any.
    allow_external : the file may take its data from outside its folder, as an OGR VRT can.
    Raises MapError with the file, the reason and the remedy.
    """
    source, plane = Path(path), Plane.of(where)
    layers = list(read_layers(source, allow_external=allow_external))
    if not layers:
        tell(VectorWarning(f"{source} is empty: it holds no obstacles"))
        return []
    shapes = [shape for layer in layers for shape in placed(layer, plane)]
    if plane.bounds is not None:
        count = sum(len(layer.shapes) for layer in layers)
        _warn_of_obstacles_outside(source, shapes, count, plane.bounds)
    return shapes


def read_area(path: str | Path, where: Where, *, allow_external: bool = False) -> BaseGeometry:
    """The polygons of a vector file, as one area on the plane; otherwise as ``read_obstacles``.

    Raises MapError also where the file holds geometries other than polygons, or where the area
    lies outside the map.
    """
    source, plane = Path(path), Plane.of(where)
    polygons: list[BaseGeometry] = []
    layers = list(read_layers(source, allow_external=allow_external))
    for layer in layers:
        for number, shape in zip(layer.numbers, layer.shapes, strict=True):
            if shape.geom_type not in {"Polygon", "MultiPolygon"}:
                raise MapError(
                    f"{layer.label}: feature {number} is a {shape.geom_type}, which bounds no "
                    "area; give polygons"
                )
        polygons += placed(layer, plane)
    if not layers:
        raise MapError(f"{source} is empty: it holds no area; give a file of polygons")
    area = shapely.union_all(polygons)
    if area.is_empty or (plane.bounds and not shapely.intersects(area, shapely.box(*plane.bounds))):
        raise MapError(f"{source}: the area lies outside the map; check its CRS and the axis order")
    return area


def _warn_of_obstacles_outside(
    source: Path, shapes: list[BaseGeometry], count: int, bounds: Bounds
) -> None:
    """Warn if some of the file's ``count`` obstacles lie wholly outside the map."""
    frame = shapely.box(*bounds)
    shapely.prepare(frame)
    inside = int(shapely.intersects(frame, np.array(shapes, np.object_)).sum())
    if inside == 0:
        text = "all obstacles lie outside the map; check the file's CRS and its axis order"
        tell(VectorWarning(f"{source}: {text}"))
    elif inside < count:
        text = f"{count - inside} of {count} obstacles lie outside the map"
        tell(VectorWarning(f"{source}: {text}"))
