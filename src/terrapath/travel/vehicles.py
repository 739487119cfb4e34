"""Vehicles: energy against rolling resistance and gravity, or time with limited power."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, Literal

import numpy as np

from ..errors import InputError
from ..validation import (
    Array,
    require_choice,
    require_fraction,
    require_positive,
)
from .model import TravelModel, travel_model


def vehicle(
    mass: float,
    rolling_resistance: float,
    regeneration: float = 0.0,
    power: float | None = None,
    speed: float | None = None,
    largest_climb: float | None = None,
    largest_descent: float | None = None,
    *,
    minimise: Literal["energy", "time"] = "energy",
    gravity: float = 9.81,
) -> TravelModel:
    """A vehicle that rolls over the ground, by its energy or its time.

    A horizontal metre at the grade m takes the energy mass gravity (mu + m) from the motor, with
    the rolling resistance mu. That is exact on slopes: the weight on the wheels falls by as much as
    the distance grows. Where it is below 0, the share ``regeneration`` of it comes back, and the
    brakes take the rest. The time is the slope distance divided by the speed: ``speed``, or less
    where the power is not enough.

    mass : kg. rolling_resistance : mu, about 0.015 on a road, 0.05 to 0.3 off it.
    regeneration : 0 to 1, the share of the energy of braking that is stored again. Paces may then
        be below 0; the model's ``gauge`` mends that.
    power : W, at the wheels. For time, the speed falls with the grade. For energy, climbs on which
        ``speed`` cannot be kept are left out, as Rowe and Ross do.
    speed : m/s along the ground. Needed for time, and for energy where ``power`` is given.
    largest_climb, largest_descent : the steepest grades along the path, both above 0. Steeper
        ground is taken in switchbacks.
    minimise : ``"energy"`` (J) or ``"time"`` (s).
    gravity : m/s^2; 1.62 on the Moon, 3.71 on Mars.

    Source: Rowe and Ross (1990), IEEE Transactions on Robotics and Automation 6, 540-553; Sun
    and Reif (2005), IEEE Transactions on Robotics 21, 102-114.
    """
    options = {
        "mass": mass,
        "rolling_resistance": rolling_resistance,
        "regeneration": regeneration,
        "power": power,
        "speed": speed,
        "largest_climb": largest_climb,
        "largest_descent": largest_descent,
        "minimise": minimise,
        "gravity": gravity,
    }
    given = {name: value for name, value in options.items() if value is not None}
    _check(given)
    weight, resistance = mass * gravity, rolling_resistance
    limit = math.inf if power is None else power
    climb, descent = (math.inf if m is None else m for m in (largest_climb, largest_descent))
    if minimise == "time" and speed is not None:
        formula = partial(_time, weight, resistance, limit, speed)
        kinks = _slower_from(weight * speed / limit, resistance)
    else:
        formula = partial(_energy, weight, resistance, regeneration)
        kinks = [-resistance]
        if speed is not None:
            climb = min(climb, _climb_at_speed(weight, resistance, limit, speed))
    return travel_model(
        "vehicle",
        formula,
        unit="s" if minimise == "time" else "J",
        source="Rowe and Ross (1990), IEEE TRA 6, 540-553; Sun and Reif (2005), IEEE TRO 21, "
        "102-114",
        grades=(-descent, climb),
        kinks=kinks,
        options=given,
    )


def _check(options: Mapping[str, Any]) -> None:
    require_choice(("energy", "time"), minimise=options["minimise"])
    require_fraction(regeneration=options["regeneration"])
    others = {
        name: value for name, value in options.items() if name not in ("minimise", "regeneration")
    }
    require_positive(**others)
    if "speed" not in options and (options["minimise"] == "time" or "power" in options):
        raise InputError(
            "speed=None: a vehicle needs a speed in m/s where time is minimised or power is given"
        )


def _energy(weight: float, resistance: float, regeneration: float, grades: Array) -> Array:
    force = resistance + grades
    return weight * np.maximum(force, regeneration * force)


def _time(weight: float, resistance: float, power: float, speed: float, grades: Array) -> Array:
    at_speed = np.sqrt(1.0 + grades * grades) / speed
    return np.asarray(np.maximum(at_speed, weight * (resistance + grades) / power))


def _slower_from(ratio: float, resistance: float) -> list[float]:
    """The grades where ratio (mu + m) = sqrt(1 + m^2): there the power just keeps the speed."""
    roots = np.roots([ratio**2 - 1.0, 2.0 * ratio**2 * resistance, ratio**2 * resistance**2 - 1.0])
    return [float(m.real) for m in roots if abs(m.imag) < 1e-12 and resistance + m.real > 0]


def _climb_at_speed(weight: float, resistance: float, power: float, speed: float) -> float:
    """The steepest grade that is climbed at full speed.

    From weight (mu + m) speed = power sqrt(1 + m^2).
    """
    on_level = weight * resistance * speed
    if on_level >= power:
        raise InputError(
            f"power={power:g} is too little for speed={speed:g} on level ground, which takes "
            f"{on_level:g} W; lower the speed"
        )
    uphill = [m for m in _slower_from(weight * speed / power, resistance) if m > 0]
    return min(uphill, default=math.inf)
