"""Surfaces whose geodesics are known or drawn, and how to draw them."""

from __future__ import annotations

import functools
import math

import numpy as np
import sympy
from hypothesis import strategies as st

import terrapath as tp
from common import numbers
from terrapath.problem import scenes
from terrapath.surface import metric
from terrapath.surface.bounds import Bounds

REGION = Bounds(*scenes.REGION)
WIDE = Bounds(-100.0, -100.0, 100.0, 100.0)
ONE_PEAK = [scenes.ONE_PEAK]
SIX_PEAKS = [scenes.FOUR_PEAKS, scenes.TWO_RESISTANCE_PEAKS]
RADIUS = 10.0


peak = st.tuples(numbers(-6.0, 6.0), numbers(0.02, 1.0), numbers(-1.0, 11.0), numbers(-1.0, 11.0))
layer_lists = st.lists(st.lists(peak, min_size=1, max_size=3), min_size=1, max_size=4)
many_layers = st.lists(st.lists(peak, min_size=1, max_size=3), min_size=1, max_size=6)
weight_lists = st.lists(numbers(0.0, 3.0), min_size=6, max_size=6)
cubics = st.lists(st.lists(numbers(-0.3, 0.3), min_size=9, max_size=9), min_size=1, max_size=4)
point = st.tuples(numbers(0.0, 10.0), numbers(0.0, 10.0))
angles = numbers(-math.pi, math.pi)
seeds = st.integers(0, 2**32 - 1)


def peaks_surface(layers, weights=None):
    weights = None if weights is None else list(weights[: len(layers)])
    return tp.Surface.from_peaks(layers, weights=weights)


def cubic_expressions(coefficients):
    """Polynomials of degree 3, which a bicubic spline is exactly."""
    x1, x2 = sympy.symbols("x1 x2", real=True)
    terms = (x1, x2, x1**2, x1 * x2, x2**2, x1**3, x1**2 * x2, x1 * x2**2, x2**3)
    return [
        sum(sympy.Float(c, 17) * term for c, term in zip(row, terms, strict=True))
        for row in coefficients
    ]


def weighted(expressions, weights):
    return [w * e for w, e in zip(weights, expressions, strict=False)]


def flat():
    return tp.Surface.from_peaks([[]])


@functools.cache
def sphere_cap():
    half = 0.5 * RADIUS
    text = f"sqrt({RADIUS}**2 - x1**2 - x2**2)"
    return tp.Surface.from_expression(text, (-half, -half, half, half), 1e-8)


@functools.cache
def cylinder():
    text = f"sqrt({RADIUS}**2 - x1**2)"
    return tp.Surface.from_expression(text, (-5.0, -20.0, 5.0, 20.0), 1e-8)


def planar_factor(surface, start, angle):
    """Radians under h for a radian on the plane: sqrt(det h) / |u|_h^2."""
    h = metric.metric_tensor(surface, start)
    u = np.array([math.cos(angle), math.sin(angle)])
    return math.sqrt(np.linalg.det(h)) / float(u @ h @ u)


def heading(velocity):
    return math.atan2(velocity[1], velocity[0])
