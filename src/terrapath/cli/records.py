"""Goals as records for JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from ..planners import GoalAnswer


def goal_state(answer: GoalAnswer) -> str:
    """How the planning to a goal ended."""
    return "farther" if answer.solution is None else answer.solution.status.value


def goal_records(goals: Iterable[GoalAnswer]) -> list[dict[str, Any]]:
    """One for each goal, in the order given; ``farther`` needed no planning to know it."""
    return [
        {
            "goal": list(answer.goal),
            "status": goal_state(answer),
            "length": None if answer.solution is None else answer.solution.length,
            "lower_bound": answer.least if math.isfinite(answer.least) else None,
            "path": None
            if answer.solution is None or answer.solution.path is None
            else answer.solution.path.points.tolist(),
        }
        for answer in goals
    ]
