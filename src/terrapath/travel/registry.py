"""The travel models by their names."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from typing import Any

from ..errors import InputError
from .energy import llobera_sluckin, minetti, pandolf
from .model import TravelModel
from .vehicles import vehicle
from .walking import campbell, irmischer_clarke, langmuir, naismith, tobler

Maker = Callable[..., TravelModel]

MAKERS: tuple[Maker, ...] = (
    tobler,
    naismith,
    langmuir,
    irmischer_clarke,
    campbell,
    minetti,
    pandolf,
    llobera_sluckin,
    vehicle,
)
MODELS: dict[str, Maker] = {maker.__name__: maker for maker in MAKERS}

# What a list of all models shows of one that cannot be made without arguments.
EXAMPLES: dict[str, Mapping[str, Any]] = {"vehicle": {"mass": 1000.0, "rolling_resistance": 0.05}}


def by_name(name: str, **options: Any) -> TravelModel:
    """The travel model of this name, such as ``"tobler"``, made with these options.

    Raises InputError where the name or an option is not known, or an option is missing. The message
    names the nearest.
    """
    maker = MODELS.get(str(name).replace("-", "_"))
    if maker is None:
        raise InputError(f"travel={name!r} is not known; {_instead(str(name), MODELS)}")
    parameters = inspect.signature(maker).parameters
    for option in options:
        if option not in parameters:
            raise InputError(f"{name} has no option {option!r}; {_instead(option, parameters)}")
    missing = [
        parameter.name
        for parameter in parameters.values()
        if parameter.default is parameter.empty and parameter.name not in options
    ]
    if missing:
        example = " ".join(f"{key}={value:g}" for key, value in EXAMPLES[maker.__name__].items())
        raise InputError(f"{name} needs {' and '.join(missing)}, such as {example}")
    return maker(**options)


def _instead(given: str, known: Mapping[str, Any]) -> str:
    """The nearest of the known names, and all of them."""
    near = get_close_matches(given.lower(), known, n=1, cutoff=0.5)
    question = f"did you mean {near[0]}? " if near else ""
    return f"{question}choose one of {', '.join(known)}"
