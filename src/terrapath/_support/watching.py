"""The progress of long work, stage by stage."""

from __future__ import annotations

from collections.abc import Callable

# Called with the name of a stage, how much of it is done, and how much there is in all.
Watch = Callable[[str, int, int], None]


def watch_nothing(stage: str, done: int, total: int) -> None:
    """Ignore the progress."""
