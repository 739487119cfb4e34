"""Numba's two views of functions, the one for types and the one for code, with a memory.

Numba tries anew at each ``+`` whether it is one of arrays, of dates or of two lists: once to
find the types of a kernel's variables, and again to find the code that adds them.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import types
from numba.core.cpu import CPUContext
from numba.core.datamodel import models, register_default
from numba.core.typing.context import Context
from numba.core.typing.templates import Signature

# The type of what one of Numba's own functions returns, by its type and those of its arguments.
_found: dict[tuple[types.Function, tuple[types.Type, ...]], Signature] = {}


class Typing(Context):
    """What is known of types."""

    def __init__(self, context: Context) -> None:
        self.__dict__ = context.__dict__  # all that it knows, and what it learns later

    def resolve_function_type(self, function: Any, args: tuple[types.Type, ...], kws: Any) -> Any:
        if kws or not isinstance(function, types.Function):
            return super().resolve_function_type(function, args, kws)
        signature = _found.get((function, args))
        if signature is None:
            signature = super().resolve_function_type(function, args, kws)
            _found[function, args] = signature
        return signature


class _Remembered(types.Function):
    """One of Numba's own functions, which looks into the memory for its signatures."""

    _function: types.Function

    def get_call_type(self, context: Typing, args: tuple[types.Type, ...], kws: Any) -> Any:
        return context.resolve_function_type(self._function, args, kws)


register_default(_Remembered)(models.OpaqueModel)  # as of any function: it has no value


@cache
def _remembered(function: types.Function) -> types.Function:
    known = object.__new__(_Remembered)  # a type called is interned, and would be numbered anew
    known.__dict__ |= {**function.__dict__, "_function": function}
    return known


class _CodeTyping(Typing):
    """What is known of types where code is made."""

    def resolve_value_type(self, value: Any) -> types.Type:
        kind = super().resolve_value_type(value)
        return _remembered(kind) if type(kind) is types.Function else kind


class Target(CPUContext):
    """What is known of code."""

    def __init__(self, context: CPUContext) -> None:
        self.__dict__ = {**context.__dict__, "typing_context": _CodeTyping(context.typing_context)}

    def get_function(self, function: Any, signature: Signature, _firstcall: bool = False) -> Any:
        """Without a look for new libraries at each function that is not known yet."""
        return super().get_function(function, signature, _firstcall=False)
