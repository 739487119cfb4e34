"""Maps as surfaces: from files, xarray and NumPy, with layers brought onto one grid."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pyproj import CRS

from ..errors import InputError, MapError
from ..surface import Surface
from ..surface.blocks import blocks
from ..surface.bounds import as_bounds
from ..surface.georeference import Georeference, metres_of, parse_crs
from ..surface.grid import Grid
from ..surface.raster import Raster
from ..surface.resampling import require_overlap, resample
from ..surface.smoothing import quantisation_step, scale_for_step
from ..validation import Array, require_count, require_not_negative
from .arrays import band_of_numpy, band_of_xarray, is_xarray
from .bands import Band, View
from .rasters import classic_netcdf, gdal, open_band, open_classic_netcdf, reading

_SOURCE = re.compile(r"(?P<path>.+?)(?::(?P<band>\d+))?(?:\*(?P<weight>[^*]*))?", re.DOTALL)

MOST_CELLS = 150_000_000  # of a map, 1.2 GB a layer
STEEPEST_DEGREES = 10.0  # rms slope of heights above which small coordinates must be degrees


@dataclass(frozen=True)
class LayerSource:
    """Where a layer comes from: a band of a map, and the weight of its changes.

    path : a file, an xarray DataArray or Dataset, or (values, x, y). band : its number, from
    1, or the name of a variable.
    """

    path: Any
    band: int | str = 1
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
        return cls(_as_path(match["path"]), int(match["band"] or 1), weight)

    @classmethod
    def of_file(cls, name: str, band: int = 1, weight: float = 1.0) -> LayerSource:
        """A band of a file, or of what GDAL reads under a name."""
        require_not_negative(**{f"the weight of {name}": weight})
        return cls(_as_path(name), band, weight)

    @classmethod
    def of(cls, source: Any) -> LayerSource:
        """From a LayerSource, a path, an array, or text as ``parse`` takes it."""
        if isinstance(source, cls):
            return source
        if isinstance(source, (Path, tuple)) or is_xarray(source):
            return cls(source)
        if isinstance(source, str):
            return cls.parse(source)
        shown = " ".join(repr(source).split())
        raise InputError(
            f"layer source {shown:.60} is not a path, FILE:BAND*WEIGHT, an xarray object or "
            "LayerSource"
        )


def _as_path(text: str) -> Path | str:
    """A Path, or the text where GDAL reads it as something else: a Path drops slashes."""
    return text if "://" in text or text.startswith("/vsi") else Path(text)


class _Part(NamedTuple):
    """A layer on its way onto the map's grid."""

    name: str
    kind: str  # "rise" or "cost"
    weight: float
    band: Band


def _open(source: LayerSource, files: ExitStack, crs: CRS | None, *, heights: bool) -> Band:
    """The band of a source; what is read later is closed with ``files``."""
    place, band = source.path, source.band
    if isinstance(band, bool) or not isinstance(band, (int, str)):
        raise InputError(f"band={band!r} is neither a number, from 1, nor a variable's name")
    if is_xarray(place):
        return band_of_xarray(place, band, crs)
    if isinstance(place, tuple) and len(place) == 3:
        return band_of_numpy(place, band, crs)
    if not isinstance(place, (str, Path)):
        shown = " ".join(repr(place).split())
        raise InputError(
            f"source {shown:.60} is not a map; give a path, an xarray object, or (values, x, y)"
        )
    if (classic := classic_netcdf(place)) is not None:
        file, variable = classic
        dataset = open_classic_netcdf(file, files)
        with reading(place):
            return band_of_xarray(dataset, variable or band, crs, label=str(place))
    return open_band(place, band, files, crs=crs, heights=heights)


def _collect(
    height: LayerSource,
    layers: Mapping[str, Any],
    costs: Mapping[str, Any],
    files: ExitStack,
    crs: CRS | None,
) -> list[_Part]:
    """All layers, opened, the heights first, each with a CRS or on the heights' cells."""
    parts = [_Part("height", "rise", 1.0, _open(height, files, crs, heights=True))]
    for kind, sources in (("rise", layers), ("cost", costs)):
        for name, given in sources.items():
            if name in {part.name for part in parts}:
                raise InputError(f"layer {name!r} is given twice; give each layer its own name")
            source = LayerSource.of(given)
            band = _open(source, files, None, heights=False)
            band = _placed(name, band, parts[0].band.grid, crs)
            parts.append(_Part(name, kind, source.weight, band))
    return parts


