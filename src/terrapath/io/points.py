"""Scattered points, as from a laser scanner, on a grid: the mean height in each cell."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pyproj import CRS
from rasterio import Affine

from .._support.extras import require_packages
from ..errors import MapError, MapWarning, tell
from ..surface.georeference import parse_crs
from ..surface.raster import Grid
from ..validation import Array
from .arrays import ArrayBand
from .bands import FARTHEST, Band, require_few_cells
from .rasters import reading, with_crs
from .sources import Unsaid

FEWEST = 16  # points of a map
POINTS_IN_CELL = 4.0  # on average, where no cell is given
MOST_PACKED = 1_000  # bytes of points that one byte of a LAZ file may hold

NAMES = (("x", "easting", "lon", "longitude"), ("y", "northing", "lat", "latitude"),
         ("z", "height", "elevation", "altitude"))  # fmt: skip


def open_points(path: Path, number: int | str, unsaid: Unsaid, read: str) -> Band:
    """The points of a file as a band: the mean of the heights in each cell; voids have no data.

    The cells' side is the one that is said; otherwise cells hold four points on average. It is
    told, and so are the voids. read : the name of the reader.
    """
    if number != 1:
        raise MapError(f"band={number!r} is not in {path}; points have one band, their height")
    with reading(path):
        points, own = READERS[read](path)
    points = _checked(path, points[np.isfinite(points).all(axis=1)])
    grid = _grid_of(path, points, unsaid)
    counts, means = _means(points, grid)
    side, voids = grid.transform.a, float((counts == 0).mean())
    tell(
        MapWarning(
            f"{path}: {len(points):,} points are averaged on {grid.columns:,} x {grid.rows:,} "
            f"cells of side {side:.6g}; {100.0 * voids:.3g} % of the cells are void, and blocked; "
            "change that by --cell-size and --fill-holes"
        )
    )
    grid = Grid(grid.rows, grid.columns, grid.transform, with_crs(own, unsaid.crs, path))
    return ArrayBand(grid=grid, label=str(path), unit="", step=0.0, array=means, is_gridded=True)


def _checked(path: Path, points: Array) -> Array:
    """The points (n, 3), where a map can be made of them."""
    if len(points) and np.abs(points).max() > FARTHEST:
        raise MapError(f"{path} has a point beyond {FARTHEST:g}, where no map is; remove it")
    if len(points) < FEWEST:
        raise MapError(f"{path} holds {len(points)} points; a map needs at least {FEWEST}")
    if not (np.ptp(points[:, :2], axis=0) > 0.0).all():
        raise MapError(f"{path}: all points lie on one line; a map needs points side by side")
    return points


def _grid_of(path: Path, points: Array, unsaid: Unsaid) -> Grid:
    """The cells to average the points in, rows from south to north."""
    low, span = points[:, :2].min(axis=0), np.ptp(points[:, :2], axis=0)
    step = _step(points)
    mean = float(np.sqrt(POINTS_IN_CELL * span.prod() / len(points)))
    side = unsaid.cell_size or step or mean
    if side == step:
        low = low - 0.5 * side  # the points are the centres of cells
    with np.errstate(all="ignore"):
        counts = np.floor(span / side) + 1.0
    if not np.isfinite(counts).all():
        raise MapError(f"{path}: its points are so near each other that no cell fits; check them")
    columns, rows = map(int, counts.tolist())
    require_few_cells(f"{path}, on cells of {side:g},", rows, columns, unsaid.most_cells)
    return Grid(rows, columns, Affine(side, 0.0, low[0], 0.0, side, low[1]))


def _means(points: Array, grid: Grid) -> tuple[npt.NDArray[np.intp], Array]:
    """How many points each cell holds, and their mean height (rows, columns), NaN for none."""
    low = np.array([grid.transform.c, grid.transform.f])
    place = ((points[:, :2] - low) / grid.transform.a).astype(np.intp)
    index, count = place[:, 1] * grid.columns + place[:, 0], grid.rows * grid.columns
    counts = np.bincount(index, minlength=count)
    sums = np.bincount(index, points[:, 2], minlength=count)
    means = np.full(count, np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return counts, means.reshape(grid.rows, grid.columns)


def _step(points: Array) -> float | None:
    """The step of points that lie on a grid, the same along x and y; None for others."""
    steps = []
    for axis in points[:, :2].T:
        places = np.unique(axis)
        gaps = np.diff(places)
        if len(places) ** 2 > 64 * len(points) or np.ptp(gaps) > 1e-6 * gaps.min():
            return None
        steps.append(float(np.median(gaps)))
    return steps[0] if abs(steps[0] - steps[1]) <= 1e-6 * steps[0] else None


def _of_las(path: Path) -> tuple[Array, CRS | None]:
    require_packages(
        f"{path}, a point cloud,", "laspy", *(["lazrs"] if path.suffix.lower() == ".laz" else [])
    )
    import laspy

    is_packed = path.suffix.lower() == ".laz"
    _require_moderate_header(path, MOST_PACKED if is_packed else 1)
    if is_packed:
        _require_moderate_chunks(path)
    cloud = laspy.read(path)
    return np.column_stack([cloud.x, cloud.y, cloud.z]), parse_crs(cloud.header.parse_crs())


def _require_moderate_header(path: Path, most_packed: int) -> None:
    """Raise MapError where a file claims more than it can hold: memory for it would be asked for.

    most_packed : how many bytes of points one byte of the file may hold.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(375)  # of the longest header, that of version 1.4

    def number(at: int, width: int) -> int:
        return int.from_bytes(head[at : at + width], "little")

    is_newest = number(25, 1) >= 4
    points, records = number(107, 4), 54 * number(100, 4)
    if is_newest:
        points, records = number(247, 8), records + 60 * number(243, 4)
    if max(number(96, 4), records) > size or points * number(105, 2) > most_packed * size:
        raise MapError(
            f"{path} is damaged: its header claims more than its {size:,} bytes can hold"
        )


