"""The options one by one, as the sections declare them."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, get_type_hints

from .option import Option
from .problem_options import ConstraintsSection, MapSection, RouteSection
from .solution_options import OutputSection, PlannerSection

# Of a scenario file, in its order.
SECTIONS: Mapping[str, type] = {
    "map": MapSection,
    "route": RouteSection,
    "constraints": ConstraintsSection,
    "planner": PlannerSection,
    "output": OutputSection,
}


class Declared(NamedTuple):
    """An option with its place, as it was declared."""

    section: str
    key: str
    type: Any
    default: Any
    option: Option

    @property
    def parameter(self) -> str:
        """Its name among the arguments of a command."""
        return f"{self.section}_{self.key}"

    @property
    def flags(self) -> tuple[str, ...]:
        """Its names on the command line; none where the command names it in another way."""
        if self.key in {"path", "scene"}:
            return ()
        return self.option.flags or (f"--{self.key.replace('_', '-')}",)


@functools.cache
def declared(section: type) -> tuple[tuple[str, Any, Any, Option], ...]:
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


def options(*sections: str) -> Iterator[Declared]:
    """The options of the sections, of all by default."""
    for name in sections or SECTIONS:
        for key, kind, default, option in declared(SECTIONS[name]):
            yield Declared(name, key, kind, default, option)
