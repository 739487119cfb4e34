"""Numba's two contexts, for types and for code, with a memory for what they find out.

At each ``+`` Numba tries again whether it adds arrays, dates or lists: once to find the types of
a kernel's variables, and once more to find the code that adds them.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import types
from numba.core.cpu import CPUContext
from numba.core.datamodel import models, register_default
from numba.core.typing.context import Context
from numba.core.typing.templates import Signature

# The signatures of Numba's own functions, by the type of the function and those of its arguments.
_found: dict[tuple[types.Function, tuple[types.Type, ...]], Signature] = {}


class Typing(Context):
    """Numba's context for types, with the memory."""

    def __init__(self, context: Context) -> None:
        self.__dict__ = context.__dict__  # shared: all that it knows, now and later

    def resolve_function_type(self, function: Any, args: tuple[types.Type, ...], kws: Any) -> Any:
        if kws or not isinstance(function, types.Function):
            return super().resolve_function_type(function, args, kws)
        signature = _found.get((function, args))
        if signature is None:
            signature = super().resolve_function_type(function, args, kws)
            _found[function, args] = signature
        return signature


class _Remembered(types.Function):
    """One of Numba's own functions, which looks up its signatures in the memory."""

    _function: types.Function

    def get_call_type(self, context: Typing, args: tuple[types.Type, ...], kws: Any) -> Any:
        return context.resolve_function_type(self._function, args, kws)


register_default(_Remembered)(models.OpaqueModel)  # like any function, it has no value


@cache
def _remembered(function: types.Function) -> types.Function:
    known = object.__new__(_Remembered)  # to call a type would intern it under a new number
    known.__dict__ |= {**function.__dict__, "_function": function}
    return known


class _CodeTyping(Typing):
    """The context for types while code is made."""

    def resolve_value_type(self, value: Any) -> types.Type:
        kind = super().resolve_value_type(value)
        return _remembered(kind) if type(kind) is types.Function else kind


class Target(CPUContext):
    """Numba's context for code, with the memory."""

    def __init__(self, context: CPUContext) -> None:
        self.__dict__ = {**context.__dict__, "typing_context": _CodeTyping(context.typing_context)}

    def get_function(self, function: Any, signature: Signature, _firstcall: bool = False) -> Any:
        """Do not look for new libraries at each function that is not known yet."""
        return super().get_function(function, signature, _firstcall=False)
