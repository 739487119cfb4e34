"""The travel models by their names."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from .._support.plug_ins import announced, loaded
from ..errors import InputError
from .energy import llobera_sluckin, minetti, pandolf
from .model import TravelModel
from .vehicles import vehicle
from .walking import campbell, irmischer_clarke, langmuir, naismith, tobler

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

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

# Where installed packages announce models of their own: a name, and a function that makes one.
PLUG_INS = "terrapath.travel"


def plug_ins() -> dict[str, EntryPoint]:
    """The models of other packages by their names; none takes the name of one of ours."""
    found = {entry.name.replace("-", "_"): entry for entry in announced(PLUG_INS)}
    return {name: entry for name, entry in found.items() if name not in MODELS}


def _of_plug_in(entry: EntryPoint) -> Maker:
    """The function that an entry point names. Raises InputError where it cannot be used."""
    maker = loaded(entry, f"travel={entry.name!r}", inspect.signature)

    def made(**options: Any) -> TravelModel:
        model = maker(**options)
        if not isinstance(model, TravelModel):
            raise InputError(
                f"travel={entry.name!r} of {entry.value} makes no travel model, but "
                f"{type(model).__name__}; return one, as of tp.travel.from_function"
            )
        return model

    made.__signature__ = inspect.signature(maker)  # type: ignore[attr-defined] # for its options
    return made


def _maker(name: str) -> Maker:
    """What makes the model of a name. Raises InputError, with the nearest name, for none."""
    key = name.replace("-", "_")
    if key in MODELS:
        return MODELS[key]
    if key in plug_ins():
        return _of_plug_in(plug_ins()[key])
    raise InputError(f"travel={name!r} is not known; {_instead(name, [*MODELS, *plug_ins()])}")


def by_name(name: str, **options: Any) -> TravelModel:
    """The travel model of this name, such as ``"tobler"``, made with these options.

    Raises InputError where the name or an option is not known, or an option is missing. The message
    names the nearest.
    """
    maker = _maker(str(name))
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
        values = EXAMPLES.get(str(name).replace("-", "_"), {})
        example = " ".join(f"{key}={value:g}" for key, value in values.items())
        such = f", such as {example}" if example else "; give a value to each"
        raise InputError(f"{name} needs {' and '.join(missing)}{such}")
    return maker(**options)


def _instead(given: str, known: Collection[str]) -> str:
    """The nearest of the known names, and all of them."""
    near = get_close_matches(given.lower(), known, n=1, cutoff=0.5)
    question = f"did you mean {near[0]}? " if near else ""
    return f"{question}choose one of {', '.join(known)}"
