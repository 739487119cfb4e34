"""One band of a map from any source, read row by row: as a whole, in part, or coarser."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from .._support.memory import BLOCK
from ..errors import MapError
from ..surface.bounds import Bounds
from ..surface.georeference import metres_of
from ..surface.layers import Kind
from ..surface.raster import Grid
from ..validation import Array

MARGIN = 8  # cells around a window: values farther out change the spline by 1e-4, relative
SAMPLED_STRIPS = 8
SAMPLED_ROWS = 16
LEAST_SHARE = 0.5  # a coarse cell needs data in this share of its cells
FEWEST_LEVELS = 16  # distinct heights that are needed to find their rounding step
MOST_LOOKED_AT = 1_000_000  # heights that are searched for the rounding step
# All values that programs write for no data are beyond these two, so that most maps can be
# dismissed at a glance, and other fills lie at least so far below the ground, metres.
USUAL, DEPTH = (-998.0, 9998.0), 300.0

MOST_CELLS = 150_000_000  # of a map, where nothing else is said; 1.2 GB for each layer
FARTHEST = 1e12  # no coordinate of a map is larger, in any unit


def require_few_cells(label: str, rows: int, columns: int, most: int) -> None:
    """Raise MapError where a map that is read as a whole has too many cells."""
    if rows * columns > most:
        raise MapError(
            f"{label} has {columns:,} x {rows:,} cells, more than {most:,}; give larger cells "
            "(points take them by --cell-size), or raise most_cells= in Python"
        )


@dataclass(frozen=True, eq=False)
class Band(ABC):
    """A band: its grid, and how to read it.

    label : its name in messages. unit : "" where unknown. step : what its numbers are rounded to
    where they are stored as integers; 0 otherwise. unit_of_axes : of the coordinates, where
    there is no CRS that names it. is_placed : does the map say where its cells lie? is_gridded :
    were its cells chosen here, from points? largest :
    the largest number that its type of 8 or 16 bits without a sign can hold; 0 for others.
    """

    grid: Grid
    label: str
    unit: str
    step: float
    unit_of_axes: str = field(default="", kw_only=True)
    is_placed: bool = field(default=True, kw_only=True)
    is_gridded: bool = field(default=False, kw_only=True)
    largest: int = field(default=0, kw_only=True)

    @abstractmethod
    def read(self, rows: slice, columns: slice) -> Array:
        """Values (rows, columns) with scale and offset applied, NaN where there is no data."""

    @property
    def rows_at_once(self) -> int:
        """How many rows the file stores together in one block."""
        return 1

    @property
    def scaling(self) -> tuple[float, float]:
        """The scale and the offset of its stored numbers."""
        return 1.0, 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Derived(Band):
    """A band whose values are made of those of another one, read in the same blocks."""

    band: Band

    @property
    def rows_at_once(self) -> int:
        """How many rows the file stores together in one block."""
        return self.band.rows_at_once


def described(band: Band) -> dict[str, Any]:
    """What is known of a band besides its values, for one that is derived from it."""
    return {entry.name: getattr(band, entry.name) for entry in fields(Band)}


class Part(NamedTuple):
    """A layer before it is brought onto the map's grid."""

    name: str
    kind: Kind
    weight: float
    band: Band


