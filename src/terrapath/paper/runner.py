"""Trials in parallel processes, each stored as soon as it is done."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from types import TracebackType

from .._support.watching import Watch, watch_nothing
from .trials import Result, Store, Trial

# Held while a result is written, so that a worker that is told to end finishes the file first.
_SAVING = threading.Lock()


def _measure_and_save(trial: Trial[Result], store: Store) -> Result:
    result = trial.measure()
    with _SAVING:
        store.save(trial, result)
    return result


def _end_when_closed(lifeline: Connection) -> None:
    with suppress(EOFError, OSError):
        lifeline.recv()
    with _SAVING:
        os._exit(1)


def _prepare_worker(lifeline: Connection) -> None:
    """Leave Ctrl-C to the parent; the worker ends when the parent closes the pipe or is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_when_closed, args=(lifeline,), daemon=True).start()


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C; on POSIX, processes that are started meanwhile ignore it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # The resource tracker is started first, because its start would allow Ctrl-C again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Runner:
    """Runs trials, or loads their results from the store. It is a context manager.

    workers : the number of processes; with 1, the trials run in this one. watch : gets the
    progress. A trial that fails ends the run, and so does Ctrl-C; finished trials stay stored.
    """

    def __init__(self, store: Store, workers: int, watch: Watch = watch_nothing) -> None:
        self.store = store
        self.workers = workers
        self.watch = watch
        self._pool: ProcessPoolExecutor | None = None
        self._lifeline: Connection | None = None

    def __enter__(self) -> Runner:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._pool is None or self._lifeline is None:
            return
        if kind is not None:
            self._lifeline.close()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._lifeline.close()

    def run(self, stage: str, trials: Sequence[Trial[Result]]) -> list[Result]:
        """The trials' results, in the trials' order."""
        found: dict[Trial[Result], Result] = {}
        missing: dict[Trial[Result], None] = {}
        for trial in trials:
            result = self.store.load(trial)
            if result is None:
                missing[trial] = None
            else:
                found[trial] = result
        total = len(found) + len(missing)
        self.watch(stage, len(found), total)
        for trial, result in self._measure(list(missing)):
            found[trial] = result
            self.watch(stage, len(found), total)
        return [found[trial] for trial in trials]

    def _measure(self, trials: list[Trial[Result]]) -> Iterator[tuple[Trial[Result], Result]]:
        """Trials with their results, in the order in which they finish."""
        if self.workers == 1:
            for trial in trials:
                yield trial, _measure_and_save(trial, self.store)
            return
        if not trials:
            return
        with _interrupts_held():
            pool = self._started_pool()
            futures: dict[Future[Result], Trial[Result]] = {
                pool.submit(_measure_and_save, trial, self.store): trial for trial in trials
            }
        for future in as_completed(futures):
            yield futures[future], future.result()

    def _started_pool(self) -> ProcessPoolExecutor:
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            workers_end, self._lifeline = context.Pipe(duplex=False)
            self._pool = ProcessPoolExecutor(
                self.workers,
                mp_context=context,
                initializer=_prepare_worker,
                initargs=(workers_end,),
            )
        return self._pool
