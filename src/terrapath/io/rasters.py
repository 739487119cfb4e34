"""Bands of rasters in any format that GDAL reads."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import CRS
from rasterio import Affine

from ..errors import MapError, TerrapathError, silence
from ..surface.georeference import parse_crs
from ..surface.raster import Grid
from ..validation import Array, is_there
from .bands import Band

MOST_BLOCK_BYTES = 2 * 2**30
SECONDS_FOR_NETWORK = 30

# Names of variables that hold heights, the likeliest first.
HEIGHT_NAMES = (
    "height", "heights", "elevation", "elev", "dem", "dtm", "altitude", "orog", "topo",
    "topography", "surface_altitude", "band1", "z",
)  # fmt: skip


@contextmanager
def gdal() -> Iterator[None]:
    """Prepare GDAL for this thread: its messages are logged, and its errors are raised.

    A dataset belongs to one thread too, so each call opens its own.
    """
    import rasterio
    from rasterio.env import get_gdal_config, set_gdal_config

    # Not an option of the Env: in the main thread that would change the whole process for a while.
    if get_gdal_config("GDAL_HTTP_TIMEOUT") is None:
        set_gdal_config("GDAL_HTTP_TIMEOUT", SECONDS_FOR_NETWORK)
    with rasterio.Env():
        yield


@contextmanager
def reading(path: str | Path, *, is_file: bool = True) -> Iterator[None]:
    """Turn any error of the ``with`` block into a MapError that names the file or the array."""
    try:
        yield
    except TerrapathError:
        raise
    except Exception as error:  # for damaged files GDAL, rasterio and NumPy raise any type
        raise _unreadable(path, error, is_file=is_file) from None


def _unreadable(path: str | Path, error: Exception, *, is_file: bool) -> MapError:
    # Checked only after an error: GDAL also reads names that are no paths, as in /vsizip/.
    if is_file and not _may_be_no_path(str(path)) and not is_there(Path(path)):
        return MapError(f"{path} does not exist; check the path")
    # Rasterio's own message only refers to the cause, which holds the reason.
    reason = " ".join(str(error.__cause__ or error).split()).rstrip(".") or type(error).__name__
    return MapError(
        f"{path} cannot be read as a raster: {reason:.300}; check that it is one, and complete"
    )


def _may_be_no_path(name: str) -> bool:
    return name.startswith("/vsi") or re.match(r"[A-Za-z0-9_+]{2,}:", name) is not None


@dataclass(frozen=True, eq=False)
class FileBand(Band):
    """A band of an open dataset."""

    dataset: Any
    number: int
    path: str | Path
    alphas: tuple[int, ...] = ()  # bands that say where there is nothing; GDAL minds only some

    @property
    def rows_at_once(self) -> int:
        """How many rows the file stores together in one block."""
        return int(self.dataset.block_shapes[self.number - 1][0])

    @property
    def scaling(self) -> tuple[float, float]:
        """The scale and the offset of its stored numbers."""
        return float(self.dataset.scales[self.number - 1]), float(
            self.dataset.offsets[self.number - 1]
        )

    def read(self, rows: slice, columns: slice) -> Array:
        """Values (rows, columns) with scale and offset applied, NaN where there is no data."""
        from rasterio.windows import Window

        size = rows.stop - rows.start, columns.stop - columns.start
        window = Window(columns.start, rows.start, size[1], size[0])
        with reading(self.path):
            stored = self.dataset.read(self.number, window=window)
            masked = self.dataset.read_masks(self.number, window=window) == 0
            for alpha in self.alphas:
                masked |= self.dataset.read(alpha, window=window) == 0
            values: Array = stored.astype(np.float64)
        scale, offset = self.scaling
        with np.errstate(over="ignore", invalid="ignore"):
            if (scale, offset) != (1.0, 0.0):
                values *= scale
                values += offset
        values[masked | ~np.isfinite(values)] = np.nan
        return values


def open_band(
    path: str | Path,
    number: int | str,
    files: Any,
    *,
    crs: CRS | None,
    heights: bool,
    is_picture: bool = False,
) -> FileBand:
    """A band of a file, or of its subdataset; the dataset is closed with the stack ``files``.

    number : the band, 1-based, or the name of a variable. crs : the CRS of a file that has none.
    heights : refuse colours. is_picture : of which a brightness is the height.
    """
    with reading(path):
        dataset = files.enter_context(open_dataset(path))
        if dataset.count == 0 or isinstance(number, str):
            name, number = (number, 1) if isinstance(number, str) else (None, number)
            dataset = files.enter_context(open_dataset(_variable(path, dataset, name)))
        _require_band(path, dataset, number)
        _require_heights(path, dataset, number, heights and not is_picture)
        kind = np.dtype(dataset.dtypes[number - 1])
        return FileBand(
            grid=_grid(path, dataset, crs),
            alphas=_alphas(path, dataset, number),
            label=str(path),
            unit=_unit(dataset, number),
            step=abs(dataset.scales[number - 1]) if kind.kind in "iu" else 0.0,
            is_placed=not (dataset.transform.is_identity or _is_unplaced(dataset)),
            largest=np.iinfo(kind).max if kind in (np.uint8, np.uint16) else 0,
            dataset=dataset,
            number=number,
            path=path,
        )


def open_dataset(path: str | Path) -> Any:
    """Open a dataset, with credentials where its name needs them, as in s3:."""
    from rasterio.env import ensure_env_with_credentials
    from rasterio.errors import NotGeoreferencedWarning

    silence(NotGeoreferencedWarning, __name__)
    return ensure_env_with_credentials(_dataset)(path)


def _dataset(path: str | Path) -> Any:
    """As ``rasterio.open``, but Python attributes its warnings to this module.

    So they can be silenced here alone: callers who open datasets themselves are still warned of
    missing georeferences.
    """
    from rasterio.io import DatasetReader

    return DatasetReader(path)


def _variable(path: str | Path, dataset: Any, name: str | None) -> str:
    """The subdataset of a variable: the named one, else the only one, else one of heights."""
    variables = {
        subdataset.rsplit(":", 1)[-1].strip('"/'): subdataset for subdataset in dataset.subdatasets
    }
    if name is not None and name in variables:
        return str(variables[name])
    if name is None and len(variables) == 1:
        return str(next(iter(variables.values())))
    likely = [key for key in HEIGHT_NAMES if key in variables]
    if name is None and likely:
        return str(variables[likely[0]])
    if not variables:
        what = "holds no raster" if dataset.count == 0 else "has bands, no variables"
        raise MapError(f"{path} {what}; name a band of it by its number")
    fault = f"variable {name!r} is not in {path}" if name else f"{path} holds several variables"
    raise MapError(f"{fault}; name one of: {', '.join(variables)}")


def _require_band(path: str | Path, dataset: Any, number: int) -> None:
    if 1 <= number <= dataset.count:
        return
    described = enumerate(dataset.descriptions[:20], start=1)
    listed = ", ".join(f"{k} {d or ''}".strip() for k, d in described)
    more = ", ..." if dataset.count > 20 else ""
    raise MapError(f"band={number} is not in {path}; its bands are: {listed}{more}")


def _alphas(path: str | Path, dataset: Any, number: int) -> tuple[int, ...]:
    """The bands of opacity. Raises MapError where the wanted band is one itself."""
    from rasterio.enums import ColorInterp

    kinds = enumerate(dataset.colorinterp, start=1)
    alphas = tuple(band for band, kind in kinds if kind == ColorInterp.alpha)
    if number in alphas:
        raise MapError(
            f"band {number} of {path} is its alpha, which says where there is data; name another"
        )
    return alphas


def _require_heights(path: str | Path, dataset: Any, number: int, heights: bool) -> None:
    """Raise MapError unless a band holds real numbers, not colours, in blocks of moderate size."""
    from rasterio.enums import ColorInterp

    kind = np.dtype(dataset.dtypes[number - 1])
    if kind.kind not in "iuf":
        raise MapError(f"band {number} of {path} holds {kind} values; real numbers are needed")
    colours = {ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.palette}
    if heights and kind.itemsize == 1 and dataset.colorinterp[number - 1] in colours:
        raise MapError(
            f"band {number} of {path} is a colour of a picture "
            f"({dataset.colorinterp[number - 1].name}), not heights; give the elevation model, or "
            "--height-range LOW,HIGH if its brightness is the height"
        )
    rows, columns = dataset.block_shapes[number - 1]
    if int(rows) * int(columns) * kind.itemsize > MOST_BLOCK_BYTES:
        raise MapError(
            f"{path} is stored in blocks of {columns:,} x {rows:,} cells, too large to read; "
            "rewrite it in tiles first"
        )


def _unit(dataset: Any, number: int) -> str:
    """The unit that the band names, else that of the vertical axis of its CRS."""
    unit = dataset.units[number - 1]
    if unit or dataset.crs is None:
        return unit or ""
    try:
        full = CRS.from_user_input(dataset.crs)
    except Exception:  # ``_grid`` reports what is wrong with the CRS
        return ""
    return str(full.axis_info[2].unit_name) if len(full.axis_info) > 2 else ""


def _grid(path: str | Path, dataset: Any, crs: CRS | None) -> Grid:
    """The grid of the cells; a file without a position has cells of side 1, north up."""
    own_crs = parse_crs(dataset.crs, f"the CRS of {path}")
    transform = Affine.identity() if _is_unplaced(dataset) else dataset.transform
    if transform.is_identity:
        _require_no_other_position(path, dataset)
        transform = Affine(1.0, 0.0, 0.0, 0.0, -1.0, float(dataset.height))
    determinant = transform.a * transform.e - transform.b * transform.d
    if not (np.isfinite(list(transform)).all() and determinant != 0.0):
        raise MapError(
            f"{path} has the geotransform {tuple(transform)[:6]}, which is not valid; check the "
            "file"
        )
    return Grid(dataset.height, dataset.width, transform, with_crs(own_crs, crs, path))


def _is_unplaced(dataset: Any) -> bool:
    """Is it a picture of Netpbm alone? GDAL makes up where its cells lie."""
    return dataset.driver == "PNM" and len(dataset.files) < 2


def _require_no_other_position(path: str | Path, dataset: Any) -> None:
    """Raise MapError where a file gives its position, but not as a regular grid."""
    if dataset.gcps[0] or dataset.rpcs:
        raise MapError(
            f"{path} has its position from ground control points or camera coefficients only; "
            "warp it to a grid first (gdalwarp)"
        )
    if dataset.driver in {"netCDF", "HDF5", "HDF5Image"}:
        raise MapError(
            f"GDAL does not find in {path} where its cells lie: the coordinates lack a "
            "standard_name or units, or are not in equal steps; open it with "
            "xarray.open_dataset and give the dataset instead"
        )


def with_crs(own: CRS | None, given: CRS | None, label: object) -> CRS | None:
    """The map's own CRS, or the one that is given for it; they must not contradict."""
    if own is None or given is None:
        return own or given
    if not own.equals(given, ignore_axis_order=True):
        raise MapError(
            f"crs={given.name} contradicts {label}, which is in {own.name}; leave it out, or "
            "bring the map into that CRS first"
        )
    return own
