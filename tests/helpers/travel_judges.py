"""Judges of travel models that share no code with the package: sampled hulls, linear programs.

The pace functions are written here a second time, from the literature.
"""

import json

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

import terrapath as tp
from common import REAL_MAPS

TAN30 = np.tan(np.pi / 6)


def _pandolf(m):
    percent, w, v = 100 * m, 70.0, 1.34
    up = 1.5 * w + w * (1.5 * v * v + 0.35 * v * percent)
    saved = percent * w * v / 3.5 - (percent + 6) ** 2 + 25 - v * v
    return np.where(m < 0, up - saved, up) / v * np.hypot(1, m)


def _polynomial(m, *coefficients):
    return sum(c * m**k for k, c in enumerate(coefficients)) * np.hypot(1, m)


def _lorentz(m):
    x = np.rad2deg(np.arctan(m))
    return 1 / (63.66 / (np.pi * 10.064 * (1 + ((x + 2.171) / 10.064) ** 2)) + 0.628 - 0.00463 * x)


# The model, its pace per horizontal metre, and the grades where that jumps or ends.
MODELS = {
    "tobler": (tp.travel.tobler, lambda m: 0.6 * np.exp(3.5 * abs(m + 0.05)), ()),
    "naismith": (tp.travel.naismith, lambda m: 0.72 + 6 * np.clip(m, 0, None), ()),
    "langmuir": (
        tp.travel.langmuir,
        lambda m: 0.72 + m * np.select([m >= 0, m >= -0.2125], [6, 1.9998], -1.9998),
        (-0.2125,),
    ),
    "irmischer_clarke": (
        tp.travel.irmischer_clarke,
        lambda m: 1 / (0.11 + np.exp(-((100 * m + 5) ** 2) / 1800)),
        (-1.0, 1.0),
    ),
    "campbell": (tp.travel.campbell, _lorentz, (-TAN30, TAN30)),
    "minetti": (
        tp.travel.minetti,
        lambda m: _polynomial(m, 2.5, 19.6, 51.9, -76.8, -58.7, 280.5),
        (-0.45, 0.45),
    ),
    "pandolf": (tp.travel.pandolf, _pandolf, (-0.25, 0.0, 0.25)),
    "llobera_sluckin": (
        tp.travel.llobera_sluckin,
        lambda m: _polynomial(m, 2.635, 17.37, 42.37, -21.43, 14.93),
        (-0.45, 0.45),
    ),
    "vehicle": (
        lambda: tp.travel.vehicle(1000.0, 0.15, largest_climb=0.25, largest_descent=0.4),
        lambda m: 9810 * np.clip(0.15 + m, 0, None),
        (-0.4, 0.25),
    ),
    "regeneration": (
        lambda: tp.travel.vehicle(800.0, 0.08, 0.6, largest_descent=0.5),
        lambda m: 7848 * np.maximum(0.08 + m, 0.6 * (0.08 + m)),
        (-0.5,),
    ),
    "power": (
        lambda: tp.travel.vehicle(1000.0, 0.1, power=6000.0, speed=4.0, minimise="time"),
        lambda m: np.maximum(np.hypot(1, m) / 4, 9810 * (0.1 + m) / 6000),
        (),
    ),
}
# Their paces are not convex between the critical grades, so that the hull depends on the ground.
LOOSE = {"campbell": 0.13, "pandolf": 0.011}


def pace_of(name):
    """The pace of the literature, infinite outside the range of the model."""
    _, pace, marks = MODELS[name]
    low = min((m for m in marks if name != "langmuir" and m < 0), default=-np.inf)
    high = max((m for m in marks if m > 0), default=np.inf)
    return lambda m: np.where((m < low) | (m > high), np.inf, pace(m))


def sampled_hull(pace, gradient, marks=(), gauge=0.0, count=40_000):
    """Directions (k, 2), their grades (k,), and the convexified cost of a unit of each (k,).

    pace : of grades. The ground rises by ``gradient`` along x. The unit ball of the cost is sampled
    in ``count`` directions, and at the grades ``marks``; its convex hull is taken.
    """
    angles = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    sharp = np.array([m for m in marks if abs(m) <= gradient])
    at_marks = np.arccos(sharp / gradient)
    angles = np.concatenate([angles, at_marks, -at_marks])
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    grades = np.concatenate([gradient * directions[:count, 0], sharp, sharp])
    costs = pace(grades) - gauge * grades
    there = np.isfinite(costs)
    hull = ConvexHull(directions[there] / costs[there, None])
    normals = hull.equations[:, :2] / -hull.equations[:, 2:]
    asked = slice(0, count, count // 200)
    return directions[asked], grades[asked], (directions[asked] @ normals.T).max(axis=1)


def cheapest_mix(grades, paces, grade):
    """The least cost of a horizontal metre that rises by ``grade``, mixing rows; None if none is.

    Any length may be walked, as the ground may be as steep as it likes: a linear program.
    """
    lengths = linprog(
        paces,
        A_ub=[-np.ones(len(grades))],
        b_ub=[-1.0],
        A_eq=[grades],
        b_eq=[grade],
        method="highs",
    )
    return lengths.fun if lengths.status == 0 else None


def cases(*groups):
    """The cases of these groups beside the clone; skips where the file is absent."""
    file = REAL_MAPS / "travel_cases.json"
    if not file.exists():
        pytest.skip("no travel_cases.json beside the clone")
    return [case for case in json.loads(file.read_text())["cases"] if case["group"] in groups]


def model_of(pace):
    """The travel model that a case describes."""
    kind = pace["kind"]
    if kind == "affine":
        line = np.array([-1.0, 0.0, 1.0])
        return tp.travel.from_table(line, pace["mu"] + pace["k"] * line, beyond="switchbacks")
    if kind == "vehicle":
        limit = pace.get("max_grade")
        limits = {"largest_climb": limit, "largest_descent": limit}
        return tp.travel.vehicle(pace["mass"], pace["mu"], gravity=pace["g"], **limits)
    return getattr(tp.travel, kind)()
