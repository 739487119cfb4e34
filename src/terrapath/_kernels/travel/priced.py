"""Surfaces with a pace: what a path costs depends on the grade in its direction of travel.

They have one layer, the height at its true scale, and all that the plain classes have. What is
asked of a point is answered as for these; what is asked of a vector is F(x, v) = c |v| P(m), with
the grade m = grad z . v / |v|. It costs more uphill than downhill, so here directions count.
"""

from typing import Any, NamedTuple

import numpy as np

from ..compiler import Kernel, inner_kernel
from ..dispatch import per_class
from ..surface.cells import CostCells
from ..surface.surfaces import Peaks, Spline
from .paces import Pace


class Price(NamedTuple):
    """A pace on a surface, and how its kinks are softened where a path is pulled taut."""

    pace: Pace
    least: float  # P is nowhere below it
    jumps: np.ndarray  # (k,): of the slope at its kinks
    width: float  # of a softened kink, in grades
    share: float  # of the length that is added, cost per map unit


class PricedPeaks(NamedTuple):
    """Exact peaks with a pace."""

    peaks: np.ndarray
    first: np.ndarray
    weights: np.ndarray
    price: Price

    plain = Peaks  # type: ignore[misc]


class PricedSpline(NamedTuple):
    """A spline with a pace."""

    coefficients: np.ndarray
    weights: np.ndarray
    x0: float
    y0: float
    dx: float
    dy: float
    log_cost: np.ndarray
    cells: CostCells
    floor: float
    price: Price

    plain = Spline  # type: ignore[misc]


def per_price(metric: Kernel, priced: Kernel) -> Any:
    """Dispatch on whether a surface has the metric h or a pace; see ``per_class``."""
    return per_class({Peaks: metric, Spline: metric, PricedPeaks: priced, PricedSpline: priced})


@inner_kernel
def no(surface):
    return False


@inner_kernel
def yes(surface):
    return True


@per_price(no, yes)
def is_directed(surface):
    """Does a path cost something else on the way back?"""


@inner_kernel
def one(surface):
    return 1.0


@inner_kernel
def least_pace(surface):
    return surface.price.least


@per_price(one, least_pace)
def least_price(surface):
    """No step on the plane costs less than this times its size and the least cost."""
