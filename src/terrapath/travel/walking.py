"""Walking times: Tobler, Naismith, Langmuir, Irmischer and Clarke, Campbell."""

from __future__ import annotations

import math
from functools import partial
from typing import Literal

import numpy as np

from ..errors import InputError
from ..validation import Array, require_choice, require_positive
from .model import TravelModel, travel_model


def tobler(*, factor: float = 1.0) -> TravelModel:
    """Tobler's hiking function: 6 exp(-3.5 |m + 0.05|) km/h.

    It is fitted to data of Imhof (1950). The critical grades are -2/7 and 2/7.

    factor : multiplies the speed. Tobler gives 0.6 off footpaths, and 1.25 on horseback.

    Source: Tobler (1993), Three presentations on geographical analysis and modeling, NCGIA
    technical report 93-1. Per horizontal metre, as the slope in it is rise over run on the map.
    """
    require_positive(factor=factor)
    return travel_model(
        "tobler",
        partial(_tobler, factor),
        unit="s",
        source="Tobler (1993), NCGIA technical report 93-1",
        kinks=[-0.05],
        options={"factor": factor},
    )


def _tobler(factor: float, grades: Array) -> Array:
    return (3.6 / (6.0 * factor)) * np.exp(3.5 * np.abs(grades + 0.05))


def naismith(*, factor: float = 1.0) -> TravelModel:
    """Naismith's rule: an hour for 5 km, and an hour more for 600 m of ascent.

    Naismith's own numbers are 3 miles and 2,000 feet; these are the usual metric ones, within 4 %
    of his. Nothing is added or taken away downhill. There are no critical grades.

    factor : multiplies the speed.

    Source: Naismith (1892), Scottish Mountaineering Club Journal 2, 136. Per horizontal metre
    ("miles on the map").
    """
    require_positive(factor=factor)
    return travel_model(
        "naismith",
        partial(_naismith, factor),
        unit="s",
        source="Naismith (1892), Scottish Mountaineering Club Journal 2, 136",
        kinks=[0.0],
        options={"factor": factor},
    )


def _naismith(factor: float, grades: Array) -> Array:
    return (0.72 + 6.0 * np.maximum(grades, 0.0)) / factor


# Langmuir's 12 degrees, as the grade that GRASS r.walk uses.
STEEP_DESCENT = -0.2125


def langmuir(*, factor: float = 1.0) -> TravelModel:
    """Naismith's rule with Langmuir's corrections downhill, with the numbers of GRASS ``r.walk``.

    0.72 s for a metre and 6 s for a metre of ascent. A metre of descent saves 1.9998 s down to the
    grade -0.2125, and costs 1.9998 s where it is steeper. (Langmuir's saving begins at 5 degrees
    only.) The pace jumps at -0.2125, where it is least; that is the critical grade downhill. Uphill
    there is none.

    factor : multiplies the speed.

    Source: Langmuir (1984), Mountaincraft and leadership; Aitken (1977), Wilderness areas in
    Scotland. Per horizontal metre.
    """
    require_positive(factor=factor)
    return travel_model(
        "langmuir",
        partial(_langmuir, factor),
        unit="s",
        source="Langmuir (1984), Mountaincraft and leadership; numbers as in GRASS r.walk",
        kinks=[STEEP_DESCENT, 0.0],
        options={"factor": factor},
    )


def _langmuir(factor: float, grades: Array) -> Array:
    rates = np.where(grades >= 0.0, 6.0, np.where(grades >= STEEP_DESCENT, 1.9998, -1.9998))
    return (0.72 + rates * grades) / factor


def irmischer_clarke(
    *,
    terrain: Literal["path", "off-path"] = "path",
    sex: Literal["male", "female"] = "male",
    factor: float = 1.0,
) -> TravelModel:
    """The speed of 200 cadets who navigated on foot, by Irmischer and Clarke.

    With s = 100 m, the grade in percent: 0.11 + exp(-(s + 5)^2 / 1800) m/s on paths, 0.11 + 0.67
    exp(-(s + 2)^2 / 1800) off them; women 0.95 times that. The speed never falls below 0.11 m/s.
    So beyond a grade of about 1.5 a metre of climb would cost ever less; the range ends before.

    terrain : ``"path"`` or ``"off-path"``. sex : ``"male"`` or ``"female"``.
    factor : multiplies the speed.

    Source: Irmischer and Clarke (2018), Measuring and modeling the speed of human navigation,
    Cartography and Geographic Information Science 45, 177-186. Per horizontal metre, as
    positions were measured by satellite.
    """
    require_positive(factor=factor)
    require_choice(("path", "off-path"), terrain=terrain)
    require_choice(("male", "female"), sex=sex)
    speed = factor * (1.0 if sex == "male" else 0.95)
    return travel_model(
        "irmischer_clarke",
        partial(_irmischer_clarke, speed, *((1.0, 5.0) if terrain == "path" else (0.67, 2.0))),
        unit="s",
        source="Irmischer and Clarke (2018), Cartography and GIS 45, 177-186",
        grades=(-1.0, 1.0),
        options={"terrain": terrain, "sex": sex, "factor": factor},
    )


