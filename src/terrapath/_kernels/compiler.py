"""The one decorator that every kernel carries, and dispatch on the surface's class."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

from numba import config, njit, types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.extending import overload

Kernel = Callable[..., Any]


def _package_stamp() -> str:
    """Hash of the source of every kernel module."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


_STAMP = _package_stamp()


class _PackageCache(FunctionCache):
    """Numba's on-disk cache, made stale by a change in *any* kernel module.

    Numba alone looks only at the file that defines a function, so an edited callee
    in another module would leave its callers running old code.
    """

    def __init__(self, function: Kernel) -> None:
        super().__init__(function)
        self._cache_file = IndexDataCacheFile(self.cache_path, self._impl.filename_base, _STAMP)


_kernels: list[Any] = []


def _compile(function: Kernel, *, inline: bool = False, allocates: bool = False) -> Kernel:
    if config.DISABLE_JIT:
        return function
    # Without Numba's run-time counting of references, which a call with a surface and a tree
    # spends more time on than on its work: the caller holds all arrays, and only a kernel that
    # makes one of its own needs the counting. Numba refuses to compile one that does without.
    dispatcher = njit(
        nogil=True,
        error_model="numpy",
        forceinline=inline,
        no_cfunc_wrapper=True,
        _nrt=allocates,
    )(function)
    dispatcher._cache = _PackageCache(function)
    _kernels.append(dispatcher)
    return dispatcher


def kernel(function: Kernel) -> Kernel:
    """Compile ``function`` at its first call and keep the machine code on disk.

    No ``fastmath`` and no contraction: the same inputs give the same bits everywhere
    the compiler runs, which determinism rests on.
    """
    return _compile(function)


def allocating_kernel(function: Kernel) -> Kernel:
    """A kernel that makes arrays of its own."""
    return _compile(function, allocates=True)


def inner_kernel(function: Kernel) -> Kernel:
    """A kernel that is always inlined: for the innermost loops, where a call costs.

    A surface handed through a call is a structure of arrays; inlining the metric
    halves the time of an edge.
    """
    return _compile(function, inline=True)


def cache_statistics() -> dict[str, int]:
    """How many kernels this process loaded from the on-disk cache and how many it compiled."""
    hits = sum(sum(dispatcher.stats.cache_hits.values()) for dispatcher in _kernels)
    misses = sum(sum(dispatcher.stats.cache_misses.values()) for dispatcher in _kernels)
    return {"loaded": hits, "compiled": misses}


_DISPATCH = """
def generic({arguments}):
    return implementations[type({surface})]({arguments})

def resolve({arguments}):
    implementation = select({surface})
    if implementation is None:
        return None
    return lambda {arguments}: implementation({arguments})
"""


def per_class(implementations: dict[type, Kernel]) -> Callable[[Kernel], Kernel]:
    """Turn a declaration ``f(surface, ...)`` into dispatch on the surface's class.

    Compiled callers resolve it at compile time through ``overload``; plain Python
    looks the class up. A surface is a ``NamedTuple`` of arrays and never a callback,
    which is what lets a compiled planner be found in the cache by the next process.
    """

    def select(surface: types.Type) -> Kernel | None:
        # A one-field tuple is typed as a NamedUniTuple, so match on the common base.
        if isinstance(surface, types.BaseNamedTuple):
            return implementations.get(surface.instance_class)
        return None

    def declare(declaration: Kernel) -> Kernel:
        names = declaration.__code__.co_varnames[: declaration.__code__.co_argcount]
        scope: dict[str, Any] = {"select": select, "implementations": implementations}
        exec(_DISPATCH.format(arguments=", ".join(names), surface=names[0]), scope)
        generic: Kernel = wraps(declaration)(scope["generic"])
        overload(generic, jit_options={"forceinline": True, "_nrt": False})(scope["resolve"])
        return generic

    return declare
