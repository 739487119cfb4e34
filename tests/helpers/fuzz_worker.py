"""A child process that tries random maps, so that a hang or a crash ends one map alone."""

import multiprocessing
import sys

from trials import PLANNERS, try_seed

MAPS_A_CHILD = 40
MEMORY = 8 * 2**30  # bytes of addresses, most of which are never used


def limit_memory() -> None:
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def child(pipe, planners, extra, limit) -> None:
    """Try the maps that the pipe names; answers are ("stage", ...) and ("done", ...)."""
    limit_memory()
    # What is compiled here takes no time of a planner later.
    for kind in ("rough", "grids"):
        try_seed(kind, 1, planners=["field", *PLANNERS], limit=1.0)
    pipe.send(("ready",))
    while (task := pipe.recv()) is not None:
        words, trial = try_seed(
            *task,
            planners=planners,
            extra=extra,
            limit=limit,
            tell=lambda stage: pipe.send(("stage", stage)),
        )
        pipe.send(("done", words, [tuple(fault) for fault in trial.faults], trial.figures))


class Worker:
    """A child process, started anew when it is used up, hangs or dies."""

    def __init__(self, planners, extra, limit) -> None:
        self.options, self.limit = (planners, extra, limit), limit
        self.process, self.left = None, 0

    def start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=child, args=(theirs, *self.options), daemon=True)
        self.process.start()
        theirs.close()
        self.left = MAPS_A_CHILD
        if not self.pipe.poll(1800.0):
            raise TimeoutError("no child became ready in half an hour")
        self.pipe.recv()

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.process = None

    def tried(self, kind: str, seed: int):
        """(words, faults, figures) of a map."""
        if self.process is None or self.left == 0:
            self.stop()
            self.start()
        self.left -= 1
        self.pipe.send((kind, seed))
        stage, patience = "the beginning", 3.0 * self.limit + 30.0
        while True:
            if not self.pipe.poll(patience):
                self.stop()
                return "", [("hang", stage, f"no answer in {patience:g} s")], {}
            try:
                answer = self.pipe.recv()
            except (EOFError, OSError):
                self.process.join()
                code = self.process.exitcode
                self.process = None
                return "", [("died", stage, f"exit code {code}")], {}
            if answer[0] == "done":
                return answer[1:]
            stage = answer[1]
