"""A child process that tries one thing after another, so that none of them ends the others."""

import multiprocessing
import sys

TRIES_A_CHILD = 40
MEMORY = 8 * 2**30  # bytes of addresses, most of which are never used


def limit_memory() -> None:
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def child(pipe, work, prepare) -> None:
    """Work on what the pipe sends; answers are ("stage", ...) and ("done", ...)."""
    limit_memory()
    prepare()
    pipe.send(("ready", None))
    while (task := pipe.recv()) is not None:
        pipe.send(("done", work(*task, tell=lambda stage: pipe.send(("stage", stage)))))


class Worker:
    """A child process, started anew when it is used up, hangs or dies.

    work(*task, tell=...) -> its answer; ``tell`` is called with the stage that begins.
    prepare() is called in each new child. patience : seconds that a stage may take. Both are
    functions of modules, for the child to find.
    """

    def __init__(self, work, prepare, patience: float) -> None:
        self.calls, self.patience = (work, prepare), patience
        self.process, self.left = None, 0

    def start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=child, args=(theirs, *self.calls), daemon=True)
        self.process.start()
        theirs.close()
        self.left = TRIES_A_CHILD
        if not self.pipe.poll(1800.0):
            raise TimeoutError("no child became ready in half an hour")
        self.pipe.recv()

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.process = None

    def tried(self, task):
        """(answer, None), or (None, what went wrong as (what, stage, details))."""
        if self.process is None or self.left == 0:
            self.stop()
            self.start()
        self.left -= 1
        self.pipe.send(task)
        stage = "the beginning"
        while True:
            if not self.pipe.poll(self.patience):
                self.stop()
                return None, ("hang", stage, f"no answer in {self.patience:g} s")
            try:
                kind, content = self.pipe.recv()
            except (EOFError, OSError):
                self.process.join()
                code, self.process = self.process.exitcode, None
                return None, ("died", stage, f"exit code {code}")
            if kind == "done":
                return content, None
            stage = content
