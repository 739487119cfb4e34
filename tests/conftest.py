"""What all tests need."""

import signal


def pytest_configure():
    # A shell starts background jobs with SIGINT ignored, and children inherit that: tests of
    # Ctrl-C would wait for a signal that nobody can see.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionstart(session):
    """Where several workers are about to start, compile once what all of them need.

    Each would compile the same kernels otherwise, and at worst lose what another has written.
    """
    options = session.config.option
    if getattr(options, "dist", "no") != "no" and not options.collectonly:
        _compile_kernels()


def _compile_kernels():
    from terrapath._kernels.compiler import cache_directory
    from terrapath.planners.warmup import warm_up

    if cache_directory() is not None:
        warm_up()
