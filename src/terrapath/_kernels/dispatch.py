"""Dispatch on the surface's class."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from numba import config, types
from numba.core.typing.templates import AbstractTemplate, infer_global

from .compiler import Kernel

_DISPATCH = """
def dispatch({arguments}):
    return implementation_of(implementations, type({surface}))({arguments})
"""


def implementation_of(implementations: dict[type, Kernel], kind: type | None) -> Kernel | None:
    """The implementation for a class, or else for the class that it extends, its ``plain`` one."""
    while kind is not None and kind not in implementations:
        kind = getattr(kind, "plain", None)
    return None if kind is None else implementations[kind]


def per_class(implementations: dict[type, Kernel]) -> Callable[[Kernel], Kernel]:
    """Turn a declaration ``f(surface, ...)`` into dispatch on the surface's class.

    Compiled callers choose the implementation at compile time and call it directly; plain
    Python looks the class up. A surface is a ``NamedTuple`` of arrays and never a callback.
    Therefore the next process can find a compiled planner in the cache. A class whose fields
    extend those of another names it as ``plain``, and shares what is not implemented for itself.
    """

    def select(surface: types.Type) -> types.Dispatcher | None:
        # A one-field tuple is typed as a NamedUniTuple, so match on the common base.
        if not isinstance(surface, types.BaseNamedTuple):
            return None
        implementation = implementation_of(implementations, surface.instance_class)
        return None if implementation is None else types.Dispatcher(implementation)

    def declare(declaration: Kernel) -> Kernel:
        names = declaration.__code__.co_varnames[: declaration.__code__.co_argcount]
        scope: dict[str, Any] = {
            "implementations": implementations,
            "implementation_of": implementation_of,
        }
        exec(_DISPATCH.format(arguments=", ".join(names), surface=names[0]), scope)
        dispatch: Kernel = wraps(declaration)(scope["dispatch"])

        class Dispatch(AbstractTemplate):
            key = dispatch

            def generic(self, args: tuple[types.Type, ...], kws: Any) -> Any:
                chosen = select(args[0])
                return None if chosen is None else chosen.get_call_type(self.context, args, kws)

            def get_impl_key(self, signature: Any) -> Any:
                chosen = select(signature.args[0])
                return None if chosen is None else chosen.get_impl_key(signature)

        if not config.DISABLE_JIT:
            infer_global(dispatch, types.Function(Dispatch))
        return dispatch

    return declare
