"""Free space: bounds minus obstacles and no-data."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from ._kernels import free_space as kernels
from .errors import InputError
from .surface import Mask
from .validation import Array, Bounds, as_array, require_positive

# Around two edges a cell keeps the lists short and the index small.
EDGES_PER_CELL = 2.0
MOST_CELLS_A_SIDE = 1024


@dataclass(frozen=True)
class Circle:
    """A closed disc that may not be entered, map units."""

    x1: float
    x2: float
    radius: float

    def __post_init__(self) -> None:
        require_positive(radius=self.radius)
        if not (math.isfinite(self.x1) and math.isfinite(self.x2)):
            raise InputError(f"the centre ({self.x1}, {self.x2}) of a circle is not finite")


Obstacle: TypeAlias = BaseGeometry | Circle | Mask
Indices: TypeAlias = npt.NDArray[np.int64]


def _parts(obstacle: BaseGeometry, index: int) -> Iterator[BaseGeometry]:
    """Polygons and lines of a geometry, checked."""
    if obstacle.is_empty:
        return
    if not shapely.is_valid(obstacle):
        raise InputError(
            f"obstacles[{index}] is not valid: {shapely.is_valid_reason(obstacle)}; "
            "repair it with shapely.make_valid"
        )
    for part in shapely.get_parts(obstacle):
        if isinstance(part, shapely.GeometryCollection) or hasattr(part, "geoms"):
            yield from _parts(part, index)
        elif isinstance(part, shapely.Polygon | shapely.LineString):
            yield part
        else:
            raise InputError(
                f"obstacles[{index}] holds a {part.geom_type}, which has no width to avoid; "
                "give it one with buffer(radius)"
            )


def _edges(geometry: BaseGeometry) -> Array:
    """Boundary edges (m, 4) of a polygon with its holes, or of a line."""
    rings: list[Any] = [geometry]
    if isinstance(geometry, shapely.Polygon):
        rings = [geometry.exterior, *geometry.interiors]
    coordinates = [shapely.get_coordinates(ring) for ring in rings]
    return np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in coordinates])


def _lists(lister: Any, grid: kernels.Grid, items: Array) -> tuple[Indices, Indices]:
    """Which items each cell of the grid holds: (first, ids) as in ``Space``."""
    counts = np.zeros(grid.nx * grid.ny + 1, np.int64)
    lister(grid, items, counts, np.empty(0, np.int64))
    first = np.cumsum(counts)
    ids = np.empty(first[-1], np.int64)
    lister(grid, items, first[:-1].copy(), ids)
    return first, ids


class FreeSpace:
    """Where a path may go: inside the bounds, touching no obstacle.

    obstacles : shapely polygons (with holes) and lines, ``Circle`` and ``Mask``. All are
    closed sets: a path may not even touch them, so ``shapely`` finds it disjoint from them.
    """

    def __init__(self, bounds: Bounds, obstacles: Iterable[Obstacle] = ()) -> None:
        self.bounds = bounds
        self.geometries: list[BaseGeometry] = []
        self.circles: list[Circle] = []
        self.masks: list[Mask] = []
        for index, obstacle in enumerate(obstacles):
            if isinstance(obstacle, Circle):
                self.circles.append(obstacle)
            elif isinstance(obstacle, Mask):
                self.masks.append(obstacle)
            elif isinstance(obstacle, BaseGeometry):
                self.geometries.extend(_parts(obstacle, index))
            else:
                raise InputError(
                    f"obstacles[{index}] is a {type(obstacle).__name__}; "
                    "give shapely geometries, Circle or Mask"
                )
        for geometry in self.geometries:
            shapely.prepare(geometry)
        self.data = self._index()

    def _index(self) -> kernels.Space:
        edges = np.concatenate([np.empty((0, 4)), *map(_edges, self.geometries)])
        circles = np.array([[c.x1, c.x2, c.radius] for c in self.circles]).reshape(-1, 3)
        grid = self._grid(len(edges) + len(circles))
        edge_first, edge_ids = _lists(kernels.list_edges, grid, edges)
        circle_first, circle_ids = _lists(kernels.list_circles, grid, circles)
        frames, shapes, blocked = _stack_masks(self.masks)
        return kernels.Space(
            grid,
            np.ascontiguousarray(edges),
            edge_first,
            edge_ids,
            circles,
            circle_first,
            circle_ids,
            frames,
            shapes,
            blocked,
        )

    def _grid(self, items: int) -> kernels.Grid:
        side = max(1, min(int(math.sqrt(items / EDGES_PER_CELL)), MOST_CELLS_A_SIDE))
        x0, y0 = self.bounds.x1_min, self.bounds.x2_min
        return kernels.Grid(x0, y0, self.bounds.width / side, self.bounds.height / side, side, side)

    def blocker(self, point: tuple[float, float]) -> str | None:
        """What makes a point not free, in words; None where it is free."""
        if not self.bounds.contains(np.array(point)):
            return f"outside the bounds {self.bounds}"
        masks = range(len(self.masks))
        if any(kernels.mask_is_hit(self.data, mask, *point, *point) for mask in masks):
            return "in a blocked or no-data cell"
        if any(shapely.intersects_xy(geometry, *point) for geometry in self.geometries):
            return "inside an obstacle"
        discs = ((circle.x1, circle.x2, circle.radius) for circle in self.circles)
        if any(kernels.may_enter_circle(*point, *point, *disc) for disc in discs):
            return "inside a circular obstacle"
        # The kernel's own answer: a point that it takes for a touch could never be left.
        if not kernels.segment_is_free(self.data, *point, *point):
            return "on the edge of an obstacle"
        return None

    def segments_are_free(self, a: Any, b: Any) -> npt.NDArray[np.bool_]:
        """Do the closed segments a-b, each (m, 2), touch nothing? One end must be free.

        In doubt, within rounding of a touch, the answer is no.
        """
        start, end = as_array(a, "a", shape=(None, 2)), as_array(b, "b", shape=(None, 2))
        if len(start) != len(end):
            raise InputError(f"a has {len(start)} points and b {len(end)}; give as many of both")
        free = np.empty(len(start), np.uint8)
        kernels.fill_free(self.data, start, end, free)
        return free.astype(bool)


def _stack_masks(masks: Sequence[Mask]) -> tuple[Array, Any, Any]:
    """Masks behind one another, as ``Space`` holds them."""
    frames, shapes, cells, offset = [], [], [], 0
    for mask in masks:
        dx, dy = mask.spacing
        frames.append([mask.x[0] - 0.5 * dx, mask.y[0] - 0.5 * dy, dx, dy])
        shapes.append([mask.blocked.shape[1], mask.blocked.shape[0], offset])
        cells.append(mask.blocked.ravel().astype(np.uint8))
        offset += mask.blocked.size
    return (
        np.array(frames, np.float64).reshape(-1, 4),
        np.array(shapes, np.int64).reshape(-1, 3),
        np.concatenate([np.empty(0, np.uint8), *cells]),
    )
