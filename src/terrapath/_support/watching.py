"""Who watches long work done, stage by stage."""

from __future__ import annotations

from collections.abc import Callable

# Called with the name of a stage, what is done of it and all of it.
Watch = Callable[[str, int, int], None]


def watch_nothing(stage: str, done: int, total: int) -> None:
    """Nobody is watching."""
