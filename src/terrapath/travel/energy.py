"""What walking takes out of a body: Minetti, Pandolf with Santee's correction, Llobera."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.polynomial import polynomial

from ..validation import Array, require_not_negative, require_positive
from .model import TravelModel, travel_model

MINETTI = (2.5, 19.6, 51.9, -76.8, -58.7, 280.5)
LLOBERA_SLUCKIN = (2.635, 17.37, 42.37, -21.43, 14.93)


def minetti(mass: float | None = None) -> TravelModel:
    """The metabolic energy of walking on a treadmill, by Minetti and others.

    280.5 i^5 - 58.7 i^4 - 76.8 i^3 + 51.9 i^2 + 19.6 i + 2.5 J per kg and metre of slope distance,
    for grades i up to 0.45. Beyond that the polynomial means nothing, and would fall below 0
    downhill. Below -0.32 it is not convex; the critical grade comes before.

    mass : kg, of the walker with what is carried. Without it costs are in J/kg.

    Source: Minetti, Moia, Roi, Susta and Ferretti (2002), Energy cost of walking and running at
    extreme uphill and downhill slopes, Journal of Applied Physiology 93, 1039-1046.
    """
    source = "Minetti et al. (2002), Journal of Applied Physiology 93, 1039-1046"
    return _polynomial("minetti", MINETTI, mass, source)


def llobera_sluckin(mass: float | None = None) -> TravelModel:
    """A polynomial by Llobera and Sluckin, whose paper is on when zigzags are better.

    2.635 + 17.37 s + 42.37 s^2 - 21.43 s^3 + 14.93 s^4. It follows the measurements of Minetti and
    others (2002) of walking, so it is taken as they are: J per kg and metre of slope distance, for
    grades up to 0.45. (Some programs take it as kJ per horizontal metre.)

    mass : kg, of the walker with what is carried. Without it costs are in J/kg.

    Source: Llobera and Sluckin (2007), Zigzagging: theoretical insights on climbing strategies,
    Journal of Theoretical Biology 249, 206-217.
    """
    source = "Llobera and Sluckin (2007), Journal of Theoretical Biology 249, 206-217"
    return _polynomial("llobera_sluckin", LLOBERA_SLUCKIN, mass, source)


def _polynomial(
    name: str, coefficients: tuple[float, ...], mass: float | None, source: str
) -> TravelModel:
    """A model by a polynomial in J per kg and metre of slope distance, of a walker of this mass."""
    if mass is not None:
        require_positive(mass=mass)
    return travel_model(
        name,
        partial(_per_mass, coefficients, 1.0 if mass is None else mass),
        unit="J/kg" if mass is None else "J",
        source=source,
        grades=(-0.45, 0.45),
        distance="slope",
        options={"mass": mass},
    )


def _per_mass(coefficients: tuple[float, ...], mass: float, grades: Array) -> Array:
    return np.asarray(mass * polynomial.polyval(grades, coefficients))


def pandolf(
    mass: float = 70.0, load: float = 0.0, *, speed: float = 1.34, terrain: float = 1.0
) -> TravelModel:
    """The metabolic energy of walking with a load at a constant speed, by Pandolf and others.

    With the body W and the load L in kg, V in m/s and the grade G in percent, the power is
    1.5 W + 2 (W + L) (L/W)^2 + eta (W + L) (1.5 V^2 + 0.35 V G) watts. Downhill the correction
    eta (G (W + L) V / 3.5 - (W + L) (G + 6)^2 / W + 25 - V^2) is taken away; at level ground it is
    not 0, so that the power jumps there by a few percent. The downhill measurements behind it end
    at -12 percent.

    mass, load : kg. speed : m/s along the ground, the same at all grades.
    terrain : eta, 1 on a treadmill or a road, 1.2 in light brush, 2.1 in loose sand.

    Source: Pandolf, Givoni and Goldman (1977), Predicting energy expenditure with loads while
    standing or walking very slowly, Journal of Applied Physiology 43, 577-581. Downhill: Santee and
    others, as in Yokota, Berglund, Santee, Buller and Hoyt (2004), USARIEM technical report T04-09.
    Per metre of slope distance: the power divided by the speed.
    """
    require_positive(mass=mass, speed=speed, terrain=terrain)
    require_not_negative(load=load)
    return travel_model(
        "pandolf",
        partial(_pandolf, mass, load, speed, terrain),
        unit="J",
        source="Pandolf et al. (1977), Journal of Applied Physiology 43, 577-581; downhill as in "
        "Yokota et al. (2004)",
        grades=(-0.25, 0.25),
        kinks=[0.0],
        distance="slope",
        options={"mass": mass, "load": load, "speed": speed, "terrain": terrain},
    )


def _pandolf(mass: float, load: float, speed: float, terrain: float, grades: Array) -> Array:
    percent, total = 100.0 * grades, mass + load
    standing = 1.5 * mass + 2.0 * total * (load / mass) ** 2
    power = standing + terrain * total * (1.5 * speed**2 + 0.35 * speed * percent)
    correction = terrain * (
        percent * total * speed / 3.5 - total * (percent + 6.0) ** 2 / mass + 25.0 - speed**2
    )
    return np.asarray(np.where(percent < 0.0, power - correction, power) / speed)
