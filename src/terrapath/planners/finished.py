"""What is done with any planner's solution: refine the path, and prove how good it is."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Any

from ..certificates.certificate import Certificate
from ..certificates.search import FEW_NODES, GOOD_GAP, MOST_NODES, lower_bound
from ..errors import UnfinishedWarning, tell, tell_unfinished
from ..geodesics.refinement import refine
from ..problem import Problem, Solution, Status
from ..validation import require_bool, require_positive
from .base import (
    INTERRUPT,
    PROVING,
    REFINING,
    Callback,
    Planner,
    Progress,
    before_proof,
    least_limit,
    options_of,
    seconds_left,
    solve_within,
)

# A bound may be above the length of a path by this share, because of rounding.
ROUNDING = 1e-7


@dataclass(frozen=True, kw_only=True)
class Finished:
    """A planner whose paths are refined, and whose solutions get a lower bound.

    refine : take the path to the locally shortest one. bound : prove a lower bound on the
    length of every path, by some seconds' work. target_gap : improve the bound until
    (length - bound) / bound is no more than this; it implies ``bound``. time_limit : seconds
    for the planner and the finishing together; a fifth of it is kept for the bound where one is
    asked for. When time is up, the solution has the path and the bound that there are: a path
    refined in part, a bound that is no more than the chord.

    What the planner itself has refined or proven is not done again. An interrupted solution
    is left as it is. If the finishing fails, the planner's path is kept.
    """

    planner: Planner
    refine: bool = False
    bound: bool = False
    target_gap: float | None = None
    time_limit: float | None = None

    def __post_init__(self) -> None:
        require_bool(refine=self.refine, bound=self.bound)
        _require_limits(self.target_gap, self.time_limit)

    @property
    def name(self) -> str:
        """The planner's name on the command line."""
        return self.planner.name

    def _options(self) -> dict[str, Any]:
        """What was asked for; of two options of one name the planner's counts. None is left out."""
        asked = {"refine": self.refine, "bound": self.bound, "target_gap": self.target_gap}
        options = asked | {k: v for k, v in options_of(self.planner).items() if v is not None}
        return {name: value for name, value in options.items() if value is not None}

    def solve(
        self,
        problem: Problem,
        *,
        callback: Callback | None = None,
        time_limit: float | None = None,
        search_limit: float | None = None,
    ) -> Solution:
        """Plan and finish. ``callback`` sees the progress and may stop the planner or the bound.

        time_limit : seconds for this call; the lower of it and the option counts.
        search_limit : seconds for the planner alone, whatever the finishing takes.
        Where the callback stops the planner, its path is finished all the same.
        """
        limit = least_limit(self.time_limit, time_limit)
        is_proven = self.bound or self.target_gap is not None
        planning = before_proof(limit) if is_proven else limit
        searching = least_limit(planning, search_limit)
        solution = solve_within(self.planner, problem, callback, searching)
        return finish(
            replace(solution, options=self._options()),
            refine=self.refine,
            bound=self.bound,
            target_gap=self.target_gap,
            time_limit=limit,
            callback=callback,
        )


def finish(
    solution: Solution,
    *,
    refine: bool = False,
    bound: bool = False,
    target_gap: float | None = None,
    time_limit: float | None = None,
    callback: Callback | None = None,
) -> Solution:
    """A solution, refined and with a lower bound as asked; see ``Finished``."""
    is_proven = bound or target_gap is not None
    if refine and solution.status is not Status.INTERRUPTED:
        planning = before_proof(time_limit) if is_proven else time_limit
        rest = seconds_left(planning, solution.seconds)
        solution = refined(solution, time_limit=rest, callback=callback)
    if is_proven and solution.status is not Status.INTERRUPTED:
        rest = seconds_left(time_limit, solution.seconds)
        solution = with_bound(solution, target_gap=target_gap, time_limit=rest, callback=callback)
    return solution


def refined(
    solution: Solution, *, time_limit: float | None = None, callback: Callback | None = None
) -> Solution:
    """The same solution with its path taken to the locally shortest one.

    time_limit : seconds; when they are over, the path is the shortest one so far.
    ``cost`` stays what the planner returned; ``unrefined`` is the planner's own path.
    """
    problem, given = solution.problem, solution.path
    if given is None or solution.unrefined is not None or problem.start == problem.goal:
        return solution
    started, watcher = time.perf_counter(), _Watcher(callback)
    try:
        _announce(solution, REFINING, watcher)
        path = refine(problem, given, time_limit=time_limit)
    except KeyboardInterrupt:
        return _interrupted(solution)
    except Exception as error:
        if error is watcher.error:
            raise
        tell_unfinished("the path could not be refined and is the planner's own", error)
        return solution
    seconds = solution.seconds + time.perf_counter() - started
    return replace(solution, path=path, unrefined=given, seconds=seconds)


