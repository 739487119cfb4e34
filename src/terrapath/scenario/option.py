"""One option: its name, type and default, and its description."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, get_type_hints

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue


# How pydantic reads a section: unknown keys are errors, and so are NaN and infinity.
STRICT: dict[str, str | bool] = {"extra": "forbid", "allow_inf_nan": False}

Point: TypeAlias = tuple[float, float]
Points: TypeAlias = tuple[Point, ...]
Rectangle: TypeAlias = tuple[float, float, float, float]
Files: TypeAlias = tuple[str, ...]
Interval: TypeAlias = tuple[float, float]
Extent: TypeAlias = float | Literal["auto", "none"]
ModelOptions: TypeAlias = dict[str, float | str]
SlopeMeasure: TypeAlias = Literal["horn", "steepest"]

# What a value has to be, in words.
NUMBER, WHOLE, SWITCH, TEXT = "a finite number", "a whole number", "true or false", "text"
FILE, FILES = "the path of a file, as text", "a list of paths, each as text"
A_POINT = "two finite numbers, [X, Y]"


@dataclass(frozen=True)
class Option:
    """The description of an option; its name, type and default are declared beside it.

    expects : the kind of value that a scenario file must give, in words. form : the value's
    placeholder on the command line. flags : on the command line, where they do not follow from
    the key. example : a value in TOML, for an option without a default. is_file : the text names
    a file.
    """

    help: str
    expects: str
    form: str | None = None
    flags: tuple[str, ...] = ()
    example: str = ""
    is_file: bool = False

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> Any:
        schema = handler(source)
        _forbid_conversion(schema)
        return schema

    def __get_pydantic_json_schema__(
        self, schema: Any, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return handler(schema) | {"description": self.help}


def _forbid_conversion(schema: object) -> None:
    """Accept no text or true as a number, and no fraction as a whole number."""
    if isinstance(schema, dict):
        if schema.get("type") in {"float", "int", "bool", "str"}:
            schema["strict"] = True
        for part in schema.values():
            _forbid_conversion(part)
    elif isinstance(schema, list | tuple):
        for part in schema:
            _forbid_conversion(part)


# Options of one kind


def a_number(text: str, form: str, example: str = "") -> Option:
    """An option that takes a number."""
    return Option(text, NUMBER, form, example=example)


def a_count(text: str, example: str) -> Option:
    """An option that takes a whole number of things."""
    return Option(text, WHOLE, "N", example=example)


def a_switch(text: str, *flags: str, example: str = "") -> Option:
    """An option that is on or off."""
    return Option(text, SWITCH, flags=flags, example=example)


def a_file(text: str, example: str, form: str = "FILE") -> Option:
    """An option that takes a file."""
    return Option(text, FILE, form, example=example, is_file=True)


def some_files(text: str, example: str, *flags: str) -> Option:
    """An option that takes any number of files."""
    return Option(text, FILES, "FILE", flags, example, is_file=True)


# Options as the sections declare them


class Declared(NamedTuple):
    """An option with its place, as it was declared."""

    section: str
    key: str
    type: object
    default: object
    option: Option

    @property
    def parameter(self) -> str:
        """Its name as an argument of a command's function."""
        return f"{self.section}_{self.key}"

    @property
    def flags(self) -> tuple[str, ...]:
        """Its names on the command line; none for the map, which is the argument WHERE."""
        if self.key in {"path", "scene"}:
            return ()
        return self.option.flags or (f"--{self.key.replace('_', '-')}",)

    @property
    def keyword(self) -> str:
        """Its name as a keyword in Python."""
        others = {"name": "planner", "files": "output", "model": "travel"}
        return "travel_options" if self.key == "options" else others.get(self.key, self.key)


@functools.cache
def declared(section: type) -> tuple[tuple[str, object, object, Option], ...]:
    """Key, type, default and option of each field of a section, in order."""
    hints = get_type_hints(section, include_extras=True)
    return tuple(
        (
            entry.name,
            hints[entry.name].__origin__,
            entry.default if entry.default is not dataclasses.MISSING else {},
            hints[entry.name].__metadata__[0],
        )
        for entry in dataclasses.fields(section)
    )
