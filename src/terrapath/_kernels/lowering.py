"""Functions that run in Python as written, and in compiled kernels as LLVM's own instructions."""

from numba import types
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global


def lowered_by(build, resolve, *kinds):
    """Compile calls of a function by ``build``, for the argument types that ``resolve`` takes."""

    def declare(function):
        class Template(AbstractTemplate):
            key = function

            def generic(self, args, kws):
                return resolve(*args)

        infer_global(function, types.Function(Template))
        lower_builtin(function, *kinds)(build)
        return function

    return declare
