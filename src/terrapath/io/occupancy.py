"""Maps of what is free and what is blocked, without heights: of nav2, and of MovingAI."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rasterio import Affine
from rasterio.enums import ColorInterp

from .._support.extras import require_packages
from ..errors import MapError
from ..surface.raster import Grid
from ..validation import Array, is_there
from .arrays import ArrayBand
from .bands import FARTHEST, Band, require_few_cells
from .rasters import gdal, open_dataset, reading
from .sources import Unsaid, require_safe

Cells = npt.NDArray[np.bool_]

MOST_BYTES = 1_000_000  # of a description
FARTHEST_TURN = 1e3  # radians; beyond that nothing is precise
MODES = ("trinary", "scale", "raw")
OCCUPIED = 100.0
METRE = "m"  # what resolutions and origins of nav2 are in
PASSABLE = b".GS"  # ground and shallow water, in maps of MovingAI


def occupancy_band(
    path: Path,
    number: int | str,
    occupancy: Array,
    blocked: Cells,
    transform: Affine,
    unit: str = "",
) -> Band:
    """Band 1, flat ground, or band 2, the cost 1 + occupancy; blocked cells are no data.

    A ring of blocked cells is laid around, so that the ground reaches to the map's very edge.
    unit : of lengths on the map, where it is known.
    """
    if number not in (1, 2):
        raise MapError(f"band={number!r} is not in {path}; it has 1, flat ground, and 2, the cost")
    values = np.zeros(blocked.shape) if number == 1 else 1.0 + occupancy
    padded = np.pad(np.where(blocked, np.nan, values), 1, constant_values=np.nan)
    rows, columns = padded.shape
    grid = Grid(rows, columns, transform @ Affine.translation(-1.0, -1.0))
    return ArrayBand(grid=grid, label=str(path), unit="", step=0.0, array=padded, unit_of_axes=unit)


# nav2: a description in YAML and a picture


def open_nav2(path: Path, number: int | str, unsaid: Unsaid) -> Band:
    """A map of nav2's map_server: ``map.yaml`` and its picture.

    Occupied and unknown cells are blocked, by the thresholds and the mode as map_server reads them
    (https://docs.nav2.org/configuration/packages/configuring-map-server.html).
    """
    about = _description(path)
    image = path.parent / str(about["image"])
    if not unsaid.allow_external:
        from .._support.external import ALLOW, reaches_out

        if reaches_out(str(about["image"]), path.parent):
            raise MapError(f"{path} names the image {image}, which is elsewhere; allow by {ALLOW}")
    resolution = _number(path, about, "resolution", None)
    if not resolution > 0.0:
        raise MapError(f"{path}: resolution={resolution:g} must be above 0, metres a cell")
    x, y, yaw = _origin(path, about)
    occupancy, unknown = _occupancy(path, about, *_shades(image, unsaid))
    blocked = unknown | (occupancy >= OCCUPIED)
    transform = (
        Affine.translation(x, y)
        @ Affine.rotation(math.degrees(yaw))
        @ Affine.scale(resolution, -resolution)
        @ Affine.translation(0.0, -float(len(blocked)))
    )
    return occupancy_band(path, number, occupancy, blocked, transform, METRE)


def _description(path: Path) -> dict[str, Any]:
    require_packages(f"{path}, a map of nav2,", "ruamel.yaml")
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        with path.open("rb") as file:
            text = file.read(MOST_BYTES + 1)
        about = YAML(typ="safe", pure=True).load(text) if len(text) <= MOST_BYTES else None
    except (OSError, ValueError, TypeError, YAMLError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise MapError(f"{path} cannot be read as YAML: {reason:.200}; check the file") from None
    if not (isinstance(about, dict) and isinstance(about.get("image"), str)):
        raise MapError(f"{path} is no map of nav2: it has no 'image'; name one, as image: map.pgm")
    return about


def _number(path: Path, about: dict[str, Any], key: str, default: float | None) -> float:
    value = about.get(key, default)
    if isinstance(value, (int, float)) and math.isfinite(value):
        return float(value)
    raise MapError(f"{path}: {key}={value!r:.60} is not a number; give one")


def _origin(path: Path, about: dict[str, Any]) -> tuple[float, float, float]:
    """x, y and yaw of the lower left corner of the picture."""
    given = about.get("origin", [0.0, 0.0, 0.0])
    try:
        x, y, yaw = (float(value) for value in given)
        if not (max(abs(x), abs(y)) < FARTHEST and abs(yaw) < FARTHEST_TURN):
            raise ValueError
    except (TypeError, ValueError):
        raise MapError(f"{path}: origin={given!r:.60} is not three numbers, [x, y, yaw]") from None
    return x, y, yaw


def _shades(image: Path, unsaid: Unsaid) -> tuple[Array, Array]:
    """Brightness and opacity of a picture's cells, from 0 to 1."""
    require_safe(image, allow_external=unsaid.allow_external)
    if not is_there(image):
        raise MapError(f"{image} does not exist; check 'image' in the map's YAML file")
    with gdal(), reading(image), open_dataset(image) as picture:
        require_few_cells(str(image), picture.height, picture.width, unsaid.most_cells)
        kinds = list(picture.colorinterp)
        bands = picture.read()
        if kinds[0] == ColorInterp.palette:
            colours = picture.colormap(1)
            table = np.array([colours.get(k, (0, 0, 0, 255)) for k in range(256)], np.uint8)
            bands = np.moveaxis(table[bands[0]], -1, 0)
            kinds = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
    if bands.dtype.kind != "u":
        raise MapError(f"{image} holds {bands.dtype} values; a picture of 8 or 16 bits is needed")
    shares = bands / float(np.iinfo(bands.dtype).max)
    is_alpha = np.array([kind == ColorInterp.alpha for kind in kinds])
    opacity = shares[is_alpha].min(axis=0) if is_alpha.any() else np.ones(shares.shape[1:])
    return shares[~is_alpha].mean(axis=0), opacity


def _occupancy(
    path: Path, about: dict[str, Any], shade: Array, opacity: Array
) -> tuple[Array, Cells]:
    """(occupancy from 0 to 100, unknown) of all cells."""
    mode = about.get("mode", "trinary")
    if mode not in MODES:
        raise MapError(f"{path}: mode={mode!r:.60} is not known; give one of {', '.join(MODES)}")
    if mode == "raw":
        raw = np.rint(255.0 * shade)
        return np.minimum(raw, OCCUPIED), raw > OCCUPIED
    high = _number(path, about, "occupied_thresh", 0.65)
    low = _number(path, about, "free_thresh", 0.25)
    if not 0.0 <= low < high <= 1.0:
        raise MapError(
            f"{path}: free_thresh={low:g} and occupied_thresh={high:g} must be "
            "0 to 1, in this order"
        )
    value = shade if _number(path, about, "negate", 0) else 1.0 - shade
    between = (value > low) & (value < high)
    occupancy = np.where(value >= high, OCCUPIED, 0.0)
    if mode == "trinary":
        return occupancy, between
    scaled = np.rint(OCCUPIED * (value - low) / (high - low)).clip(0.0, OCCUPIED - 1.0)
    return np.where(between, scaled, occupancy), opacity < 1.0


# MovingAI: rows of letters


def open_movingai(path: Path, number: int | str, most_cells: int) -> Band:
    """A grid of the MovingAI benchmarks (Sturtevant 2012): x is the column, y the row, downwards.

    The centre of the first cell is (0, 0), as in the problems that belong to the map.
    """
    with reading(path):
        content = path.read_bytes()
    head, found, body = content.partition(b"map\n" if b"\r" not in content else b"map\r\n")
    words = head.split()
    sizes = {words[k]: words[k + 1] for k in range(0, len(words) - 1, 2)}
    try:
        rows, columns = int(sizes[b"height"]), int(sizes[b"width"])
    except (KeyError, ValueError):
        raise MapError(f"{path} is no map of MovingAI: it gives no height and width") from None
    lines = body.split()
    if not found or len(lines) != rows or any(len(line) != columns for line in lines):
        raise MapError(f"{path} does not hold {rows} rows of {columns} cells, as it says")
    require_few_cells(str(path), rows, columns, most_cells)
    cells = np.frombuffer(b"".join(lines), np.uint8).reshape(rows, columns)
    blocked = ~np.isin(cells, np.frombuffer(PASSABLE, np.uint8))
    transform = Affine.translation(-0.5, -0.5)
    return occupancy_band(path, number, np.zeros(blocked.shape), blocked, transform)
