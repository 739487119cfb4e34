"""Scenario files: TOML that holds every option of ``terrapath plan``.

What may stand in one is declared in ``terrapath.options``; pydantic reads it. An error is one
line with the file, the line, the key, its value and what is expected.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError
from .listing import SECTIONS, Declared, declared, options
from .problem_options import LayerTable
from .scenario import Scenario

# A scenario is a page or two; what is larger is something else.
MOST_BYTES = 1_000_000
# Prefixes of the text that are read to find the line of an error.
MOST_ATTEMPTS = 200
MOST_SHOWN = 60

# What pydantic calls a key that no section has.
UNKNOWN = "unexpected_keyword_argument"


class ScenarioError(InputError):
    """A scenario file that cannot be used."""


@functools.cache
def _adapter() -> Any:
    from pydantic import TypeAdapter

    return TypeAdapter(Scenario)


def scenario_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of a scenario."""
    from pydantic.json_schema import GenerateJsonSchema

    class Schema(GenerateJsonSchema):
        """TOML has no null: what is not given is left out."""

        def nullable_schema(self, schema: Any) -> Any:
            return self.generate_inner(schema["schema"])

        def default_schema(self, schema: Any) -> Any:
            if schema.get("default", ()) in (None, ()):
                return self.generate_inner(schema["schema"])
            return super().default_schema(schema)

    made = _adapter().json_schema(schema_generator=Schema)
    return {"$schema": GenerateJsonSchema.schema_dialect, **made}


def read_scenario(path: str | Path) -> Scenario:
    """The scenario in a TOML file; its paths are taken from the file's folder.

    Raises ScenarioError with the file, the line, the key, its value and what is expected.
    """
    file = Path(path)
    text = _read_text(file)
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ScenarioError(f"{file} is nested too deeply to be a scenario") from None
    except ValueError as error:  # of TOML, and numbers of too many digits
        raise ScenarioError(f"{file} is not valid TOML: {error}") from None
    scenario = _validated(data, text, file)
    _require_one_map(scenario, text, file)
    return _resolved(scenario, file.parent)


def _read_text(file: Path) -> str:
    try:
        if file.exists() and not file.is_file():
            raise ScenarioError(f"{file} is not a file; name a scenario file (.toml)")
        with file.open("rb") as stream:
            content = stream.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioError(f"{file} cannot be read: {reason}; check the path") from None
    if len(content) > MOST_BYTES:
        raise ScenarioError(f"{file} has over {MOST_BYTES:,} bytes; no scenario is so large")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ScenarioError(f"{file}, line {line}: not UTF-8; save it as such") from None


def _validated(data: dict[str, Any], text: str, file: Path) -> Scenario:
    from pydantic import ValidationError

    try:
        scenario: Scenario = _adapter().validate_python(data)
    except ValidationError as error:
        # A misspelt key is why another is missing.
        found = sorted(error.errors(include_url=False), key=lambda one: one["type"] != UNKNOWN)
        keys, reason = _explained(found[0], data)
        raise _error(file, text, keys, reason) from None
    return scenario


def _error(file: Path, text: str, keys: tuple[str, ...], reason: str) -> ScenarioError:
    line = _line_of(text, keys)
    place = str(file) if line is None else f"{file}, line {line}"
    return ScenarioError(f"{place}: {reason}")


def _require_one_map(scenario: Scenario, text: str, file: Path) -> None:
    if scenario.map.path is not None and scenario.map.scene is not None:
        reason = "[map] has both a path and a scene; leave out one of them"
        raise _error(file, text, ("map", "scene"), reason)
    if scenario.map.path is None and scenario.map.scene is None:
        reason = '[map] has neither a path nor a scene; give one, as path = "dem.tif"'
        raise _error(file, text, ("map",), reason)


# Paths


