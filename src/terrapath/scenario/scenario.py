"""All options together: a question to Terrapath."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

from ..errors import InputError
from .option import STRICT, Declared, declared
from .sections import ConstraintsSection, MapSection, OutputSection, PlannerSection, RouteSection

# Values by section and key.
Given: TypeAlias = Mapping[str, Mapping[str, object]]

# The sections of a scenario file, in its order.
SECTIONS: Mapping[str, type] = {
    "map": MapSection,
    "route": RouteSection,
    "constraints": ConstraintsSection,
    "planner": PlannerSection,
    "output": OutputSection,
}


def options(*sections: str) -> Iterator[Declared]:
    """The options of these sections; of all where none is named."""
    for name in sections or SECTIONS:
        for key, kind, default, option in declared(SECTIONS[name]):
            yield Declared(name, key, kind, default, option)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A question to Terrapath: the values of all options of ``terrapath plan``."""

    __pydantic_config__: ClassVar[dict[str, str | bool]] = STRICT

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

    def overridden(self, given: Given) -> Scenario:
        """The scenario with the given values in place of its own; tables are merged by name."""
        changed = {}
        for name, values in given.items():
            section = getattr(self, name)
            merged = {
                key: {**getattr(section, key), **value} if isinstance(value, dict) else value
                for key, value in values.items()
            }
            changed[name] = dataclasses.replace(section, **merged)
        return dataclasses.replace(self, **changed)


def require_scenario(value: object) -> None:
    """Raise InputError for what is no scenario."""
    if not isinstance(value, Scenario):
        raise InputError(f"scenario={value!r:.60} is none; make one with tp.scenario.load")
