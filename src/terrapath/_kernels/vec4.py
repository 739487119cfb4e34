"""Four numbers at once: an array (4,) in plain Python, one vector in compiled kernels.

LLVM turns loops over arrays into vector instructions, but neither a sum over the sixteen
coefficients of a spline nor an exponential in the middle of a formula. In Python each function
here runs as it is written; ``lowered_by`` gives the compiler the instructions that replace it.
A number beside a ``Four`` stands for four equal numbers. IEEE 754 defines every operation on a
``Four``, and their order is fixed, so the bits are the same on every processor.
"""

import math
import operator

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models, register_default
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing.templates import signature

from .lowering import lowered_by

_DOUBLE, _LANE = ir.DoubleType(), ir.IntType(32)
_VECTOR, _BITS = ir.VectorType(_DOUBLE, 4), ir.VectorType(ir.IntType(64), 4)


class FourType(types.Type):
    """The compiler's type of four numbers."""

    def __init__(self):
        super().__init__("Four")

    def can_convert_from(self, context, other):
        return Conversion.safe if isinstance(other, types.Number) else None

    def unify(self, context, other):
        return self if isinstance(other, types.Number) else None


_FOUR = FourType()


@register_default(FourType)
class _FourModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


@lower_cast(types.Number, FourType)
def _splat(context, builder, kind, _, number):
    number = context.cast(builder, number, kind, types.float64)
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, _LANE(0))
    places = ir.Constant(ir.VectorType(_LANE, 4), [0] * 4)
    return builder.shuffle_vector(first, ir.Constant(_VECTOR, ir.Undefined), places)


def _all_four(*args):
    """A ``Four`` is returned, and all arguments become one, where any argument is one."""
    return signature(_FOUR, *[_FOUR] * len(args)) if _FOUR in args else None


# Operators


def _arithmetic(instruction):
    return lambda context, builder, signature, args: getattr(builder, instruction)(*args)


for _operator, _instruction in {
    operator.add: "fadd",
    operator.sub: "fsub",
    operator.mul: "fmul",
    operator.truediv: "fdiv",
}.items():
    lowered_by(_arithmetic(_instruction), _all_four, FourType, FourType)(_operator)


def _lane(context, builder, signature, args):
    return builder.extract_element(*args)


def _lane_of(four, lane):
    is_lane = four == _FOUR and isinstance(lane, types.Integer)
    return signature(types.float64, four, types.intp) if is_lane else None


lowered_by(_lane, _lane_of, FourType, types.intp)(operator.getitem)


# Functions


def _put_together(context, builder, signature, args):
    vector = ir.Constant(_VECTOR, ir.Undefined)
    for lane, number in enumerate(args):
        vector = builder.insert_element(vector, number, _LANE(lane))
    return vector


@lowered_by(
    _put_together,
    lambda *args: signature(_FOUR, *[types.float64] * 4),
    *[types.float64] * 4,
)
def four(a, b, c, d):
    """Put four numbers together."""
    return np.array((a, b, c, d))


def _load(context, builder, signature, args):
    array = context.make_array(signature.args[0])(context, builder, args[0])
    shape = cgutils.unpack_tuple(builder, array.shape, 3)
    strides = cgutils.unpack_tuple(builder, array.strides, 3)
    first = cgutils.get_item_pointer2(
        context, builder, array.data, shape, strides, signature.args[0].layout, args[1:]
    )
    return builder.load(builder.bitcast(first, _VECTOR.as_pointer()), align=8)


@lowered_by(
    _load,
    lambda array, *_: signature(_FOUR, array, *[types.intp] * 3),
    types.Array,
    *[types.intp] * 3,
)
def four_in_row(array, k, j, i):
    """The four entries of a float64 array (., ., .) from (k, j, i) on."""
    return array[k, j, i : i + 4]


def _load_with(context, builder, signature, args):
    array = context.make_array(signature.args[0])(context, builder, args[0])
    shape = cgutils.unpack_tuple(builder, array.shape, 3)
    strides = cgutils.unpack_tuple(builder, array.strides, 3)
    first = cgutils.get_item_pointer2(
        context, builder, array.data, shape, strides, signature.args[0].layout, args[1:4]
    )
    vector = builder.insert_element(
        ir.Constant(_VECTOR, ir.Undefined), builder.load(first), _LANE(0)
    )
    for lane, offset in enumerate(args[4:], start=1):
        vector = builder.insert_element(
            vector, builder.load(builder.gep(first, [offset])), _LANE(lane)
        )
    return vector


@lowered_by(
    _load_with,
    lambda array, *_: signature(_FOUR, array, *[types.intp] * 6),
    types.Array,
    *[types.intp] * 6,
)
def four_entries(array, k, j, i, a, b, c):
    """Four entries of a float64 array (., ., .) in C order: (k, j, i), and those a, b, c after."""
    place = np.ravel_multi_index((k, j, i), array.shape)
    return array.ravel()[[place, place + a, place + b, place + c]]


def _intrinsic(builder, name, *args):
    """Call an intrinsic function of LLVM's, of numbers or of fours."""
    kind = args[0].type
    suffix = "v4f64" if kind == _VECTOR else "f64"
    function_type = ir.FunctionType(kind, [kind] * len(args))
    function = cgutils.get_or_insert_function(builder.module, function_type, f"{name}.{suffix}")
    return builder.call(function, args)


