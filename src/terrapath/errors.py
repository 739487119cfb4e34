"""Errors, and warnings that a listener can receive.

Every message names the value, the limit and the remedy. A warning goes to the listener of the
current context, so each thread and each task has its own. Without a listener it becomes an
ordinary Python warning.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeAlias

import lazy_loader


class TerrapathError(Exception):
    """Base of every error that Terrapath raises on purpose. The command line exits with code 2."""


class InputError(TerrapathError, ValueError):
    """An argument that cannot be used."""


class OutsideSurfaceError(InputError):
    """A point where the surface is not defined."""


class BlockedError(InputError):
    """A point that no path can pass through, because it is not in free space."""


class FitError(InputError):
    """A function that no spline of a reasonable size approximates within the tolerance."""


class MapError(TerrapathError):
    """A map or another file that cannot be read, or cannot be written."""


class MissingExtraError(TerrapathError, ImportError):
    """An optional package is not installed. The message names the command that installs it."""


class CertificateError(TerrapathError):
    """A certificate that does not prove what it claims."""


class TerrapathWarning(UserWarning):
    """Base of every warning that Terrapath gives on purpose. The command prints it as one line."""


class KernelWarning(TerrapathWarning, RuntimeWarning):
    """Kernels are compiled more slowly or more often than they could be."""


class MapWarning(TerrapathWarning):
    """A map was not used exactly as it is: something was assumed, or taken as no data."""


class VectorWarning(TerrapathWarning):
    """A vector file was not used exactly as it is: something was assumed, or left out."""


class RepairedWarning(VectorWarning):
    """Geometries of a vector file were not valid, and were repaired."""


class GroundWarning(TerrapathWarning):
    """The planner may miss the shortest path on this kind of ground; another one does not."""


class SnapWarning(TerrapathWarning):
    """A start or a goal was not on free ground, and was moved there, as it was asked for."""


class UnfinishedWarning(TerrapathWarning, RuntimeWarning):
    """A path could not be refined or bounded. It is left out, or returned as it was before."""


Listener: TypeAlias = Callable[[TerrapathWarning], object]

PACKAGE = str(Path(__file__).parent) + os.sep

_listener: ContextVar[Listener | None] = ContextVar("terrapath_listener", default=None)


def tell(warning: TerrapathWarning) -> None:
    """Send a warning to the listener; without one, warn at the line that called Terrapath."""
    listener = _listener.get()
    if listener is None:
        warnings.warn(warning, stacklevel=_level_outside())
    else:
        listener(warning)


def tell_unfinished(what: str, error: Exception) -> None:
    """Warn that something could not be done, and say why."""
    reason = " ".join(f"{type(error).__name__}: {error}".split())
    tell(UnfinishedWarning(f"{what}: {reason}"))


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """Send the warnings of the ``with`` block to ``listener`` alone, each at once.

    Where such blocks are nested, the innermost listener gets them. A new thread starts without a
    listener.
    """
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


@contextmanager
def collecting() -> Iterator[list[TerrapathWarning]]:
    """Collect the warnings of the ``with`` block in a list, in their order.

    A listener outside the block gets each of them too, at once.
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
    """Ignore one category of warnings from one module of another library, from now on.

    The filter is never removed: all threads share the filters, so a temporary one would disturb
    other threads. For the same reason, name the module and the category exactly. Call this at
    each use, because other code may reset the filters.
    """
    pattern = re.escape(module) + r"\Z"
    if ("ignore", None, category, re.compile(pattern), 0) not in warnings.filters:
        warnings.filterwarnings("ignore", category=category, module=pattern)


def _level_outside() -> int:
    """The ``stacklevel`` for ``tell``: that of the first caller outside Terrapath.

    A module that is imported at its first use is imported by frames of Python and lazy_loader.
    """
    importers = (str(Path(m.__file__ or PACKAGE).parent) for m in (importlib, lazy_loader))
    inside = (PACKAGE, "<frozen importlib", *importers)
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(inside):
        if not frame.f_code.co_filename.startswith("<frozen importlib"):
            level += 1  # warnings do not count the frames of imports
        frame = frame.f_back
    return level
