"""Ask for a place in memory before it is read."""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import signature

from .lowering import lowered_by

_BYTE, _FLAG = ir.IntType(8).as_pointer(), ir.IntType(32)


def _fetch(context, builder, signature, args):
    array = context.make_array(signature.args[0])(context, builder, args[0])
    place = builder.bitcast(builder.gep(array.data, [args[1]]), _BYTE)
    kind = ir.FunctionType(ir.VoidType(), [_BYTE, _FLAG, _FLAG, _FLAG])
    fetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
    builder.call(fetch, [place, _FLAG(0), _FLAG(3), _FLAG(1)])
    return args[1]


def _resolve(array, place):
    is_row = isinstance(array, types.Array) and array.layout == "C"
    return signature(types.intp, array, types.intp) if is_row else None


@lowered_by(_fetch, _resolve, types.Array, types.intp)
def fetch(array, place):
    """Ask for an entry of an array in C order, by its number, which may be any."""
    return place
