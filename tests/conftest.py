"""What all tests need."""

import signal


def pytest_configure():
    # A shell starts background jobs with SIGINT ignored, and children inherit that: tests of
    # Ctrl-C would wait for a signal that nobody can see.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
