"""The tables that ``terrapath plan``, ``check`` and ``field`` print."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from .._support.memory import peak_memory
from ..problem import Path, Problem, Solution, Status
from ..problem.solution import LARGE_GAP
from ..scenario.answers import goal_status
from ..surface import Layer, Surface
from ..surface.georeference import amount
from ..surface.ground import is_weighted, value_unit
from .console import percent, remark

if TYPE_CHECKING:
    from ..certificates.certificate import Certificate
    from ..distance.field import DistanceField
    from ..planners import GoalAnswer

# Units that are of no length.
AMOUNTS = ("s", "J", "J/kg")

# At most this many of a planner's alternative routes are shown.
MOST_ALTERNATIVES = 5


def _gap(solution: Solution, target: float | None) -> str:
    """The gap, whether it meets the target where there is one, and what may help if it is large."""
    gap, text = solution.gap, solution.gap_in_words
    assert gap is not None
    if target is not None:
        met = "is met" if gap <= target else "is not met"
        return f"{text}; the target of {percent(target)} {met}"
    if gap > LARGE_GAP and solution.planner != "optimal" and solution.problem.travel is None:
        return f"{text}; --planner optimal may find a better route, or a better bound"
    return text


def _grade(slope: float) -> str:
    """A slope as rise over run, and as an angle."""
    return f"{percent(slope)} ({math.degrees(math.atan(slope)):.3g} degrees)"


def _longer(length: float, than: float, unit: str) -> str:
    """A length, and how much longer it is than the path."""
    more = length / than - 1.0 if than > 0.0 else 0.0
    longer, same = (" more", "the same") if unit in AMOUNTS else (" longer", "as long")
    return f"{amount(length, unit)} ({percent(more) + longer if more > 1e-9 else same})"


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
    """The path's length, its lower bound and gap, and lengths to compare it with."""
    path, value = solution.path, solution.value
    if path is None or value is None:
        return
    unit = solution.unit
    yield "value", f"{amount(value, unit)}; what was minimised"
    if solution.lower_bound is not None:
        yield "lower bound", f"{amount(solution.lower_bound, unit)}; {solution.bound_in_words}"
        yield "gap", _gap(solution, target_gap)
    yield from _on_the_ground(path)
    yield from _switchbacks(path)
    if solution.unrefined is not None:
        yield "planner's path", _longer(solution.unrefined.value, value, unit)
    assert solution.cost is not None
    yield "planner's cost", amount(solution.cost, unit)
    if solution.problem.travel is None:
        yield "straight-line length", amount(solution.straight_length, unit)
        yield from _contributions(path)
    else:
        yield "straight line", amount(solution.straight_value, unit)
    if solution.alternatives:
        others = solution.alternatives[:MOST_ALTERNATIVES]
        yield "next best", ", ".join(_longer(other.value, value, unit) for other in others)


def _travel(problem: Problem) -> Iterator[tuple[str, str]]:
    """What was minimised in place of length, and where it comes from."""
    if (travel := problem.travel) is not None:
        yield "travel model", f"{travel!r}, for each horizontal metre; {travel.source}"


def _switchbacks(path: Path) -> Iterator[tuple[str, str]]:
    """How much of the route is so steep that its value is that of switchbacks."""
    share = path.in_switchbacks
    if share > 0.0:
        yield (
            "switchbacks",
            f"{percent(share)} of the route is steeper than the critical grades; there the value "
            "is that of switchbacks",
        )


def _on_the_ground(path: Path) -> Iterator[tuple[str, str]]:
    """What people ask of a route, whatever was minimised."""
    unit = path.ground_unit
    yield "ground length", amount(path.ground_length, unit)
    yield "climb, descent", f"{amount(path.climb, unit)}, {amount(path.descent, unit)}"
    yield "steepest grade", f"{_grade(path.steepest)} along the route"
    yield "side slope", f"{_grade(path.steepest_side)} at most, across the route"


