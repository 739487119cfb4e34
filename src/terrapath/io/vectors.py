"""Obstacles and areas from vector files, brought onto the plane that is planned in."""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import shapely
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError
from shapely.geometry.base import BaseGeometry

from ..errors import InputError, MapError, TerrapathWarning
from ..free_space import POINTS, Geometries, Indices, outlines, simple_parts
from ..surface import Surface
from ..surface.georeference import Georeference
from ..validation import Array, Bounds

# A straight edge of the file, bent by the projection, is followed to this distance, metres.
TOLERANCE = 0.01
MOST_ROUNDS = 12
MOST_CORNERS = 20_000_000
# Where along an edge it is looked at how far it bends: no bend is small at both places.
PLACES = (0.3, 0.6)

# Around the map what is brought along reaches as far as this share of the map's longer side.
MARGIN = 1.0

FARTHEST = 1e12  # no coordinate of a map is larger, in any unit
MOST_BYTES = 4 * 2**30

# Formats whose coordinates are said to be WGS 84 whatever they are.
EARTHLY_FORMATS = ("GeoJSON", "GeoJSONSeq", "KML", "LIBKML")

Where: TypeAlias = Surface | Georeference | None
Move: TypeAlias = Callable[[Array], Array]


class VectorWarning(TerrapathWarning):
    """A vector file was not taken as it stands: something was assumed, or left out."""


class RepairedWarning(VectorWarning):
    """Geometries of a vector file were not valid, and have been repaired."""


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
    source, plane = Path(path), _Plane.of(where)
    layers = list(_layers(source))
    found = [shape for layer in layers for shape in _placed(layer, plane)]
    if plane.bounds is not None:
        _tell_of_outsiders(source, found, sum(len(layer.shapes) for layer in layers), plane.bounds)
    return found


def read_area(path: str | Path, where: Where) -> BaseGeometry:
    """The polygons of a vector file, as one area on the plane; otherwise as ``read_obstacles``.

    Raises MapError, too, where the file holds something else than polygons, or the area lies
    outside the map.
    """
    source, plane = Path(path), _Plane.of(where)
    found: list[BaseGeometry] = []
    for layer in _layers(source):
        for number, shape in zip(layer.numbers, layer.shapes, strict=True):
            if shape.geom_type not in {"Polygon", "MultiPolygon"}:
                raise MapError(
                    f"{layer.label}: feature {number} is a {shape.geom_type}, which bounds no "
                    "area; give polygons"
                )
        found += _placed(layer, plane)
    area = shapely.union_all(found)
    if area.is_empty or (plane.bounds and not shapely.intersects(area, shapely.box(*plane.bounds))):
        raise MapError(f"{source}: the area lies outside the map; check its CRS and the axis order")
    return area


def _tell(category: type[Warning], text: str) -> None:
    warnings.warn(text, category, stacklevel=2)


def _tell_of_outsiders(
    source: Path, shapes: list[BaseGeometry], count: int, bounds: Bounds
) -> None:
    """Where some of the file's obstacles touch no place on the map."""
    frame = shapely.box(*bounds)
    shapely.prepare(frame)
    inside = int(shapely.intersects(frame, np.array(shapes, np.object_)).sum())
    if inside == 0:
        _tell(
            VectorWarning,
            f"{source}: all obstacles lie outside the map; check the file's CRS and its axis order",
        )
    elif inside < count:
        _tell(VectorWarning, f"{source}: {count - inside} of {count} obstacles lie outside the map")


# The plane


@dataclass(frozen=True)
class _Plane:
    """What is planned in."""

    georeference: Georeference | None
    bounds: Bounds | None

    @classmethod
    def of(cls, where: Where) -> _Plane:
        if where is None or isinstance(where, Georeference):
            return cls(where, None)
        if isinstance(where, Surface):
            return cls(where.georeference, where.bounds)
        raise InputError(f"where={where!r} is neither a Surface nor a Georeference")

    def crs_of(self, layer: _Layer) -> CRS | None:
        """The CRS that a layer comes in; None where it is the plane's own, or there is none."""
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
            _tell(
                VectorWarning,
                f"{layer.label} has no CRS and is taken to be in the map's own coordinates, "
                f"{crs.name}",
            )
        elif layer.driver in EARTHLY_FORMATS and not reference.is_earth and _is_wgs84(crs):
            crs = reference.crs.geodetic_crs or reference.map_crs
            _tell(
                VectorWarning,
                f"{layer.label} cannot name another body than Earth and is taken as longitude "
                f"and latitude of {crs.name}",
            )
        return None if crs == reference.crs else crs


