"""The layers of a vector file, checked and repaired."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError
from shapely.geometry.base import BaseGeometry

from ..._support.extras import require_packages
from ...errors import MapError, RepairedWarning, VectorWarning, silence, tell
from ...space.free_space import Geometries, Indices, simple_parts
from ...validation import is_there
from ..bands import FARTHEST
from ..sources import require_safe

MOST_BYTES = 4 * 2**30
MOST_TO_KNOW_GML = 4096  # bytes in which GML names its namespace
PACKED = (".gz", ".zip")


@dataclass(frozen=True, eq=False)
class Layer:
    """The geometries of a layer in the file's CRS, none empty. numbers : of their features."""

    label: str
    driver: str
    crs: CRS | None
    shapes: Geometries  # (m,)
    numbers: Indices  # (m,)


def read_layers(path: Path, *, allow_external: bool = False) -> Iterator[Layer]:
    """The layers of a file that hold geometries, checked and repaired; none for an empty file.

    allow_external : the file may take its data from outside its folder.
    """
    source, wanted = _found(path)
    _refuse_absurd_sizes(source)
    require_safe(source, allow_external=allow_external)
    require_packages(f"reading {source}", "pyogrio")
    names, count = _listed(source, wanted)
    data = _content(source)
    layers = [
        layer
        for name in names
        for layer in [_read_layer(source, data, name, alone=len(names) == 1)]
        if layer is not None
    ]
    if count and not layers:
        raise MapError(f"{path} holds no features with a geometry; check that it is the right file")
    yield from map(repaired, layers)


def _found(path: Path) -> tuple[Path, str]:
    """The file, and the name of its layer that is wanted, "" for all."""
    if is_there(path):
        return path, ""
    file, _, wanted = str(path).rpartition(":")
    if not file or not is_there(Path(file)):
        raise MapError(f"{path} does not exist; check the path")
    return Path(file), wanted


def _content(source: Path) -> Path | bytes:
    """The file; its bytes where GDAL would leave another file (.gfs) beside it."""
    if not source.is_file():
        return source
    with source.open("rb") as file:
        is_gml = b"opengis.net/gml" in file.read(MOST_TO_KNOW_GML)
    return source.read_bytes() if is_gml and source.suffix.lower() not in PACKED else source


def _listed(source: Path, wanted: str) -> tuple[list[str], int]:
    """The names of the layers to read, and how many features all layers have."""
    import pyogrio

    data = _content(source)
    with quietly(source):
        known = [(str(name), kind) for name, kind in pyogrio.list_layers(data)]
    if wanted:
        if wanted not in {name for name, _ in known}:
            listed = ", ".join(name for name, _ in known)
            raise MapError(f"{source} has no layer {wanted!r}; its layers are: {listed}")
        return [wanted], _count(data, source, wanted)
    with_geometry = [name for name, kind in known if kind is not None]
    count = sum(_count(data, source, name) for name, _ in known)
    if count and not with_geometry:
        raise MapError(f"{source} holds no layer with geometries; give a file of polygons or lines")
    return with_geometry, count


def _count(data: Path | bytes, source: Path, layer: str) -> int:
    import pyogrio

    with quietly(source):
        return int(pyogrio.read_info(data, layer=layer, force_feature_count=True)["features"])


def _refuse_absurd_sizes(path: Path) -> None:
    """Raise MapError for a file that is too large, before memory is allocated."""
    try:
        files = [p for p in path.glob("*") if p.is_file()] if path.is_dir() else [path]
        size = sum(file.stat().st_size for file in files)
    except (OSError, ValueError) as error:
        raise MapError(f"{path} cannot be read: {reason_of(error)}") from None
    if size > MOST_BYTES:
        raise MapError(
            f"{path} holds {size / 2**30:,.1f} GiB, more than {MOST_BYTES / 2**30:g} GiB; "
            "cut out the part around the map"
        )


