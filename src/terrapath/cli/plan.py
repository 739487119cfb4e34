"""``terrapath plan``: one route, from a scene or a map."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from ..errors import InputError
from .exit_codes import ExitCode
from .outputs import require_ending, require_outputs
from .question import Goal, HeightBand, Layers, Question, Start, Weights, Where

if TYPE_CHECKING:
    from ..planners import Finished
    from ..problem import Problem, Solution


@dataclass(frozen=True)
class Outputs:
    """Where the answer goes."""

    files: list[Path]
    plot: Path | None
    certificate: Path | None

    def check(self) -> None:
        """Find out before the planning whether all can be written."""
        from ..io.routes import require_known_format

        for path in self.files:
            require_known_format(path)
        if self.plot is not None:
            from ..plotting.figure import require_known_picture

            require_known_picture(self.plot)
        if self.certificate is not None:
            require_ending(self.certificate, "certificate", ".npz")
        optional = (self.plot, self.certificate)
        require_outputs([*self.files, *(path for path in optional if path is not None)])

    def write(self, solution: Solution) -> None:
        """Write every file that there is something to write into."""
        from ..io import write_route

        for path in self.files:
            write_route(solution, path)
        if self.certificate is not None:
            if solution.certificate is None:
                print("terrapath: no bound was proven to write a certificate of", file=sys.stderr)
            else:
                solution.certificate.save(self.certificate)
        if self.plot is not None:
            from ..plotting import plot_route

            plot_route(solution, self.plot)


def _require_agreement(
    planner: str, refine: bool, bound: bool, target_gap: float | None, certificate: Path | None
) -> None:
    """Raise InputError for options that contradict each other."""
    if planner == "optimal" and not (refine and bound):
        raise InputError(
            "planner optimal refines its routes and proves its bound by itself; leave out "
            "--no-refine and --no-bound, or choose fast-marching"
        )
    for option, value in (("--target-gap", target_gap), ("--certificate", certificate)):
        if value is not None and not bound:
            raise InputError(f"{option} asks for a bound and --no-bound for none; leave out one")


@contextmanager
def _remarks() -> Iterator[None]:
    """What could not be finished goes to standard error, one line each."""
    from ..planners import UnfinishedWarning

    with warnings.catch_warnings():
        warnings.simplefilter("always", UnfinishedWarning)
        show_others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if issubclass(category, UnfinishedWarning):
                print(f"terrapath: {message}", file=sys.stderr)
            else:
                show_others(message, category, *place)

        warnings.showwarning = cast("Any", show)
        yield


def _solve(planner: Finished, problem: Problem, quiet: bool) -> Solution:
    """Plan, with a progress bar where somebody is watching."""
    from .progress import progress_bar

    with _remarks(), progress_bar(problem, quiet) as callback:
        return planner.solve(problem, callback=callback)


def plan_command(
    where: Where,
    start: Start = None,
    goal: Goal = None,
    planner: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="rrt-star-r, rrt-star (chord baseline), rrt, dijkstra, a-star, fast-marching, "
            "geodesic-traversal or optimal.",
        ),
    ] = "rrt-star-r",
    refine: Annotated[
        bool,
        typer.Option(
            "--refine/--no-refine",
            help="Take the planner's path to the locally shortest one [default], or not.",
        ),
    ] = True,
    bound: Annotated[
        bool,
        typer.Option(
            "--bound/--no-bound",
            help="Prove how short any path can be [default], or not.",
        ),
    ] = True,
    target_gap: Annotated[
        float | None,
        typer.Option(
            metavar="G",
            help="Refine the bound until (length - bound) / bound is G "
            "[default: 0.001 with optimal, else the first bound will do].",
        ),
    ] = None,
    routes: Annotated[
        int | None,
        typer.Option(metavar="N", help="Distinct routes that optimal looks for [default: 3]."),
    ] = None,
    samples: Annotated[
        int | None, typer.Option(metavar="N", help="Samples to draw [default: 10000].")
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            metavar="S", help="Longest edge, map units [default: a twelfth of the region's side]."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(metavar="K", help="The same seed, the same route [default: 0]."),
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            metavar="D",
            help="Of the nodes of dijkstra, a-star, fast-marching and optimal, map units "
            "[default: a 250th of the region's longer side, or a cell of a finer map].",
        ),
    ] = None,
    neighbours: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Of a node of dijkstra and a-star: 8, 16 or 32 [default: 16]."
        ),
    ] = None,
    directions: Annotated[
        int | None,
        typer.Option(metavar="N", help="Rays of geodesic-traversal [default: 600]."),
    ] = None,
    radius_factor: Annotated[
        float | None,
        typer.Option(metavar="F", help="Times the least near radius of the theory [default: 1.5]."),
    ] = None,
    goal_bias: Annotated[
        float | None,
        typer.Option(metavar="P", help="Share of samples that are the goal [default: 0.05]."),
    ] = None,
    informed: Annotated[
        bool | None,
        typer.Option(
            "--informed/--uniform",
            help="Sample where better paths can be [default], or everywhere.",
        ),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Stop then, with the best so far."),
    ] = None,
    target_length: Annotated[
        float | None, typer.Option(metavar="LENGTH", help="Stop at a path this short, map units.")
    ] = None,
    height_band: HeightBand = None,
    layer: Layers = None,
    weight: Weights = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Write .geojson, .csv or .json; may be repeated."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the route: .png, .svg, .pdf or .jpg.")
    ] = None,
    certificate: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the proof of the bound, .npz, for `terrapath check`."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> int:
    """Plan one route on a surface, and prove how far from the shortest it can be.

    Exit codes: 0 solved, 2 bad input, 3 no path found within the limits, 4 proven
    unreachable, 130 interrupted (the best route so far is written).
    """
    _require_agreement(planner, refine, bound, target_gap, certificate)
    from ..planners import make_finished

    outputs = Outputs(output or [], plot, certificate)
    outputs.check()
    options = {
        "samples": samples,
        "step": step,
        "seed": seed,
        "spacing": spacing,
        "neighbours": neighbours,
        "directions": directions,
        "routes": routes,
        "radius_factor": radius_factor,
        "goal_bias": goal_bias,
        "informed": informed,
        "time_limit": time_limit,
        "target_length": target_length,
    }
    given = {name: value for name, value in options.items() if value is not None}
    chosen = make_finished(planner, refine=refine, bound=bound, target_gap=target_gap, **given)
    question = Question(
        where=where, start=start, goal=goal, height_band=height_band, layers=layer, weights=weight
    )
    solution = _solve(chosen, question.problem(), quiet or as_json)
    # Shown before it is written, so that a full disk loses no answer.
    _print(solution, as_json, target_gap)
    if solution.path is not None:
        outputs.write(solution)
    return exit_code(solution)


def _print(solution: Solution, as_json: bool, target_gap: float | None) -> None:
    if as_json:
        from ..io import route_record

        typer.echo(json.dumps(route_record(solution)))
        return
    from .report import print_report

    print_report(solution, target_gap)


def exit_code(solution: Solution) -> ExitCode:
    """The documented exit code for a solution."""
    from ..problem import Status

    return {
        Status.SOLVED: ExitCode.SOLVED,
        Status.NOT_FOUND: ExitCode.NOT_FOUND,
        Status.UNREACHABLE: ExitCode.UNREACHABLE,
        Status.INTERRUPTED: ExitCode.INTERRUPTED,
    }[solution.status]
