"""Reads maps as surfaces, from files, xarray and NumPy, with all layers on one grid."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from pyproj import CRS

from ..errors import InputError, MapError, MapWarning, tell
from ..surface import Surface
from ..surface.bounds import as_bounds
from ..surface.georeference import Georeference, metres_of
from ..surface.raster import Grid, Raster
from ..validation import Array, require_count, require_not_negative
from .bands import MOST_CELLS, Band, Part, View, quantisation_step
from .rasters import gdal
from .sources import LayerSource, NoData, Source, Unsaid

if TYPE_CHECKING:
    from ..surface.costs import CellLayers
    from ..surface.layers import Kind
    from .undeclared import Fills, Meaning

# x_min, y_min, x_max, y_max in the map's own coordinates.
Rectangle: TypeAlias = tuple[float, float, float, float]
# The sources of layers, by the layers' names.
Sources: TypeAlias = Mapping[str, LayerSource | Source]

STEEPEST_DEGREES = 10.0  # if the rms slope is above this, small coordinates must be degrees


@dataclass(eq=False)
class OpenMap:
    """A map whose files are open; see ``open_map``. Only for use in one thread."""

    heights: Part
    layers: Sources
    costs: Sources
    fill_holes: float
    smoothing: float | str | None
    unsaid: Unsaid
    files: ExitStack
    smooth_costs: bool = False
    is_closed: bool = False

    @cached_property
    def _fills(self) -> Fills:
        from .undeclared import Fills

        return Fills(self.unsaid.no_data)

    def _without_fills(self, view: View, meaning: Meaning) -> View:
        """The view, with what is no data without being declared as such."""
        is_searched = self.unsaid.no_data == "auto"
        if is_searched and view.looks_usual():
            return view
        return self._fills.blocked(view, meaning)

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
            base = self._without_fills(base, "heights")
            target = base.grid.southward() if base.grid.is_upright else base.grid
            bands = self._read(base, target, most_cells)
            cells = self._own_cells(base, target, most_cells)
            factor, unit = self._into_plane_unit(bands[0], target)
            scale = _scale(self.smoothing, base, math.sqrt(math.prod(base.grid.sides)), factor)
            surface = Raster.on(target, bands).to_surface(
                names=[part.name for part in self._parts],
                units=[unit, *(part.band.unit for part in self._parts[1:])],
                weights=[part.weight for part in self._parts],
                kinds=[part.kind for part in self._parts],
                fill_holes=float(self.fill_holes),
                smoothing=scale,
            )
        if cells is not None:
            from ..surface.costs import with_cells

            surface = with_cells(surface, cells)
        band = self.heights.band
        return replace(surface, source=band.label, unit_of_axes=band.unit_of_axes)

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
            *(("cost" if self.smooth_costs else "cells", *item) for item in self.costs.items()),
        ]
        parts = [self.heights]
        for kind, name, source in given:
            if name in {part.name for part in parts}:
                raise InputError(f"layer {name!r} is given twice; give each layer its own name")
            parts.append(self._opened(name, kind, LayerSource.of(source)))
        return parts

    def _opened(self, name: str, kind: Kind, source: LayerSource) -> Part:
        from .alignment import placed

        band = source.open(self.files, self.unsaid, heights=False)
        grid = self.heights.band.grid
        if self.unsaid.is_local:
            band = replace(band, grid=replace(band.grid, crs=None))
        return Part(name, kind, source.weight, placed(name, band, grid, self.unsaid.crs))

    def _read(self, base: View, target: Grid, most_cells: int) -> Array:
        """All layers (layers, rows, columns) on the cells of the target."""
        if len(self._parts) == 1:
            bands = np.empty((1, target.rows, target.columns))
            if base.read_as(target, bands[0]):
                return bands
        from .alignment import read_all

        return read_all(self._parts, base, target, most_cells, self._without_fills)

    def _own_cells(self, base: View, target: Grid, most_cells: int) -> CellLayers | None:
        """The costs of cells that are not those of the heights."""
        if not self.costs or self.smooth_costs:
            return None
        from .alignment import own_cells

        return own_cells(self._parts, base, target, most_cells, self._without_fills)

    def _into_plane_unit(self, heights: Array, target: Grid) -> tuple[float, str]:
        """Convert heights to the plane's unit, in place; returns the factor and the new unit."""
        band = self.heights.band
        if target.crs is None and not self.unsaid.is_local:
            _require_no_degrees(heights, target, band.label)
        plane = band.unit_of_axes
        if target.plane is not None:
            plane = Georeference(target.plane, target.plane).unit
        _tell_of_unit(band, plane)
        factor, unit = _into_plane_unit(band.unit, plane)
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
    smooth_costs: bool = False,
    fill_holes: float = 0.0,
    smoothing: float | str | None = "auto",
    crs: CRS | str | int | None = None,
    nodata: NoData = "auto",
    height_unit: str | None = None,
    cell_size: float | None = None,
    height_range: tuple[float, float] | None = None,
    allow_external: bool = False,
    most_cells: int = MOST_CELLS,
) -> Iterator[OpenMap]:
    """Open a map, to count its cells and to read surfaces of it: of the whole, in part, coarser.

    The heights are opened at once. Further layers are opened once, for the first surface. See
    ``read_surface`` for the arguments; most_cells is of maps that are read as a whole when they
    are opened, as points and maps of robots. Raises MapError or InputError with the file, the
    value and the remedy.
    """
    require_not_negative(fill_holes=fill_holes)
    require_count(most=2**62, most_cells=most_cells)
    unsaid = Unsaid.of(
        crs, nodata, height_unit, cell_size, height_range, allow_external=allow_external
    )
    unsaid = replace(unsaid, most_cells=most_cells)
    files = ExitStack()
    opened = None
    try:
        with gdal():
            band = LayerSource.of_heights(source, height_band).open(files, unsaid)
        heights = Part("height", "rise", 1.0, band)
        given = (layers or {}, costs or {}, fill_holes, smoothing, unsaid, files, smooth_costs)
        opened = OpenMap(heights, *given)
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