def _placed(name: str, band: Band, base: Grid, crs: CRS | None) -> Band:
    """A layer with a CRS, the given one or that of the heights whose cells it has."""
    grid = band.grid
    if grid.crs is None and crs is not None:
        return replace(band, grid=replace(grid, crs=crs))
    if grid.crs is not None and base.crs is not None:
        return band
    if not _has_cells_of(grid, base):
        raise MapError(
            f"layer {name!r} lies on another grid than the heights and at least one of them has "
            "no CRS, so they cannot be brought together; assign it, as in crs='EPSG:32633'"
        )
    return replace(band, grid=replace(grid, crs=base.crs))


def _has_cells_of(grid: Grid, other: Grid) -> bool:
    return grid.is_same(other) or grid.flipped().is_same(other)


# Reading onto one grid


def _read(view: View) -> Array:
    values = np.empty((view.grid.rows, view.grid.columns))
    view.read_into(values)
    return values


def _view_onto(part: _Part, base: View, target: Grid) -> View:
    """What the map needs of a layer, no finer than the map."""
    grid = part.band.grid
    if grid.crs == base.band.grid.crs and grid.is_same(base.band.grid):
        return replace(base, band=part.band)
    require_overlap(f"layer {part.name!r} ({part.band.label})", grid, target)
    x, y = target.outline(grid.crs)
    if grid.crs is not None and grid.crs.is_geographic:
        west, _, east, _ = grid.extent()
        x = x + 360.0 * np.rint((0.5 * (west + east) - x) / 360.0)
    column, row = grid.cells(x, y)
    ratio = max(float(np.ptp(column)) / target.columns, float(np.ptp(row)) / target.rows)
    view = View.whole(part.band).coarser(max(1, math.floor(ratio + 0.01)))
    return view.around(x, y) or view


def _onto(view: View, target: Grid, out: Array) -> None:
    """What is seen of a band on the target's cells: read straight where they are the same."""
    grid = view.grid
    same_crs = grid.crs == target.crs
    if same_crs and grid.is_same(target):
        view.read_into(out)
    elif same_crs and grid.flipped().is_same(target):
        view.read_into(out[::-1])
    else:
        resample(_read(view), grid, target, out, linear=False)


def _costs_onto(name: str, view: View, target: Grid, out: Array) -> None:
    """Costs on the target's cells, within the range that they have: logarithms, bilinear."""
    values = _read(view)
    _require_costs(name, values, view.grid)
    np.log(values, out=values)
    resample(values, view.grid, target, out, linear=True)
    np.exp(out, out=out)


def _base_view(band: Band, within: Any, margin: float, decimate: int, most_cells: int) -> View:
    """What is read of the heights; refused where it is too large, before it is read."""
    view = View.whole(band).coarser(decimate)
    if within is not None:
        view = view.within(as_bounds(within, "within"))
        view = view.widened(margin) if margin > 0.0 else view
    view.require_size(most_cells)
    return view


# Units and checks


def _into_plane_unit(unit: str, plane: str) -> tuple[float, str]:
    """The factor that brings heights into the plane's unit, and the unit they have then."""
    theirs, ours = metres_of(unit), metres_of(plane)
    if theirs is None or ours is None:
        return 1.0, unit or plane
    factor = theirs / ours
    # Metres stay as they are, to the bit.
    return (1.0 if abs(factor - 1.0) < 1e-12 else factor), plane


def _require_costs(name: str, values: Array, grid: Grid) -> None:
    """Raise MapError with the place of a cost that is not above 0."""
    for rows in blocks(grid.rows, grid.columns):
        wrong = np.argwhere(values[rows] <= 0.0)
        if len(wrong):
            row, column = wrong[0]
            x, y = grid.place(column + 0.5, rows.start + row + 0.5)
            raise MapError(
                f"cost {name!r} is {values[rows.start + row, column]:g} at x={x:.10g}, "
                f"y={y:.10g}; costs multiply lengths and must be above 0: mark forbidden ground as "
                "no-data, and raise the rest"
            )


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


def _scale(smoothing: Any, view: View, cell: float, factor: float) -> float | None:
    """The length scale of the smoothing, map units; factor : from the band's unit to theirs."""
    if not isinstance(smoothing, str):
        return None if smoothing is None else smoothing * 1.0
    if smoothing != "auto":
        raise InputError(f"smoothing={smoothing!r} is no length; give map units, 'auto' or None")
    step = view.band.step or quantisation_step(view.sample())
    # Means over blocks of cells are that much finer.
    return scale_for_step(step * factor / view.factor, cell) or None


