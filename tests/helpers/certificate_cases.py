"""Surfaces, certificates and forgeries that tests of several claims share."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

import terrapath as tp
from terrapath.certificates.certificate import seal_of
from terrapath.certificates.search import Search, search_window
from terrapath.problem import scenes
from terrapath.space.lattice import Lattice

SIDE = 10.0
BOUNDS = (0.0, 0.0, SIDE, SIDE)
# Far above the rounding of an oracle's own sums, far below what any missing term would make.
ROUNDING = 1e-12


def certified(problem, side, length=math.inf, repairs=0):
    """A certificate on a lattice of so many nodes."""
    window = search_window(problem, length)
    spacing = max(window.width, window.height) / side
    search = Search(problem, Lattice.spanning(window, spacing), length * (1.0 + 1e-6))
    for _ in range(repairs):
        search.repair()
    return search.certify()


def random_peaks(random, layers, steepest=4.0):
    """Layers of peaks of all widths and signs, and their weights."""
    made = []
    for _ in range(layers):
        count = random.integers(1, 5)
        falloff = np.exp(random.uniform(math.log(0.02), math.log(4.0), count))
        slope = random.uniform(0.1, steepest, count) * random.choice([-1.0, 1.0], count)
        amplitude = slope * np.sqrt(math.e / (2.0 * falloff))
        made.append(np.column_stack([amplitude, falloff, random.uniform(0.0, SIDE, (count, 2))]))
    return made, random.choice([0.0, 0.3, 1.0, 1.0, 1.0, 2.5], layers)


def random_surface(random, layers, on_spline):
    """Peaks, or rough splines through few or many random samples."""
    if not on_spline:
        peaks, weights = random_peaks(random, layers)
        return tp.Surface.from_peaks(peaks, weights=weights)
    nx, ny = random.integers(4, 14, 2) if random.random() < 0.7 else random.integers(40, 70, 2)
    x, y = np.linspace(0.0, SIDE, nx), np.linspace(0.0, SIDE, ny)
    steep = random.uniform(0.0, 0.8) * SIDE / max(nx, ny)
    values = steep * random.normal(size=(layers, ny, nx))
    weights = random.choice([0.0, 0.3, 1.0, 1.0, 2.5], layers)
    return tp.Surface.from_grid(values, x, y, weights=weights)


def square(count):
    """Points (p, q) all over [-1, 1]^2, its edges and corners among them."""
    axis = np.linspace(-1.0, 1.0, count)
    return (grid.ravel() for grid in np.meshgrid(axis, axis))


def resealed(made, **changes):
    """A changed certificate with a correct seal, so that only the mathematics can reject it."""
    changed = replace(made, **changes)
    return replace(changed, seal=seal_of(changed))


def nudged(made, row, column, by):
    coefficients = made.coefficients.copy()
    coefficients[row, column] += by
    return coefficients


def hills():
    return scenes.load("one-peak")