@dataclass(frozen=True)
class View:
    """A part of a band to read: its rows and columns, and how much coarser."""

    band: Band
    rows: slice
    columns: slice
    factor: int = 1

    @classmethod
    def whole(cls, band: Band) -> View:
        """The whole band."""
        return cls(band, slice(0, band.grid.rows), slice(0, band.grid.columns))

    @property
    def grid(self) -> Grid:
        """The grid of the cells that are read."""
        window = self.band.grid.window(self.rows, self.columns)
        return window if self.factor == 1 else window.coarser(self.factor)

    @property
    def is_whole(self) -> bool:
        """Is it all of the band?"""
        grid = self.band.grid
        return (self.rows, self.columns) == (slice(0, grid.rows), slice(0, grid.columns))

    def coarser(self, factor: int) -> View:
        """The same part with cells ``factor`` times as wide and as high."""
        return replace(self, factor=factor)

    def around(self, x: Array, y: Array) -> View | None:
        """The part around points in the band's own coordinates; None where they lie outside."""
        column, row = self.band.grid.cells(x, y)
        kept = []
        for index, count in ((row, self.band.grid.rows), (column, self.band.grid.columns)):
            first = max(0, math.floor(index.min() - MARGIN * self.factor))
            last = min(count, math.ceil(index.max() + MARGIN * self.factor) + 1)
            if first >= last or index.max() < -0.5 or index.min() > count - 0.5:
                return None
            kept.append(slice(first, last))
        return replace(self, rows=kept[0], columns=kept[1])

    def widened(self, margin: float) -> View:
        """The view with a margin added on every side, in the unit of the planning plane."""
        grid = self.band.grid
        rows, columns = grid.window(self.rows, self.columns).reach(margin)
        return replace(
            self,
            rows=slice(max(self.rows.start - rows, 0), min(self.rows.stop + rows, grid.rows)),
            columns=slice(
                max(self.columns.start - columns, 0), min(self.columns.stop + columns, grid.columns)
            ),
        )

    def within(self, bounds: Bounds) -> View:
        """The part inside a rectangle of the map's own coordinates, and a few cells around it."""
        x = np.array([bounds.x1_min, bounds.x1_max] * 2)
        y = np.repeat([bounds.x2_min, bounds.x2_max], 2)
        part = self.around(x, y)
        if part is None:
            extent = ", ".join(f"{value:.10g}" for value in self.band.grid.extent())
            raise MapError(
                f"{tuple(bounds)} does not touch {self.band.label}, which covers ({extent}) "
                "as (x_min, y_min, x_max, y_max); check the order and the CRS"
            )
        return part

    def require_size(self, most_cells: int) -> None:
        """Raise MapError where there are too many cells, before memory is allocated."""
        grid = self.grid
        if min(grid.rows, grid.columns) < 1:
            raise MapError(
                f"decimate={self.factor} leaves {grid.columns} x {grid.rows} cells of "
                f"{self.band.label}; lower it"
            )
        if grid.rows * grid.columns > most_cells:
            factor = math.ceil(self.factor * math.sqrt(grid.rows * grid.columns / most_cells))
            raise MapError(
                f"{self.band.label} has {grid.columns:,} x {grid.rows:,} cells, more than "
                f"{most_cells:,}; read a part of it, in Python by within=(x_min, y_min, x_max, "
                f"y_max) and on the command line by --bounds, or all of it coarser, in Python by "
                f"decimate={factor}"
            )

    def strips(self) -> Iterator[tuple[int, Array]]:
        """Blocks of rows, each with the index of its first; they do not cut a coarse cell."""
        width = self.columns.stop - self.columns.start
        unit = math.lcm(self.factor, self.band.rows_at_once)
        if unit * width > 8 * BLOCK:
            unit = self.factor
        size = unit * max(1, BLOCK // (unit * width))
        start = self.rows.start
        while start < self.rows.stop:
            stop = min(start + size - (start - self.rows.start) % size, self.rows.stop)
            yield start - self.rows.start, self.band.read(slice(start, stop), self.columns)
            start = stop

    def sample(self) -> Array:
        """Some rows of the band at full resolution, spread over the part."""
        width = self.columns.stop - self.columns.start
        count = self.rows.stop - self.rows.start
        wanted = min(count, max(SAMPLED_ROWS, BLOCK // width))
        starts = np.linspace(self.rows.start, self.rows.stop, SAMPLED_STRIPS + 1).astype(int)[:-1]
        size = max(1, wanted // SAMPLED_STRIPS)
        return np.concatenate(
            [
                self.band.read(slice(start, min(start + size, self.rows.stop)), self.columns)
                for start in np.unique(starts).tolist()
            ]
        )

    def looks_usual(self) -> bool:
        """Are all values so moderate that none can stand for no data?"""
        low, high = np.inf, -np.inf
        if self.band.scaling != (1.0, 0.0):  # fills are stored as they are
            return False
        for _, strip in replace(self, factor=1).strips():
            values = strip[np.isfinite(strip)]
            if values.size:
                low, high = min(low, float(values.min())), max(high, float(values.max()))
            metres = metres_of(self.band.unit) or 1.0
            if low < USUAL[0] or high > USUAL[1] or (high - low) * metres >= DEPTH:
                return False
        return True

    def read_as(self, target: Grid, out: Array) -> bool:
        """Read into ``out`` if the target has the same cells, with its rows in either order.

        Returns False, and reads nothing, if its cells are different.
        """
        if (order := self.order_in(target)) is None:
            return False
        self.read_into(out[order])
        return True

    def order_in(self, target: Grid) -> slice | None:
        """The target's rows as they come here, if it has the same cells; None if it has others."""
        grid = self.grid
        if grid.crs != target.crs:
            return None
        if grid.is_same(target):
            return slice(None)
        return slice(None, None, -1) if grid.flipped().is_same(target) else None

    def read_into(self, out: Array) -> None:
        """Read the values of the grid's cells into ``out`` (rows, columns)."""
        for start, strip in self.strips():
            means = strip if self.factor == 1 else _block_means(strip, self.factor)
            first = start // self.factor
            out[first : first + len(means)] = means


def _block_means(values: Array, factor: int) -> Array:
    """Means over the cells with data of each block; NaN where over half of a block has none."""
    rows, columns = (size // factor for size in values.shape)
    cut = values[: rows * factor, : columns * factor]
    cells = cut.reshape(rows, factor, columns, factor)
    known = np.isfinite(cells).sum(axis=(1, 3))
    means = np.full(known.shape, np.nan)
    enough = known >= LEAST_SHARE * factor * factor
    np.divide(np.nansum(cells, axis=(1, 3)), known, out=means, where=enough)
    return means


def quantisation_step(values: Array) -> float:
    """The step that heights are rounded to; 0 where they are not rounded, or it is not found.

    values : any shape, NaN where unknown. A step is found where all gaps between distinct values
    are multiples of the smallest gap, to the precision of 32-bit numbers.
    """
    flat = values.reshape(-1)
    looked_at = flat[:: max(1, flat.size // MOST_LOOKED_AT)]
    levels = np.unique(looked_at[np.isfinite(looked_at)])
    if len(levels) < FEWEST_LEVELS:
        return 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # beyond 32 bits no step is found
        rounding = float(np.spacing(np.float32(np.abs(levels).max())))
    gaps = np.diff(levels)
    gaps = gaps[gaps > 2.0 * rounding]
    # Gaps near the precision of 32-bit numbers come from that precision, not from rounding.
    if len(gaps) < FEWEST_LEVELS - 1 or (least := float(gaps.min())) < 8.0 * rounding:
        return 0.0
    multiples = np.rint(gaps / least)
    step = float(gaps.sum() / multiples.sum())
    off = np.abs(gaps - multiples * step)
    return step if float(off.max()) <= 2.0 * rounding + 1e-9 * step else 0.0