def _resolved(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with its files seen from where the command runs."""
    seen: Any
    changed: dict[str, dict[str, Any]] = {}
    for entry in options():
        value = getattr(getattr(scenario, entry.section), entry.key)
        see = functools.partial(_joined if entry.section == "output" else _seen_from, folder)
        if entry.option.is_file and isinstance(value, tuple):
            seen = tuple(map(see, value))
        elif entry.option.is_file and value:
            seen = see(value)
        elif isinstance(value, dict) and entry.key in {"layers", "costs"}:
            seen = {
                name: dataclasses.replace(table, file=see(table.file))
                for name, table in value.items()
            }
        else:
            continue
        changed.setdefault(entry.section, {})[entry.key] = seen
    return scenario.overridden(changed)


def _joined(folder: Path, name: str) -> str:
    return str(folder / name)


def _seen_from(folder: Path, name: str) -> str:
    """FILE or FILE:LAYER. What GDAL opens by another name (NETCDF:..., /vsizip/...) stays."""
    if "://" in name or name.startswith("/vsi"):
        return name
    file, _, layer = name.rpartition(":")
    is_layer = bool(file and layer) and _exists(folder / file)
    is_other = ":" in name and not is_layer and not _exists(folder / name)
    return name if is_other else _joined(folder, name)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


# What is wrong, in words


def _explained(error: Mapping[str, Any], data: dict[str, Any]) -> tuple[tuple[str, ...], str]:
    """Where in the file an error of pydantic's is, and what it is."""
    keys = _keys_of(error["loc"], data)
    if error["type"] == UNKNOWN:
        return keys, _unknown(keys)
    if error["type"] == "missing" and isinstance(error["loc"][-1], str):
        return keys, f"{_named(keys)} has no {error['loc'][-1]!r}; give it one"
    value = functools.reduce(lambda table, key: table[key], keys, data)
    shown = " ".join(repr(value).split())
    shown = shown if len(shown) <= MOST_SHOWN else shown[:MOST_SHOWN] + " ..."
    return keys, f"{_named(keys)} is {shown}, but {_expected(keys)} is expected"


def _keys_of(location: Iterable[Any], data: Any) -> tuple[str, ...]:
    """The part of a location that is made of the file's keys; the rest is pydantic's own."""
    keys: list[str] = []
    for part in location:
        if not (isinstance(data, dict) and part in data):
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


def _nearest_option(key: str, section: str) -> str:
    """Of the section, else of another; options are also known by their name as a flag."""
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


# Lines


def _line_of(text: str, keys: tuple[str, ...]) -> int | None:
    """The line on which the entry of these keys begins; None where it is not found.

    The text is read up to some line, by tomllib as all of it: an entry stands where reading
    one more line brings it in.
    """
    lines, attempts = text.split("\n"), MOST_ATTEMPTS

    def read_to(end: int) -> tuple[int, Any]:
        """The last line up to ``end`` that a statement ends on, and what is in them."""
        nonlocal attempts
        for last in range(end, 0, -1):
            attempts -= 1
            if attempts < 0:
                break
            try:
                return last, tomllib.loads("\n".join(lines[:last]) + "\n")
            except ValueError:
                continue
        return 0, {}

    low, high = 0, len(lines)  # not in the first ``low`` lines; in the first ``high``
    if not keys or not _holds(read_to(high)[1], keys):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        end, data = read_to(middle)
        if _holds(data, keys):
            high = end
        elif end == low or attempts < 0:
            low = middle if attempts >= 0 else high
        else:
            low = middle
    return None if attempts < 0 else _first_of_statement(lines, high)


def _first_of_statement(lines: list[str], last: int) -> int:
    """The first line of the statement that ends on ``last``."""
    for first in range(last, max(last - MOST_ATTEMPTS, 0), -1):
        try:
            tomllib.loads("\n".join(lines[: first - 1]) + "\n")
        except ValueError:
            continue
        return first
    return last


def _holds(data: Any, keys: tuple[str, ...]) -> bool:
    for key in keys:
        if not (isinstance(data, dict) and key in data):
            return False
        data = data[key]
    return True
