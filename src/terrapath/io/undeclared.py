"""No-data values that no tag declares, found from the values themselves.

A fill value stands out: its cells end in cliffs on every side, far higher than the steps of the
ground elsewhere. Real ground that happens to have the same value does not: a lake has a shore, and
the sea floor passes through -9999 on a slope.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from ..errors import MapWarning, tell
from ..surface.georeference import metres_of
from ..surface.neighbours import grown
from ..validation import Array
from .bands import DEPTH, USUAL, Band, Derived, View, described
from .sources import NoData

Cells: TypeAlias = npt.NDArray[np.bool_]
# What the values of a band are.
Meaning: TypeAlias = Literal["heights", "layer", "costs"]

# Values that programs write for no data.
KNOWN = np.array([
    -9999.0, -99999, -999999, -999, -32768, -32767, -2147483648, -2147483647,
    9999, 99999, 999999, 32767, 65535, 2147483647, 4294967295,
])  # fmt: skip
HUGE = 1e9  # no height has this magnitude, in any unit
# From these magnitudes on, a value means no data. Costs may be dear: 9999 or 65535 is one.
BEYOND: dict[Meaning, float] = {"heights": HUGE, "layer": np.inf, "costs": 1e30}
CLIFFS = 5.0  # a fill's cliffs are this many times as high as 99 % of the steps elsewhere
# A flat plain of any other value is a fill if it lies so far below everything else (DEPTH), and its
# cliffs are this many times the steps elsewhere and this steep on all sides.
PLAIN_CLIFFS, STEEPEST = 10.0, 2.0
FEWEST = 4  # cells of such a plain
MIXED = 0.8  # the share of the way from a fill to the ground where interpolated cells are found
FEWEST_STEPS = 100  # that tell how high the steps of the ground are
FRINGE = 3  # cells around a fill that interpolation may have mixed with it
DEGREE = 111_320.0  # metres
MOST_STEPS = 20_000  # that are kept of one strip


class Finding(NamedTuple):
    """Values from ``low`` to ``high`` that are no data, in how many cells, and where first."""

    low: float
    high: float
    value: float
    cells: int
    row: int
    column: int


@dataclass(frozen=True, eq=False, kw_only=True)
class WithoutFills(Derived):
    """A band in which further values are no data. ranges : (low, high) of each."""

    ranges: tuple[tuple[float, float], ...]

    @property
    def scaling(self) -> tuple[float, float]:
        """The scale and the offset of its stored numbers."""
        return self.band.scaling

    def read(self, rows: slice, columns: slice) -> Array:
        """Values (rows, columns), NaN where there is no data."""
        values = self.band.read(rows, columns)
        for low, high in self.ranges:
            values[(values >= low) & (values <= high)] = np.nan
        return values


def without(band: Band, *ranges: tuple[float, float]) -> Band:
    """The band, with the values in these ranges as no data."""
    if not ranges:
        return band
    return WithoutFills(**described(band), band=band, ranges=ranges)


def of_value(value: float) -> tuple[float, float]:
    """The range of numbers that a file may hold for a value: it may be rounded to 32 bits."""
    with np.errstate(over="ignore"):
        stored = float(np.float32(value))
    return min(value, stored), max(value, stored)


@dataclass(frozen=True)
class Fills:
    """What counts as no data in the bands of a map, and what was found in each."""

    no_data: NoData
    found: dict[int, list[Finding]] = field(default_factory=dict)

    def blocked(self, view: View, meaning: Meaning) -> View:
        """The view, with what is no data without being declared as such; it is told of."""
        if self.no_data == "none":
            return view
        if self.no_data != "auto":
            # Said of the heights alone: 0 may be no height, and yet a slope or a temperature.
            ranges = [of_value(self.no_data)] if meaning == "heights" else []
            return replace(view, band=without(view.band, *ranges))
        key = id(view.band)  # the map keeps its bands
        if key not in self.found:
            found = findings(view, meaning)
            for finding in found:
                tell(MapWarning(_in_words(view, finding, meaning)))
            if not view.is_whole:
                return _freed(view, found)
            self.found[key] = found
        return _freed(view, self.found[key])


def _freed(view: View, found: list[Finding]) -> View:
    return replace(view, band=without(view.band, *((f.low, f.high) for f in found)))


def _in_words(view: View, found: Finding, meaning: Meaning) -> str:
    x, y = view.band.grid.place(
        view.columns.start + found.column + 0.5, view.rows.start + found.row + 0.5
    )
    between = ""
    if found.low != found.high and abs(found.value) < HUGE:
        between = f", or lie between that and {found.high + found.low - found.value:.6g},"
    cells = f"{found.cells:,} cell{'s hold' if found.cells > 1 else ' holds'}"
    does, remedy = (
        "no ground does",
        (
            f"say so by --nodata {found.value:.10g}, or --nodata none if it is ground "
            "(nodata= in Python)"
        ),
    )
    if meaning == "costs":
        does, remedy = "no cost can be", "declare it as no-data in the file"
    return (
        f"{view.band.label}: {cells} {found.value:.10g}{between} as {does}, though no tag "
        f"declares it as no-data, the first at x={x:.10g}, y={y:.10g}; they are blocked; {remedy}"
    )


# The search


def findings(view: View, meaning: Meaning) -> list[Finding]:
    """The values in the part of a band that are no data, though nothing says so.

    Other values than the known ones are looked for only in heights, and in costs only those that
    no cost can be: negative, or beyond all costs.
    """
    whole = replace(view, factor=1)
    seen = _Seen(*view.band.scaling, meaning)
    for start, strip in whole.strips():
        seen.add(start, strip)
    found = seen.findings_beyond()
    candidates = sorted(seen.suspects)
    plain = seen.plain(view.band) if meaning == "heights" else None
    for value in [*candidates, *([] if plain is None else [plain])]:
        borders = _Borders(value, [v for v in candidates if v != value], meaning)
        for start, strip in whole.strips():
            borders.add(start, strip)
        finding = borders.finding(PLAIN_CLIFFS if value == plain else CLIFFS)
        if finding is not None:
            found.append(finding)
    return found


class _Seen:
    """What a first look at all values remembers."""

    def __init__(self, scale: float, offset: float, meaning: Meaning) -> None:
        # Fills are stored as they are, and what is read is scaled.
        self.fills = np.unique(np.concatenate([KNOWN, KNOWN * scale + offset]))
        if meaning == "costs":
            self.fills = self.fills[self.fills < 0.0]
        self.is_heights, self.most = meaning == "heights", BEYOND[meaning]
        self.usual = USUAL if (scale, offset) == (1.0, 0.0) else (np.inf, -np.inf)
        self.suspects: set[float] = set()
        self.known = self.huge = 0
        self.first_huge = (0, 0)
        self.beyond = [(0, 0.0), (0, 0.0)]  # cells and a value, far below and far above
        self.lowest, self.count, self.second = np.inf, 0, np.inf

    def add(self, start: int, strip: Array) -> None:
        """Look at a strip of rows."""
        values = strip[np.isfinite(strip)]
        self.known += values.size
        if not values.size:
            return
        low, high = float(values.min()), float(values.max())
        if low <= -self.most or high >= self.most:
            self._add_huge(start, strip, values)
            values = values[np.abs(values) < self.most]
        if low < self.usual[0] or high > self.usual[1]:
            far = values[(values < self.usual[0]) | (values > self.usual[1])]
            here = self.fills[np.isin(self.fills, far)]
            self.suspects.update(here.tolist())
            if len(here):
                values = values[~np.isin(values, here)]
        if self.is_heights and values.size:
            self._add_lowest(values)

    def _add_huge(self, start: int, strip: Array, values: Array) -> None:
        if not self.huge:
            held = np.abs(np.nan_to_num(strip, posinf=0, neginf=0)) >= self.most
            row, column = np.argwhere(held)[0]
            self.first_huge = start + int(row), int(column)
        for side, far in enumerate((values[values <= -self.most], values[values >= self.most])):
            if far.size:
                cells, value = self.beyond[side]
                self.beyond[side] = cells + far.size, value if cells else float(far[0])
                self.huge += far.size

    def findings_beyond(self) -> list[Finding]:
        """The values beyond all that are meant, unless the map holds nothing else."""
        if not 0 < self.huge < self.known:
            return []
        sides = zip(((-np.inf, -self.most), (self.most, np.inf)), self.beyond, strict=True)
        return [Finding(*side, value, n, *self.first_huge) for side, (n, value) in sides if n]

    def _add_lowest(self, values: Array) -> None:
        low = float(values.min())
        here = int((values == low).sum())
        above = values[values > low] if low <= self.lowest else values
        second = float(above.min()) if above.size else np.inf
        if low < self.lowest:
            second = min(second, self.lowest)
            self.lowest, self.count, self.second = low, here, second
        else:
            self.count += here if low == self.lowest else 0
            self.second = min(self.second, second)

    def plain(self, band: Band) -> float | None:
        """The lowest value, where so much lies so far above it that it may be a fill."""
        gap = self.second - self.lowest
        metres = metres_of(band.unit) or 1.0
        cell = band.grid.cell
        if band.grid.crs is not None:
            factor = band.grid.crs.axis_info[0].unit_conversion_factor
            cell *= DEGREE if band.grid.crs.is_geographic else factor
        steep = gap * metres >= STEEPEST * cell
        is_far = np.isfinite(gap) and gap * metres >= DEPTH and steep
        return self.lowest if is_far and self.count >= FEWEST else None


class _Borders:
    """The cliffs around the cells of a value, and the steps of the ground elsewhere."""

    def __init__(self, value: float, others: list[float], meaning: Meaning) -> None:
        self.value, self.others, self.meaning = value, np.array(others), meaning
        self.jumps: list[Array] = []  # at the cells' borders
        self.steps: list[Array] = []  # elsewhere, and away from the cells
        self.steps_away: list[Array] = []
        self.cells, self.first = 0, (0, 0)
        self.nearest = np.inf  # the least distance of any other value
        self.far = [np.inf, -np.inf]  # lowest and highest value away from the cells
        self.near: list[Array] = []  # values beside them

    def add(self, start: int, strip: Array) -> None:
        """Look at a strip of rows."""
        values = strip.copy()
        if self.others.size:
            values[np.isin(values, self.others)] = np.nan
        values[np.abs(values) >= BEYOND[self.meaning]] = np.nan
        held = values == self.value
        if held.any():
            if not self.cells:
                row, column = np.argwhere(held)[0]
                self.first = start + int(row), int(column)
            self.cells += int(held.sum())
        around = held
        for _ in range(FRINGE if held.any() else 0):
            around = grown(around)
        for axis in (0, 1):
            steps = np.abs(np.diff(values, axis=axis))
            holding = np.add(*_pairs(held, axis), dtype=np.uint8)
            _keep(self.jumps, steps[holding == 1])
            _keep(self.steps, steps[holding == 0])
            _keep(self.steps_away, steps[np.add(*_pairs(around, axis), dtype=np.uint8) == 0])
        self._add_rest(values, held, around)

    def _add_rest(self, values: Array, held: Cells, around: Cells) -> None:
        rest = values[~held & np.isfinite(values)]
        if rest.size:
            self.nearest = min(self.nearest, float(np.abs(rest - self.value).min()))
        away = values[~around & np.isfinite(values)]
        if away.size:
            self.far = [min(self.far[0], float(away.min())), max(self.far[1], float(away.max()))]
        if held.any():
            _keep(self.near, values[around & ~held], most=1_000_000)

    def finding(self, cliffs: float) -> Finding | None:
        """The value as a finding, where its cells end in cliffs."""
        jumps, steps, away = map(_together, (self.jumps, self.steps, self.steps_away))
        # Beside a fill that was interpolated the steps are high, too.
        steps = away if len(away) >= FEWEST_STEPS else steps
        usual = float(np.percentile(steps, 99.0)) if len(steps) else 0.0
        jump = float(np.median(jumps)) if len(jumps) else self.nearest
        is_apart = self.nearest > self.far[1] - self.far[0] >= 0.0
        is_certain = self.meaning == "costs" or jump > cliffs * usual or is_apart
        if not self.cells or not is_certain:
            return None
        if not len(jumps) and not np.isfinite(self.nearest) and self.value > 0.0:
            return None  # the whole map is as high as this
        low, high = self._with_fringe(usual)
        near = _together(self.near)
        mixed = near[(near >= low) & (near <= high)]
        # What interpolation mixed with the fill is anywhere between it and the ground.
        if not len(mixed) or np.abs(mixed - self.value).min() > MIXED * (high - low):
            return Finding(self.value, self.value, self.value, self.cells, *self.first)
        return Finding(low, high, self.value, self.cells + len(mixed), *self.first)

    def _with_fringe(self, usual: float) -> tuple[float, float]:
        """The value, and what lies between it and all of the ground that is not beside it."""
        least, most = self.far
        if self.value < least < np.inf:
            return self.value, max(self.value, np.nextafter(least - FRINGE * usual, -np.inf))
        if -np.inf < most < self.value:
            return min(self.value, np.nextafter(most + FRINGE * usual, np.inf)), self.value
        return self.value, self.value


def _together(kept: list[Array]) -> Array:
    return np.concatenate([*kept, np.empty(0)])


def _pairs(cells: Cells, axis: int) -> tuple[Cells, Cells]:
    """The cells without the first and without the last row, or column."""
    return (cells[1:], cells[:-1]) if axis == 0 else (cells[:, 1:], cells[:, :-1])


def _keep(kept: list[Array], values: Array, most: int = MOST_STEPS) -> None:
    """Keep some of the finite values."""
    values = values[np.isfinite(values)]
    if values.size:
        kept.append(values[:: max(1, values.size // most)])