def _is_wgs84(crs: CRS) -> bool:
    return bool(crs.is_geographic and crs.ellipsoid and crs.ellipsoid.name == "WGS 84")


# Files


@dataclass(frozen=True, eq=False)
class _Layer:
    """The geometries of a layer as the file has them, none empty. numbers : of their features."""

    label: str
    driver: str
    crs: CRS | None
    shapes: Geometries  # (m,)
    numbers: Indices  # (m,)


def _layers(path: Path) -> Iterator[_Layer]:
    """The layers of a file that hold geometries, checked and repaired."""
    source, names = _listed(path)
    layers = [
        layer
        for name in names
        for layer in [_read_layer(source, name, alone=len(names) == 1)]
        if layer is not None
    ]
    if not layers:
        raise MapError(f"{path} holds no features with a geometry; check that it is the right file")
    yield from map(_repaired, layers)


def _listed(path: Path) -> tuple[Path, list[str]]:
    """The file and the layers that are asked for."""
    source, wanted = path, ""
    if not path.exists():
        file, _, wanted = str(path).rpartition(":")
        source = Path(file)
        if not file or not source.exists():
            raise MapError(f"{path} does not exist; check the path")
    _refuse_absurd_sizes(source)
    import pyogrio

    with _quietly(source):
        known = [(str(name), kind) for name, kind in pyogrio.list_layers(source)]
    if wanted:
        if wanted not in {name for name, _ in known}:
            listed = ", ".join(name for name, _ in known)
            raise MapError(f"{source} has no layer {wanted!r}; its layers are: {listed}")
        return source, [wanted]
    with_geometry = [name for name, kind in known if kind is not None]
    if not with_geometry:
        raise MapError(f"{source} holds no layer with geometries; give a file of polygons or lines")
    return source, with_geometry


def _refuse_absurd_sizes(path: Path) -> None:
    """Before any memory is taken; what is packed counts as it will be unpacked."""
    try:
        files = [p for p in path.glob("*") if p.is_file()] if path.is_dir() else [path]
        size = sum(file.stat().st_size for file in files)
        if path.is_file() and zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                size = sum(item.file_size for item in archive.infolist())
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError) as error:
        raise MapError(f"{path} cannot be read: {_reason(error)}") from None
    if size > MOST_BYTES:
        raise MapError(
            f"{path} holds {size / 2**30:,.1f} GiB, more than {MOST_BYTES / 2**30:g} GiB; "
            "cut out the part around the map"
        )


