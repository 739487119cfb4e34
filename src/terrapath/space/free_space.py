"""Free space: bounds minus obstacles, no-data and too steep ground."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from .._kernels.space import free_space as kernels
from ..errors import InputError
from ..surface import Mask
from ..surface.bounds import Bounds
from ..validation import Array, Point, as_array, as_point, require_positive
from .lattice import Lattice

# About two edges or circles in each cell of the index keep its lists short and itself small.
ITEMS_PER_CELL = 2.0
MOST_CELLS_A_SIDE = 1024

# The cells of masks are widened by this share of a cell, and by the rounding of coordinates: a few
# units in the last place of the largest one.
CELL_MARGIN = 2e-10
COORDINATE_ERROR = 8.0 * 2.0**-53

# In proofs of separation a disc is replaced by a polygon inside it, with this many corners.
CORNERS_OF_DISC = 64


@dataclass(frozen=True)
class Circle:
    """A closed disc that may not be entered: centre (x1, x2) and radius, map units.

    Raises InputError for a radius that is not above 0, or a number that is not finite.
    """

    x1: float
    x2: float
    radius: float

    def __post_init__(self) -> None:
        require_positive(radius=self.radius)
        if not (math.isfinite(self.x1) and math.isfinite(self.x2)):
            raise InputError(f"the centre ({self.x1}, {self.x2}) of a circle is not finite")

    @property
    def inscribed(self) -> shapely.Polygon:
        """A polygon that lies wholly inside the disc, despite rounding."""
        # It is turned a little, so that the corners of equal discs do not nearly touch their sides.
        angles = 0.1 + np.linspace(0.0, 2.0 * math.pi, CORNERS_OF_DISC, endpoint=False)
        ring = np.column_stack([np.cos(angles), np.sin(angles)])
        return shapely.Polygon((self.x1, self.x2) + self.radius * (1.0 - 1e-9) * ring)


Obstacle: TypeAlias = BaseGeometry | Circle | Mask
_Patch: TypeAlias = tuple[Any, npt.NDArray[np.bool_]]
Indices: TypeAlias = npt.NDArray[np.int64]
Geometries: TypeAlias = npt.NDArray[np.object_]


POINTS = (0, 4)  # shapely's type ids
POLYGON = 3


def are_points(geometries: Geometries) -> npt.NDArray[np.bool_]:
    """(m,), which geometries are points, or several of them."""
    return np.isin(shapely.get_type_id(geometries), POINTS)


class Parts(NamedTuple):
    """Obstacles by kind; geometries are split into points, lines and polygons."""

    geometries: Geometries  # (m,)
    owners: Indices  # (m,): the obstacle that each belongs to
    circles: list[Circle]  # in their order
    masks: list[Mask]  # in their order


def sort_obstacles(obstacles: Iterable[Obstacle]) -> Parts:
    """Obstacles by kind, checked. Raises InputError with the index of one that is none."""
    given = list(obstacles)
    for index, obstacle in enumerate(given):
        if not isinstance(obstacle, BaseGeometry | Circle | Mask):
            raise InputError(
                f"obstacles[{index}] is a {type(obstacle).__name__}; "
                "give shapely geometries, Circle or Mask"
            )
    places = [k for k, obstacle in enumerate(given) if isinstance(obstacle, BaseGeometry)]
    owners = np.array(places, np.int64)
    geometries = np.array([given[k] for k in places], np.object_)
    _refuse_invalid(geometries, owners)
    circles = [obstacle for obstacle in given if isinstance(obstacle, Circle)]
    masks = [obstacle for obstacle in given if isinstance(obstacle, Mask)]
    return Parts(*simple_parts(geometries, owners), circles, masks)


def _refuse_invalid(geometries: Geometries, owners: Indices) -> None:
    invalid = ~shapely.is_valid(geometries)
    if invalid.any():
        raise InputError(
            f"obstacles[{owners[invalid][0]}] is not valid: "
            f"{shapely.is_valid_reason(geometries[invalid][0])}; repair it with shapely.make_valid"
        )


def simple_parts(geometries: Geometries, owners: Indices) -> tuple[Geometries, Indices]:
    """The points, lines and polygons that geometries are made of, however nested; none is empty.

    owners (m,) : the obstacle that each geometry belongs to. Returns the parts and their owners.
    """
    while (shapely.get_type_id(geometries) > POLYGON).any():
        geometries, which = shapely.get_parts(geometries, return_index=True)
        owners = owners[which]
    kept = ~shapely.is_empty(geometries)
    return geometries[kept], owners[kept]


def _refuse_points(parts: Parts) -> None:
    without_width = are_points(parts.geometries)
    if without_width.any():
        raise InputError(
            f"obstacles[{parts.owners[without_width][0]}] holds a Point, which has no width to "
            "avoid; give the problem a radius, or the point a width with buffer(radius)"
        )


def outlines(geometries: Geometries) -> tuple[Geometries, Indices]:
    """The rings of polygons, and other parts as they are, in their order.

    Returns them, and for each the index of the geometry that it belongs to.
    """
    rings, owners = shapely.get_rings(geometries, return_index=True)
    is_other = shapely.get_type_id(geometries) != POLYGON
    owners = np.concatenate([owners, np.flatnonzero(is_other)])
    order = np.argsort(owners, kind="stable")
    return np.concatenate([rings, geometries[is_other]])[order], owners[order]


def _edges(geometries: Geometries) -> Array:
    """Edges (m, 4) of polygons, holes included, and of lines: x1 and x2 of both ends."""
    corners, line = shapely.get_coordinates(outlines(geometries)[0], return_index=True)
    edges = np.hstack([corners[:-1], corners[1:]])
    return np.asarray(edges[line[1:] == line[:-1]].reshape(-1, 4))


def index_grid(bounds: Bounds, items: int) -> kernels.Grid:
    """The cells over the bounds in which ``items`` edges or circles are listed."""
    side = max(1, min(int(math.sqrt(items / ITEMS_PER_CELL)), MOST_CELLS_A_SIDE))
    step = (bounds.width / side, bounds.height / side)
    return kernels.Grid(bounds.x1_min, bounds.x2_min, *step, side, side)


def listed(
    lister: Callable[..., None], grid: kernels.Grid, items: Array
) -> tuple[Indices, Indices]:
    """The items of each cell of the grid: (first, ids) as in ``Space``.

    lister : the kernel that counts and lists items of their kind.
    """
    counts = np.zeros(grid.nx * grid.ny + 1, np.int64)
    if len(items) == 0:  # saves compiling the kernel
        return counts, np.empty(0, np.int64)
    lister(grid, items, counts, np.empty(0, np.int64))
    first = np.cumsum(counts)
    ids = np.empty(first[-1], np.int64)
    lister(grid, items, first[:-1].copy(), ids)
    return first, ids


class FreeSpace:
    """Where a path may go: inside the bounds, touching no obstacle.

    obstacles : shapely polygons (with holes) and lines, ``Circle`` and ``Mask``. All are closed
    sets, so a path may not even touch them. ``shapely`` finds each path disjoint from them.
    Raises InputError for an obstacle that is none of these, or not valid.
    """

    def __init__(self, bounds: Bounds, obstacles: Iterable[Obstacle] = ()) -> None:
        self.bounds = bounds
        parts = sort_obstacles(obstacles)
        _refuse_points(parts)
        self.geometries: list[BaseGeometry] = list(parts.geometries)
        self.circles = parts.circles
        self.masks = parts.masks
        self._geometries = parts.geometries
        shapely.prepare(self._geometries)
        self.data = self._index()

    def _index(self) -> kernels.Space:
        edges = _edges(self._geometries)
        circles = np.array([[c.x1, c.x2, c.radius] for c in self.circles]).reshape(-1, 3)
        grid = index_grid(self.bounds, len(edges) + len(circles))
        edge_first, edge_ids = listed(kernels.list_edges, grid, edges)
        circle_first, circle_ids = listed(kernels.list_circles, grid, circles)
        frames, shapes, blocked = _stack_masks(self.masks, self.bounds)
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

    @property
    def has_obstacles(self) -> bool:
        """Is there anything to avoid within the bounds?"""
        return bool(self.geometries or self.circles or self.masks)

    def blocker(self, point: Point) -> str | None:
        """Why a point (x1, x2) is not free, in words; None where it is free."""
        if not self.bounds.contains(np.array(point)):
            return f"outside the bounds {self.bounds}"
        return self._obstacle_at(point) if self.has_obstacles else None

    def _obstacle_at(self, point: Point) -> str | None:
        """Which obstacle holds a point, in words; None where none does."""
        masks = range(len(self.masks))
        if any(kernels.mask_is_hit(self.data, mask, *point, *point) for mask in masks):
            return "in a blocked or no-data cell"
        if shapely.intersects_xy(self._geometries, *point).any():
            return "inside an obstacle"
        discs = ((circle.x1, circle.x2, circle.radius) for circle in self.circles)
        if any(kernels.may_enter_circle(*point, *point, *disc) for disc in discs):
            return "inside a circular obstacle"
        # The kernel decides: no edge could lead away from a point that it finds blocked.
        if not kernels.segment_is_free(self.data, *point, *point):
            return "on the edge of an obstacle"
        return None

    def segments_are_free(self, a: npt.ArrayLike, b: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """(m,), which closed segments a-b touch no obstacle.

        a, b : (m, 2), map units; of each segment one end must be free. In doubt, within rounding
        of a touch, a segment is not free. Raises InputError where their numbers differ.
        """
        start, end = as_array(a, "a", shape=(None, 2)), as_array(b, "b", shape=(None, 2))
        if len(start) != len(end):
            raise InputError(f"a has {len(start)} points and b {len(end)}; give as many of both")
        if not self.has_obstacles:
            return np.ones(len(start), bool)
        free = np.empty(len(start), np.uint8)
        kernels.fill_free(self.data, start, end, free)
        return free.astype(bool)

    def allows(self, points: Array) -> bool:
        """Does a path through points (m, 2), map units, stay in the bounds and touch nothing?

        One of its points must be free. Whether it is read forwards or backwards does not matter.
        """
        inside = bool(self.bounds.contains(points).all())
        return inside and bool(self.segments_are_free(points[:-1], points[1:]).all())

    def covered_cells(self, lattice: Lattice, *, on_sides: bool = False) -> npt.NDArray[np.bool_]:
        """(ny - 1, nx - 1), which cells of a lattice surely lie wholly inside one obstacle.

        on_sides : those of a mask, too, that end on sides of its blocked cells. As these are
        widened a little, no path meets even the sides.
        """
        covered = np.zeros((lattice.ny - 1, lattice.nx - 1), bool)
        slack = -0.5 * CELL_MARGIN if on_sides else 1e-9
        for mask in self.masks:
            covered |= _covered_by_mask(mask, lattice, slack)
        large = self._geometries[_may_cover(self._geometries, lattice)]
        patches = [_covered_by_geometry(geometry, lattice) for geometry in large]
        patches += [_covered_by_disc(circle, lattice) for circle in self.circles]
        for window, inside in patches:
            covered[window] |= inside
        return covered

    def separates(self, a: Point, b: Point) -> bool:
        """Is it proven that no path in free space leads from a to b?

        a, b : (x1, x2), map units, in free space. False where a path exists. False also where
        rounding leaves a doubt: at a gap or a touch within rounding, or where a proof would
        take too long. Raises InputError where a or b is not free.
        """
        for name, point in (("a", as_point(a, "a")), ("b", as_point(b, "b"))):
            if blocker := self.blocker(point):
                raise InputError(f"{name}=({point[0]:.10g}, {point[1]:.10g}) is {blocker}")
        if not self.has_obstacles:
            return False
        from .reachability import separated

        discs = np.array([circle.inscribed for circle in self.circles], np.object_)
        walls, _ = outlines(np.concatenate([self._geometries, discs]))
        return separated(self.bounds, self.data, self.masks, walls, a, b)


def _may_cover(geometries: Geometries, lattice: Lattice) -> npt.NDArray[np.bool_]:
    """(m,), which geometries are polygons that are large enough to cover a cell."""
    west, south, east, north = shapely.bounds(geometries).reshape(-1, 4).T
    slack = 1.0 - 1e-9
    is_large = (east - west >= slack * lattice.dx) & (north - south >= slack * lattice.dy)
    return np.asarray(is_large & (shapely.get_type_id(geometries) == POLYGON))


def _covered_by_geometry(polygon: BaseGeometry, lattice: Lattice) -> _Patch:
    """Cells around a polygon that it covers."""
    window, low, high = _cells_near(lattice, polygon.bounds)
    boxes = shapely.box(low[..., 0], low[..., 1], high[..., 0], high[..., 1])
    return window, np.asarray(shapely.covers(polygon, boxes), bool).reshape(low.shape[:2])


def _covered_by_disc(circle: Circle, lattice: Lattice) -> _Patch:
    """Cells around a disc whose four corners lie in it."""
    x, y, r = circle.x1, circle.x2, circle.radius
    window, low, high = _cells_near(lattice, (x - r, y - r, x + r, y + r))
    reach = np.maximum(np.abs(low - (x, y)), np.abs(high - (x, y)))
    return window, np.asarray(np.hypot(reach[..., 0], reach[..., 1]) <= r * (1.0 - 1e-12))


def _covered_by_mask(mask: Mask, lattice: Lattice, slack: float) -> npt.NDArray[np.bool_]:
    """Cells all of whose ground, and so much more on all sides, is blocked by the mask."""
    dx, dy = mask.spacing
    columns = _mask_spans(lattice.x, mask.x[0] - 0.5 * dx, dx, len(mask.x), slack)
    rows = _mask_spans(lattice.y, mask.y[0] - 0.5 * dy, dy, len(mask.y), slack)
    sums = np.zeros((len(mask.y) + 1, len(mask.x) + 1), np.int64)
    sums[1:, 1:] = mask.blocked.cumsum(0).cumsum(1)
    (j0, j1, in_rows), (i0, i1, in_columns) = rows, columns
    j0, j1, in_rows = j0[:, None], j1[:, None], in_rows[:, None]
    blocked = sums[j1, i1] - sums[j0, i1] - sums[j1, i0] + sums[j0, i0]
    return np.asarray((blocked == (j1 - j0) * (i1 - i0)) & in_rows & in_columns)


def _mask_spans(
    nodes: Array, origin: float, step: float, count: int, slack: float
) -> tuple[Indices, Indices, npt.NDArray[np.bool_]]:
    """For each cell of an axis: the first mask cell it meets, one past the last, is it within?

    slack : what is added to the cell at both ends, in cells of the mask.
    """
    first = np.floor((nodes[:-1] - origin) / step - slack).astype(np.int64)
    last = np.ceil((nodes[1:] - origin) / step + slack).astype(np.int64)
    return np.clip(first, 0, count), np.clip(last, 0, count), (first >= 0) & (last <= count)


def _cells_near(
    lattice: Lattice, bounds: tuple[float, float, float, float]
) -> tuple[Any, Array, Array]:
    """The window of cells that meet a rectangle, and their lower and upper corners."""
    columns = np.searchsorted(lattice.x, (bounds[0], bounds[2]))
    rows = np.searchsorted(lattice.y, (bounds[1], bounds[3]))
    i = np.arange(max(columns[0] - 1, 0), min(columns[1], lattice.nx - 1))
    j = np.arange(max(rows[0] - 1, 0), min(rows[1], lattice.ny - 1))
    low = np.stack(np.meshgrid(lattice.x[i], lattice.y[j]), axis=-1)
    high = np.stack(np.meshgrid(lattice.x[i + 1], lattice.y[j + 1]), axis=-1)
    return np.ix_(j, i), low, high


def cell_margin(mask: Mask, bounds: Bounds) -> float:
    """By which share of a cell the cells of a mask are widened, to make up for rounding.

    Nothing nearer than this to a blocked cell counts as free; ground a little farther away does.
    """
    largest = max(np.abs([*bounds, *mask.x[[0, -1]], *mask.y[[0, -1]]]))
    return float(CELL_MARGIN + COORDINATE_ERROR * largest / min(mask.spacing))


def _stack_masks(
    masks: Sequence[Mask], bounds: Bounds
) -> tuple[Array, Indices, npt.NDArray[np.uint8]]:
    """Masks one after another: frames, shapes and cells, as in ``Space``."""
    frames, shapes, cells, offset = [], [], [], 0
    for mask in masks:
        dx, dy = mask.spacing
        corner = [mask.x[0] - 0.5 * dx, mask.y[0] - 0.5 * dy]
        frames.append([*corner, dx, dy, cell_margin(mask, bounds)])
        shapes.append([mask.blocked.shape[1], mask.blocked.shape[0], offset])
        cells.append(mask.blocked.ravel().astype(np.uint8))
        offset += mask.blocked.size
    return (
        np.array(frames, np.float64).reshape(-1, 5),
        np.array(shapes, np.int64).reshape(-1, 3),
        np.concatenate([np.empty(0, np.uint8), *cells]),
    )