@contextmanager
def quietly(path: Path) -> Iterator[None]:
    """Turn errors of GDAL and GEOS into one MapError, and do not show their warnings."""
    for module in ("pyogrio.core", "pyogrio.raw"):
        silence(RuntimeWarning, module)
    try:
        with np.errstate(all="ignore"):
            yield
    except MapError:
        raise
    except Exception as error:  # for damaged files, drivers raise errors of any type
        raise MapError(
            f"{path} cannot be read as vectors: {reason_of(error)}; check that it is a "
            "vector file, and complete"
        ) from None


def reason_of(error: Exception) -> str:
    """The message of an error, on one short line."""
    text = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    return text.split("; ")[0][:200]


def _read_layer(path: Path, data: Path | bytes, name: str, *, alone: bool) -> Layer | None:
    """One layer, with those features that have a geometry; None where no feature has one."""
    import pyogrio

    label = str(path) if alone else f"{path}:{name}"
    with quietly(path):
        driver = pyogrio.read_info(
            data, layer=name, force_feature_count=False, force_total_bounds=False
        ).get("driver", "")
        about, ids, packed, _ = pyogrio.raw.read(
            data, layer=name, columns=[], force_2d=True, return_fids=True
        )
        shapes = np.empty(0, np.object_) if packed is None else shapely.from_wkb(packed)
    crs = _parsed(about["crs"], label)
    missing = shapely.is_missing(shapes) | shapely.is_empty(shapes)
    if missing.all():
        return None
    if missing.any():
        count = int(missing.sum())
        text = f"{label}: without geometry and left out: {count} of {len(shapes)} features"
        tell(VectorWarning(f"{text}, the first is feature {ids[missing][0]}"))
    layer = Layer(label, driver, crs, shapes[~missing], ids[~missing])
    require_places(layer, "a coordinate that is not finite, or on no map; repair or remove it")
    return layer


def _parsed(crs: object, label: str) -> CRS | None:
    if crs is None:
        return None
    try:
        return CRS.from_user_input(crs)
    except CRSError as error:
        raise MapError(f"{label}: the CRS is not understood: {reason_of(error)}") from None


def require_places(layer: Layer, what: str) -> None:
    """Raise MapError where a coordinate is not finite or too large. what : the feature has it."""
    corners, owners = shapely.get_coordinates(layer.shapes, return_index=True)
    bad = ~(np.abs(corners) < FARTHEST).all(axis=1)
    if bad.any():
        raise MapError(f"{layer.label}: feature {layer.numbers[owners[bad][0]]} has {what}")


def repaired(layer: Layer) -> Layer:
    """The layer with valid geometries only; those that the repair leaves empty are left out."""
    broken = np.flatnonzero(~shapely.is_valid(layer.shapes))
    if len(broken) == 0:
        return layer
    with quietly(Path(layer.label)):
        reason = shapely.is_valid_reason(layer.shapes[broken[0]])
        mended = shapely.make_valid(layer.shapes[broken], method="structure", keep_collapsed=True)
    shapes = layer.shapes.copy()
    shapes[broken] = [with_extent(shape) for shape in mended]
    text = f"{layer.label}: not valid, and repaired: {len(broken)} of {len(shapes)} geometries"
    tell(RepairedWarning(f"{text}, the first is feature {layer.numbers[broken[0]]}: {reason}"))
    kept = ~shapely.is_empty(shapes)
    return replace(layer, shapes=shapes[kept], numbers=layer.numbers[kept])


def with_extent(shape: BaseGeometry) -> BaseGeometry:
    """The polygons of a geometry; where it has none, its lines."""
    parts, _ = simple_parts(np.array([shape], np.object_), np.zeros(1, np.int64))
    dimensions = shapely.get_dimensions(parts)
    parts = parts[dimensions == dimensions.max(initial=1)]
    return parts[0] if len(parts) == 1 else shapely.union_all(parts)
