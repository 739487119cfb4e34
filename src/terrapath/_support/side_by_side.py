"""Work of equal parts on all cores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
        for part in parts:
            work(part)
            if must_stop():
                return False
        return True
    with ThreadPoolExecutor(min(cores(), len(parts))) as pool:
        try:
            for _ in pool.map(work, parts):
                if must_stop():
                    return False
        finally:
            pool.shutdown(cancel_futures=True)
    return True
