"""Where the layers of a map come from, and the bands that they are."""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, Union

from pyproj import CRS

from ..errors import InputError
from ..validation import require_not_negative
from .bands import Band
from .rasters import classic_netcdf, open_band, open_classic_netcdf, reading

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from xarray import DataArray, Dataset

# What GDAL reads under a name, an object of xarray, or (values, x, y).
Source: TypeAlias = Union[
    str, Path, "DataArray", "Dataset", "tuple[ArrayLike, ArrayLike, ArrayLike]"
]

_TEXT = re.compile(r"(?P<path>.+?)(?::(?P<band>\d+))?(?:\*(?P<weight>[^*]*))?", re.DOTALL)


@dataclass(frozen=True)
class LayerSource:
    """Where a layer comes from: a band of a map, and the weight of its changes.

    path : a file, an xarray DataArray or Dataset, or (values, x, y). band : its number, from
    1, or the name of a variable.
    """

    path: Source
    band: int | str = 1
    weight: float = 1.0

    @classmethod
    def parse(cls, text: str) -> LayerSource:
        """FILE[:BAND][*WEIGHT]."""
        match = _TEXT.fullmatch(text)
        try:
            if match is None:
                raise ValueError
            weight = 1.0 if match["weight"] is None else float(match["weight"])
        except ValueError:
            raise InputError(
                f"layer {text!r} is not of the form FILE[:BAND][*WEIGHT], as in rocks.tif:3*20"
            ) from None
        require_not_negative(**{f"the weight of layer {text!r}": weight})
        return cls(_as_path(match["path"]), int(match["band"] or 1), weight)

    @classmethod
    def of_file(cls, name: str, band: int = 1, weight: float = 1.0) -> LayerSource:
        """A band of a file, or of what GDAL reads under a name."""
        require_not_negative(**{f"the weight of {name}": weight})
        return cls(_as_path(name), band, weight)

    @classmethod
    def of_heights(cls, source: Source, band: int | str) -> LayerSource:
        """A band of a map, whose name is taken as it stands."""
        return cls(_as_path(source) if isinstance(source, str) else source, band)

    @classmethod
    def of(cls, source: LayerSource | Source) -> LayerSource:
        """From a LayerSource, a path, an array, or text as ``parse`` takes it."""
        if isinstance(source, cls):
            return source
        if isinstance(source, str):
            return cls.parse(source)
        if isinstance(source, (Path, tuple)) or _is_xarray(source):
            return cls(source)  # type: ignore[arg-type] # mypy does not see what xarray's are
        shown = " ".join(repr(source).split())
        raise InputError(
            f"layer source {shown:.60} is not a path, FILE:BAND*WEIGHT, an xarray object or "
            "LayerSource"
        )

    def open(self, files: ExitStack, crs: CRS | None, *, heights: bool) -> Band:
        """The band, its file open until ``files`` are closed. crs : where the map has none.

        heights : do its numbers have to be heights?
        """
        if isinstance(self.band, bool) or not isinstance(self.band, (int, str)):
            raise InputError(
                f"band={self.band!r} is neither a number, from 1, nor a variable's name"
            )
        if not isinstance(self.path, (str, Path)):
            return _band_of_array(self.path, self.band, crs)
        if (classic := classic_netcdf(self.path)) is not None:
            return _band_of_netcdf(self.path, *classic, self.band, files, crs)
        return open_band(self.path, self.band, files, crs=crs, heights=heights)


def _as_path(text: str) -> Path | str:
    """A Path, or the text where GDAL reads it as something else: a Path drops slashes."""
    return text if "://" in text or text.startswith("/vsi") else Path(text)


def _is_xarray(source: object) -> bool:
    """Is it an xarray object? Asked without importing xarray."""
    return type(source).__module__.split(".")[0] == "xarray"


def _band_of_array(source: Any, band: int | str, crs: CRS | None) -> Band:
    from .arrays import band_of_numpy, band_of_xarray

    if _is_xarray(source):
        return band_of_xarray(source, band, crs)
    if isinstance(source, tuple) and len(source) == 3:
        return band_of_numpy(source, band, crs)
    shown = " ".join(repr(source).split())
    raise InputError(
        f"source {shown:.60} is not a map; give a path, an xarray object, or (values, x, y)"
    )


def _band_of_netcdf(
    name: str | Path,
    file: Path,
    variable: str | None,
    band: int | str,
    files: ExitStack,
    crs: CRS | None,
) -> Band:
    from .arrays import band_of_xarray

    dataset = open_classic_netcdf(file, files)
    with reading(name):
        return band_of_xarray(dataset, variable or band, crs, label=str(name))