def read_surface(
    source: Any,
    *,
    height_band: int | str = 1,
    layers: Mapping[str, Any] | None = None,
    costs: Mapping[str, Any] | None = None,
    fill_holes: float = 0.0,
    smoothing: float | str | None = "auto",
    crs: Any = None,
    within: Any = None,
    margin: float = 0.0,
    decimate: int = 1,
    most_cells: int = MOST_CELLS,
) -> Surface:
    """A surface from a map of heights and further layers.

    source : anything GDAL reads, an xarray DataArray or Dataset, or (values, x, y).
    height_band : its band of heights, 1-based, or the name of a variable.
    layers, costs : name -> LayerSource, path, array or text FILE[:BAND][*WEIGHT]; brought onto
    the grid of the heights. The change of a layer costs, or the level of a cost, above 0.
    fill_holes : the longest side, map units of the plane, of holes that are filled; cells
    without data in any layer are blocked else.
    smoothing : standard deviation, map units; "auto": the least that heights rounded to a
    step need, none where they are not; None or 0: none.
    crs : where the map has none. within : (x_min, y_min, x_max, y_max) in the map's own
    coordinates; only that is read. margin : so much more around it, map units of the plane: what
    lies beyond is not seen, and a vehicle's radius reaches over the edge. decimate : means over
    so many cells a side are read. most_cells : a map with more is refused before memory is taken.

    A map in degrees, or turned, is brought onto a local projection in metres; heights are
    brought into the plane's unit. Raises MapError or InputError with the file, the value and
    the remedy.
    """
    require_not_negative(fill_holes=fill_holes, margin=margin)
    require_count(decimate=decimate)
    require_count(most=2**62, most_cells=most_cells)
    given = parse_crs(crs, f"crs={crs!r}")
    with gdal(), ExitStack() as files:
        height = LayerSource(_as_path(source) if isinstance(source, str) else source, height_band)
        parts = _collect(height, layers or {}, costs or {}, files, given)
        base = _base_view(parts[0].band, within, margin, decimate, most_cells)
        target = base.grid.planning_grid()
        bands = _read_all(parts, base, target, most_cells)
        plane = "" if target.crs is None else Georeference(target.crs, target.crs).unit
        if target.crs is None:
            _require_no_degrees(bands[0], target, parts[0].band.label)
        factor, unit = _into_plane_unit(parts[0].band.unit, plane)
        if factor != 1.0:
            bands[0] *= factor
        scale = _scale(smoothing, base, target.cell, factor)
    raster = Raster.on(target, bands)
    surface = (raster.trimmed() if base.grid.needs_warp else raster).to_surface(
        names=[part.name for part in parts],
        units=[unit, *(part.band.unit for part in parts[1:])],
        weights=[part.weight for part in parts],
        kinds=[part.kind for part in parts],
        fill_holes=float(fill_holes),
        smoothing=scale,
    )
    return replace(surface, source=parts[0].band.label)


def count_cells(
    source: Any, *, height_band: int | str = 1, crs: Any = None, within: Any = None
) -> int:
    """How many cells ``read_surface`` would read of the heights, from the header alone."""
    given = parse_crs(crs, f"crs={crs!r}")
    with gdal(), ExitStack() as files:
        height = LayerSource(_as_path(source) if isinstance(source, str) else source, height_band)
        view = View.whole(_open(height, files, given, heights=True))
        if within is not None:
            view = view.within(as_bounds(within, "within"))
        return view.grid.rows * view.grid.columns


def _read_all(parts: list[_Part], base: View, target: Grid, most_cells: int) -> Array:
    """All layers (layers, rows, columns) on the cells of the target."""
    views = [base, *(_view_onto(part, base, target) for part in parts[1:])]
    for view in views:
        view.require_size(most_cells)
    bands = np.empty((len(parts), target.rows, target.columns))
    for part, view, out in zip(parts, views, bands, strict=True):
        if part.kind == "cost":
            _costs_onto(part.name, view, target, out)
        else:
            _onto(view, target, out)
    return bands


class OpenMap:
    """Shim until maps are opened once."""

    def __init__(self, source: Any, **options: Any) -> None:
        self.source, self.options = source, options

    def cells(self, within: Any = None) -> int:
        o = self.options
        return count_cells(self.source, height_band=o["height_band"], crs=o["crs"], within=within)

    def surface(self, *, within: Any = None, margin: float = 0.0, decimate: int = 1) -> Surface:
        return read_surface(
            self.source, within=within, margin=margin, decimate=decimate, **self.options
        )


@contextmanager
def open_map(source: Any, **options: Any) -> Iterator[OpenMap]:
    yield OpenMap(source, **options)
