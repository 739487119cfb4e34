"""Files of robots and scanners that GDAL does not read, each opened as a band."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from ..errors import MapError
from .bands import Band
from .rasters import gdal, open_dataset, reading
from .sources import Unsaid


def _nav2(path: Path, number: int | str, unsaid: Unsaid) -> Band:
    from .occupancy import open_nav2

    return open_nav2(path, number, unsaid)


def _movingai(path: Path, number: int | str, unsaid: Unsaid) -> Band:
    from .occupancy import open_movingai

    return open_movingai(path, number, unsaid.most_cells)


def _points(read: str, path: Path, number: int | str, unsaid: Unsaid) -> Band:
    from .points import open_points

    return open_points(path, number, unsaid, read)


# By the names that ``sources.FORMS`` gives to endings.
OPENERS: dict[str, Callable[[Path, int | str, Unsaid], Band]] = {
    "nav2": _nav2,
    "movingai": _movingai,
    "las": partial(_points, "las"),
    "ply": partial(_points, "ply"),
    "text": partial(_points, "text"),
}


def is_grid_of_gdal(path: Path, unsaid: Unsaid) -> bool:
    """Is it a file of points that GDAL reads as a grid, because they lie on one?"""
    if path.suffix.lower() != ".xyz" or unsaid.cell_size is not None:
        return False
    try:
        with gdal(), reading(path):
            open_dataset(path).close()
    except MapError:
        return False
    return True


def open_form(form: str, path: Path, number: int | str, unsaid: Unsaid) -> Band:
    """The band of a file of this form."""
    return OPENERS[form](path, number, unsaid)
