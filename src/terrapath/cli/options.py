"""The command line's options, made from the declarations that scenario files use, too."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterable
from typing import Annotated, Any

import typer

from ..errors import InputError
from ..scenario.option import Declared, Extent, Files, ModelOptions, Point, Points, Rectangle
from ..scenario.scenario import (
    Given,
    LayerTable,
    LayerTables,
    Scenario,
    Weights,
    assembled,
    options,
)

Where = Annotated[
    str,
    typer.Argument(
        metavar="WHERE",
        help="A built-in scene (see `terrapath scenes`), a raster, or a scenario file (.toml).",
    ),
]


def _numbers(text: str, name: str, form: str, what: str) -> tuple[float, ...]:
    """Numbers with commas between them, as many as the form has."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
        if len(numbers) != form.count(",") + 1:
            raise ValueError
    except ValueError:
        raise InputError(
            f"{name}={text!r} is not {what}; write it as {form}, with a comma between numbers"
        ) from None
    return numbers


def parse_point(text: str, name: str) -> Point:
    """A point that is given as X,Y."""
    x, y = _numbers(text, name, "X,Y", "a point")
    return x, y


def _parse_pair(text: str, name: str, form: str) -> tuple[float, float]:
    """A point, or another two numbers."""
    first, second = _numbers(text, name, form, "a point" if form == "X,Y" else "two numbers")
    return first, second


def _parse_pairs(texts: Iterable[str], option: str, form: str) -> dict[str, str]:
    """The values of NAME=VALUE by their names, which must differ."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, separator, value = (part.strip() for part in text.partition("="))
        if not (separator and name and value):
            raise InputError(f"{option} {text!r} is not of the form {form}")
        if name in pairs:
            raise InputError(f"{option} gives the name {name!r} twice; give each its own name")
        pairs[name] = value
    return pairs


def _parse_layers(texts: list[str], option: str, form: str) -> LayerTables:
    from ..io import LayerSource

    sources = {
        name: LayerSource.parse(value) for name, value in _parse_pairs(texts, option, form).items()
    }
    return {
        name: LayerTable(file=str(source.path), band=int(source.band), weight=source.weight)
        for name, source in sources.items()
    }


def _parse_weights(texts: list[str], option: str, form: str) -> Weights:
    weights = {}
    for name, value in _parse_pairs(texts, option, form).items():
        try:
            weights[name] = float(value)
        except ValueError:
            raise InputError(f"{option} {name}={value}: {value!r} is not a number") from None
    return weights


def as_number(text: str) -> float | str:
    """A number where the text is one, whole where it is whole."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _parse_options(texts: list[str], option: str, form: str) -> ModelOptions:
    pairs = _parse_pairs(texts, option, form)
    return {name: as_number(value) for name, value in pairs.items()}


def _parse_extent(text: str, option: str) -> Extent:
    words: dict[str, Extent] = {"auto": "auto", "none": "none"}
    if text in words:
        return words[text]
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option} {text!r} is not a number; give one, auto or none") from None


def _is_flag(declaration: Declared) -> bool:
    return declaration.type in (bool, bool | None)


def _typed_by(declaration: Declared) -> object:
    """The type that typer reads from the command line; what it cannot read stays text."""
    several = (Points, Point | Points, Files, LayerTables, Weights, ModelOptions)
    if declaration.type in several:
        return list[str] | None
    for kind in (int, float, bool):
        if declaration.type in (kind, kind | None):
            return kind | None
    return str | None


def _value(declaration: Declared, given: object) -> object:
    """The value in a scenario file that means the same as ``given`` on the command line."""
    kind, flag, form = declaration.type, declaration.flags[0], declaration.option.form or ""
    name = declaration.key
    readers: list[tuple[object, Callable[[Any], object]]] = [
        (Point | None, lambda text: _parse_pair(text, name, form)),
        (Points, lambda texts: tuple(parse_point(text, name) for text in texts)),
        (Point | Points, lambda texts: tuple(parse_point(text, name) for text in texts)),
        (Rectangle | None, lambda text: _numbers(text, name, form, "a rectangle")),
        (LayerTables, lambda texts: _parse_layers(texts, flag, form)),
        (Weights, lambda texts: _parse_weights(texts, flag, form)),
        (ModelOptions, lambda texts: _parse_options(texts, flag, form)),
        (Extent, lambda text: _parse_extent(text, flag)),
        (int | str | None, lambda text: int(text) if text.isdecimal() else text),
        (Files, tuple),
    ]
    for known, read in readers:
        if kind == known:
            return read(given)
    return given


def _parameter(declaration: Declared) -> inspect.Parameter:
    option = declaration.option
    metavar = None if _is_flag(declaration) else option.form
    shown = typer.Option(*declaration.flags, metavar=metavar, help=option.help, show_default=False)
    return inspect.Parameter(
        declaration.parameter,
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[_typed_by(declaration), shown],
    )


def _taken(sections: Iterable[str], also: Iterable[str], without: Iterable[str]) -> list[Declared]:
    """The command-line options of these sections, plus and minus some by their parameter names."""
    named, left_out = set(also), set(without)
    return [
        declaration
        for declaration in options()
        if declaration.flags
        and (declaration.section in sections or declaration.parameter in named)
        and declaration.parameter not in left_out
    ]


def asked(where: str, given: Given) -> Scenario:
    """The scenario that is asked for; on a terminal, leave is asked where its file reaches out."""
    try:
        return assembled(where, given)
    except InputError as error:
        from ..scenario.toml import ExternalError

        is_terminal = all(stream and stream.isatty() for stream in (sys.stdin, sys.stderr))
        if not (isinstance(error, ExternalError) and is_terminal):
            raise
        if not typer.confirm(f"terrapath: {error}. Go on?", err=True):
            raise
        allowed = {**given.get("map", {}), "allow_external": True}
        return assembled(where, {**given, "map": allowed})


def with_options(
    *sections: str, also: Iterable[str] = (), without: Iterable[str] = ()
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Give a command the options of these sections, so that typer reads them.

    The command is called with ``given``: the values from the command line, by section and key.
    also, without : options to add and to leave out, by parameter names such as planner_spacing.
    """
    taken = _taken(sections, also, without)

    def decorate(command: Callable[..., int]) -> Callable[..., int]:
        def read(**values: object) -> int:
            shared = [(declaration, values.pop(declaration.parameter)) for declaration in taken]
            return command(given=_by_section(shared), **values)

        own = inspect.signature(command, eval_str=True).parameters.values()
        kept = [p.replace(kind=p.KEYWORD_ONLY) for p in own if p.name != "given"]
        parameters = [*kept, *map(_parameter, taken)]
        read.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        read.__annotations__ = {p.name: p.annotation for p in parameters}
        read.__doc__, read.__name__ = command.__doc__, command.__name__
        return read

    return decorate


def _by_section(values: Iterable[tuple[Declared, object]]) -> Given:
    given: dict[str, dict[str, object]] = {}
    for declaration, value in values:
        if value is not None and value != []:
            given.setdefault(declaration.section, {})[declaration.key] = _value(declaration, value)
    return given