def _irmischer_clarke(factor: float, height: float, shift: float, grades: Array) -> Array:
    bell = np.exp(-((100.0 * grades + shift) ** 2) / 1800.0)
    return 1.0 / (factor * (0.11 + height * bell))


# Campbell et al. (2019), supplement, table S1: percentile of the speed, and a, b, c, d, e.
CAMPBELL = {
    1: (-2.1, 12.273, 21.816, 0.263, -0.00193),
    5: (-1.527, 14.041, 36.813, 0.32, -0.00273),
    10: (-1.568, 13.328, 38.892, 0.404, -0.00323),
    15: (-1.626, 11.847, 38.231, 0.481, -0.00356),
    20: (-1.71, 10.154, 36.905, 0.557, -0.00389),
    25: (-1.822, 8.827, 37.111, 0.616, -0.00402),
    30: (-1.858, 8.412, 39.995, 0.645, -0.0043),
    35: (-1.891, 8.584, 44.852, 0.649, -0.00443),
    40: (-1.958, 8.96, 50.34, 0.649, -0.00457),
    45: (-2.05, 9.402, 56.172, 0.646, -0.0046),
    50: (-2.171, 10.064, 63.66, 0.628, -0.00463),
    55: (-2.317, 10.712, 71.572, 0.608, -0.00451),
    60: (-2.459, 11.311, 79.287, 0.599, -0.00461),
    65: (-2.647, 12.089, 89.143, 0.576, -0.00465),
    70: (-2.823, 12.784, 98.697, 0.566, -0.00493),
    75: (-3.067, 13.888, 113.655, 0.518, -0.00488),
    80: (-3.371, 15.395, 134.409, 0.443, -0.00472),
    85: (-3.661, 17.137, 159.027, 0.385, -0.00534),
    90: (-3.06, 16.653, 138.875, 0.823, -0.01386),
    95: (-3.485, 17.033, 138.04, 1.179, -0.01252),
    99: (-4.0, 13.903, 123.515, 1.961, -0.01081),
}
STEEPEST_CAMPBELL = math.tan(math.radians(30.0))


def campbell(*, percentile: int = 50, factor: float = 1.0) -> TravelModel:
    """The speeds of some 30,000 people who hiked, jogged and ran, by Campbell and others.

    A Lorentz function of the slope in degrees, for percentiles of the speed: 1 is the slowest. The
    50th is a jog of 2.6 m/s on level ground; hikers are between the 5th and the 30th or so.

    percentile : 1, 5, 10, 15, ..., 95 or 99. factor : multiplies the speed.

    Source: Campbell, Dennison, Butler and Page (2019), Using crowdsourced fitness tracker data
    to model the relationship between slope and travel rates, Applied Geography 106, 93-107, for
    slopes up to 30 degrees. Per horizontal metre.
    """
    require_positive(factor=factor)
    if percentile not in tuple(CAMPBELL):
        raise InputError(
            f"percentile={percentile!r} is not in the table; choose one of "
            f"{', '.join(map(str, CAMPBELL))}"
        )
    return travel_model(
        "campbell",
        partial(_campbell, factor, CAMPBELL[percentile]),
        unit="s",
        source="Campbell et al. (2019), Applied Geography 106, 93-107",
        grades=(-STEEPEST_CAMPBELL, STEEPEST_CAMPBELL),
        options={"percentile": percentile, "factor": factor},
    )


def _campbell(
    factor: float, constants: tuple[float, float, float, float, float], grades: Array
) -> Array:
    a, b, c, d, e = constants
    degrees = np.degrees(np.arctan(grades))
    lorentz = 1.0 / (math.pi * b * (1.0 + ((degrees - a) / b) ** 2))
    return 1.0 / (factor * (c * lorentz + d + e * degrees))
