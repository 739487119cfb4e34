"""Reads maps as surfaces, from files, xarray and NumPy, with all layers on one grid."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, Union

import numpy as np
from pyproj import CRS

from ..errors import InputError, MapError
from ..surface import Surface
from ..surface.bounds import as_bounds
from ..surface.georeference import Georeference, metres_of, parse_crs
from ..surface.raster import Grid, Raster
from ..validation import Array, require_count, require_not_negative
from .bands import Band, Part, View, quantisation_step
from .rasters import classic_netcdf, gdal, open_band, open_classic_netcdf, reading

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from xarray import DataArray, Dataset

    from ..surface.layers import Kind


# What GDAL reads under a name, an object of xarray, or (values, x, y).
Source: TypeAlias = Union[
    str, Path, "DataArray", "Dataset", "tuple[ArrayLike, ArrayLike, ArrayLike]"
]

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

    def open(self, files: ExitStack, crs: CRS | None, *, heights: bool) -> Band:
        """Open the band; its file stays open until ``files`` is closed.

        crs : the CRS of a map that has none. heights : must its numbers be heights?
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

    dataset = open_classic_netcdf(file, files)
    with reading(name):
        return band_of_xarray(dataset, variable or band, crs, label=str(name))


# x_min, y_min, x_max, y_max in the map's own coordinates.
Rectangle: TypeAlias = tuple[float, float, float, float]
# The sources of layers, by the layers' names.
Sources: TypeAlias = Mapping[str, LayerSource | Source]

MOST_CELLS = 150_000_000  # of a map; 1.2 GB for each layer
STEEPEST_DEGREES = 10.0  # if the rms slope is above this, small coordinates must be degrees


@dataclass(eq=False)
class OpenMap:
    """A map whose files are open; see ``open_map``. Only for use in one thread."""

    heights: Part
    layers: Sources
    costs: Sources
    fill_holes: float
    smoothing: float | str | None
    crs: CRS | None
    files: ExitStack
    is_closed: bool = False

    def _require_open(self) -> None:
        if self.is_closed:
            raise InputError(f"{self.heights.band.label} is closed; use the map inside open_map")

    def cells(self, within: Rectangle | None = None) -> int:
        """How many cells ``surface`` would read of the heights, from the header alone."""
        self._require_open()
        grid = self._view(within).grid
        return grid.rows * grid.columns

    def surface(
        self,
        *,
        within: Rectangle | None = None,
        margin: float = 0.0,
        decimate: int = 1,
        most_cells: int = MOST_CELLS,
    ) -> Surface:
        """The surface of the map or of a part of it, as ``read_surface`` describes it."""
        self._require_open()
        require_not_negative(margin=margin)
        require_count(decimate=decimate)
        require_count(most=2**62, most_cells=most_cells)
        base = self._view(within, margin, decimate)
        base.require_size(most_cells)
        # Heights of damaged files may overflow. They are refused later, or become no-data.
        with gdal(), np.errstate(over="ignore", invalid="ignore"):
            target = base.grid.planning_grid()
            bands = self._read(base, target, most_cells)
            factor, unit = self._into_plane_unit(bands[0], target)
            scale = _scale(self.smoothing, base, target.cell, factor)
        raster = Raster.on(target, bands)
        surface = (raster.trimmed() if base.grid.needs_warp else raster).to_surface(
            names=[part.name for part in self._parts],
            units=[unit, *(part.band.unit for part in self._parts[1:])],
            weights=[part.weight for part in self._parts],
            kinds=[part.kind for part in self._parts],
            fill_holes=float(self.fill_holes),
            smoothing=scale,
        )
        return replace(surface, source=self.heights.band.label)

    def _view(self, within: Rectangle | None, margin: float = 0.0, decimate: int = 1) -> View:
        """The part of the heights to read."""
        view = View.whole(self.heights.band).coarser(decimate)
        if within is not None:
            view = view.within(as_bounds(within, "within"))
            view = view.widened(margin) if margin > 0.0 else view
        return view

    @cached_property
    def _parts(self) -> list[Part]:
        """All layers, opened when first needed; each has a CRS, or the cells of the heights."""
        given: list[tuple[Kind, str, LayerSource | Source]] = [
            *(("rise", *item) for item in self.layers.items()),
            *(("cost", *item) for item in self.costs.items()),
        ]
        parts = [self.heights]
        for kind, name, source in given:
            if name in {part.name for part in parts}:
                raise InputError(f"layer {name!r} is given twice; give each layer its own name")
            parts.append(self._opened(name, kind, LayerSource.of(source)))
        return parts

    def _opened(self, name: str, kind: Kind, source: LayerSource) -> Part:
        from .alignment import placed

        band = source.open(self.files, None, heights=False)
        return Part(name, kind, source.weight, placed(name, band, self.heights.band.grid, self.crs))

    def _read(self, base: View, target: Grid, most_cells: int) -> Array:
        """All layers (layers, rows, columns) on the cells of the target."""
        if len(self._parts) == 1:
            bands = np.empty((1, target.rows, target.columns))
            if base.read_as(target, bands[0]):
                return bands
        from .alignment import read_all

        return read_all(self._parts, base, target, most_cells)

    def _into_plane_unit(self, heights: Array, target: Grid) -> tuple[float, str]:
        """Convert heights to the plane's unit, in place; returns the factor and the new unit."""
        if target.crs is None:
            _require_no_degrees(heights, target, self.heights.band.label)
        plane = "" if target.crs is None else Georeference(target.crs, target.crs).unit
        factor, unit = _into_plane_unit(self.heights.band.unit, plane)
        if factor != 1.0:
            heights *= factor
        return factor, unit


