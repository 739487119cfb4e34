"""Names, units and lengths as axes, titles and legends show them."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..io.routes.profile import clean
from ..problem import Problem, Solution, Status
from ..surface.georeference import in_hours, in_watt_hours

# Longer axes are in kilometres; metres.
LONGEST_IN_METRES = 10_000.0


def in_words(text: str) -> str:
    """A name from a map for matplotlib, which would read plain dollar signs as mathematics."""
    return clean(text).replace("$", r"\$")


def with_unit(name: str, unit: str, gap: str = " ") -> str:
    """A name with its unit, as axes show it."""
    return f"{in_words(name)}{gap}({in_words(unit)})" if unit else in_words(name)


def format_length(length: float, unit: str) -> str:
    """A length with its unit, as titles and legends show it."""
    text = f"{length:{'.4f' if length < 1000.0 else ',.0f'}} {unit}".rstrip()
    others = {"s": in_hours, "J": in_watt_hours}
    return f"{others[unit](length)} ({text})" if unit in others else text


def lengths_in_words(solution: Solution) -> str:
    """The length of a solution's path on the ground, and the value where it is another."""
    path = solution.path
    assert path is not None
    ground = format_length(path.ground_length, path.ground_unit)
    if path.ground_length == path.length and not solution.is_weighted:
        return f"length {ground}"
    return f"{ground} on the ground, value {format_length(path.value, solution.unit)}"


def nothing_in_words(solution: Solution) -> str:
    """That there is no path, and whether that is proven."""
    proven = " because none exists" if solution.status is Status.UNREACHABLE else ""
    return f"{solution.planner} found no path{proven}"


def straight_name(solution: Solution) -> str:
    """What the straight lines from stop to stop are called."""
    return "straight legs" if solution.legs else "straight line"


class AxisUnit(NamedTuple):
    """The unit of an axis of lengths."""

    name: str
    size: float  # map units

    @classmethod
    def for_lengths(cls, longest: float, unit: str) -> AxisUnit:
        """Kilometres where numbers in metres would be long, else the map's unit."""
        is_long = unit == "m" and longest >= LONGEST_IN_METRES
        return cls("km", 1000.0) if is_long else cls(unit, 1.0)

    def format(self, length: float, place: int | None = None) -> str:
        """The number that the axis shows for a length in map units; matplotlib gives ``place``."""
        return f"{length / self.size:.10g}"

    def label(self, name: str) -> str:
        """The axis label."""
        return f"{name} ({self.name})" if self.name else name

    def apply(self, axis: Any) -> None:
        """Show the numbers of an axis in this unit, all digits of them."""
        axis.set_major_formatter(self.format)


def label_axes(axes: Any, problem: Problem) -> None:
    """Label both axes with units; kilometres where numbers in metres would be long."""
    longer = max(problem.bounds.width, problem.bounds.height)
    shown = AxisUnit.for_lengths(longer, problem.surface.unit)
    for axis in (axes.xaxis, axes.yaxis):
        shown.apply(axis)
    axes.set_xlabel(shown.label("$x_1$"))
    axes.set_ylabel(shown.label("$x_2$"))
