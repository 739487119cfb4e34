"""SymPy expressions in x1 and x2 as array functions with exact gradients."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import sympy

from ..errors import InputError
from ..validation import Array
from .fitting import Function, Gradient

X1, X2 = sympy.symbols("x1 x2", real=True)
NAMES: dict[str, sympy.Expr] = {"x1": X1, "x2": X2, "pi": sympy.pi, "E": sympy.E}

FUNCTIONS: dict[str, Callable[..., sympy.Expr]] = {
    name: getattr(sympy, name)
    for name in (
        "Abs", "Heaviside", "LambertW", "Max", "Min", "acos", "acosh", "acot", "acsc", "asec",
        "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "ceiling", "cos", "cosh", "cot", "coth",
        "csc", "erf", "erfc", "exp", "floor", "ln", "log", "sec", "sign", "sin", "sinc", "sinh",
        "sqrt", "tan", "tanh",
    )
}  # fmt: skip
FUNCTIONS |= {"abs": sympy.Abs, "max": sympy.Max, "min": sympy.Min}

OPERATORS: dict[type[ast.operator], Callable[[sympy.Expr, sympy.Expr], sympy.Expr]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
SIGNS: dict[type[ast.unaryop], Callable[[sympy.Expr], sympy.Expr]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}

MOST_LETTERS = 20_000
MOST_DIGITS = 400  # of a whole number, and of the whole number that a power is


def _parse(text: str) -> sympy.Expr:
    """The formula, built from its syntax tree: numbers, operators and known functions only.

    SymPy's own parser evaluates the text as Python, and so runs any code in it.
    """
    shown = f"expression {text!r:.200}"
    try:
        if len(str(text)) > MOST_LETTERS:
            raise InputError(f"{shown} has over {MOST_LETTERS:,} letters; sample it on a grid")
        tree = ast.parse(str(text).strip(), mode="eval")
        _require_known_names(tree, shown)
        expression = _built(tree.body, shown)
    except InputError:
        raise
    except (RecursionError, MemoryError):
        raise InputError(f"{shown} is nested too deeply; sample it on a grid") from None
    except Exception as error:  # a syntax error, and whatever SymPy raises for its arguments
        reason = " ".join(str(error).split())
        raise InputError(f"{shown} is not understood: {reason:.200}") from None
    if expression.has(sympy.I):
        raise InputError(
            f"{shown} is not a real formula of known functions; "
            "write it in x1 and x2 with SymPy's functions, as in exp(-x1**2)"
        )
    return expression


def _require_known_names(tree: ast.Expression, shown: str) -> None:
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    called = {node.func for node in ast.walk(tree) if isinstance(node, ast.Call)}
    used -= {node.id for node in called if isinstance(node, ast.Name)}
    if unknown := sorted(used - NAMES.keys()):
        raise InputError(f"{shown} has the unknown names {unknown}; the variables are x1 and x2")


def _built(node: ast.expr, shown: str) -> sympy.Expr:
    """The SymPy expression of a node of the syntax tree."""
    match node:
        case ast.Constant(value=bool() | complex()):
            pass
        case ast.Constant(value=int() | float() as number):
            _require_moderate(number, shown)
            return sympy.sympify(number)
        case ast.Name(id=name) if name in NAMES:
            return NAMES[name]
        case ast.UnaryOp(op=sign, operand=of) if type(sign) in SIGNS:
            return SIGNS[type(sign)](_built(of, shown))
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return _power(_built(left, shown), _built(right, shown), shown)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_built(left, shown), _built(right, shown))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            return FUNCTIONS[name](*(_built(argument, shown) for argument in arguments))
        case ast.Call(func=ast.Name(id=name)) if name not in FUNCTIONS:
            raise InputError(
                f"{shown} is not a real formula of known functions: {name!r:.60} is none of them; "
                "write it in x1 and x2 with SymPy's functions, as in exp(-x1**2)"
            )
    raise InputError(
        f"{shown} is not a formula: {ast.unparse(node)!r:.80} is no number, operator or known "
        "function; write it in x1 and x2"
    )


def _power(base: sympy.Expr, exponent: sympy.Expr, shown: str) -> sympy.Expr:
    """A power; SymPy computes one of whole numbers exactly, however many digits it has."""
    if base.is_Rational and exponent.is_Rational and base not in (0, 1, -1):
        digits = abs(exponent) * sympy.log(max(abs(base.p), base.q), 10).n()
        if digits > MOST_DIGITS:
            raise InputError(f"{shown} has a power with over {MOST_DIGITS} digits; lower it")
    return base**exponent


def _require_moderate(number: float, shown: str) -> None:
    if isinstance(number, int) and abs(number) >= 10**MOST_DIGITS:
        raise InputError(f"{shown} has a number with over {MOST_DIGITS} digits; lower it")


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