@contextmanager
def open_map(
    source: Source,
    *,
    height_band: int | str = 1,
    layers: Sources | None = None,
    costs: Sources | None = None,
    fill_holes: float = 0.0,
    smoothing: float | str | None = "auto",
    crs: CRS | str | int | None = None,
) -> Iterator[OpenMap]:
    """Open a map, to count its cells and to read surfaces of it: of the whole, in part, coarser.

    The heights are opened at once. Further layers are opened once, for the first surface. See
    ``read_surface`` for the arguments. Raises MapError or InputError with the file, the value and
    the remedy.
    """
    require_not_negative(fill_holes=fill_holes)
    given = parse_crs(crs, f"crs={crs!r}")
    files = ExitStack()
    opened = None
    try:
        with gdal():
            band = LayerSource.of_heights(source, height_band).open(files, given, heights=True)
        heights = Part("height", "rise", 1.0, band)
        opened = OpenMap(heights, layers or {}, costs or {}, fill_holes, smoothing, given, files)
        yield opened
    finally:
        if opened is not None:
            opened.is_closed = True
        with gdal():
            files.close()


# Units and checks


def _into_plane_unit(unit: str, plane: str) -> tuple[float, str]:
    """The factor that converts heights to the plane's unit, and their unit after that."""
    theirs, ours = metres_of(unit), metres_of(plane)
    if theirs is None or ours is None:
        return 1.0, unit or plane
    factor = theirs / ours
    # Where the units are the same, the heights must keep every bit.
    return (1.0 if abs(factor - 1.0) < 1e-12 else factor), plane


def _require_no_degrees(heights: Array, grid: Grid, label: str) -> None:
    """Raise MapError where a map without a CRS seems to be in degrees."""
    x_min, y_min, x_max, y_max = grid.extent()
    if x_min < -360.0 or x_max > 360.0 or y_min < -90.0 or y_max > 90.0:
        return
    steps = np.diff(heights[: 2**20 // grid.columns + 2], axis=1) / abs(grid.transform.a)
    steps = steps[np.isfinite(steps)]
    if len(steps) and np.sqrt(np.square(steps).mean()) > STEEPEST_DEGREES:
        raise MapError(
            f"{label} has no CRS, and its coordinates, {x_min:.6g} to {x_max:.6g} and {y_min:.6g} "
            f"to {y_max:.6g}, look like degrees; name its CRS, as in crs='EPSG:4326'"
        )


def _scale(smoothing: float | str | None, view: View, cell: float, factor: float) -> float | None:
    """The length scale of the smoothing, map units. factor : heights to the plane's unit."""
    if not isinstance(smoothing, str):
        return None if smoothing is None else smoothing * 1.0
    if smoothing != "auto":
        raise InputError(f"smoothing={smoothing!r} is not a length; give map units, 'auto' or None")
    step = view.band.step or quantisation_step(view.sample())
    if step == 0.0:
        return None
    from ..surface.smoothing import scale_for_step

    # Means over blocks of cells are rounded to a finer step.
    return scale_for_step(step * factor / view.factor, cell) or None


def read_surface(
    source: Source,
    *,
    height_band: int | str = 1,
    layers: Sources | None = None,
    costs: Sources | None = None,
    fill_holes: float = 0.0,
    smoothing: float | str | None = "auto",
    crs: CRS | str | int | None = None,
    within: Rectangle | None = None,
    margin: float = 0.0,
    decimate: int = 1,
    most_cells: int = MOST_CELLS,
) -> Surface:
    """A surface from a map of heights and further layers.

    source : anything GDAL reads, an xarray DataArray or Dataset, or (values, x, y).
    height_band : its band of heights, 1-based, or the name of a variable.
    layers, costs : name -> LayerSource, path, array or text ``FILE[:BAND][*WEIGHT]``; resampled to
    the grid of the heights. A change of one of ``layers`` costs. The value of one of ``costs``
    multiplies lengths, and must be above 0.
    fill_holes : holes up to this side are filled, map units of the plane; all other cells
    without data in any layer are blocked.
    smoothing : standard deviation, map units. "auto": where heights are rounded to a step, the
    least smoothing that they need, otherwise none. None or 0: none.
    crs : the CRS of a map that has none. within : (x_min, y_min, x_max, y_max) in the map's own
    coordinates; only this part is read. margin : how much more is read around it, map units of
    the plane. A vehicle's radius reaches over the edge, and ground that is not read cannot block
    it. decimate : means over blocks of this many cells a side are read. most_cells : a map with
    more cells is refused before memory is allocated.

    A map in degrees, or a rotated one, is projected to a local projection in metres. Heights are
    converted to the plane's unit. Raises MapError or InputError with the file, the value and the
    remedy.
    """
    with open_map(
        source,
        height_band=height_band,
        layers=layers,
        costs=costs,
        fill_holes=fill_holes,
        smoothing=smoothing,
        crs=crs,
    ) as opened:
        return opened.surface(
            within=within, margin=margin, decimate=decimate, most_cells=most_cells
        )


def count_cells(
    source: Source,
    *,
    height_band: int | str = 1,
    crs: CRS | str | int | None = None,
    within: Rectangle | None = None,
) -> int:
    """How many cells ``read_surface`` would read of the heights, from the header alone."""
    with open_map(source, height_band=height_band, crs=crs) as opened:
        return opened.cells(within)
