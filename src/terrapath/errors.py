"""What goes wrong: errors, and warnings for whoever listens.

Every message names the value, the limit and the remedy. A warning goes to the listener of the
context, so each thread and each task has its own; where there is none, it is one of Python's.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeAlias


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


Listener: TypeAlias = Callable[[TerrapathWarning], object]

PACKAGE = str(Path(__file__).parent) + os.sep

_listener: ContextVar[Listener | None] = ContextVar("terrapath_listener", default=None)


def tell(warning: TerrapathWarning) -> None:
    """Hand a warning to the listener; where there is none, warn at the line that called us."""
    listener = _listener.get()
    if listener is None:
        warnings.warn(warning, stacklevel=_level_outside())
    else:
        listener(warning)


def tell_unfinished(what: str, error: Exception) -> None:
    """Tell what could not be done, and why."""
    reason = " ".join(f"{type(error).__name__}: {error}".split())
    tell(UnfinishedWarning(f"{what}: {reason}"))


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """Inside, ``listener`` gets each warning as it comes, and nobody else does.

    Of listeners inside one another the innermost gets it. A new thread starts without any.
    """
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


@contextmanager
def collecting() -> Iterator[list[TerrapathWarning]]:
    """The list that the warnings given inside are added to, in their order.

    Whoever listens outside hears of them as well, as they come.
    """
    collected: list[TerrapathWarning] = []
    outside = _listener.get()

    def note(warning: TerrapathWarning) -> None:
        collected.append(warning)
        if outside is not None:
            outside(warning)

    with told_to(note):
        yield collected


def silence(category: type[Warning], module: str) -> None:
    """From now on, ignore what is warned of in one module of a library that we read files with.

    Set once and for good: filters that come and go are seen by all threads. So name exactly
    the module and the category. Asked for at each use, for others may reset the filters.
    """
    pattern = re.escape(module) + r"\Z"
    if ("ignore", None, category, re.compile(pattern), 0) not in warnings.filters:
        warnings.filterwarnings("ignore", category=category, module=pattern)


def _level_outside() -> int:
    """The ``stacklevel``, for ``tell``, of the first caller that is not Terrapath's own."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        level, frame = level + 1, frame.f_back
    return level