def with_bound(
    solution: Solution,
    *,
    target_gap: float | None = None,
    time_limit: float | None = None,
    callback: Callback | None = None,
) -> Solution:
    """The same solution with a proven lower bound on every path's value.

    With a travel model the bound is the chord: the straight line of constant grade.

    target_gap : improve the bound until the gap is no more than this; by default until a tenth of a
    percent, or for some seconds' work, by no clock. time_limit : seconds.
    ``callback`` sees each bound, and ends the search for a better one by returning True.
    After Ctrl-C the best bound proven so far is kept, if there is one.
    """
    _require_limits(target_gap, time_limit)
    if solution.path is None or _is_proven(solution, target_gap):
        return solution
    if solution.problem.travel is not None:
        return _with_chord(solution)
    started, before, watcher = time.perf_counter(), solution.seconds, _Watcher(callback)
    best: Certificate | None = None

    def watch(certificate: Certificate) -> bool:
        nonlocal best
        best = certificate
        seen = _progress(solution, PROVING, before + time.perf_counter() - started)
        seen = seen._replace(lower_bound=float(certificate))
        return watcher(seen)

    try:
        _announce(solution, PROVING, watcher)
        best = lower_bound(
            solution.problem,
            length=solution.path.length,
            target_gap=target_gap or GOOD_GAP,
            most_nodes=MOST_NODES if target_gap else FEW_NODES,
            time_limit=time_limit,
            watch=watch,
        )
    except KeyboardInterrupt:
        solution = _interrupted(solution)
    except Exception as error:
        if error is watcher.error:
            raise
        tell_unfinished("no better bound could be proven", error)
    solution = replace(solution, seconds=before + time.perf_counter() - started)
    return solution if best is None else with_certificate(solution, best)


def _with_chord(solution: Solution) -> Solution:
    """The solution bounded by the chord, which holds whatever is in between."""
    value = solution.value
    assert value is not None
    return replace(solution, lower_bound=min(solution.problem.chord, value))  # rounding apart


def with_certificate(solution: Solution, certificate: Certificate) -> Solution:
    """The solution with its bound, which is no more than the path's length.

    Above it by more than rounding, either of them is wrong, and no bound is better than that one.
    """
    value, length = certificate.value, solution.length
    assert length is not None
    if value > length * (1.0 + ROUNDING):
        contradiction = f"{value:.10g} contradicts the path's length, {length:.10g}"
        tell(UnfinishedWarning(f"a bound of {contradiction}; it is left out; please report this"))
        return solution
    return replace(solution, lower_bound=min(value, length), certificate=certificate)


def _require_limits(target_gap: float | None, time_limit: float | None) -> None:
    optional = {"target_gap": target_gap, "time_limit": time_limit}
    require_positive(**{name: value for name, value in optional.items() if value is not None})


def _is_proven(solution: Solution, target_gap: float | None) -> bool:
    if solution.certificate is None or solution.gap is None:
        return False
    return target_gap is None or solution.gap <= target_gap


def _interrupted(solution: Solution) -> Solution:
    return replace(solution, status=Status.INTERRUPTED, stopped_by=INTERRUPT)


def _progress(solution: Solution, stage: str, seconds: float) -> Progress:
    value = math.inf if solution.value is None else solution.value
    count = solution.samples
    return Progress(count, count, seconds, value, solution.lower_bound or 0.0, stage)


class _Watcher:
    """A callback, and the error that it raised: the caller's own, and no failure of a stage."""

    def __init__(self, callback: Callback | None) -> None:
        self.callback = callback
        self.error: Exception | None = None

    def __call__(self, progress: Progress) -> bool:
        try:
            return self.callback is not None and bool(self.callback(progress))
        except Exception as error:
            self.error = error
            raise


def _announce(solution: Solution, stage: str, watcher: _Watcher) -> None:
    """Show the callback which stage begins; here it can stop nothing."""
    watcher(_progress(solution, stage, solution.seconds))