class _quietly:  # noqa: N801 -- reads as a verb
    """GDAL's complaints become one MapError, its warnings are not shown."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.caught = warnings.catch_warnings()

    def __enter__(self) -> None:
        self.caught.__enter__()
        warnings.simplefilter("ignore")

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.caught.__exit__(kind, error, trace)
        # Of a foreign file, drivers raise whatever they do.
        if isinstance(error, Exception) and not isinstance(error, MapError):
            raise MapError(
                f"{self.path} cannot be read as vectors: {_reason(error)}; check that it is a "
                "vector file, and whole"
            ) from None


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    return text.split("; ")[0][:200]


def _read_layer(path: Path, name: str, *, alone: bool) -> _Layer | None:
    """One layer, without features that have no geometry; None where none has one."""
    import pyogrio

    label = str(path) if alone else f"{path}:{name}"
    with _quietly(path):
        driver = pyogrio.read_info(
            path, layer=name, force_feature_count=False, force_total_bounds=False
        ).get("driver", "")
        about, ids, packed, _ = pyogrio.raw.read(
            path, layer=name, columns=[], force_2d=True, return_fids=True
        )
        shapes = np.empty(0, np.object_) if packed is None else shapely.from_wkb(packed)
    crs = _parsed(about["crs"], label)
    missing = shapely.is_missing(shapes) | shapely.is_empty(shapes)
    if missing.all():
        return None
    if missing.any():
        count = int(missing.sum())
        _tell(
            VectorWarning,
            f"{label}: without geometry and left out: {count} of {len(shapes)} features, the "
            f"first is feature {ids[missing][0]}",
        )
    layer = _Layer(label, driver, crs, shapes[~missing], ids[~missing])
    _require_places(layer, "a coordinate that is not finite, or on no map; mend or remove it")
    return layer


def _parsed(crs: Any, label: str) -> CRS | None:
    if crs is None:
        return None
    try:
        return CRS.from_user_input(crs)
    except CRSError as error:
        raise MapError(f"{label}: the CRS is not understood: {_reason(error)}") from None


def _require_places(layer: _Layer, what: str) -> None:
    corners, owners = shapely.get_coordinates(layer.shapes, return_index=True)
    bad = ~(np.abs(corners) < FARTHEST).all(axis=1)
    if bad.any():
        raise MapError(f"{layer.label}: feature {layer.numbers[owners[bad][0]]} has {what}")


def _repaired(layer: _Layer) -> _Layer:
    """With valid geometries only. What the repair leaves of no extent is left out."""
    reasons, broken = layer.shapes, np.flatnonzero(~shapely.is_valid(layer.shapes))
    if len(broken) == 0:
        return layer
    with _quietly(Path(layer.label)):
        reason = shapely.is_valid_reason(reasons[broken[0]])
        mended = shapely.make_valid(layer.shapes[broken], method="structure", keep_collapsed=True)
    shapes = layer.shapes.copy()
    shapes[broken] = [_with_extent(shape) for shape in mended]
    _tell(
        RepairedWarning,
        f"{layer.label}: not valid, and repaired: {len(broken)} of {len(shapes)} geometries, the "
        f"first is feature {layer.numbers[broken[0]]}: {reason}",
    )
    kept = ~shapely.is_empty(shapes)
    return replace(layer, shapes=shapes[kept], numbers=layer.numbers[kept])


def _with_extent(shape: BaseGeometry) -> BaseGeometry:
    """The polygons of a geometry, else its lines."""
    parts, _ = simple_parts(np.array([shape], np.object_), np.zeros(1, np.int64))
    dimensions = shapely.get_dimensions(parts)
    parts = parts[dimensions == dimensions.max(initial=1)]
    return parts[0] if len(parts) == 1 else shapely.union_all(parts)


# Onto the plane


def _placed(layer: _Layer, plane: _Plane) -> list[BaseGeometry]:
    """The geometries of a layer on the plane."""
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
            f"{_reason(error)}"
        ) from None

    def move(corners: Array) -> Array:
        return np.column_stack(transformer.transform(corners[:, 0], corners[:, 1]))

    metres = target.axis_info[0].unit_conversion_factor if target.axis_info else 1.0
    with _quietly(Path(layer.label)):
        near = layer if region is None else _clipped(layer, region)
        near = _with_more_corners(near, move, TOLERANCE / metres)
        layer = replace(near, shapes=np.asarray(shapely.transform(near.shapes, move)))
    _require_places(
        layer,
        f"a place that {target.name} does not reach; check the file's CRS, or cut out the part "
        "around the map",
    )
    return list(_repaired(layer).shapes)


def _region(transformer: Transformer, bounds: Bounds) -> Bounds | None:
    """Where in the file's CRS the map lies, and around it; None where that is no rectangle."""
    reach = MARGIN * max(bounds.width, bounds.height)
    x0, y0, x1, y1 = bounds
    low, high = (x0 - reach, y0 - reach), (x1 + reach, y1 + reach)
    found = transformer.transform_bounds(*low, *high, densify_pts=41, direction="INVERSE")
    region = Bounds(*found)
    if not np.isfinite(found).all() or region.width <= 0.0 or region.height <= 0.0:
        return None  # across the date line, or beyond where the projection holds
    return region


def _clipped(layer: _Layer, region: Bounds) -> _Layer:
    """Without what lies far from the map, where projections give nonsense."""
    frame = shapely.box(*region)
    near = shapely.intersects(layer.shapes, frame)
    shapes, numbers = layer.shapes[near], layer.numbers[near]
    reaching = ~shapely.covered_by(shapes, frame)
    cut = shapely.intersection(shapes[reaching], frame)
    # What only touches the frame leaves points and lines there, far outside the map.
    same = shapely.get_dimensions(cut) == shapely.get_dimensions(shapes[reaching])
    shapes[reaching] = [
        _with_extent(shape) if kept and shape.geom_type == "GeometryCollection" else shape
        for shape, kept in zip(cut, same, strict=True)
    ]
    kept = ~reaching
    kept[reaching] = same
    return replace(layer, shapes=shapes[kept], numbers=numbers[kept])


def _with_more_corners(layer: _Layer, move: Move, tolerance: float) -> _Layer:
    """With so many corners that straight edges follow the bent ones to the tolerance."""
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
    """How long edges of each shape (m,) may be, infinite where they are short enough."""
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
