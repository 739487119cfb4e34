"""The result table of ``terrapath plan``."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from ..problem import Solution, Status


def _amount(value: float, unit: str) -> str:
    """A number with its unit; millimetres on maps, micro-units on small scenes."""
    digits = ",.3f" if abs(value) >= 1000.0 else ".6f"
    return f"{value:{digits}} {unit}".rstrip()


def _point(solution: Solution, point: tuple[float, float]) -> str:
    """A point of the plane, and where it lies on Earth or another body."""
    surface = solution.problem.surface
    shown = f"{point[0]:.10g}, {point[1]:.10g} {surface.unit}".rstrip()
    if surface.georeference is not None:
        longitude, latitude = surface.georeference.to_lonlat(np.array(point))
        shown += f"  (longitude {longitude:.6f}, latitude {latitude:.6f})"
    return shown


def _counter_line(solution: Solution) -> str:
    return ", ".join(f"{value:,} {name}" for name, value in solution.counters.items())


def _rows(solution: Solution) -> Iterator[tuple[str, str]]:
    problem = solution.problem
    unit = problem.surface.unit
    yield "status", f"{solution.status.value} ({solution.stopped_by})"
    yield "planner", solution.planner
    yield "start", _point(solution, problem.start)
    yield "goal", _point(solution, problem.goal)
    if problem.surface.georeference is not None:
        yield "planned in", problem.surface.georeference.name
    yield "surface", ", ".join(map(str, problem.surface.layers)) + f"; {problem.surface.fit}"
    if solution.path is not None and solution.length is not None:
        assert solution.cost is not None
        yield "true length", _amount(solution.length, unit)
        yield "planner's cost", _amount(solution.cost, unit)
        yield "straight-line length", _amount(problem.straight_length, unit)
        yield "climb", _amount(solution.path.climb, problem.surface.layers[0].unit)
    if solution.alternatives:
        shown = ", ".join(_amount(path.length, unit) for path in solution.alternatives[:5])
        yield "next best", shown
    rate = f" ({solution.samples / solution.seconds:,.0f} a second)" if solution.seconds else ""
    yield "samples", f"{solution.samples:,}{rate}"
    yield "seconds", f"{solution.seconds:.3f}"
    if solution.counters:
        yield "counters", _counter_line(solution)


def print_report(solution: Solution) -> None:
    """Print the table on standard output, and what went wrong on standard error."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="bold")
    table.add_column()
    for name, value in _rows(solution):
        table.add_row(name, Text(value))  # not markup: units stand in square brackets
    Console(highlight=False).print(table)
    if solution.status is not Status.SOLVED:
        reason = f"{solution.status.message} (stopped by: {solution.stopped_by})"
        print(f"terrapath: {reason}", file=sys.stderr)