def _tell_of_unit(band: Band, plane: str) -> None:
    """Tell of heights whose unit is not known, where it may be another one than the plane's."""
    if metres_of(plane) is None or metres_of(band.unit) is not None:
        return
    if band.unit:
        what = f"in {band.unit!r}, which is not a known unit of length, and are taken to be"
    elif metres_of(plane) != 1.0:
        what = "without a unit, and are taken to be"
    else:
        return
    tell(
        MapWarning(
            f"{band.label}: heights are {what} in {plane}, as the plane is; give their unit by "
            "--height-unit (height_unit= in Python)"
        )
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
            f"to {y_max:.6g}, look like degrees; name its CRS, as in crs='EPSG:4326', or give "
            "crs='none' to plan on them as they are"
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
    smooth_costs: bool = False,
    fill_holes: float = 0.0,
    smoothing: float | str | None = "auto",
    crs: CRS | str | int | None = None,
    nodata: NoData = "auto",
    height_unit: str | None = None,
    cell_size: float | None = None,
    height_range: tuple[float, float] | None = None,
    allow_external: bool = False,
    within: Rectangle | None = None,
    margin: float = 0.0,
    decimate: int = 1,
    most_cells: int = MOST_CELLS,
) -> Surface:
    """A surface from a map of heights and further layers.

    source : anything GDAL reads, an xarray DataArray or Dataset, or (values, x, y).
    height_band : its band of heights, 1-based, or the name of a variable.
    layers, costs : name -> LayerSource, path, array or text ``FILE[:BAND][*WEIGHT]``. A change of
    one of ``layers`` costs; they are resampled to the grid of the heights. The value of one of
    ``costs`` multiplies lengths, and must be above 0. It is what the raster says in each of its
    cells. Where a cost raster is not upright on the plane, as one in degrees, or several have
    different cells, the cells are those of the heights, with the value at their centres.
    smooth_costs : take costs as samples of smooth fields instead; between samples they are
    interpolated in their logarithms.
    fill_holes : holes up to this side are filled, map units of the plane; all other cells
    without data in any layer are blocked.
    smoothing : standard deviation, map units. "auto": where heights are rounded to a step, the
    least smoothing that they need, otherwise none. None or 0: none.
    crs : the CRS of a map that has none; "none": the map is a plane of its own, and no CRS is
    looked for. nodata : "auto": what the map declares as no data, and values that stand out as
    such, with a MapWarning; "none": only what it declares; or a further value. height_unit : of
    heights that have none, "m" or "ft". cell_size : the side of the cells of a picture, which
    does not say it. height_range : (low, high), the heights of a picture's darkest and brightest
    numbers. allow_external : a virtual raster (VRT) may take its data from outside its folder.
    within : (x_min, y_min, x_max, y_max) in the map's own
    coordinates; only this part is read. margin : how much more is read around it, map units of
    the plane. A vehicle's radius reaches over the edge, and ground that is not read cannot block
    it. decimate : means over blocks of this many cells a side are read. most_cells : a map with
    more cells is refused before memory is allocated.

    A map in degrees, or a rotated one, is projected to a local projection in metres. Heights are
    converted to the plane's unit. Raises MapError or InputError with the file, the value and the
    remedy.
    """
    require_count(most=2**62, most_cells=most_cells)
    is_whole = within is None and decimate == 1
    with open_map(
        source,
        height_band=height_band,
        layers=layers,
        costs=costs,
        smooth_costs=smooth_costs,
        fill_holes=fill_holes,
        smoothing=smoothing,
        crs=crs,
        nodata=nodata,
        height_unit=height_unit,
        cell_size=cell_size,
        height_range=height_range,
        allow_external=allow_external,
        # Of a map that is read in part or coarser, the whole may have more.
        most_cells=most_cells if is_whole else max(MOST_CELLS, most_cells),
    ) as opened:
        return opened.surface(
            within=within, margin=margin, decimate=decimate, most_cells=most_cells
        )
