"""Where a layer of a map comes from, and what is said about it besides what it says itself."""

from __future__ import annotations

import math
import re
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Union

import numpy as np
from pyproj import CRS
from rasterio import Affine

from .._support.external import (
    BEGINNING,
    DESCRIBES,
    archive_of,
    require_moderate_archive,
    require_no_reach,
)
from ..errors import InputError, MapError, MapWarning, tell
from ..surface.georeference import LENGTH_UNITS, metres_of, parse_crs
from ..validation import Array, require_no_pipe, require_not_negative, require_positive
from .bands import MOST_CELLS, Band, Derived, described
from .rasters import open_band, reading

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from xarray import DataArray, Dataset


# What GDAL reads under a name, an object of xarray, or (values, x, y).
Source: TypeAlias = Union[
    str, Path, "DataArray", "Dataset", "tuple[ArrayLike, ArrayLike, ArrayLike]"
]

# Files of robots and scanners, by their endings; see ``forms``.
FORMS = {
    ".yaml": "nav2", ".yml": "nav2", ".map": "movingai", ".las": "las", ".laz": "las",
    ".ply": "ply", ".csv": "text", ".txt": "text", ".xyz": "text",
}  # fmt: skip
NETCDF_ENDINGS = (".nc", ".nc4", ".cdf", ".netcdf")

_TEXT = re.compile(r"(?P<path>.+?)(?::(?P<band>\d+))?(?:\*(?P<weight>[^*]*))?", re.DOTALL)


@dataclass(frozen=True)
class LayerSource:
    """Where a layer comes from: a band of a map, and the layer's weight.

    path : a file, an xarray DataArray or Dataset, or (values, x, y). band : its number, from
    1, or the name of a variable.
    """

    path: Source
    band: int | str = 1
    weight: float = 1.0

    @classmethod
    def parse(cls, text: str) -> LayerSource:
        """From text of the form ``FILE[:BAND][*WEIGHT]``."""
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
        """A band of a file, or of another source that GDAL knows by this name."""
        require_not_negative(**{f"the weight of {name}": weight})
        return cls(_as_path(name), band, weight)

    @classmethod
    def of_heights(cls, source: Source, band: int | str) -> LayerSource:
        """A band of a map; in its name, no band and no weight is looked for."""
        return cls(_as_path(source) if isinstance(source, str) else source, band)

    @classmethod
    def of(cls, source: LayerSource | Source) -> LayerSource:
        """From a LayerSource, a path, an array, or text as ``parse`` takes it."""
        if isinstance(source, cls):
            return source
        if isinstance(source, str):
            return cls.parse(source)
        if isinstance(source, (Path, tuple)) or _is_xarray(source):
            return cls(source)  # type: ignore[arg-type] # mypy cannot see that it is xarray's
        shown = " ".join(repr(source).split())
        raise InputError(
            f"layer source {shown:.60} is not a path, FILE:BAND*WEIGHT, an xarray object or "
            "LayerSource"
        )

    def open(self, files: ExitStack, unsaid: Unsaid, *, heights: bool = True) -> Band:
        """Open the band; its file stays open until ``files`` is closed.

        unsaid : what is said about the map of heights. heights : is this it?
        """
        if heights:
            return unsaid.applied_to(self._opened(files, unsaid, heights=True))
        alone = Unsaid(allow_external=unsaid.allow_external, most_cells=unsaid.most_cells)
        return self._opened(files, alone, heights=False)

    def _opened(self, files: ExitStack, unsaid: Unsaid, *, heights: bool) -> Band:
        crs = unsaid.crs
        if isinstance(self.band, bool) or not isinstance(self.band, (int, str)):
            raise InputError(
                f"band={self.band!r} is neither a number, from 1, nor a variable's name"
            )
        if not isinstance(self.path, (str, Path)):
            return _band_of_array(self.path, self.band, crs)
        beginning = require_safe(self.path, allow_external=unsaid.allow_external)
        if may_be_netcdf(self.path, beginning):
            from .netcdf import netcdf

            if (named := netcdf(self.path)) is not None:
                return _band_of_netcdf(self.path, *named, self.band, files, crs)
        if (form := form_of(self.path, beginning)) is not None:
            from .forms import is_grid_of_gdal, open_form

            if not is_grid_of_gdal(Path(self.path), unsaid):
                return open_form(form, Path(self.path), self.band, unsaid)
        return open_band(
            self.path,
            self.band,
            files,
            crs=crs,
            heights=heights,
            is_picture=unsaid.height_range is not None,
        )


