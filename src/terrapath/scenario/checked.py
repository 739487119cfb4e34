"""Values checked by pydantic against the declarations of the sections, and mistakes in words."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from .option import Declared, declared
from .scenario import SECTIONS, LayerTable, Scenario, options

if TYPE_CHECKING:
    from pydantic import TypeAdapter
    from pydantic.json_schema import JsonSchemaValue

# Longer values are cut in messages, characters.
MOST_SHOWN = 60

# Pydantic's error type for a key that no section has.
UNKNOWN = "unexpected_keyword_argument"


class WrongValueError(Exception):
    """A value, or a key, that a scenario cannot have.

    keys : where it is: the section, the key, and so on. reason : what is wrong, in words.
    """

    def __init__(self, keys: tuple[str, ...], reason: str) -> None:
        super().__init__(reason)
        self.keys, self.reason = keys, reason


@functools.cache
def _adapter() -> TypeAdapter[Scenario]:
    from pydantic import TypeAdapter

    return TypeAdapter(Scenario)


def scenario_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of a scenario."""
    from pydantic.json_schema import GenerateJsonSchema

    class Schema(GenerateJsonSchema):
        """A schema without null, which TOML does not have: a key may be left out instead."""

        def nullable_schema(self, schema: Any) -> JsonSchemaValue:
            return self.generate_inner(schema["schema"])

        def default_schema(self, schema: Any) -> JsonSchemaValue:
            if schema.get("default", ()) in (None, ()):
                return self.generate_inner(schema["schema"])
            return super().default_schema(schema)

    made = _adapter().json_schema(schema_generator=Schema)
    return {"$schema": GenerateJsonSchema.schema_dialect, **made}


def validated(data: dict[str, Any]) -> Scenario:
    """The scenario with these values, by section and key. Raises WrongValueError for a mistake."""
    from pydantic import ValidationError

    try:
        return _adapter().validate_python(data)
    except ValidationError as error:
        # Unknown keys first: where a key is misspelt, the right one is missing, too.
        errors = sorted(error.errors(include_url=False), key=lambda one: one["type"] != UNKNOWN)
        raise WrongValueError(*_explained(errors[0], data)) from None


def _explained(error: Mapping[str, Any], data: dict[str, Any]) -> tuple[tuple[str, ...], str]:
    """The keys at which one of pydantic's errors is, and what is wrong there, in words."""
    keys = _keys_of(error["loc"], data)
    if error["type"] == UNKNOWN:
        return keys, _unknown(keys)
    if error["type"] == "missing" and isinstance(error["loc"][-1], str):
        return keys, f"{_named(keys)} has no {error['loc'][-1]!r}; give it one"
    value = functools.reduce(lambda table, key: table[key], keys, data)
    shown = " ".join(repr(value).split())
    shown = shown if len(shown) <= MOST_SHOWN else shown[:MOST_SHOWN] + " ..."
    return keys, f"{_named(keys)} is {shown}, but {_expected(keys)} is expected"


def _keys_of(location: Iterable[int | str], data: object) -> tuple[str, ...]:
    """The part of a location that consists of keys of the file; pydantic adds more to it."""
    keys: list[str] = []
    for part in location:
        if not (isinstance(part, str) and isinstance(data, dict) and part in data):
            break
        keys.append(part)
        data = data[part]
    return tuple(keys)


def _named(keys: tuple[str, ...]) -> str:
    section, *rest = keys
    return f"{'.'.join(rest)} in [{section}]" if rest else f"[{section}]"


def _expected(keys: tuple[str, ...]) -> str:
    section, *rest = keys
    if not rest:
        return f"a table, [{section}],"
    option = next(entry.option for entry in options(section) if entry.key == rest[0])
    if len(rest) == 3:
        return next(o.expects for key, _, _, o in declared(LayerTable) if key == rest[2])
    if rest[0] == "weights" and len(rest) == 2:
        return "a finite number"
    return option.expects


def _unknown(keys: tuple[str, ...]) -> str:
    """An unknown key, and the nearest known one."""
    *place, key = keys
    if not place:
        return f"unknown section [{key}]; {_nearest(key, list(SECTIONS))}"
    if len(place) > 1:
        known = [name for name, *_ in declared(LayerTable)]
        return f"unknown key {key!r} in [{'.'.join(place)}]; {_nearest(key, known)}"
    return f"unknown key {key!r} in [{place[0]}]; {_nearest_option(key, place[0])}"


def _nearest(key: str, known: list[str]) -> str:
    near = difflib.get_close_matches(key, known, n=1)
    return f"did you mean {near[0]}?" if near else f"choose one of {', '.join(known)}"


def nearest_keyword(keyword: str, known: Collection[Declared]) -> str:
    """What an unknown keyword argument may have been meant to be, in words."""
    words = {word: entry.keyword for entry in known for word in _words(entry)}
    near = difflib.get_close_matches(keyword, words, n=1)
    if near:
        return f"did you mean {words[near[0]]}?"
    return f"choose one of {', '.join(entry.keyword for entry in known)}"


def _nearest_option(key: str, section: str) -> str:
    """The nearest option of the section, else of another. The names of flags count, too."""
    for within in ([section], SECTIONS):
        words = {word: entry for entry in options(*within) for word in _words(entry)}
        near = difflib.get_close_matches(key, words, n=1)
        if near:
            entry = words[near[0]]
            where = "" if entry.section == section else f" in [{entry.section}]"
            return f"did you mean {entry.key}{where}?"
    return f"choose one of {', '.join(entry.key for entry in options(section))}"


def _words(entry: Declared) -> list[str]:
    flags = [word.strip("-").replace("-", "_") for flag in entry.flags for word in flag.split("/")]
    return [*flags, entry.key]  # a key wins over a flag of the same spelling