def _require_moderate_chunks(path: Path) -> None:
    """Raise MapError where a LAZ file claims absurdly many chunks, for which lazrs would abort."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(96)  # where the header says where the points begin
        start = int.from_bytes(file.read(4), "little")
        file.seek(min(start, size))
        table = int.from_bytes(file.read(8), "little", signed=True)
        if table == -1:  # written as a stream: the place is at the end
            file.seek(max(size - 8, 0))
            table = int.from_bytes(file.read(8), "little", signed=True)
        file.seek(min(max(table, 0), size))
        chunks = int.from_bytes(file.read(8)[4:], "little")
    if chunks > size:
        raise MapError(f"{path} is damaged: it claims {chunks:,} chunks in {size:,} bytes")


def _of_ply(path: Path) -> tuple[Array, CRS | None]:
    require_packages(f"{path}, a point cloud,", "plyfile")
    from plyfile import PlyData

    vertices = PlyData.read(path)["vertex"]
    return np.column_stack([np.asarray(vertices[axis], np.float64) for axis in "xyz"]), None


def _of_text(path: Path) -> tuple[Array, CRS | None]:
    """Rows of x, y and z, between commas, semicolons or blanks; a heading may name them."""
    with path.open(encoding="utf-8-sig") as file:
        first = file.readline()
        separator = next((mark for mark in ",;\t" if mark in first), None)
        names = next(csv.reader([first], delimiter=separator or " "))
        columns, skipped = [0, 1, 2], 0
        if not all(map(is_number, (name for name in names if name.strip()))):
            columns, skipped = _columns_of([name.strip().lower() for name in names], path), 1
    rows = np.loadtxt(
        path, delimiter=separator, skiprows=skipped, usecols=columns, ndmin=2, encoding="utf-8-sig"
    )
    return rows, None


def is_number(text: str) -> bool:
    """Is a text a number?"""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _columns_of(names: list[str], path: Path) -> list[int]:
    found = [next((names.index(name) for name in group if name in names), None) for group in NAMES]
    if any(column is None for column in found):
        raise MapError(
            f"{path} has the columns {', '.join(names):.100}, of which not all of x, y and z are "
            "known; name them so in its first line"
        )
    return [column for column in found if column is not None]


READERS: dict[str, Callable[[Path], tuple[Any, CRS | None]]] = {
    "las": _of_las,
    "ply": _of_ply,
    "text": _of_text,
}
