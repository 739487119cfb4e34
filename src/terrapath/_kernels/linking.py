"""Kernels that are linked from the kernels they call, through internals of Numba.

Numba makes machine code of every function that a compiled one calls, optimised together with
all that it calls in turn. A function at the bottom of six calls is optimised seven times, and
six of the results never run. So a kernel has two sides here. Python calls the dispatcher,
which makes machine code and keeps it on disk. Kernels call its ``_Part``, which stops at
LLVM's intermediate code; that is optimised once, in the machine code of its caller.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any

from llvmlite.binding import Linkage, parse_assembly
from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.core.typing.context import Context

from ..errors import KernelWarning
from .cache import KernelCache
from .fallback import falling_back, is_plain
from .signatures import Target, Typing

Function = Callable[..., Any]


# The beginning of Numba's names for environments. A function's environment holds what it needs
# of its module.
_ENVIRONMENT = "_ZN08NumbaEnv"


class _Library(JITCodeLibrary):
    """What a kernel is compiled to, with the parts that it calls directly or through others."""

    def add_linking_library(self, library: Any) -> None:
        super().add_linking_library(library)
        # Callers before what they call: LLVM links only what is already referred to.
        if isinstance(library, _PartLibrary):
            self._linking_libraries.extend(library._linking_libraries)

    def _optimize_functions(self, ll_module: Any) -> None:
        """Do only what linking needs: everything is optimised together, later."""
        ll_module.data_layout = self._codegen._data_layout


class _KernelLibrary(_Library):
    """Machine code, for Python."""

    def _optimize_final_module(self) -> None:
        """Run all passes at once, without Numba's cheap ones for reference counting.

        Environments that nothing refers to may go. Those are the environments of all parts: they
        are for errors, which kernels do not raise, and loading the kernel would make each anew.
        LLVM must also know that no other kernel uses these parts. Then it inlines a part that is
        called once, and passes on only those arrays of a surface and a tree that are read.
        Passing on all arrays took a third of a tree's time.
        """
        for variable in self._final_module.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                variable.linkage = Linkage.linkonce_odr
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr and not function.is_declaration:
                function.linkage = Linkage.internal
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)

    def _get_module_for_linking(self) -> Any:
        """What is kept beside the machine code: only names, because callers link the part."""
        names = [function.name for function in self.get_defined_functions()]
        return parse_assembly("".join(f'define void @"{n}"() {{ ret void }}\n' for n in names))


class _PartLibrary(_Library):
    """Intermediate code alone: it is linked and optimised where a kernel calls it."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True


def _start_runtime() -> None:
    """Start what machine code that makes arrays needs: an allocator, which is compiled, too."""
    rtsys.initialize(CPUDispatcher.targetdescr.target_context)


# Numba's passes for what no kernel has: contexts, closures, branches that types decide, loops over
# tuples of several types, calls that Numba inlines, expressions with whole arrays. They change
# nothing here, and took a tenth of the time: each reads the whole function, and after each Numba
# computes again where every variable is in use.
_LEFT_OUT = frozenset(
    {
        "with_lifting",
        "inline_closure_likes",
        "dead_branch_prune",
        "make_function_op_code_to_jit_function",
        "inline_inlinables",
        "find_literally",
        "literal_unroll",
        "inline_overloads",
        "nopython_rewrites",
        "nopython_supported_feature_validation",
        "dump_parfor_diagnostics",
    }
)


class _LibraryCompiler(Compiler):
    """A compiler that writes into a library of ours, and runs only the passes that kernels need."""

    def __init__(self, typing: Context, target: CPUContext, *rest: Any) -> None:
        super().__init__(Typing(typing), Target(target), *rest)

    def define_pipelines(self) -> list[PassManager]:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [p for p in pipeline.passes if p[0].name() not in _LEFT_OUT]
        return pipelines

    def _use(self, library: _Library) -> None:
        if self.state.flags.nrt:
            library._reload_init.add(_start_runtime)  # callers that link it do so, too
        self.state.library = library


