"""Scenario files: TOML that holds every option of ``terrapath plan``.

``sections`` declares what a file may contain. An error is one line with the file, the line, the
key, its value and what is expected.
"""

from __future__ import annotations

import dataclasses
import functools
import tomllib
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..validation import is_there
from .checked import WrongValueError, validated
from .option import Declared
from .scenario import Given, Scenario, options

# A scenario is one or two pages long; a file larger than this is something else.
MOST_BYTES = 1_000_000
# At most this many beginnings of the text are read to find the line of an error.
MOST_ATTEMPTS = 200


class ScenarioError(InputError):
    """A scenario file that cannot be used."""


def read_scenario(path: str | Path, given: Given | None = None) -> Scenario:
    """The scenario in a TOML file; paths in it are relative to the file's folder.

    given : what the user gives besides, and so allows; None where the file may reach anywhere.
    Raises ScenarioError with the file, the line, the key, its value and what is expected.
    """
    file = Path(path)
    text = _read_text(file)
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ScenarioError(f"{file} is nested too deeply to be a scenario") from None
    except ValueError as error:  # not TOML, or a number with too many digits
        raise ScenarioError(f"{file} is not valid TOML: {error}") from None
    scenario = _validated(data, text, file)
    _require_one_map(scenario, text, file)
    if scenario.map.allow_external:
        reason = "allow_external is for the user to give, not for a file; leave it out"
        raise _error(file, text, ("map", "allow_external"), reason)
    if given is not None:
        _require_inside(scenario, file, given)
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
        raise ScenarioError(f"{file} has over {MOST_BYTES:,} bytes; no scenario is that large")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ScenarioError(f"{file}, line {line}: not UTF-8; save it as such") from None


def _validated(data: dict[str, Any], text: str, file: Path) -> Scenario:
    try:
        return validated(data)
    except WrongValueError as mistake:
        raise _error(file, text, mistake.keys, mistake.reason) from None


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


class ExternalError(ScenarioError):
    """A scenario file that names files outside its folder, without leave."""


# Paths


def _require_inside(scenario: Scenario, file: Path, given: Given) -> None:
    """Raise ExternalError where a scenario from a file reaches out of its folder.

    given : what the user gives instead of the file's values, and so allows.
    """
    from .._support.external import ALLOW, is_inside, reaches_out

    for entry in options():
        if entry.key in given.get(entry.section, {}):
            continue
        is_output = entry.section == "output"
        for name in _names_of(entry, getattr(getattr(scenario, entry.section), entry.key)):
            if is_output and not is_inside(str(file.parent / name), file.parent):
                what = "writes to", "outside its folder"
            elif not is_output and reaches_out(name, file.parent):
                what = "reads", "which is elsewhere"
            else:
                continue
            raise ExternalError(
                f"{file} {what[0]} {name!r:.200}, {what[1]}; allow that by {ALLOW}, or give the "
                "file yourself"
            )


def _names_of(entry: Declared, value: object) -> list[str]:
    """The files that the value of an option names."""
    if isinstance(value, dict) and entry.key in {"layers", "costs"}:
        return [table.file for table in value.values()]
    if not entry.option.is_file or not value:
        return []
    return list(value) if isinstance(value, tuple) else [str(value)]


def _resolved(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with paths that lead from the working directory to its files."""
    resolved: object
    changed: dict[str, dict[str, object]] = {}
    for entry in options():
        value = getattr(getattr(scenario, entry.section), entry.key)
        resolve = functools.partial(_joined if entry.section == "output" else _input_in, folder)
        if entry.option.is_file and isinstance(value, tuple):
            resolved = tuple(map(resolve, value))
        elif entry.option.is_file and value:
            resolved = resolve(value)
        elif isinstance(value, dict) and entry.key in {"layers", "costs"}:
            resolved = {
                name: dataclasses.replace(table, file=resolve(table.file))
                for name, table in value.items()
            }
        else:
            continue
        changed.setdefault(entry.section, {})[entry.key] = resolved
    return scenario.overridden(changed)


def _joined(folder: Path, name: str) -> str:
    return str(folder / name)


def _input_in(folder: Path, name: str) -> str:
    """FILE or FILE:LAYER in a folder. Other names for GDAL (NETCDF:..., /vsizip/...) stay."""
    if "://" in name or name.startswith("/vsi"):
        return name
    file, _, layer = name.rpartition(":")
    is_layer = bool(file and layer) and is_there(folder / file)
    is_other = ":" in name and not is_layer and not is_there(folder / name)
    return name if is_other else _joined(folder, name)


# Lines


def _line_of(text: str, keys: tuple[str, ...]) -> int | None:
    """The line on which the entry with these keys begins; None where it is not found.

    tomllib gives no lines. So the beginning of the text is read, up to one line or another: the
    entry is on the line that must be added for it to appear. Bisection finds that line.
    """
    lines, attempts = text.split("\n"), MOST_ATTEMPTS

    def read_to(end: int) -> tuple[int, object]:
        """The last line up to ``end`` on which a statement ends, and the data up to there."""
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

    low, high = 0, len(lines)  # the entry is not in the first ``low`` lines, but in ``high``
    if not keys or not _holds(read_to(high)[1], keys):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        end, data = read_to(middle)
        if _holds(data, keys):
            high = end
        elif attempts < 0:
            return None
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


def _holds(data: object, keys: tuple[str, ...]) -> bool:
    for key in keys:
        if not (isinstance(data, dict) and key in data):
            return False
        data = data[key]
    return True
