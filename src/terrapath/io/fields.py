"""Distance fields as rasters."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from rasterio import Affine

from .. import __version__
from .._support.files import written_whole
from ..distance.field import DistanceField
from ..errors import MapError
from ..surface.ground import quantity, value_unit
from ..validation import Array


def _north_up(field: DistanceField) -> tuple[Array, Affine]:
    """Values with rows from north to south, NaN where not reached; nodes are cell centres."""
    lattice = field.lattice
    bounds, dx, dy = lattice.bounds, lattice.dx, lattice.dy
    values = np.where(np.isfinite(field.values), field.values, np.nan)[::-1]
    return values, Affine(dx, 0, bounds.x1_min - 0.5 * dx, 0, -dy, bounds.x2_max + 0.5 * dy)


def _tags(field: DistanceField) -> dict[str, str | float]:
    """The source of the distances and the weights of the layers, as tags of the file."""
    weights = {f"weight_{layer.name}": layer.weight for layer in field.surface.layers}
    source = {"source_x1": repr(field.source[0]), "source_x2": repr(field.source[1])}
    return {"software": f"terrapath {__version__}", **source, **weights}


def _write_geotiff(field: DistanceField, file: Path) -> None:
    """One band of float64, deflated."""
    from rasterio.io import MemoryFile

    values, transform = _north_up(field)
    reference, unit = field.surface.georeference, value_unit(field.surface)
    name = quantity(field.surface)
    profile: dict[str, object] = {
        "driver": "GTiff",
        "width": values.shape[1],
        "height": values.shape[0],
        "count": 1,
        "dtype": "float64",
        "nodata": np.nan,
        "transform": transform,
        "crs": None if reference is None else reference.crs.to_wkt(),
        "compress": "deflate",
        "predictor": 3,
    }
    # In memory first: GDAL does not report every failure to write, and may add a side file.
    with MemoryFile() as memory:
        with memory.open(**profile) as dataset:
            dataset.write(values, 1)
            dataset.set_band_description(1, f"{name} ({unit})" if unit else name)
            dataset.units = (unit,)
            dataset.update_tags(**_tags(field))
        file.write_bytes(memory.read())


def _write_npz(field: DistanceField, file: Path) -> None:
    """The lattice's own arrays: values (ny, nx) at x (nx,) and y (ny,), infinite if not reached."""
    reference = field.surface.georeference
    with file.open("wb") as stream:
        np.savez_compressed(
            stream,
            distance=field.values,
            x=field.lattice.x,
            y=field.lattice.y,
            source=np.array(field.source),
            unit=value_unit(field.surface),
            crs="" if reference is None else reference.crs.to_wkt(),
        )


WRITERS: dict[str, Callable[[DistanceField, Path], None]] = {
    ".tif": _write_geotiff,
    ".tiff": _write_geotiff,
    ".npz": _write_npz,
}


def require_known_format(path: Path) -> None:
    """Raise MapError for a file ending that stands for no known format."""
    if path.suffix.lower() not in WRITERS:
        raise MapError(f"output={str(path)!r} has no known format; end it in {', '.join(WRITERS)}")


def write_field(field: DistanceField, path: str | Path) -> None:
    """Write a distance field as .tif (GeoTIFF) or .npz, completely or not at all.

    In the GeoTIFF nodes are cell centres, and cells that were not reached are no-data.
    """
    target = Path(path)
    require_known_format(target)
    with written_whole(target) as temporary:
        WRITERS[target.suffix.lower()](field, temporary)