def _rows(solution: Solution, target_gap: float | None) -> Iterator[tuple[str, str]]:
    problem = solution.problem
    surface = problem.surface
    yield "status", f"{solution.status.value} ({solution.stopped_by})"
    yield "planner", solution.planner
    yield from _travel(problem)
    yield "start", _point(problem, problem.start)
    for x, y in solution.stops[1:-1]:
        yield "via", _point(problem, (x, y))
    yield "goal", _point(problem, problem.goal)
    if surface.georeference is not None:
        yield "planned in", surface.georeference.name
    yield from _fit(surface)
    for layer in surface.layers:
        if problem.travel is None:
            yield f"layer {layer.name}", _weight(layer, surface.unit)
    for layer in surface.costs:
        yield f"cost {layer.name}", _exponent(layer, "length" if problem.travel is None else "pace")
    yield from _corridor(solution)
    yield from _constraints(solution)
    yield from _lengths(solution, target_gap)
    yield "samples", f"{solution.samples:,}"
    yield "seconds", f"{solution.seconds:.3f}"
    if solution.counters:
        yield "counters", _counter_line(solution)
    peak = peak_memory()
    if peak is not None:
        yield "memory", f"{peak / 1e6:,.0f} MB at most"


def _corridor(solution: Solution) -> Iterator[tuple[str, str]]:
    """The part of the map that was planned on at full resolution, and what is proven elsewhere."""
    corridor, unit = solution.corridor, solution.problem.surface.unit
    if corridor is None:
        return
    around = amount(corridor.half_width, unit)
    coarse = amount(corridor.coarse_length, solution.unit)
    yield (
        "corridor",
        f"{around} on both sides of a route of {coarse}, planned on the map read "
        f"{corridor.decimate} times coarser",
    )
    least = corridor.least_length(solution)
    if least is None:
        yield "elsewhere", "nothing is proven: a path there may cost less"
    else:
        chords = amount(least, solution.unit)
        verb = "costs less" if is_weighted(solution.problem.surface) else "is shorter"
        yield "elsewhere", f"no path on the map {verb} than {chords}, by chords"


def _each(surface: Surface, values: Iterable[float]) -> str:
    """A number for each layer, with the layer's name and unit."""
    layers = (*surface.layers, *surface.costs)
    shown = zip(layers, values, strict=False)
    return ", ".join(f"{layer.name} {value:.2g} {layer.unit}".rstrip() for layer, value in shown)


def _fit(surface: Surface) -> Iterator[tuple[str, str]]:
    """How the surface was fitted to the input, and how far it is from it."""
    fit = surface.fit
    unit = surface.layers[0].unit if len(surface.layers) == 1 else "in the layers' units"
    exact = fit.value_error == 0.0
    yield "surface", fit.method if exact else f"{fit.method}; error {fit.value_error:.2g} {unit}"
    if fit.smoothing is not None:
        largest = _each(surface, fit.smoothing.largest_change)
        yield (
            "smoothed",
            f"over {amount(fit.smoothing.scale, surface.unit)}; moved by at most {largest}; "
            f"rms {_each(surface, fit.smoothing.rms_change)}",
        )


def _weight(layer: Layer, unit: str) -> str:
    """What a change of the layer costs, in words."""
    one = f"1 {layer.unit}" if layer.unit else "1"
    if layer.weight == 0.0:
        return "does not count: its weight is 0"
    return f"a change of {one} counts as {layer.weight:g}{' ' + unit if unit else ''} of travel"


def _exponent(layer: Layer, what: str) -> str:
    """What the value of a cost layer does, in words."""
    power = "" if layer.weight == 1.0 else f" to the power of {layer.weight:g}"
    return f"its value{power} multiplies the {what}"


def _contributions(path: Path) -> Iterator[tuple[str, str]]:
    """The share of the value that each layer causes."""
    parts = (f"{percent(share)} {name}" for name, share in path.contributions.items())
    yield "value made of", ", ".join(parts)


def _constraints(solution: Solution) -> Iterator[tuple[str, str]]:
    """What limits the route besides the edge of the map."""
    problem, unit = solution.problem, solution.problem.surface.unit
    if problem.obstacles:
        yield "obstacles", f"{len(problem.obstacles):,}"
    if problem.radius:
        yield "vehicle radius", amount(problem.radius, unit) + ", kept from everything blocked"
    if problem.max_slope is not None:
        limit = problem.constraints.slope_limit
        by = "by Horn's formula" if limit is not None and limit.by_horn else "at their steepest"
        steep = problem.constraints.steep
        share = 0.0 if steep is None else float(steep.blocked.mean())
        yield (
            "slope limit",
            f"{problem.max_slope:g} degrees; {percent(share)} of the cells are steeper, {by}",
        )
    # In a corridor this area is the corridor, which is in the table already.
    if problem.keep_in is not None and solution.corridor is None:
        import shapely

        area = shapely.union_all(problem.keep_in).area
        yield "keep-in area", f"{area:,.6g} {unit}^2" if unit else "given"


