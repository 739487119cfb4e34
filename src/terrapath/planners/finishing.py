"""What is done with any planner's answer: refine the path, and prove how good it is."""

from __future__ import annotations

import time
from dataclasses import replace

from ..bounding import lower_bound
from ..certificate import Certificate
from ..problem import Solution
from ..refinement import refine


def refined(solution: Solution) -> Solution:
    """The same solution with its path taken to the locally shortest one.

    ``cost`` stays what the planner believed; ``unrefined`` is the planner's own path.
    """
    if solution.path is None or solution.problem.start == solution.problem.goal:
        return solution
    started = time.perf_counter()
    path = refine(solution.problem, solution.path)
    return replace(
        solution,
        path=path,
        unrefined=solution.path,
        seconds=solution.seconds + time.perf_counter() - started,
    )


def bounded(
    solution: Solution, *, target_gap: float | None = None, time_limit: float | None = None
) -> Solution:
    """The same solution with a proven lower bound on every path's length.

    target_gap : refine the bound until the gap is met. time_limit : seconds.
    """
    if solution.path is None or solution.certificate is not None:
        return solution
    certificate = lower_bound(
        solution.problem,
        length=solution.path.length,
        target_gap=target_gap,
        time_limit=time_limit,
    )
    return with_certificate(solution, certificate)


def with_certificate(solution: Solution, certificate: Certificate) -> Solution:
    """The solution with its bound; rounding apart, no bound is above a path's length."""
    assert solution.length is not None
    value = min(certificate.value, solution.length)
    return replace(solution, lower_bound=value, certificate=certificate)
