"""Bands of xarray DataArrays and Datasets, and of NumPy arrays with coordinates."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pyproj import CRS
from pyproj.exceptions import CRSError
from rasterio import Affine

from ..errors import InputError, MapError
from ..surface.georeference import parse_crs
from ..surface.raster import Grid
from ..validation import Array, as_array
from .axes import in_unit_of_axes, is_degrees
from .bands import Band
from .rasters import HEIGHT_NAMES, reading, with_crs

X_NAMES = ("x", "lon", "longitude", "easting", "eastings", "east", "projection_x_coordinate")
Y_NAMES = ("y", "lat", "latitude", "northing", "northings", "north", "projection_y_coordinate")
DEGREES = ("degree", "degrees", "deg")
UNEQUAL = 0.05  # how far, in cells, a coordinate may be from its place in equal steps


@dataclass(frozen=True, eq=False)
class ArrayBand(Band):
    """A two-dimensional array, NumPy's or xarray's, in the order (row, column)."""

    array: Any
    no_data: tuple[float, ...] = ()
    scale: float = 1.0
    offset: float = 0.0
    rows_in_chunk: int = 1

    @property
    def rows_at_once(self) -> int:
        """How many rows the file stores together in one block."""
        return self.rows_in_chunk

    @property
    def scaling(self) -> tuple[float, float]:
        """The scale and the offset of its stored numbers."""
        return self.scale, self.offset

    def read(self, rows: slice, columns: slice) -> Array:
        """Values (rows, columns) with scale and offset applied, NaN where there is no data."""
        with reading(self.label, is_file=False):  # an xarray object may read its file only here
            part = self.array[rows, columns]
            part = np.ma.asarray(getattr(part, "values", part))
        with np.errstate(over="ignore", invalid="ignore"):
            stored = np.ma.filled(part.astype(float), np.nan)
            values: Array = np.array(stored, dtype=np.float64)
            for value in self.no_data:
                values[values == value] = np.nan
            values *= self.scale
            values += self.offset
        values[~np.isfinite(values)] = np.nan
        return values


def band_of_numpy(source: tuple[Any, Any, Any], which: int | str, crs: CRS | None) -> ArrayBand:
    """The band of (values, x, y): values (ny, nx) at the coordinates of the cell centres.

    which : the number of the band; it must be 1.
    """
    values, x, y = source
    _require_band(which, 1, "the array")
    x, y = as_array(x, "x", shape=(None,)), as_array(y, "y", shape=(None,))
    array = np.ma.asarray(values)
    if array.shape != (len(y), len(x)):
        raise InputError(f"values has shape {array.shape}; ({len(y)}, {len(x)}) is expected")
    _require_numbers(array.dtype, "the array")
    return _on_axes(array, x, y, crs, label="the array", unit="")


def band_of_xarray(
    source: Any,
    which: int | str,
    crs: CRS | None,
    *,
    label: str = "",
    variable: str | None = None,
) -> ArrayBand:
    """The band of a DataArray, or of a variable of a Dataset.

    which : the number of the band, from 1, or the name of the variable. label : its name in
    messages; by default the array's name. variable : its name, where ``which`` is a number of it.
    """
    array = source
    if hasattr(source, "data_vars"):
        array, first = _variable(source, variable or which)
        which = which if isinstance(which, int) else first
    if not label:
        label = f"the array {array.name!r}" if array.name is not None else "the array"
    _require_numbers(array.dtype, label)
    x, y = plane_dimensions(array, label)
    chunks = dict(zip(array.dims, array.encoding.get("chunksizes") or (), strict=False))
    array = _plane(array, x, y, which, label).transpose(y, x)
    crs = with_crs(_crs(source, array, x, y), crs, label)
    attributes = array.attrs
    described: dict[str, Any] = {"label": label, "unit": str(attributes.get("units", ""))}
    units = [_unit_of_axis(array, axis) for axis in (x, y)]
    crs = in_unit_of_axes(crs, units, label)
    described["unit_of_axes"] = "" if is_degrees(units[0]) else units[0]
    described["no_data"] = tuple(
        float(value)
        for key in ("_FillValue", "missing_value", "nodata", "nodatavals")
        for value in np.ravel(attributes.get(key, ()))
    )
    described["rows_in_chunk"] = int(chunks.get(y) or 1)
    described["scale"] = float(attributes.get("scale_factor", 1.0))
    described["offset"] = float(attributes.get("add_offset", 0.0))
    if x not in array.coords or y not in array.coords:
        grid = _grid_of_transform(source, array, crs, label)
        return ArrayBand(grid=grid, array=array, step=_step(array, described["scale"]), **described)
    x_axis, y_axis = (
        as_array(array[axis].values, f"{axis} of {label}", shape=(None,)) for axis in (x, y)
    )
    return _on_axes(array, x_axis, y_axis, crs, **described)


def _unit_of_axis(array: Any, axis: Hashable) -> str:
    """The unit of the coordinates along a dimension; "" where it is not said."""
    attributes = array[axis].attrs if axis in array.coords else {}
    return str(attributes.get("units", "")).strip()


def _require_band(which: int | str, count: int, label: str) -> None:
    if not (isinstance(which, int) and 1 <= which <= count):
        raise MapError(f"band={which!r} is not in {label}; it has {count}, counted from 1")


def _require_numbers(kind: np.dtype[Any], label: str) -> None:
    if kind.kind not in "iuf":
        raise MapError(f"{label} holds {kind} values; real numbers are needed")


def _step(array: Any, scale: float) -> float:
    return abs(scale) if array.dtype.kind in "iu" else 0.0


def _on_axes(
    array: Any, x: Array, y: Array, crs: CRS | None, *, scale: float = 1.0, **described: Any
) -> ArrayBand:
    """A band from the coordinates of its cell centres, which may decrease."""
    label = described["label"]
    (x0, dx), (y0, dy) = _steps(x, f"x of {label}"), _steps(y, f"y of {label}")
    if dx < 0.0:
        array, x0, dx = array[:, ::-1], x[-1], -dx
    transform = Affine(dx, 0.0, x0 - 0.5 * dx, 0.0, dy, y0 - 0.5 * dy)
    grid = Grid(len(y), len(x), transform, crs)
    return ArrayBand(grid=grid, array=array, step=_step(array, scale), scale=scale, **described)


def _steps(axis: Array, name: str) -> tuple[float, float]:
    """(first, step) of an axis in equal steps."""
    if len(axis) < 2:
        raise MapError(f"{name} has {len(axis)} values; a map needs at least 4")
    first, step = float(axis[0]), float((axis[-1] - axis[0]) / (len(axis) - 1))
    off = np.abs(axis - np.linspace(axis[0], axis[-1], len(axis))).max()
    if step == 0.0 or off > UNEQUAL * abs(step):
        rounded = off <= 2.0 * float(np.spacing(np.float32(np.abs(axis).max())))
        remedy = (
            "its values are rounded to 32-bit numbers; give them in 64 bits, or as differences "
            "from a round number"
            if rounded
            else "resample it to equal steps first"
        )
        raise MapError(f"{name} is not in equal steps; {remedy}")
    return first, step


# The dimensions, variables and CRS of an array


def _variable(dataset: Any, which: int | str) -> tuple[Any, int | str]:
    """The named variable, or else the one that holds heights; and the number of its band."""
    maps = {
        str(name): variable for name, variable in dataset.data_vars.items() if variable.ndim >= 2
    }
    if isinstance(which, str):
        if which not in maps:
            raise MapError(f"variable {which!r} is not in the dataset; it has: {', '.join(maps)}")
        return maps[which], 1
    standard = ("surface_altitude", "height", "altitude", "height_above_reference_ellipsoid")
    likely = [name for name in HEIGHT_NAMES if name in maps]
    likely += [name for name, v in maps.items() if v.attrs.get("standard_name") in standard]
    if len(maps) == 1 or likely:
        return maps[likely[0] if likely else next(iter(maps))], which
    raise MapError(
        f"the dataset has the variables {', '.join(maps) or 'none'}, none known as heights; name "
        "one (height_band='NAME'), or give the DataArray"
    )


def plane_dimensions(array: Any, label: str) -> tuple[Hashable, Hashable]:
    """The dimensions along x and y. Raises MapError where they are not known."""
    return _dimension(array, "x", label), _dimension(array, "y", label)


def _dimension(array: Any, axis: str, label: str) -> Hashable:
    """The dimension along x or y: by its CF attributes, or else by its name."""
    names = X_NAMES if axis == "x" else Y_NAMES
    candidates: dict[str, list[Hashable]] = {"attributes": [], "name": []}
    for dimension in array.dims:
        attributes = array[dimension].attrs if dimension in array.coords else {}
        standard = str(attributes.get("standard_name", ""))
        toward = "east" if axis == "x" else "north"
        if (
            str(attributes.get("axis", "")).lower() == axis
            or standard in names
            or str(attributes.get("units", "")).lower() in {f"{d}_{toward}" for d in DEGREES}
        ):
            candidates["attributes"].append(dimension)
        if str(dimension).lower() in names:
            candidates["name"].append(dimension)
    for dimensions in candidates.values():
        if len(dimensions) == 1:
            return dimensions[0]
    raise MapError(
        f"{label} has the dimensions {', '.join(map(str, array.dims))}, of which "
        f"{'none' if not candidates['name'] else 'more than one'} is known as {axis}; rename one "
        f"to {axis!r}"
    )


def _plane(array: Any, x: Hashable, y: Hashable, which: int | str, label: str) -> Any:
    """One band: dimensions of length 1 are dropped; the remaining one counts the bands, from 1."""
    rest = [dimension for dimension in array.dims if dimension not in {x, y}]
    for dimension in [d for d in rest if array.sizes[d] == 1 and d != "band"]:
        array = array.isel({dimension: 0})
        rest.remove(dimension)
    if len(rest) > 1:
        raise MapError(
            f"{label} has the further dimensions {', '.join(map(str, rest))}; select one map of "
            "it first, as with .isel"
        )
    _require_band(which, array.sizes[rest[0]] if rest else 1, label)
    return array.isel({rest[0]: int(which) - 1}) if rest else array


def _mapping(source: Any, array: Any) -> dict[str, Any]:
    """Attributes of the variable that describes the CRS, as CF and rioxarray write it."""
    name = array.attrs.get("grid_mapping", array.encoding.get("grid_mapping", "spatial_ref"))
    for holder in (array.coords, source if hasattr(source, "data_vars") else {}):
        if name in holder:
            return dict(holder[name].attrs)
    return {}


def _crs(source: Any, array: Any, x: Hashable, y: Hashable) -> CRS | None:
    """The CRS that an array describes; WGS 84 where its coordinates are degrees."""
    label = f"the CRS of the array {array.name!r}"
    mapping = _mapping(source, array)
    text = mapping.get("crs_wkt") or mapping.get("spatial_ref") or array.attrs.get("crs")
    if text:
        return parse_crs(text, label)
    if mapping.get("grid_mapping_name"):
        try:
            return parse_crs(CRS.from_cf(mapping), label)
        except (CRSError, KeyError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise MapError(f"{label} is not understood: {reason:.200}") from None
    for dimension, toward, names in (
        (x, "east", ("lon", "longitude")),
        (y, "north", ("lat", "latitude")),
    ):
        attributes = array[dimension].attrs if dimension in array.coords else {}
        units = str(attributes.get("units", "")).lower()
        by_name = str(dimension).lower() in names and units in {"", *DEGREES}
        if not by_name and not (units.startswith("degree") and units.endswith(toward)):
            return None
    return CRS.from_epsg(4326)


def _grid_of_transform(source: Any, array: Any, crs: CRS | None, label: str) -> Grid:
    """The grid of an array without coordinates, from the GeoTransform that rioxarray writes."""
    text = _mapping(source, array).get("GeoTransform")
    if text is None:
        raise MapError(f"{label} has no coordinates along x and y; add them")
    try:
        transform = Affine.from_gdal(*map(float, str(text).split()))
    except (TypeError, ValueError):
        raise MapError(f"{label} has the GeoTransform {text!r}; it must be six numbers") from None
    return Grid(array.sizes[array.dims[0]], array.sizes[array.dims[1]], transform, crs)
