"""Slow, obvious oracles for certificates: formulas in NumPy, rationals and mpmath, no kernel.

Splines are sums of the cardinal B-spline of SciPy or of truncated powers, dual norms come from
the inverse of h, and closed forms say how long a shortest path is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
from scipy.interpolate import BSpline

# The cubic B-spline on the knots 0, 1, 2, 3, 4.
CARDINAL = BSpline.basis_element(np.arange(5.0), extrapolate=False)


def basis_matrix(shares, count, derivative=0):
    """Values (m, count) of the B-splines of a row at s, counted in knots from the first one.

    B-spline i is centred at knot i - 1.
    """
    offsets = np.asarray(shares)[:, None] - np.arange(count) + 3.0
    return np.nan_to_num(CARDINAL(offsets, derivative))


@dataclass(frozen=True)
class Sheet:
    """Bicubic splines (..., ny + 2, nx + 2) from a corner, knots dx and dy apart."""

    coefficients: np.ndarray
    x0: float
    y0: float
    dx: float
    dy: float

    def at(self, points, along_x=0, along_y=0):
        """Values or derivatives (..., m) at points (m, 2)."""
        rows, columns = self.coefficients.shape[-2:]
        a = basis_matrix((points[:, 0] - self.x0) / self.dx, columns, along_x)
        b = basis_matrix((points[:, 1] - self.y0) / self.dy, rows, along_y)
        scale = self.dx**along_x * self.dy**along_y
        return np.einsum("mj,...ji,mi->...m", b, self.coefficients, a) / scale

    def gradient(self, points):
        """(..., m, 2)."""
        return np.stack([self.at(points, 1, 0), self.at(points, 0, 1)], axis=-1)


class Terrain:
    """A surface's weighted layers by the plain formulas: values and gradients at points."""

    def __init__(self, surface: Any) -> None:
        self.data = surface.data

    def values(self, points):
        """(layers, m)."""
        if hasattr(self.data, "dx"):
            return self.data.weights[:, None] * _sheet(self.data).at(points)
        return np.stack([self._peaks(k, points)[0] for k in range(len(self.data.weights))])

    def gradients(self, points):
        """(layers, m, 2)."""
        if hasattr(self.data, "dx"):
            return self.data.weights[:, None, None] * _sheet(self.data).gradient(points)
        return np.stack([self._peaks(k, points)[1] for k in range(len(self.data.weights))])

    def _peaks(self, layer, points):
        first, last = self.data.first[layer : layer + 2]
        total, slope = np.zeros(len(points)), np.zeros((len(points), 2))
        for a, falloff, x, y in self.data.peaks[first:last]:
            offset = points - (x, y)
            value = self.data.weights[layer] * a * np.exp(-falloff * (offset**2).sum(axis=1))
            total += value
            slope -= 2.0 * falloff * offset * value[:, None]
        return total, slope

    def lift(self, points):
        """(m, 2 + layers)."""
        return np.concatenate([points, self.values(points).T], axis=1)


def _sheet(data):
    return Sheet(data.coefficients, data.x0, data.y0, data.dx, data.dy)


def dual_norm_squared(slopes, gradients):
    """du^T h^-1 du, for slopes (m, 2) of u and gradients (layers, m, 2) of the layers."""
    h = np.eye(2) + np.einsum("kmi,kmj->mij", gradients, gradients)
    solved = np.linalg.solve(h, slopes[..., None])[..., 0]
    return (slopes * solved).sum(axis=1)


def sheet_of(certificate):
    """The function u of a certificate."""
    rows, columns = certificate.coefficients.shape
    x0, y0, x1, y1 = certificate.bounds
    dx, dy = (x1 - x0) / (columns - 3), (y1 - y0) / (rows - 3)
    return Sheet(certificate.coefficients, x0, y0, dx, dy)


def needs_of(problem, certificate, points):
    """At points (m, 2): the dual norm of du, and (W - u) / chord to the goal."""
    sheet, terrain = sheet_of(certificate), Terrain(problem.surface)
    norm = np.sqrt(dual_norm_squared(sheet.gradient(points), terrain.gradients(points)))
    goal = terrain.lift(np.array([problem.goal]))
    chord = np.linalg.norm(terrain.lift(points) - goal, axis=1)
    short = np.maximum(certificate.horizon - sheet.at(points), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        way_out = np.where(short == 0.0, 0.0, short / chord)
    return norm, way_out


# Exact arithmetic


def exact_basis(share, derivative):
    """The B-splines 0 to 3 of a knot span at a rational place in it, from truncated powers."""
    found = []
    for i in range(4):
        s = Fraction(share) + 3 - i
        power = 3 - derivative
        total = Fraction(0)
        for k in range(5):
            if s > k:
                total += (-1) ** k * math.comb(4, k) * (s - k) ** power
        found.append(total / math.factorial(power))
    return found


def exact_sheet(coefficients, i, j, t, s, along_x=0, along_y=0):
    """A spline's value or derivative by t and s, both rational, in cell (i, j)."""
    a, b = exact_basis(t, along_x), exact_basis(s, along_y)
    return sum(
        b[q] * a[k] * Fraction(float(coefficients[j + q, i + k]))
        for q in range(4)
        for k in range(4)
    )


def exact_dual_norm_squared(slope, gradients):
    """By Cramer's rule from h, in whatever numbers are given."""
    h11 = 1 + sum(g[0] * g[0] for g in gradients)
    h12 = sum(g[0] * g[1] for g in gradients)
    h22 = 1 + sum(g[1] * g[1] for g in gradients)
    top = h22 * slope[0] ** 2 - 2 * h12 * slope[0] * slope[1] + h11 * slope[1] ** 2
    return top / (h11 * h22 - h12 * h12)


def exact_peaks_gradient(peaks, weight, x, y):
    """Of one layer, in mpmath's numbers."""
    along_x = along_y = mpmath.mpf(0)
    for a, falloff, cx, cy in peaks:
        ox, oy = x - mpmath.mpf(cx), y - mpmath.mpf(cy)
        f = mpmath.mpf(falloff)
        value = mpmath.mpf(weight) * mpmath.mpf(a) * mpmath.exp(-f * (ox * ox + oy * oy))
        along_x -= 2 * f * ox * value
        along_y -= 2 * f * oy * value
    return along_x, along_y


# Closed forms


def unrolled_length(profile, start, goal):
    """Shortest length on a surface whose layers depend on x1 alone: it unrolls to the plane.

    profile : a Spline with weights; its coefficients are the same in every row.
    """
    low, high = sorted((start[0], goal[0]))
    knots = profile.x0 + profile.dx * np.arange(profile.coefficients.shape[2] - 2)
    cuts = np.unique(np.concatenate([[low, high], knots[(knots > low) & (knots < high)]]))
    cuts = np.unique(np.concatenate([cuts[:-1] + k / 8 * np.diff(cuts) for k in range(8)] + [cuts]))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(cuts)[:, None]
    x = (cuts[:-1, None] + half * (1.0 + nodes)).ravel()
    row = basis_matrix((x - profile.x0) / profile.dx, profile.coefficients.shape[2], 1) / profile.dx
    slopes = profile.weights[:, None] * np.einsum("ki,mi->km", profile.coefficients[:, 1], row)
    speed = np.sqrt(1.0 + (slopes**2).sum(axis=0)).reshape(half.shape[0], -1)
    return math.hypot(float((half * weights * speed).sum()), goal[1] - start[1])
