"""Random rough maps: fractal and hilly ground, pits, cliffs, walls, steep planes and steps.

A map is plain data, so that judges need nothing of the package to look at it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy import ndimage

import terrapath as tp
from judges import Ground, boxes_of
from layouts import star


@dataclass(frozen=True)
class RoughMap:
    """Samples at the centres of cells, and what may not be entered.

    x : (nx,), y : (ny,), map units. heights, cost, mask, holes : (ny, nx), the last three None
    where there are none; ``holes`` have no data. ground : what made the heights.
    """

    seed: int
    kind: str
    ground: str
    x: np.ndarray
    y: np.ndarray
    heights: np.ndarray
    weight: float = 1.0
    cost: np.ndarray | None = None
    mask: np.ndarray | None = None
    holes: np.ndarray | None = None
    polygons: tuple[shapely.Polygon, ...] = ()
    max_slope: float | None = None
    start: tuple[float, float] = (0.0, 0.0)
    goal: tuple[float, float] = (0.0, 0.0)

    @property
    def cell(self) -> np.ndarray:
        return np.array([self.x[1] - self.x[0], self.y[1] - self.y[0]])

    def surface(self) -> tp.Surface:
        layers, weights, kinds = [self.heights], [self.weight], ["rise"]
        if self.cost is not None:
            layers, weights, kinds = [*layers, self.cost], [*weights, 1.0], [*kinds, "cost"]
        holes = None if self.holes is None else tp.Mask(self.holes, self.x, self.y)
        return tp.Surface.from_grid(
            np.stack(layers), self.x, self.y, weights=weights, kinds=kinds, nodata=holes
        )

    def problem(self) -> tp.Problem:
        obstacles = [*self.polygons]
        if self.mask is not None:
            obstacles.append(tp.Mask(self.mask, self.x, self.y))
        return tp.Problem(
            self.surface(), self.start, self.goal, obstacles=obstacles, max_slope=self.max_slope
        )

    def own_ground(self, surface: tp.Surface) -> Ground:
        """What the judges measure on. surface : has the costs between samples, if any."""
        if self.cost is None:
            return Ground(self.x, self.y, self.heights, self.weight)
        low, high = (self.x[0], self.y[0]), (self.x[-1], self.y[-1])

        def cost(points):
            return surface.cost_values(np.clip(points, low, high))[:, 0]

        least = float(self.cost.min()) * (1.0 - 1e-12)
        return Ground(self.x, self.y, self.heights, self.weight, cost, least)

    def walls(self, steep: tp.Mask | None = None) -> list[shapely.Geometry]:
        """All that is closed, as shapely polygons. steep : the cells that are too steep."""
        parts = [*self.polygons]
        for cells in (self.mask, self.holes):
            if cells is not None:
                parts.extend(boxes_of(cells, self.x, self.y))
        return parts if steep is None else [*parts, *boxes_of(steep.blocked, steep.x, steep.y)]

    def __str__(self) -> str:
        shape = "x".join(map(str, self.heights.shape[::-1]))
        cell = "x".join(f"{side:g}" for side in self.cell)
        parts = [
            f"{self.ground} {shape} cells {cell} at ({self.x[0]:.10g}, {self.y[0]:.10g})",
            f"weight {self.weight:g}",
            "" if self.cost is None else f"costs {self.cost.min():g}..{self.cost.max():g}",
            "" if self.mask is None else f"mask {self.mask.mean():.0%}",
            "" if self.holes is None else f"no data {self.holes.mean():.0%}",
            f"{len(self.polygons)} polygons" if self.polygons else "",
            "" if self.max_slope is None else f"max_slope {self.max_slope:g}",
            f"{self.start} to {self.goal}",
        ]
        return ", ".join(part for part in parts if part)


# Heights, in cells of the smaller side; each (random, ny, nx) -> (ny, nx)


def fractal(random, ny, nx, roughness=None):
    """Noise whose amplitude falls as frequency^-roughness, of standard deviation 1."""
    power = random.choice([1.2, 1.6, 2.0, 2.5]) if roughness is None else roughness
    frequency = np.hypot(np.fft.fftfreq(ny)[:, None], np.fft.rfftfreq(nx)[None])
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(random.standard_normal((ny, nx))) * frequency**-power
    heights = np.fft.irfft2(noise, (ny, nx))
    return heights / heights.std()


def hilly(random, ny, nx):
    rows, columns = np.mgrid[:ny, :nx]
    heights = np.zeros((ny, nx))
    for _ in range(random.integers(4, 13)):
        j, i, size = random.uniform(0, ny), random.uniform(0, nx), random.uniform(2.0, 12.0)
        distance = (rows - j) ** 2 + (columns - i) ** 2
        heights += random.uniform(-2, 2) * size / 3 * np.exp(-distance / (2 * size**2))
    return heights


def _gentle(random, ny, nx):
    return 3.0 * ndimage.gaussian_filter(random.standard_normal((ny, nx)), 4.0)


def pits(random, ny, nx):
    """Quarries and towers with sides of one cell in gentle ground."""
    heights = _gentle(random, ny, nx)
    for _ in range(random.integers(1, 6)):
        j, i = random.integers(ny - 1), random.integers(nx - 1)
        depth = random.choice([-1, -1, 1]) * random.uniform(1.0, 30.0)
        heights[j : j + random.integers(1, 9), i : i + random.integers(1, 9)] += depth
    return heights


def cliffs(random, ny, nx):
    """Steps of one cell along lines that wander across the map, and dikes one cell wide."""
    heights = _gentle(random, ny, nx)
    for _ in range(random.integers(1, 4)):
        line = nx * random.uniform(0.2, 0.8) + np.cumsum(random.integers(-1, 2, ny))
        beyond = np.arange(nx)[None] - line.astype(int)[:, None]
        height = random.choice([-1, 1]) * random.uniform(1.0, 30.0)
        is_dike = random.random() < 0.5
        raised = (beyond == 0) if is_dike else beyond >= 0
        if is_dike:
            raised[random.integers(ny)] = False  # a gap
        heights += height * raised
        heights = heights.T.copy() if heights.shape[0] == heights.shape[1] else heights
    return heights


def steps(random, ny, nx):
    heights = 6.0 * fractal(random, ny, nx, 2.0)
    size = random.uniform(1.0, 5.0)
    return size * np.floor(heights / size)


def plane(random, ny, nx):
    slope, turn = 10.0 ** random.uniform(-1, 2), random.uniform(0, 2 * np.pi)
    rows, columns = np.mgrid[:ny, :nx]
    return slope * (np.cos(turn) * columns + np.sin(turn) * rows)


GROUNDS = {
    "fractal": fractal,
    "hilly": hilly,
    "pits": pits,
    "cliffs": cliffs,
    "steps": steps,
    "plane": plane,
}


def _relief(random, kind, shape, cell):
    """Heights (ny, nx), map units."""
    heights = GROUNDS[kind](random, *shape)
    if kind == "fractal":
        rise = np.hypot(*np.gradient(heights))
        heights *= random.choice([0.1, 0.3, 1.0]) / np.sqrt((rise**2).mean())
    return heights * cell.min()


# Costs


def _blobs(random, ny, nx):
    return np.exp(np.log(255.0) * _ranks(fractal(random, ny, nx, 2.5)))


def _ranks(values):
    """Values from 0 to 1."""
    return (values - values.min()) / np.ptp(values)


def _line_cells(random, ny, nx):
    """Cells of a line one cell wide that wanders from the lower to the upper edge."""
    columns = nx * random.uniform(0.25, 0.75) + np.cumsum(random.integers(-1, 2, ny))
    return np.arange(ny), np.clip(columns.astype(int), 0, nx - 1)


def _river(random, ny, nx):
    cost = np.ones((ny, nx))
    rows, columns = _line_cells(random, ny, nx)
    cost[rows, columns] = 255.0
    ford = random.integers(ny - 2)
    cost[rows[ford : ford + 2], columns[ford : ford + 2]] = 1.0
    return cost


def _road(random, ny, nx):
    cost = np.full((ny, nx), random.choice([5.0, 20.0, 100.0]))
    cost[_line_cells(random, ny, nx)] = 1.0
    return cost


COSTS = (_blobs, _river, _road)


# Obstacles


def _some_mask(random, ny, nx):
    """Scattered cells, patches, or a wall with a door of one cell."""
    which = random.integers(3)
    if which == 0:
        return random.random((ny, nx)) < random.uniform(0.03, 0.25)
    if which == 1:
        patches = fractal(random, ny, nx, 2.0)
        return patches > np.quantile(patches, random.uniform(0.6, 0.95))
    mask = np.zeros((ny, nx), bool)
    mask[:, random.integers(1, nx - 1)] = True
    mask[random.integers(ny)] = False
    return mask


def _some_polygons(random, x, y, cell):
    """Stars anywhere, and rectangles along the edges of cells."""
    low, high = np.array([x[0], y[0]]), np.array([x[-1], y[-1]])
    polygons = []
    for _ in range(random.integers(1, 7)):
        centre = random.uniform(low, high)
        if random.random() < 0.5:
            radii = random.uniform(0.5, 5.0, random.integers(3, 9))
            shape = star(0.0, 0.0, radii, random.uniform(0, 6.28), 0.0)
            shape = shapely.transform(shape, lambda ring, c=centre: c + ring * cell)
        else:
            corner = low + cell * (np.floor((centre - low) / cell) + 0.5)
            shape = shapely.box(*corner, *(corner + cell * random.integers(1, 8, 2)))
        polygons.append(shape)
    return tuple(shape for shape in polygons if shape.is_valid)


def _pocket(mask, shape, cell, random):
    """A mask that closes the eight cells around one, but for a door of one cell."""
    j, i = cell
    mask = np.zeros(shape, bool) if mask is None else mask.copy()
    mask[max(j - 1, 0) : j + 2, max(i - 1, 0) : i + 2] = True
    mask[j, i] = False
    doors = [(j + b, i + a) for b, a in ((0, 1), (0, -1), (1, 0), (-1, 0))]
    doors = [(b, a) for b, a in doors if 0 <= b < shape[0] and 0 <= a < shape[1]]
    mask[doors[random.integers(len(doors))]] = False
    return mask


# Whole maps


def _axes(random, aspects, sizes):
    """x and y of the centres; all edges of cells are exact in binary."""
    ny, nx = random.integers(*sizes, 2)
    cell = np.full(2, random.choice([0.5, 1.0, 10.0, 30.0]))
    cell[random.integers(2)] *= random.choice(aspects)
    x0, y0 = (0.0, 0.0) if random.random() < 0.5 else (5e5, 4.2e6)
    return x0 + cell[0] * (np.arange(nx) + 0.5), y0 + cell[1] * (np.arange(ny) + 0.5)


def _with_obstacles(random, made):
    shape = made.heights.shape
    mask = _some_mask(random, *shape) if random.random() < 0.4 else None
    holes = None
    if random.random() < 0.2:
        patches = fractal(random, *shape, 2.5)
        holes = patches > np.quantile(patches, random.uniform(0.8, 0.97))
    polygons = ()
    if random.random() < 0.35:
        polygons = _some_polygons(random, made.x, made.y, made.cell)
    max_slope = None
    if random.random() < 0.15:
        rise = np.hypot(*np.gradient(made.heights, made.y, made.x))
        limit = np.degrees(np.arctan(np.quantile(rise, random.uniform(0.7, 0.98))))
        max_slope = float(np.clip(np.round(limit, 3), 0.1, 89.0))
    return replace(made, mask=mask, holes=holes, polygons=polygons, max_slope=max_slope)


def _some_place(random, made):
    """Anywhere; sometimes a corner of the bounds or a sample."""
    low, high = np.array([made.x[0], made.y[0]]), np.array([made.x[-1], made.y[-1]])
    kind = random.random()
    if kind < 0.06:
        place = np.where(random.random(2) < 0.5, low, high)
    elif kind < 0.2:
        place = np.array([random.choice(made.x), random.choice(made.y)])
    else:
        place = np.clip(random.uniform(low, high).round(3), low, high)
    return tuple(place.tolist())


def _with_ends(random, made):
    """The map with a free start and goal, None where none were found."""
    if random.random() < 0.08:
        ny, nx = made.heights.shape
        cell = (int(random.integers(ny)), int(random.integers(nx)))
        made = replace(made, mask=_pocket(made.mask, (ny, nx), cell, random))
        pocket = (float(made.x[cell[1]]), float(made.y[cell[0]]))
    else:
        pocket = None
    together = random.random() < 0.04
    for _ in range(60):
        start, goal = _some_place(random, made), pocket or _some_place(random, made)
        if together:
            goal = tuple(np.clip(np.array(start) + 0.1 * made.cell, start, None).tolist())
            goal = (min(goal[0], made.x[-1]), min(goal[1], made.y[-1]))
        placed = replace(made, start=start, goal=goal)
        if _is_free(placed):
            return placed
    return None


def _is_free(made):
    try:
        steep = made.problem().constraints.steep
    except tp.BlockedError:
        return False
    walls, ends = made.walls(steep), shapely.points([made.start, made.goal])
    tree = shapely.STRtree(np.asarray(walls, object))
    return len(tree.query(ends, predicate="dwithin", distance=0.01 * made.cell.min())[0]) == 0


def _map_of(random, seed, kind, ground, x, y, weight):
    made = RoughMap(seed, kind, ground, x, y, np.empty((len(y), len(x))))
    heights = _relief(random, ground, (len(y), len(x)), made.cell)
    cost = None
    if random.random() < 0.35:
        cost = COSTS[random.integers(len(COSTS))](random, len(y), len(x))
    made = replace(made, heights=heights, weight=weight, cost=cost)
    for _ in range(10):
        if (placed := _with_ends(random, _with_obstacles(random, made))) is not None:
            return placed
    return _with_ends(random, made)


def random_map(seed: int) -> RoughMap:
    """A rough map; the same for the same seed."""
    random = np.random.default_rng([14, 0, seed])
    names = ["fractal", "hilly", "fractal", "hilly", *GROUNDS]
    aspects = [1, 1, 1, 1, 1, 2, 10, 100]
    x, y = _axes(random, aspects, (20, 81))
    weight = float(random.choice([1.0, 1.0, 3.0, 10.0, 30.0, 100.0]))
    return _map_of(random, seed, "rough", names[seed % len(names)], x, y, weight)


def pathological_map(seed: int) -> RoughMap:
    """Slopes to 1e5, weights to 1e6, cells to 1e6 : 1, as small as a map may be."""
    random = np.random.default_rng([14, 1, seed])
    x, y = _axes(random, [1, 1, 100, 10_000, 1_000_000], (4, 31))
    ground = ["plane", "plane", *GROUNDS][seed % (2 + len(GROUNDS))]
    weight = float(10.0 ** random.integers(0, 7))
    if ground == "plane":
        weight = float(10.0 ** random.integers(0, 4))
    return _made_worse(random, _map_of(random, seed, "pathological", ground, x, y, weight))


def _made_worse(random, made):
    """Sometimes the goal is the start itself, or a polygon has a corner there."""
    draw = random.random()
    if draw < 0.05:
        return replace(made, goal=made.start)
    if draw < 0.1:
        corners = np.array([(0.0, 0.0), (2.0, 1.0), (1.0, 2.0)]) * made.cell + made.start
        return replace(made, polygons=(*made.polygons, shapely.Polygon(corners)))
    return made
