"""What goes wrong with an input. Every message names the value, the limit and the remedy."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class TerrapathError(Exception):
    """Base of every error that Terrapath raises on purpose. The command exits with 2."""


class InputError(TerrapathError, ValueError):
    """An argument that cannot be used."""


class OutsideSurfaceError(InputError):
    """A point where the surface is not defined."""


class BlockedError(InputError):
    """A point that no path can be at."""


class FitError(InputError):
    """A function that no spline of a reasonable size follows to the asked tolerance."""


class MapError(TerrapathError):
    """A file that cannot be read as a map, or written."""


class MissingExtraError(TerrapathError, ImportError):
    """A package that not every installation has. The message names the command to install it."""


class CertificateError(TerrapathError):
    """A certificate that does not prove what it claims."""


class TerrapathWarning(UserWarning):
    """Base of every warning that Terrapath gives on purpose. The command shows it as one line."""


class KernelWarning(TerrapathWarning, RuntimeWarning):
    """Kernels are compiled more slowly or more often than they could be."""


class UnfinishedWarning(TerrapathWarning, RuntimeWarning):
    """A path could not be refined or bounded, and is left out or given as it was before."""


def warn_unfinished(what: str, error: Exception) -> None:
    """Tell what could not be done, and why."""
    reason = " ".join(f"{type(error).__name__}: {error}".split())
    tell(UnfinishedWarning(f"{what}: {reason}"))


_LISTENER: ContextVar[Callable[[TerrapathWarning], None] | None] = ContextVar(
    "listener", default=None
)


def tell(warning: TerrapathWarning) -> None:
    listener = _LISTENER.get()
    if listener is None:
        warnings.warn(warning, stacklevel=3)
    else:
        listener(warning)


@contextmanager
def told_to(listener: Callable[[TerrapathWarning], None]) -> Iterator[None]:
    before = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(before)


@contextmanager
def collecting() -> Iterator[list[TerrapathWarning]]:
    told: list[TerrapathWarning] = []
    outer = _LISTENER.get()

    def note(warning: TerrapathWarning) -> None:
        told.append(warning)
        if outer is not None:
            outer(warning)

    with told_to(note):
        yield told