def may_be_netcdf(path: str | Path, beginning: bytes) -> bool:
    """Is it worth a look whether a name is of a netCDF file? beginning : the file's."""
    text = str(path).lower()
    return (
        beginning.startswith(b"CDF") or text.startswith("netcdf:") or text.endswith(NETCDF_ENDINGS)
    )


def form_of(path: str | Path, beginning: bytes) -> str | None:
    """The form of a file that GDAL does not read, as a key of ``forms.OPENERS``; or None."""
    form = FORMS.get(Path(path).suffix.lower()) if beginning else None
    return None if form == "movingai" and not beginning.startswith(b"type") else form


def require_safe(name: str | Path, *, allow_external: bool) -> bytes:
    """The first bytes of a file, b"" where a name is of something else.

    The one door that rasters, pictures and vectors go through. Raises MapError for a pipe, an
    archive that is too large, and a file that takes its data from outside its folder without leave.
    """
    path = Path(name)
    require_no_pipe(path)
    text = str(name)
    if ":" in text:
        for part in re.split(r'[:"]', text):
            require_no_pipe(Path(part or "."))
    archive = archive_of(text) if "zip" in text.lower() else None
    if archive is not None:
        require_moderate_archive(archive, allow_external=allow_external)
    try:
        with path.open("rb") as file:
            beginning = file.read(BEGINNING)
    except (OSError, ValueError):
        return b""
    if beginning.startswith(b"PK") and path != archive:
        require_moderate_archive(path, allow_external=allow_external)
    if DESCRIBES.search(beginning) and not allow_external:
        require_no_reach(path, beginning)
    return beginning


def _as_path(text: str) -> Path | str:
    """A Path; or the text itself where GDAL reads it as something else, as a Path drops slashes."""
    return text if "://" in text or text.startswith("/vsi") else Path(text)


def _is_xarray(source: object) -> bool:
    """Is it an xarray object? Checked without importing xarray."""
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
    from .netcdf import open_netcdf

    dataset = open_netcdf(file, files)
    with reading(name):
        return band_of_xarray(dataset, band, crs, label=str(name), variable=variable)


# What is said about a map

# What a map's cells without data hold: what its tags declare and what looks like it ("auto"), only
# what its tags declare ("none"), or that and this value.
NoData: TypeAlias = float | Literal["auto", "none"]

# The CRS of a map that is planned on as it lies, without a place on Earth.
LOCAL = "none"


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretched(Derived):
    """Heights of a picture: its numbers, from 0 to the largest that fits, as low to high."""

    low: float
    scale: float

    def read(self, rows: slice, columns: slice) -> Array:
        """Heights (rows, columns), NaN where there is no data."""
        return np.asarray(self.low + self.scale * self.band.read(rows, columns))


