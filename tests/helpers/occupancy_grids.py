"""Random occupancy grids: scattered cells, rooms, mazes and streets, with doors of one cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

import terrapath as tp
from judges import boxes_of
from mazes import maze


@dataclass(frozen=True)
class OccupancyGrid:
    """Flat ground with blocked cells. start, goal : columns and rows from the outer corner."""

    seed: int
    kind: str
    blocked: np.ndarray  # (ny, nx)
    start: tuple[float, float]
    goal: tuple[float, float]
    cell: float = 1.0
    origin: tuple[float, float] = (0.0, 0.0)
    as_polygons: bool = False

    @property
    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        ny, nx = self.blocked.shape
        x0, y0 = self.origin
        return x0 + self.cell * (np.arange(nx) + 0.5), y0 + self.cell * (np.arange(ny) + 0.5)

    def place(self, cells):
        """Map coordinates of columns and rows."""
        return tuple(float(o + self.cell * c) for o, c in zip(self.origin, cells, strict=True))

    @property
    def boxes(self) -> np.ndarray:
        return boxes_of(self.blocked, *self.centres)

    def problem(self) -> tp.Problem:
        ny, nx = self.blocked.shape
        # One cell more on each side, so that the ground reaches the outer edges.
        ends = zip(self.origin, (nx, ny), strict=True)
        x, y = (first + self.cell * (np.arange(-1, n + 1) + 0.5) for first, n in ends)
        ground = tp.Surface.from_grid(np.zeros((ny + 2, nx + 2)), x, y)
        obstacles = list(self.boxes) if self.as_polygons else [tp.Mask(self.blocked, *self.centres)]
        bounds = (*self.place((0, 0)), *self.place((nx, ny)))
        return tp.Problem(ground, self.place(self.start), self.place(self.goal), bounds, obstacles)

    def __str__(self) -> str:
        shape = "x".join(map(str, self.blocked.shape[::-1]))
        how = "polygons" if self.as_polygons else "mask"
        ends = f"{self.start} to {self.goal} cells"
        return f"{self.kind} {shape} as {how}, cell {self.cell:g} at {self.origin}, {ends}"


def _scattered(random, ny, nx):
    return random.random((ny, nx)) < random.uniform(0.20, 0.45)


def _rooms(random, ny, nx):
    """Rooms with walls of one cell; a door of one cell in most walls."""
    blocked, size = np.zeros((ny, nx), bool), int(random.integers(4, 9))
    rows, columns = np.arange(size, ny - 1, size), np.arange(size, nx - 1, size)
    blocked[rows], blocked[:, columns] = True, True
    rooms = [np.append(0, lines + 1) for lines in (rows, columns)]
    for row in rows:
        for first in rooms[1]:
            if random.random() < 0.8:
                blocked[row, min(first + random.integers(size - 1), nx - 1)] = False
    for column in columns:
        for first in rooms[0]:
            if random.random() < 0.8:
                blocked[min(first + random.integers(size - 1), ny - 1), column] = False
    return blocked


def _maze(random, ny, nx):
    """A maze with a few walls broken through."""
    return maze(random, ny, nx) & (random.random((ny, nx)) > random.choice([0.0, 0.05]))


def _streets(random, ny, nx):
    """Blocks of houses between streets of one or two cells, some of them closed."""
    blocked = np.ones((ny, nx), bool)
    for axis, count in ((0, ny), (1, nx)):
        street = int(random.integers(0, 4))
        while street < count:
            width = int(random.integers(1, 3))
            np.moveaxis(blocked, axis, 0)[street : street + width] = False
            street += width + int(random.integers(2, 7))
    return blocked | (random.random((ny, nx)) < 0.03)


GRIDS = {"scattered": _scattered, "rooms": _rooms, "maze": _maze, "streets": _streets}


def _ends(random, blocked):
    """Two places in free cells, most often of one component: centres, or anywhere within."""
    parts, _ = ndimage.label(~blocked)
    cells = np.argwhere(~blocked)
    first = cells[random.integers(len(cells))]
    if random.random() < 0.9:
        cells = np.argwhere(parts == parts[tuple(first)])
    picked = np.array([first, cells[random.integers(len(cells))]])[:, ::-1]
    within = 0.5 if random.random() < 0.5 else random.uniform(0.05, 0.95, (2, 2)).round(3)
    return [tuple(end.tolist()) for end in picked + within]


def random_grid(seed: int) -> OccupancyGrid:
    """The same grid for the same seed; each kind as a mask and as polygons in turn."""
    random = np.random.default_rng([14, 2, seed])
    kind = list(GRIDS)[seed % len(GRIDS)]
    ny, nx = random.integers(20, 51, 2)
    blocked = GRIDS[kind](random, ny, nx)
    blocked[tuple(random.integers((ny, nx)))] = False  # there is a free cell
    start, goal = _ends(random, blocked)
    return OccupancyGrid(
        seed,
        kind,
        blocked,
        start,
        goal,
        cell=float(random.choice([0.5, 1.0, 10.0])),
        origin=(0.0, 0.0) if random.random() < 0.5 else (5e5, 4.2e6),
        as_polygons=bool(seed // len(GRIDS) % 2),
    )