def _print_table(rows: Iterable[tuple[str, str]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="bold")
    table.add_column()
    for name, value in rows:
        table.add_row(name, Text(value))  # not markup: square brackets are around units
    Console(highlight=False).print(table)


def _print_parts(heading: str, header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> None:
    """A table of legs or goals, one line for each."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, title=heading, title_justify="left")
    for name in header:
        table.add_column(name, justify="left" if name in {"to", "status"} else "right")
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False)
    console.print()
    console.print(table)


def _optional(value: float | None, unit: str) -> str:
    return "-" if value is None or not np.isfinite(value) else amount(value, unit)


def _print_legs(solution: Solution) -> None:
    unit = solution.unit
    rows = [
        (
            str(k),
            _place(leg.problem.goal),
            leg.status.value,
            _optional(leg.value, unit),
            _ground_length(leg),
            _optional(leg.lower_bound, unit),
            "-" if leg.gap is None else percent(leg.gap),
        )
        for k, leg in enumerate(solution.legs, start=1)
    ]
    header = ("leg", "to", "status", "value", "ground length", "lower bound", "gap")
    _print_parts("Legs", header, rows)


def _ground_length(solution: Solution | None) -> str:
    if solution is None or solution.path is None:
        return "-"
    return amount(solution.path.ground_length, solution.path.ground_unit)


def _print_goals(goals: Iterable[GoalAnswer], unit: str) -> None:
    rows = [
        (
            str(k),
            _place(answer.goal),
            goal_status(answer),
            _optional(None if answer.solution is None else answer.solution.value, unit),
            _ground_length(answer.solution),
            _optional(answer.least, unit),
        )
        for k, answer in enumerate(goals, start=1)
    ]
    _print_parts("Goals", ("goal", "to", "status", "value", "ground length", "lower bound"), rows)


def _place(point: tuple[float, float]) -> str:
    return f"{point[0]:.10g}, {point[1]:.10g}"


def print_report(
    solution: Solution, target_gap: float | None = None, goals: Iterable[GoalAnswer] = ()
) -> None:
    """Print the tables on standard output, and what went wrong on standard error.

    target_gap : None where none was given. goals : where there are several.
    """
    _print_table(_rows(solution, target_gap))
    if solution.legs:
        _print_legs(solution)
    if answers := list(goals):
        _print_goals(answers, solution.unit)
    if solution.status is not Status.SOLVED:
        is_proven = solution.status is Status.UNREACHABLE
        reason = solution.stopped_by if is_proven else f"stopped by: {solution.stopped_by}"
        remark(f"{solution.status.message} ({reason})")


def print_check(problem: Problem, certificate: Certificate, seconds: float) -> None:
    """What was proven of a certificate that holds."""
    unit, lattice = value_unit(problem.surface), certificate.lattice
    claim = "no path costs less" if is_weighted(problem.surface) else "no path is shorter"
    _print_table(
        [
            ("certificate", "holds"),
            ("start", _point(problem, problem.start)),
            ("goal", _point(problem, problem.goal)),
            ("lower bound", f"{amount(certificate.value, unit)}; {claim}"),
            ("dual norm", f"at most {certificate.norm:.9g}"),
            ("cells", f"{lattice.nx - 1:,} x {lattice.ny - 1:,}"),
            ("seconds", f"{seconds:.3f}"),
        ]
    )


def print_field(field: DistanceField, seconds: float) -> None:
    """What a distance field covers."""
    problem, lattice = field.problem, field.lattice
    assert problem is not None  # the command computes fields of problems only
    unit = problem.surface.unit
    reached = field.values[np.isfinite(field.values)]
    _print_table(
        [
            ("start", _point(problem, problem.start)),
            ("nodes", f"{lattice.nx:,} x {lattice.ny:,}, {percent(field.reached)} reached"),
            ("spacing", amount(max(lattice.dx, lattice.dy), unit)),
            ("farthest", amount(float(reached.max(initial=0.0)), value_unit(problem.surface))),
            ("seconds", f"{seconds:.3f}"),
        ]
    )