@dataclass(frozen=True, kw_only=True)
class Unsaid:
    """What the user says about the map of heights.

    crs : the CRS of a map that has none. is_local : no CRS is looked for. no_data : see ``NoData``.
    height_unit : of heights that have none. cell_size : the side of the cells of a picture.
    height_range : the heights that a picture's darkest and brightest numbers stand for.
    allow_external : the files may take their data from outside their folders. most_cells : of a
    map that is read as a whole.
    """

    crs: CRS | None = None
    is_local: bool = False
    no_data: NoData = "auto"
    height_unit: str = ""
    cell_size: float | None = None
    height_range: tuple[float, float] | None = None
    allow_external: bool = False
    most_cells: int = MOST_CELLS

    @classmethod
    def of(
        cls,
        crs: object,
        nodata: object,
        height_unit: str | None,
        cell_size: float | None,
        height_range: tuple[float, float] | None,
        *,
        allow_external: bool = False,
    ) -> Unsaid:
        """From the arguments of ``read_surface``, checked."""
        is_local = isinstance(crs, str) and crs.lower() == LOCAL
        if height_unit is not None and metres_of(height_unit) is None:
            raise InputError(
                f"height_unit={height_unit!r:.60} is not a known unit of length; give one of "
                f"{', '.join(dict.fromkeys(unit for unit in LENGTH_UNITS if len(unit) < 6))}"
            )
        if cell_size is not None:
            require_positive(cell_size=cell_size)
        return cls(
            crs=None if is_local else parse_crs(crs, f"crs={crs!r}"),
            is_local=is_local,
            no_data=_require_no_data(nodata),
            height_unit=height_unit or "",
            cell_size=cell_size,
            height_range=None if height_range is None else _as_range(height_range),
            allow_external=allow_external,
        )

    def applied_to(self, band: Band) -> Band:
        """The band of heights, with what is said about it."""
        if self.is_local:
            band = replace(band, grid=replace(band.grid, crs=None))
        if self.cell_size is not None:
            band = _with_cells(band, self.cell_size)
        if self.height_range is not None:
            _tell_of_cells(band, self.cell_size)
            band = _stretched(band, *self.height_range)
        elif band.largest == 255 and not (band.unit or self.height_unit):
            tell(MapWarning(
                f"{band.label} holds 8-bit numbers without a unit, as pictures and hillshades do, "
                "and is taken as heights from 0 to 255; give the elevation model if it is none, "
                "--height-range LOW,HIGH and --cell-size for a heightmap, or --height-unit m if "
                "these are heights"
            ))  # fmt: skip
        return _with_unit(band, self.height_unit) if self.height_unit else band


def _as_range(given: tuple[float, float]) -> tuple[float, float]:
    try:
        low, high = map(float, given)
    except (TypeError, ValueError):
        raise InputError(f"height_range={given!r:.60} is not (low, high), two numbers") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(
            f"height_range=({low:g}, {high:g}) is not two finite numbers, the lower one first"
        )
    return low, high


def _tell_of_cells(band: Band, size: float | None) -> None:
    """Tell of a picture of heights whose cells nobody gave a size."""
    if size is None and not band.is_placed:
        tell(MapWarning(
            f"{band.label} does not say how wide its cells are, and they are taken to be 1 by 1; "
            "give their side by --cell-size, in the unit of the heights"
        ))  # fmt: skip


def _with_cells(band: Band, size: float) -> Band:
    if band.is_gridded:
        return band
    if band.is_placed:
        raise InputError(
            f"cell_size={size:g}: {band.label} says itself where its cells lie; leave it out"
        )
    grid = band.grid
    transform = Affine(size, 0.0, 0.0, 0.0, -size, size * grid.rows)
    return replace(band, grid=replace(grid, transform=transform))


def _stretched(band: Band, low: float, high: float) -> Band:
    if not band.largest:
        raise MapError(
            f"height_range=({low:g}, {high:g}): {band.label} holds no whole numbers of 8 or 16 "
            "bits, so nothing says which is the highest; leave it out, or convert the picture"
        )
    scale = (high - low) / band.largest
    return Stretched(**{**described(band), "step": scale}, band=band, low=low, scale=scale)


def _with_unit(band: Band, unit: str) -> Band:
    own = metres_of(band.unit)
    if own is not None and own != metres_of(unit):
        raise InputError(
            f"height_unit={unit!r} contradicts {band.label}, whose heights are in {band.unit!r}; "
            "leave it out, or correct the file"
        )
    return replace(band, unit=unit)


def _require_no_data(value: object) -> NoData:
    """The value as it is. Raises InputError for what is neither a number nor a known word."""
    if value in ("auto", "none"):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
        raise InputError(f"nodata={value!r} is neither a number, nor 'auto' or 'none'")
    return float(value)
