"""From what a user names and asks to a scenario: a file's values, and over them those given."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .._support.files import require_name
from ..errors import InputError
from .option import Files
from .scenario import Scenario, options
from .sections import MapSection


def load(where: str | Path, **given: Any) -> Scenario:
    """A question to Terrapath, ready for ``answer``.

    where : a scenario file (``.toml``), a raster, or the name of a built-in scene.
    given : options over the file's, called as in a scenario file, with ``planner`` for the
    planner's name and ``output`` for the files of the route: ``start=(0, 0)``,
    ``planner="optimal"``, ``weights={"height": 10}``, ``max_slope=25``. Paths are seen from the
    working directory.
    Raises InputError for an option that is not known, with the nearest one that is, and for a
    value of the wrong kind; ScenarioError with the line of a scenario file.
    """
    if not isinstance(where, str | Path):
        raise InputError(
            f"where={type(where).__name__} is no path; name a scenario file, a raster or a scene, "
            "or plan on arrays with tp.read_surface, tp.Problem and tp.plan"
        )
    return assembled(str(where), _checked(given))


def assembled(where: str, given: Mapping[str, Mapping[str, Any]]) -> Scenario:
    """A scenario file's values, or those of a map or a scene, and over them the given ones.

    given : checked values by section and key. Raises InputError for a name no file can have.
    """
    asked = _at(where).overridden(given)
    for file in asked.files():
        require_name(Path(file))
    return asked


def _at(where: str) -> Scenario:
    from ..problem.scenes import SCENES

    if Path(where).suffix.lower() == ".toml":
        from .toml import read_scenario

        return read_scenario(where)
    return Scenario(map=MapSection(scene=where) if where in SCENES else MapSection(path=where))


def _checked(given: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Keywords of Python as checked values by section and key."""
    from .checked import WrongValueError, nearest_keyword, validated

    known = {entry.keyword: entry for entry in options()}
    asked: dict[str, dict[str, Any]] = {}
    for keyword, value in given.items():
        if keyword not in known:
            raise InputError(f"there is no option {keyword!r}; {nearest_keyword(keyword)}")
        entry = known[keyword]
        several = entry.type == Files and isinstance(value, str | Path)
        asked.setdefault(entry.section, {})[entry.key] = _plain([value] if several else value)
    try:
        checked = validated(asked)
    except WrongValueError as mistake:
        raise InputError(mistake.reason) from None
    return {
        section: {key: getattr(getattr(checked, section), key) for key in values}
        for section, values in asked.items()
    }


def _plain(value: Any) -> Any:
    """Paths as text, arrays and their numbers as Python's own."""
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value.tolist() if hasattr(value, "tolist") else value
