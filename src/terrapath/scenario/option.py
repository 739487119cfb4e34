"""What is said of one option, and how pydantic reads it."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

# How pydantic reads a section: unknown keys are errors, and so are NaN and infinity.
STRICT: dict[str, Any] = {"extra": "forbid", "allow_inf_nan": False}


@dataclass(frozen=True)
class Option:
    """What is said of an option beside its name, type and default.

    expects : what a scenario file has to give, in words. form : what stands for the value on
    the command line. flags : there, where they are not made of the key. example : as TOML,
    for an option without a default. is_file : the text names a file.
    """

    help: str
    expects: str
    form: str | None = None
    flags: tuple[str, ...] = ()
    example: str = ""
    is_file: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        schema = handler(source)
        _forbid_conversion(schema)
        return schema

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> Any:
        return handler(schema) | {"description": self.help}


def _forbid_conversion(schema: Any) -> None:
    """No number from text, no whole number from a fraction, no number from true."""
    if isinstance(schema, dict):
        if schema.get("type") in {"float", "int", "bool", "str"}:
            schema["strict"] = True
        for part in schema.values():
            _forbid_conversion(part)
    elif isinstance(schema, list | tuple):
        for part in schema:
            _forbid_conversion(part)


# Types of more than one section.
Files: TypeAlias = tuple[str, ...]
Extent: TypeAlias = float | Literal["auto", "none"]

# What a value has to be, in words.
NUMBER, WHOLE, SWITCH, TEXT = "a finite number", "a whole number", "true or false", "text"
FILE, FILES = "the path of a file, as text", "a list of paths, each as text"
A_POINT = "two finite numbers, [X, Y]"
COUNT: Any = functools.partial(Option, expects=WHOLE, form="N")
