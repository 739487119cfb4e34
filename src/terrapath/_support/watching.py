"""Long work: its progress, stage by stage, and when it must stop."""

from __future__ import annotations

import time
from collections.abc import Callable

# Called with the name of a stage, how much of it is done, and how much there is in all.
Watch = Callable[[str, int, int], None]

# Called now and then with how many nodes are settled; returning True stops the work.
WatchCount = Callable[[int], bool | None]

# Asked by long work about every tenth of a second, or more often, whether it must stop; then it
# ends with what it has. Once True, always True, so that each loop of nested ones sees it.
MustStop = Callable[[], bool]

never: MustStop = bool  # bool() is False


def watch_nothing(stage: str, done: int, total: int) -> None:
    """Ignore the progress."""


def stop_after(seconds: float, must_stop: MustStop = never) -> MustStop:
    """True from so many seconds on, counted from now, or where ``must_stop`` is."""
    end = time.perf_counter() + seconds
    return lambda: time.perf_counter() >= end or must_stop()
