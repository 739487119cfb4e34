"""Rasters that GDAL reads, as surfaces."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import CRS

from ..errors import InputError, MapError
from ..surface import Surface
from ..surface.georeference import Georeference
from ..surface.raster import Raster, parse_crs
from ..validation import Array, require_not_negative

_SOURCE = re.compile(r"(?P<path>.+?)(?::(?P<band>\d+))?(?:\*(?P<weight>[^*]*))?", re.DOTALL)


@dataclass(frozen=True)
class LayerSource:
    """Where a layer comes from: a band of a raster, and the weight of its changes."""

    path: Path
    band: int = 1
    weight: float = 1.0

    @classmethod
    def parse(cls, text: str) -> LayerSource:
        """FILE[:BAND][*WEIGHT]."""
        match = _SOURCE.fullmatch(text)
        try:
            if match is None:
                raise ValueError
            weight = 1.0 if match["weight"] is None else float(match["weight"])
        except ValueError:
            raise InputError(
                f"layer {text!r} is not of the form FILE[:BAND][*WEIGHT], as in rocks.tif:3*20"
            ) from None
        require_not_negative(**{f"the weight of layer {text!r}": weight})
        return cls(Path(match["path"]), int(match["band"] or 1), weight)

    @classmethod
    def of(cls, source: Any) -> LayerSource:
        """From a LayerSource, a path, or text as ``parse`` takes it."""
        if isinstance(source, cls):
            return source
        if isinstance(source, Path):
            return cls(source)
        if isinstance(source, str):
            return cls.parse(source)
        raise InputError(f"layer source {source!r} is not a path, FILE:BAND*WEIGHT or LayerSource")


def _unreadable(path: Path, error: Exception) -> MapError:
    # Asked only now: GDAL also reads names that are no paths, as in /vsizip/.
    if not path.exists():
        return MapError(f"{path} does not exist; check the path")
    # Rasterio puts the reason into the cause: its own message only points there.
    reason = str(error.__cause__ or error).split("\n")[0].rstrip(".")
    return MapError(f"{path} cannot be read as a raster: {reason}; check that it is one, and whole")


def _read_band(source: LayerSource) -> tuple[Raster, str]:
    """One band with its unit."""
    import rasterio
    from rasterio.errors import RasterioError

    try:
        with rasterio.open(source.path) as dataset:
            if not 1 <= source.band <= dataset.count:
                listed = ", ".join(f"{k} {d or ''}".strip() for k, d in _descriptions(dataset))
                raise MapError(
                    f"band={source.band} is not in {source.path}; its bands are: {listed}"
                )
            data = dataset.read(source.band, masked=True)
            values = np.ma.filled(data.astype(np.float64), np.nan)
            values = values * dataset.scales[source.band - 1] + dataset.offsets[source.band - 1]
            values[~np.isfinite(values)] = np.nan
            raster = Raster(values[None], dataset.transform, parse_crs(dataset.crs))
            return raster, dataset.units[source.band - 1] or ""
    except (RasterioError, OSError) as error:
        raise _unreadable(source.path, error) from None


def _descriptions(dataset: Any) -> list[tuple[int, str | None]]:
    return list(enumerate(dataset.descriptions, start=1))


def _onto(raster: Raster, base: Raster) -> Array:
    """A band on the grid of another raster (bilinear where the grids differ)."""
    same_grid = raster.transform.almost_equals(base.transform, 1e-9 * abs(base.transform.a))
    if same_grid and raster.bands.shape == base.bands.shape and raster.crs == base.crs:
        return raster.bands
    if raster.crs is None or base.crs is None:
        raise MapError(
            "the layers lie on different grids and at least one has no CRS, so they cannot be "
            "brought together; assign a CRS first"
        )
    from rasterio.warp import Resampling, reproject

    bands = np.full(base.bands.shape, np.nan)
    reproject(
        raster.bands,
        bands,
        src_transform=raster.transform,
        src_crs=raster.crs.to_wkt(),
        src_nodata=np.nan,
        dst_transform=base.transform,
        dst_crs=base.crs.to_wkt(),
        dst_nodata=np.nan,
        resampling=Resampling.bilinear,
    )
    return bands


def _height_unit(unit: str, crs: CRS | None) -> str:
    """The unit that the file names, else metres where the plane is in metres."""
    if unit or crs is None:
        return unit
    return "m" if Georeference(crs, crs).unit == "m" else ""


def read_surface(
    path: str | Path,
    *,
    height_band: int = 1,
    layers: Mapping[str, Any] | None = None,
) -> Surface:
    """A surface from a raster and further layers.

    path : anything GDAL reads. height_band : its band of heights, 1-based.
    layers : name -> LayerSource, path, or text FILE[:BAND][*WEIGHT]; brought onto the grid
    of the heights. Cells without data in any layer are blocked. A map in degrees, or turned,
    is brought onto a local projection in metres.
    Raises MapError or InputError with the file, the value and the remedy.
    """
    sources = {"height": LayerSource(Path(path), height_band)}
    for name, source in (layers or {}).items():
        if name in sources:
            raise InputError(f"layer {name!r} is given twice; give each layer its own name")
        sources[name] = LayerSource.of(source)
    read = {name: _read_band(source) for name, source in sources.items()}
    base = read["height"][0]
    bands = np.concatenate([_onto(raster, base) for raster, _ in read.values()])
    raster = Raster(bands, base.transform, base.crs)
    if raster.needs_warp():
        raster = raster.to_local_metres()
    units = {name: unit for name, (_, unit) in read.items()}
    units["height"] = _height_unit(units["height"], raster.crs)
    return raster.to_surface(
        names=list(sources),
        units=list(units.values()),
        weights=[source.weight for source in sources.values()],
    )
