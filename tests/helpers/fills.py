"""Real ground of many kinds, and fills: cells without data that nothing declares."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from rough_maps import fractal

FILLS = (-9999.0, -32768.0, 32767.0, -99999.0, -999.0, 65535.0, 1e20, -3.4028234663852886e38)
PLAINS = (-1500.0, -5000.0, -12345.0)  # no program's own value, far below the ground
SHAPES = ("blob", "edge", "wedge", "cells", "most")


def _rough(random, side, roughness=2.2):
    """(side, side), standard deviation 1."""
    return fractal(random, side, side, roughness)


def _lake(random, side, level, relief):
    """Ground with a plain of water, and slopes down to its shore."""
    ground = level + relief * (_rough(random, side) + 0.7)
    return np.maximum(ground, level)


def _steep_lake(random, side, level):
    """A flat sea between escarpments, as the Dead Sea: 30 degrees on cells of 30 m."""
    x = np.abs(np.arange(side) - side / 2.0) * 30.0
    slope = np.maximum(0.0, x - 0.2 * side * 30.0) * 0.6
    return np.maximum(level + slope[None, :] + 40.0 * _rough(random, side), level)


def _pit(random, side, depth):
    ground = 100.0 + 20.0 * _rough(random, side)
    ground[side // 3 : side // 2, side // 3 : side // 2] = ground.min() - depth
    return ground


def _city(random, side):
    ground = 50.0 + 2.0 * _rough(random, side)
    for _ in range(8):
        j, i = random.integers(0, side - 12, 2)
        ground[j : j + 8, i : i + 10] = 60.0 + random.choice([20.0, 80.0, 250.0])
    return ground


def _steps(random, side):
    return 25.0 * np.floor(_rough(random, side) * 4.0)


GROUNDS = {
    "hills": lambda r, n: 300.0 + 80.0 * _rough(r, n),
    "mountains": lambda r, n: np.round(2000.0 + 500.0 * _rough(r, n, 1.7)),
    "rough": lambda r, n: 100.0 + 10.0 * r.normal(size=(n, n)),
    "lake": lambda r, n: _lake(r, n, 395.5, 60.0),
    "sea and mountains": lambda r, n: np.round(_lake(r, n, 0.0, 900.0)),
    "dead sea": lambda r, n: _steep_lake(r, n, -430.5),
    "bathymetry": lambda r, n: np.round(-9998.7 + 300.0 * _rough(r, n)),
    "trench": lambda r, n: -9998.7 + 0.5 * _rough(r, n),
    "steep bathymetry": lambda r, n: np.round(-8000.0 + 1200.0 * _rough(r, n, 1.7)),
    "moon": lambda r, n: np.round(9900.0 + 120.0 * _rough(r, n)),
    "crater": lambda r, n: -9000.0 - 60.0 * np.abs(_rough(r, n)),
    "pit": lambda r, n: _pit(r, n, 100.0),
    "city": _city,
    "steps": _steps,
    "flat": lambda r, n: np.zeros((n, n)),
    "a flat pit": lambda r, n: np.pad(np.full((n // 4, n // 4), -10.0), ((9, n - n // 4 - 9),) * 2),
    "a plateau of 9999": lambda r, n: np.round(np.minimum(9999.0, 9950.0 + 60 * _rough(r, n))),
    "a floor at -999": lambda r, n: np.maximum(-999.0, -960.0 + 60 * _rough(r, n)),
}  # fmt: skip


def shape(random, side, kind):
    """(side, side) bool: the cells of a fill."""
    cells = np.zeros((side, side), bool)
    rows, columns = np.mgrid[0:side, 0:side]
    if kind == "blob":
        j, i = random.integers(6, side - 6, 2)
        cells = np.hypot(rows - j, columns - i) < random.uniform(2.0, side / 4)
    elif kind == "edge":
        cells[:, : random.integers(1, side // 3)] = True
    elif kind == "wedge":
        cells = rows + 2 * columns < side * random.uniform(0.3, 1.0)
    elif kind == "cells":
        cells[random.integers(0, side, 9), random.integers(0, side, 9)] = True
    else:
        cells = np.hypot(rows - side / 2, columns - side / 2) > side / 4
    return cells


def resampled(values, cells, value):
    """(values, cells) as a bilinear warp makes them that takes the fill for ground."""
    filled = np.where(cells, value, values)
    mixed = ndimage.shift(filled, (0.4, 0.3), order=1, mode="nearest")
    share = ndimage.shift(cells.astype(float), (0.4, 0.3), order=1, mode="nearest")
    return mixed.astype(np.float32).astype(float), share > 0.0


def stands_out(ground, value):
    """Can a fill be told from this ground at all? A person could not, if it lies within it."""
    low, high = ground.min(), ground.max()
    gap = max(low - value, value - high)
    return gap > 0.5 * (high - low) and (value in FILLS or (value < low and gap > 500.0))