class _KernelCompiler(_LibraryCompiler):
    """The compiler of kernels that Python calls."""

    def compile_extra(self, function: Function) -> CompileResult:
        library = _KernelLibrary(self.state.targetctx.codegen(), function.__qualname__)
        library.enable_object_caching()
        self._use(library)
        with _collection_paused():
            return super().compile_extra(function)


@contextmanager
def _collection_paused() -> Iterator[None]:
    """Pause garbage collection, which would make a compilation take a quarter longer."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        _leave_to_full_collection()
        gc.enable()


def _leave_to_full_collection() -> None:
    """Move all objects to the oldest generation, so that the next small collection is fast."""
    if not gc.get_freeze_count():  # otherwise objects that the caller froze would be unfrozen
        gc.freeze()
        gc.unfreeze()


class _PartCompiler(_LibraryCompiler):
    """The compiler of parts, which kernels call."""

    def compile_extra(self, function: Function) -> CompileResult:
        library = _PartLibrary(self.state.targetctx.codegen(), function.__qualname__)
        self._use(library)
        self.state.flags.no_compile = True
        result = super().compile_extra(function)
        library.finalize()
        # Callers find a part by its entry point: here the library, which Python cannot call.
        self.state.targetctx.insert_user_function(library, result.fndesc, [library])
        return result._replace(entry_point=library)


def _settled(kind: types.Type) -> types.Type:
    """One type for all integers, whatever their width, and also where their value is known.

    Otherwise each combination of types would be compiled separately.
    """
    kind = types.unliteral(kind)
    if isinstance(kind, types.Integer) and kind.signed:
        return types.intp
    return kind


class _Part(CPUDispatcher):
    """The side of a kernel that other kernels call."""

    def get_call_template(self, args: tuple[types.Type, ...], kws: Any) -> Any:
        return super().get_call_template(tuple(map(_settled, args)), kws)

    def compile(self, args: tuple[types.Type, ...]) -> Any:
        """Compile without Numba's timers, which would disturb each other where parts call parts."""
        if args not in self.overloads:
            with self._compiling_counter:
                result = self._compiler.compile(args, None)
            self.overloads[tuple(result.signature.args)] = result
        return self.overloads[args].entry_point


class LinkedKernel(CPUDispatcher):
    """The side of a kernel that Python calls; other kernels are given its part."""

    @cached_property
    def part(self) -> _Part:
        """What kernels call."""
        options = {**self.targetoptions, "no_cpython_wrapper": True}
        return _Part(self.py_func, targetoptions=options, pipeline_class=_PartCompiler)

    @cached_property
    def plain(self) -> Any:
        """The same kernel as Numba compiles it, for where linking fails."""
        return self.make_plain(self.py_func)

    @property
    def _for_kernels(self) -> Any:
        return self.plain if is_plain() else self.part

    def get_call_template(self, args: tuple[types.Type, ...], kws: Any) -> Any:
        return self._for_kernels.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        return self._for_kernels.get_overload(sig)

    def compile(self, sig: Any) -> Any:
        if is_plain():
            return self._compile_plainly(sig)
        try:
            return super().compile(sig)
        except KernelWarning:  # an error where the caller asked for that
            raise
        except Exception as error:
            with falling_back(error):
                return self._compile_plainly(sig)

    def _compile_plainly(self, args: tuple[types.Type, ...]) -> Any:
        self.plain.compile(args)
        if args not in self.overloads:
            self.add_overload(self.plain.overloads[args])
        return self.overloads[args].entry_point


def link(
    function: Function, make_plain: Callable[[Function], Any], *, inline: bool, allocates: bool
) -> LinkedKernel:
    """Declare a kernel.

    allocates : it makes arrays of its own. Only such a kernel needs Numba's reference counting,
    because callers hold all other arrays; Numba refuses to compile it without. The counting takes
    longer than the work itself where a call has a surface and a tree.
    """
    options = {
        "nopython": True,
        "boundscheck": None,
        "nogil": True,
        "error_model": "numpy",
        "forceinline": inline,
        "no_cfunc_wrapper": True,
        "_nrt": allocates,
    }
    kernel = LinkedKernel(function, targetoptions=options, pipeline_class=_KernelCompiler)
    kernel.make_plain = make_plain
    kernel._cache = KernelCache(function)
    return kernel