def _fma(builder, a, b, c):
    return _intrinsic(builder, "llvm.fma", a, b, c)


def _fused(context, builder, signature, args):
    return _fma(builder, *args)


@lowered_by(_fused, _all_four, FourType, FourType, FourType)
def fused(a, b, c):
    """The sum a b + c; rounded once where it is compiled."""
    return a * b + c


def _total(context, builder, signature, args):
    def half(first):
        places = ir.Constant(ir.VectorType(_LANE, 2), [first, first + 1])
        return builder.shuffle_vector(args[0], ir.Constant(_VECTOR, ir.Undefined), places)

    pair = builder.fadd(half(0), half(2))
    return builder.fadd(*(builder.extract_element(pair, _LANE(lane)) for lane in range(2)))


@lowered_by(_total, lambda v: signature(types.float64, _FOUR), FourType)
def total(v):
    """The sum of the four: (first + third) + (second + fourth)."""
    return (v[0] + v[2]) + (v[1] + v[3])


# Of a number or of four


def _of_number_or_four(build):
    """Compile calls of a function of one argument by ``build``, whichever it is."""

    def resolve(x):
        return signature(_FOUR, x) if x == _FOUR else signature(types.float64, types.float64)

    def declare(function):
        lower_builtin(function, FourType)(build)
        return lowered_by(build, resolve, types.float64)(function)

    return declare


def _of_numbers_or_fours(build, count, answer=None):
    """Compile calls of a function of so many numbers, or fours, by ``build``.

    answer : the type that is returned; that of the arguments where it is None.
    """

    def resolve(*args):
        kind = _FOUR if _FOUR in args else types.float64
        return signature(answer or kind, *[kind] * count)

    def declare(function):
        lower_builtin(function, *[FourType] * count)(build)
        return lowered_by(build, resolve, *[types.float64] * count)(function)

    return declare


def _where_above(context, builder, signature, args):
    return builder.select(builder.fcmp_ordered(">", *args[:2]), *args[2:])


@_of_numbers_or_fours(_where_above, 4)
def where_above(x, limit, a, b):
    """The number a where x is above the limit, else b."""
    return np.where(x > limit, a, b)[()]


def _larger(context, builder, signature, args):
    return builder.select(builder.fcmp_ordered(">", *args), *args)


@_of_numbers_or_fours(_larger, 2)
def larger(a, b):
    """The larger of two numbers."""
    return np.where(a > b, a, b)[()]


def _any_above(context, builder, signature, args):
    above = builder.fcmp_ordered(">", *args)
    if signature.args[0] != _FOUR:
        return above
    bits = ir.IntType(4)
    return builder.icmp_unsigned("!=", builder.bitcast(above, bits), bits(0))


@_of_numbers_or_fours(_any_above, 2, types.boolean)
def any_above(x, limit):
    """Is the number, or any of the four, above the limit?"""
    return bool(np.any(x > limit))


# Cody and Waite (1980): e^x = 2^n e^r with n = round(x / log 2), so that |r| <= (log 2) / 2;
# there the Taylor polynomial of degree 13 is within 1e-17. log 2 is split such that n times
# its first part is exact. A large number is added, so that the last bits of the sum hold n.
_LOWEST, _HIGHEST = -708.0, 709.0
_SHIFT = 1.5 * 2.0**52
_LOG2_HIGH, _LOG2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
_TAYLOR = [1.0 / math.factorial(k) for k in range(13, -1, -1)]


def _exp_of_four(builder, x):
    def constant(number):
        return ir.Constant(_VECTOR, [number] * 4)

    for sign, limit in (("<", _LOWEST), (">", _HIGHEST)):
        beyond = builder.fcmp_ordered(sign, x, constant(limit))
        x = builder.select(beyond, constant(limit), x)
    shifted = _fma(builder, x, constant(1.0 / math.log(2.0)), constant(_SHIFT))
    n = builder.fsub(shifted, constant(_SHIFT))
    r = _fma(builder, n, constant(-_LOG2_HIGH), x)
    r = _fma(builder, n, constant(-_LOG2_LOW), r)
    power = constant(_TAYLOR[0])
    for coefficient in _TAYLOR[1:]:
        power = _fma(builder, power, r, constant(coefficient))
    exponent = builder.shl(builder.bitcast(shifted, _BITS), ir.Constant(_BITS, [52] * 4))
    return builder.bitcast(builder.add(builder.bitcast(power, _BITS), exponent), _VECTOR)


def _exp(context, builder, signature, args):
    if signature.args[0] == _FOUR:
        return _exp_of_four(builder, args[0])
    return _intrinsic(builder, "llvm.exp", args[0])


@_of_number_or_four(_exp)
def exp(x):
    """e^x of a number or of four. Of four: within 1e-15, and limited to e^-708 to e^709."""
    return np.exp(x)


def _sqrt(context, builder, signature, args):
    return _intrinsic(builder, "llvm.sqrt", args[0])


@_of_number_or_four(_sqrt)
def sqrt(x):
    """The square root of a number or of four."""
    return np.sqrt(x)
