"""SymPy expressions in x1 and x2 as array functions with exact gradients."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import sympy
from sympy.core.function import AppliedUndef
from sympy.parsing.sympy_parser import parse_expr

from ..errors import InputError
from ..validation import Array
from .fitting import Function, Gradient

X1, X2 = sympy.symbols("x1 x2", real=True)


def _parse(text: str) -> sympy.Expr:
    try:
        expression = parse_expr(str(text), local_dict={"x1": X1, "x2": X2})
    except Exception as error:  # SymPy's parser raises any error that Python's does
        raise InputError(f"expression {text!r} is not understood: {error}") from None
    if not isinstance(expression, sympy.Expr):
        raise InputError(f"expression {text!r} is not a formula; write it in x1 and x2")
    unknown = sorted(str(symbol) for symbol in expression.free_symbols - {X1, X2})
    if unknown:
        raise InputError(
            f"expression {text!r} has the unknown names {unknown}; the variables are x1 and x2"
        )
    if expression.has(AppliedUndef, sympy.I):
        raise InputError(
            f"expression {text!r} is not a real formula of known functions; "
            "write it in x1 and x2 with SymPy's functions, as in exp(-x1**2)"
        )
    return expression


def _array_function(expressions: Sequence[sympy.Expr]) -> Callable[[Array, Array], Array]:
    functions: list[Callable[[Array, Array], npt.ArrayLike]] = [
        sympy.lambdify((X1, X2), e, "numpy") for e in expressions
    ]

    def evaluate(x: Array, y: Array) -> Array:
        # A constant expression gives a scalar even for arrays. The fit looks for values that
        # are not finite, and names their place.
        with np.errstate(all="ignore"):
            return np.stack([np.broadcast_to(f(x, y), x.shape) for f in functions])

    return evaluate


def compile_expressions(texts: Sequence[str]) -> tuple[Function, Gradient]:
    """The layers as a function of arrays, and their exact gradients."""
    if not texts:
        raise InputError("expressions is empty; a surface needs at least one layer")
    expressions = [_parse(text) for text in texts]
    along_x = _array_function([sympy.diff(e, X1) for e in expressions])
    along_y = _array_function([sympy.diff(e, X2) for e in expressions])
    return _array_function(expressions), lambda x, y: np.stack([along_x(x, y), along_y(x, y)])
