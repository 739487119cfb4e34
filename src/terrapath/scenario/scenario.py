"""A question to Terrapath: all options together, from a file, a map or a scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from ..errors import InputError
from .option import STRICT, Declared, Files, declared
from .sections import ConstraintsSection, MapSection, OutputSection, PlannerSection, RouteSection

# Of a scenario file, in its order.
SECTIONS: Mapping[str, type] = {
    "map": MapSection,
    "route": RouteSection,
    "constraints": ConstraintsSection,
    "planner": PlannerSection,
    "output": OutputSection,
}


def options(*sections: str) -> Iterator[Declared]:
    """The options of the sections, of all by default."""
    for name in sections or SECTIONS:
        for key, kind, default, option in declared(SECTIONS[name]):
            yield Declared(name, key, kind, default, option)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A question to Terrapath: all that ``terrapath plan`` can be told."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    map: MapSection = field(default_factory=MapSection)
    route: RouteSection = field(default_factory=RouteSection)
    constraints: ConstraintsSection = field(default_factory=ConstraintsSection)
    planner: PlannerSection = field(default_factory=PlannerSection)
    output: OutputSection = field(default_factory=OutputSection)

    def files(self) -> Iterator[str]:
        """All files that are named, to be read or written."""
        yield from self.inputs()
        yield from self.outputs()

    def inputs(self) -> Iterator[str]:
        """The files that are named to be read."""
        yield from self._named(*(name for name in SECTIONS if name != "output"))
        for table in (*self.map.layers.values(), *self.map.costs.values()):
            yield table.file

    def outputs(self) -> Iterator[str]:
        """The files that are named to be written."""
        yield from self._named("output")

    def _named(self, *sections: str) -> Iterator[str]:
        for entry in options(*sections):
            value = getattr(getattr(self, entry.section), entry.key)
            if entry.option.is_file and value:
                yield from [value] if isinstance(value, str) else value

    def overridden(self, given: Mapping[str, Mapping[str, Any]]) -> Scenario:
        """With the values given, by section and key; tables are merged name by name."""
        changed = {}
        for name, values in given.items():
            section = getattr(self, name)
            merged = {
                key: {**getattr(section, key), **value} if isinstance(value, dict) else value
                for key, value in values.items()
            }
            changed[name] = dataclasses.replace(section, **merged)
        return dataclasses.replace(self, **changed)


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
        _require_name(Path(file))
    return asked


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
    if not ending:  # as no scene has
        from ..problem.scenes import SCENES

        if where in SCENES:
            return Scenario(map=MapSection(scene=where))
    return Scenario(map=MapSection(path=where))


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
