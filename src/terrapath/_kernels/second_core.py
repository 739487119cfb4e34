"""A second process that compiles kernels while this one compiles others.

Numba compiles on one core. So the second process compiles what is needed later while this one
compiles what is needed now, into the same cache. It does so by a *rehearsal*: small work that
uses the kernels. Whatever happens to the second process, this one compiles what it does not
find: it may lose time, never an answer.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from contextlib import suppress
from types import TracebackType
from typing import Self

from . import cache

# What the second process runs, with the names of rehearsals. It uses a package above this one, so
# it cannot be imported here.
REHEARSALS = "terrapath.planners.warmup"

# The longest time to wait for the second process, seconds.
LONGEST_WAIT = 120.0


def rehearsal_name(work: str, surface_class: str) -> str:
    """What `warmup` calls some work on a class of surface."""
    return f"{work} on {surface_class}"


def cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class SecondCore:
    """A context: the first compilation in it starts a second process with these rehearsals.

    rehearsals : their names in `warmup`. The process starts only where there are two cores, and
    not after ``wait``. Where all kernels are in the cache nothing is compiled, so none is started.
    """

    def __init__(self, *rehearsals: str) -> None:
        self.rehearsals = rehearsals
        self.process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        cache.listeners.append(self.start)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        place: TracebackType | None,
    ) -> None:
        self._start_no_more()
        self._end()

    def start(self, kernel: str = "") -> None:
        """Start the process, if that helps; ``kernel`` is what is about to be compiled here."""
        self._start_no_more()
        if not self.rehearsals or not sys.executable or cores() < 2:
            return
        # Nothing is imported from the working directory. The standard input of the second process
        # closes when this process ends, however that happens.
        command = [sys.executable, "-P", "-m", REHEARSALS, *self.rehearsals]
        nowhere = subprocess.DEVNULL
        with suppress(OSError):
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=nowhere, stderr=nowhere
            )

    def wait(self) -> None:
        """Wait until the second process has compiled its kernels, or has failed to."""
        self._start_no_more()
        if self.process is not None:
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(LONGEST_WAIT)
        self._end()

    def _start_no_more(self) -> None:
        with suppress(ValueError):
            cache.listeners.remove(self.start)

    def _end(self) -> None:
        """End the process, if it still runs, and forget it."""
        process, self.process = self.process, None
        if process is None:
            return
        process.kill()
        process.wait()
        if process.stdin is not None:
            process.stdin.close()


def serve_first_core() -> None:
    """Be the second process: end when the first does, and at once where no kernel can be kept."""
    threading.Thread(target=_end_with_the_first, daemon=True).start()
    cache.listeners.append(_require_keeping)


def _end_with_the_first() -> None:
    os.read(sys.__stdin__.fileno() if sys.__stdin__ else 0, 1)
    os._exit(1)


def _require_keeping(kernel: str) -> None:
    if cache.unkept() is not None:
        sys.exit(1)
