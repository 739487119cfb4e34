"""Surfaces of cost rasters, random ones, and a walker through their cells.

The walker shares no code with the package.
"""

import itertools
import math

import numpy as np
from scipy.ndimage import gaussian_filter

import terrapath as tp
from judges import Ground, value_of

CELL = 10.0


def cell_surface(costs, heights=None, x=None, y=None, **options):
    """Ground (ny, nx), flat without heights, under one cost raster; centres at 0, 10, 20, ..."""
    ny, nx = costs.shape
    x, y = CELL * np.arange(nx) if x is None else x, CELL * np.arange(ny) if y is None else y
    ground = np.zeros_like(costs) if heights is None else heights
    given = {"names": ["height", "going"], "kinds": ["rise", "cells"], **options}
    return tp.Surface.from_grid([ground, costs], x, y, **given)


def random_costs(random, count):
    """Costs (count, count): roads, rivers or patches, one to five cells wide, ratios to 1,000."""
    ratio, width = 10.0 ** random.uniform(0.3, 3.0), int(random.integers(1, 6))
    kind = random.choice(["roads", "rivers", "patches"])
    if kind == "patches":
        field = gaussian_filter(random.standard_normal((count, count)), random.uniform(1.0, 5.0))
        return np.where(field > np.quantile(field, random.uniform(0.3, 0.8)), ratio, 1.0)
    costs = np.full((count, count), ratio if kind == "roads" else 1.0)
    for _ in range(int(random.integers(1, 6))):
        winding(random, costs, width, 1.0 if kind == "roads" else ratio)
    if kind == "rivers":  # fords
        for _ in range(3):
            i, j = random.integers(0, count, 2)
            costs[max(j - 2, 0) : j + 3, max(i - 2, 0) : i + 3] = 1.0
    return costs


def winding(random, costs, width, value):
    """A band of cells across the raster, one to five cells wide."""
    count = len(costs)
    slope, at, bend = random.uniform(-1.0, 1.0), random.uniform(0.2, 0.8) * count, 0.0
    for k in range(count):
        bend += random.normal(0.0, 0.3)
        at = float(np.clip(at + slope + 0.2 * bend, 0, count - 1))
        low = max(int(at) - width // 2, 0)
        costs[low : low + width, k] = value
    if random.random() < 0.5:
        costs[...] = costs.T.copy()


def random_heights(random, count, steep):
    """Hills (count, count), map units; flat where steep is 0."""
    smooth = gaussian_filter(random.standard_normal((count, count)), random.uniform(3.0, 8.0))
    return steep * smooth / max(float(np.abs(np.gradient(smooth, CELL)).max()), 1e-12)


class Walker:
    """Lengths over the cells of a raster (ny, nx) with centres at x, y, and heights there."""

    def __init__(self, costs, heights, x, y):
        self.costs, self.x, self.y = costs, x, y
        self.cell = x[1] - x[0], y[1] - y[0]
        self.land = Ground(x, y, heights) if np.ptp(heights) else None

    def cost_at(self, px, py, along_side):
        """The cost of a stretch with its middle at p; on a side that it runs along, the lower."""
        last_j, last_i = np.array(self.costs.shape) - 1
        found, shifts = [], (-1e-6, 1e-6) if along_side else (0.0,)
        for east in shifts:
            for north in shifts:
                i = min(max(round((px - self.x[0]) / self.cell[0] + east), 0), last_i)
                j = min(max(round((py - self.y[0]) / self.cell[1] + north), 0), last_j)
                found.append(self.costs[j, i])
        return min(found)

    def ground(self, a, b):
        """The length on the ground of a straight stretch."""
        if self.land is None:
            return math.dist(a, b)
        return value_of(self.land, np.array([a, b]))

    def length(self, points):
        """The weighted length of a polyline."""
        return sum(self.segment(a, b) for a, b in itertools.pairwise(points))

    def segment(self, a, b):
        cuts = {0.0, 1.0}
        for axis, places in enumerate((self.x, self.y)):
            sides = np.append(places - 0.5 * self.cell[axis], places[-1] + 0.5 * self.cell[axis])
            if abs(b[axis] - a[axis]) > 1e-6 * self.cell[axis]:
                shares = (sides - a[axis]) / (b[axis] - a[axis])
                cuts |= set(shares[(shares > 0.0) & (shares < 1.0)].tolist())
        total, cuts = 0.0, sorted(cuts)
        steps = np.abs(np.subtract(b, a)) / self.cell
        along_side = steps.min() <= 1e-6 * steps.max()
        for low, high in itertools.pairwise(cuts):
            at = [(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])) for t in (low, high)]
            middle = 0.5 * (at[0][0] + at[1][0]), 0.5 * (at[0][1] + at[1][1])
            total += self.cost_at(*middle, along_side) * self.ground(*at)
        return total
