"""Work of equal parts on all cores."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from .._kernels.second_core import cores
from .watching import MustStop

Part = TypeVar("Part")


def on_all_cores(work: Callable[[Part], None], parts: Sequence[Part], must_stop: MustStop) -> bool:
    """Do the work of all parts, in any order; False where it must stop before all is done.

    work : runs on several threads at once, so most of it must be in kernels.
    """
    if len(parts) < 2 or cores() < 2:
        return _all_done(map(work, parts), len(parts), must_stop)
    with ThreadPoolExecutor(min(cores(), len(parts))) as pool:
        try:
            return _all_done(pool.map(work, parts), len(parts), must_stop)
        finally:
            pool.shutdown(cancel_futures=True)


def _all_done(results: Iterable[None], count: int, must_stop: MustStop) -> bool:
    """Wait for so many results; False where it must stop before the last."""
    return all(done == count or not must_stop() for done, _ in enumerate(results, start=1))
