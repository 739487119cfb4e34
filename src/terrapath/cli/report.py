"""The result table of ``terrapath plan``."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator

import numpy as np

from ..certificate import Certificate
from ..eikonal import DistanceField
from ..problem import Problem, Solution, Status

# Of the routes that a planner found besides the best, so many are shown.
MOST_ALTERNATIVES = 5


def _amount(value: float, unit: str) -> str:
    """A number with its unit; millimetres on maps, micro-units on small scenes."""
    digits = ",.3f" if abs(value) >= 1000.0 else ".6f"
    return f"{value:{digits}} {unit}".rstrip()


def percent(share: float) -> str:
    """A share in percent, to three digits."""
    return f"{100.0 * share:.3g} %"


def _gap(gap: float, target: float | None) -> str:
    """The gap, and how it stands to the target where there is one."""
    if target is None:
        return percent(gap)
    met = "is met" if gap <= target else "is not met"
    return f"{percent(gap)}; the target of {percent(target)} {met}"


def _longer(length: float, than: float, unit: str) -> str:
    """A length, and how much more it is than the path's."""
    more = length / than - 1.0 if than > 0.0 else 0.0
    return f"{_amount(length, unit)} ({percent(more) + ' longer' if more > 1e-9 else 'as long'})"


def _point(problem: Problem, point: tuple[float, float]) -> str:
    """A point of the plane, and where it lies on Earth or another body."""
    surface = problem.surface
    shown = f"{point[0]:.10g}, {point[1]:.10g} {surface.unit}".rstrip()
    if surface.georeference is not None:
        longitude, latitude = surface.georeference.to_lonlat(np.array(point))
        shown += f"  (longitude {longitude:.6f}, latitude {latitude:.6f})"
    return shown


def _counter_line(solution: Solution) -> str:
    return ", ".join(f"{value:,} {name}" for name, value in solution.counters.items())


def _lengths(solution: Solution, target_gap: float | None) -> Iterator[tuple[str, str]]:
    """The path's length, what it is worth, and what it is compared with."""
    problem, path, length = solution.problem, solution.path, solution.length
    if path is None or length is None:
        return
    unit = problem.surface.unit
    yield "true length", _amount(length, unit)
    if solution.lower_bound is not None and solution.gap is not None:
        yield "lower bound", _amount(solution.lower_bound, unit) + "; no path is shorter"
        yield "gap", _gap(solution.gap, target_gap)
    if solution.unrefined is not None:
        yield "planner's path", _longer(solution.unrefined.length, length, unit)
    assert solution.cost is not None
    yield "planner's cost", _amount(solution.cost, unit)
    yield "straight-line length", _amount(problem.straight_length, unit)
    yield "climb", _amount(path.climb, problem.surface.layers[0].unit)
    if solution.alternatives:
        others = solution.alternatives[:MOST_ALTERNATIVES]
        yield "next best", ", ".join(_longer(other.length, length, unit) for other in others)


def _rows(solution: Solution, target_gap: float | None) -> Iterator[tuple[str, str]]:
    problem = solution.problem
    yield "status", f"{solution.status.value} ({solution.stopped_by})"
    yield "planner", solution.planner
    yield "start", _point(problem, problem.start)
    yield "goal", _point(problem, problem.goal)
    if problem.surface.georeference is not None:
        yield "planned in", problem.surface.georeference.name
    yield "surface", ", ".join(map(str, problem.surface.layers)) + f"; {problem.surface.fit}"
    yield from _lengths(solution, target_gap)
    yield "samples", f"{solution.samples:,}"
    yield "seconds", f"{solution.seconds:.3f}"
    if solution.counters:
        yield "counters", _counter_line(solution)


def _print_table(rows: Iterable[tuple[str, str]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="bold")
    table.add_column()
    for name, value in rows:
        table.add_row(name, Text(value))  # not markup: units stand in square brackets
    Console(highlight=False).print(table)


def print_report(solution: Solution, target_gap: float | None = None) -> None:
    """Print the table on standard output, and what went wrong on standard error.

    target_gap : the gap that was asked for, if any.
    """
    _print_table(_rows(solution, target_gap))
    if solution.status is not Status.SOLVED:
        reason = f"{solution.status.message} (stopped by: {solution.stopped_by})"
        print(f"terrapath: {reason}", file=sys.stderr)


def print_check(problem: Problem, certificate: Certificate, seconds: float) -> None:
    """What was proven of a certificate that holds."""
    unit, lattice = problem.surface.unit, certificate.lattice
    _print_table(
        [
            ("certificate", "holds"),
            ("start", _point(problem, problem.start)),
            ("goal", _point(problem, problem.goal)),
            ("proven bound", _amount(certificate.value, unit) + "; no path is shorter"),
            ("dual norm", f"at most {certificate.norm:.9g}"),
            ("cells", f"{lattice.nx - 1:,} x {lattice.ny - 1:,}"),
            ("seconds", f"{seconds:.3f}"),
        ]
    )


def print_field(problem: Problem, field: DistanceField, seconds: float) -> None:
    """What a distance field covers."""
    unit, lattice = problem.surface.unit, field.lattice
    reached = field.values[np.isfinite(field.values)]
    _print_table(
        [
            ("start", _point(problem, problem.start)),
            ("nodes", f"{lattice.nx:,} x {lattice.ny:,}, {percent(field.reached)} reached"),
            ("spacing", _amount(max(lattice.dx, lattice.dy), unit)),
            ("farthest", _amount(float(reached.max(initial=0.0)), unit)),
            ("seconds", f"{seconds:.3f}"),
        ]
    )
