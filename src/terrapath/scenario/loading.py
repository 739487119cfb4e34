"""From what a user names and asks to a scenario: a file's values, and over them those given."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from ..errors import InputError
from .option import Files
from .scenario import Given, Scenario, options
from .sections import MapSection

# The map is named by itself, and how an answer is printed is the command's matter.
_NO_KEYWORDS = {"path", "scene", "json", "quiet"}


def load(where: str | Path, **given: object) -> Scenario:
    """A question to Terrapath, ready for ``answer``.

    where : a scenario file (``.toml``), a raster, or the name of a built-in scene.
    given : options that override the file's. Their names are the keys of a scenario file, but
    ``planner`` is the planner's name and ``output`` the files of the route: ``start=(0, 0)``,
    ``planner="optimal"``, ``weights={"height": 10}``, ``max_slope=25``. Paths are relative to the
    working directory.
    Raises InputError for an unknown option, with the nearest known one, and for a value of the
    wrong kind; ScenarioError with the line of a scenario file.
    """
    if not isinstance(where, str | Path):
        raise InputError(
            f"where={type(where).__name__} is no path; name a scenario file, a raster or a scene, "
            "or plan on arrays with tp.read_surface, tp.Problem and tp.plan"
        )
    return assembled(str(where), _checked(given))


def assembled(where: str, given: Given) -> Scenario:
    """The scenario of a scenario file, a map or a scene, with the given values instead of its own.

    given : checked values by section and key. Raises InputError for a name no file can have.
    """
    scenario = _at(where).overridden(given)
    for file in scenario.files():
        _require_name(Path(file))
    return scenario


def _require_name(path: Path) -> None:
    """Raise InputError for a name that no file can have."""
    try:
        path.exists()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{str(path)[:60]!r} cannot be a file: {reason}; check the path") from None


def _at(where: str) -> Scenario:
    ending = Path(where).suffix.lower()
    if ending == ".toml":
        from .toml import read_scenario

        return read_scenario(where)
    if not ending:  # names of scenes have none
        from ..problem.scenes import SCENES

        if where in SCENES:
            return Scenario(map=MapSection(scene=where))
    return Scenario(map=MapSection(path=where))


def _checked(given: Mapping[str, object]) -> Given:
    """Keyword arguments as checked values by section and key."""
    from .checked import WrongValueError, nearest_keyword, validated

    known = {entry.keyword: entry for entry in options() if entry.keyword not in _NO_KEYWORDS}
    values: dict[str, dict[str, object]] = {}
    for keyword, value in given.items():
        if keyword not in known:
            raise InputError(
                f"there is no option {keyword!r}; {nearest_keyword(keyword, known.values())}"
            )
        entry = known[keyword]
        several = entry.type == Files and isinstance(value, str | Path)
        values.setdefault(entry.section, {})[entry.key] = _plain([value] if several else value)
    try:
        checked = validated(values)
    except WrongValueError as mistake:
        raise InputError(mistake.reason) from None
    return {
        section: {key: getattr(getattr(checked, section), key) for key in keys}
        for section, keys in values.items()
    }


def _plain(value: object) -> object:
    """A value with paths as text, and arrays and their numbers as Python's own types."""
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple | Iterator):
        return [_plain(entry) for entry in value]
    return value.tolist() if hasattr(value, "tolist") else value
