"""The decorators of kernels, and how they compile: by ``linking`` or plainly by Numba."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any

from numba import config, njit

from . import cache as kernel_cache
from .fallback import describe, fall_back, is_plain, require_tested_version

Kernel = Callable[..., Any]


@cache
def _linking() -> ModuleType | None:
    """The module that compiles fast; None where it does not work with the installed Numba."""
    require_tested_version()
    if is_plain():
        return None
    try:
        from . import linking
    except Exception as error:  # whatever Numba has changed
        fall_back(describe(error))
        return None
    return linking


def _plain(function: Kernel, *, inline: bool) -> Kernel:
    """A kernel as Numba compiles it by itself, in a cache that notices every edit."""
    dispatcher = njit(nogil=True, error_model="numpy", forceinline=inline)(function)
    dispatcher._cache = kernel_cache.KernelCache(function)
    return dispatcher


def _compile(function: Kernel, *, inline: bool = False, allocates: bool = False) -> Kernel:
    if config.DISABLE_JIT:
        return function
    make_plain = partial(_plain, inline=inline)
    linking = _linking()
    if linking is None or is_plain():
        return make_plain(function)
    try:
        return linking.link(function, make_plain, inline=inline, allocates=allocates)
    except Exception as error:
        fall_back(describe(error))
        return make_plain(function)


def kernel(function: Kernel) -> Kernel:
    """Compile ``function`` at its first call and keep the machine code on disk.

    No ``fastmath`` and no contraction: results must be reproducible, so the same inputs give
    the same bits wherever the compiler runs.
    """
    return _compile(function)


def allocating_kernel(function: Kernel) -> Kernel:
    """A kernel that makes arrays of its own."""
    return _compile(function, allocates=True)


def inner_kernel(function: Kernel) -> Kernel:
    """A kernel that is always inlined: for the innermost loops, where a call costs.

    A surface is a structure of arrays, which is slow to pass to a call. Inlining the metric
    halves the time of an edge.
    """
    return _compile(function, inline=True)


def cache_statistics() -> dict[str, int]:
    """How many kernels this process loaded from the on-disk cache and how many it compiled."""
    return dict(kernel_cache.statistics)


def cache_directory() -> Path | None:
    """Where compiled kernels are kept; None where none are compiled."""
    return None if config.DISABLE_JIT else kernel_cache.directory()
