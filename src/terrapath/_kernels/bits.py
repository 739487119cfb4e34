"""Sets of the numbers 0 to 63, as the bits of an integer of 64 bits."""

from llvmlite import ir
from numba import types
from numba.core.typing.templates import signature

from .lowering import lowered_by

_INT = ir.IntType(64)
_ALL = 2**64 - 1


def _intrinsic(builder, name, *args):
    kinds = [arg.type for arg in args]
    function = builder.module.declare_intrinsic(name, [_INT], ir.FunctionType(_INT, kinds))
    return builder.call(function, args)


def _of_integers(build, count):
    """Compile calls of a function of so many integers by ``build``."""
    kinds = [types.int64] * count
    return lowered_by(build, lambda *_: signature(types.int64, *kinds), *kinds)


def _zeros(builder, name, bits):
    """The zeros below the lowest bit or above the highest; any number where there is no bit."""
    return _intrinsic(builder, name, bits, ir.Constant(ir.IntType(1), 1))


def _count(context, builder, signature, args):
    return _intrinsic(builder, "llvm.ctpop", *args)


@_of_integers(_count, 1)
def count_bits(bits):
    """How many numbers are in a set."""
    return (int(bits) & _ALL).bit_count()


def _lowest(context, builder, signature, args):
    return _zeros(builder, "llvm.cttz", args[0])


@_of_integers(_lowest, 1)
def lowest_bit(bits):
    """The least number of a set, which must have one."""
    return (int(bits) & -int(bits)).bit_length() - 1


def _after(context, builder, signature, args):
    bits, k = args
    turned = _intrinsic(builder, "llvm.fshr", bits, bits, builder.add(k, _INT(1)))
    return builder.add(_zeros(builder, "llvm.cttz", turned), _INT(1))


@_of_integers(_after, 2)
def steps_after(bits, k):
    """How far after k, on a ring of 64, the next number of a set is; the set must have one."""
    return next(step for step in range(1, 65) if int(bits) >> (k + step) % 64 & 1)


def _before(context, builder, signature, args):
    bits, k = args
    turned = _intrinsic(builder, "llvm.fshl", bits, bits, builder.sub(_INT(64), k))
    return builder.add(_zeros(builder, "llvm.ctlz", turned), _INT(1))


@_of_integers(_before, 2)
def steps_before(bits, k):
    """How far before k, on a ring of 64, the next number of a set is; the set must have one."""
    return next(step for step in range(1, 65) if int(bits) >> (k - step) % 64 & 1)
