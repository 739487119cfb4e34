"""Kernels that are linked from the kernels they call, by what Numba keeps to itself.

Numba makes machine code of every function that a compiled one calls, optimised together with
all that it calls in turn: what lies at the bottom of six calls is optimised seven times, and
nobody ever runs six of them. So a kernel has two sides here. Python calls the dispatcher,
which makes machine code and keeps it on disk; kernels call its ``_Part``, which stops at
LLVM's intermediate code. That is optimised once, in the machine code of who calls it.
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


# How Numba's names of environments begin: what a function needs of the module it stands in.
_ENVIRONMENT = "_ZN08NumbaEnv"


class _Library(JITCodeLibrary):
    """What a kernel is compiled to, with the parts that it calls directly or through others."""

    def add_linking_library(self, library: Any) -> None:
        super().add_linking_library(library)
        # Callers before what they call: LLVM links what something refers to already.
        if isinstance(library, _PartLibrary):
            self._linking_libraries.extend(library._linking_libraries)

    def _optimize_functions(self, ll_module: Any) -> None:
        """Only what is needed to link: all is optimised at once, later."""
        ll_module.data_layout = self._codegen._data_layout


class _KernelLibrary(_Library):
    """Machine code, for Python."""

    def _optimize_final_module(self) -> None:
        """All passes at once; Numba's own, cheap ones before them are for counted references.

        Environments that nothing refers to may go, which are those of all parts: they are for
        errors that kernels do not raise, and each is made anew where the kernel is loaded.
        Parts are for this kernel alone, which LLVM must know: then it puts one that is called
        once in place of its call, and hands on no more of a surface and a tree than is read.
        Calls with all of their arrays took a third of a tree's time.
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
        """What is kept beside the machine code: names alone, for callers link the part."""
        names = [function.name for function in self.get_defined_functions()]
        return parse_assembly("".join(f'define void @"{n}"() {{ ret void }}\n' for n in names))


class _PartLibrary(_Library):
    """Intermediate code alone: it is linked and optimised where a kernel calls it."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True


def _start_runtime() -> None:
    """What machine code that makes arrays needs first: an allocator, which is compiled, too."""
    rtsys.initialize(CPUDispatcher.targetdescr.target_context)


# Numba's passes for what no kernel has: contexts, closures, branches that types decide, loops over
# tuples of several types, calls to put in place of themselves, expressions with whole arrays. They
# change nothing here, and took a tenth of the time: each looks through all of a function, and Numba
# works out anew after it where each variable lives.
_SPARED = frozenset(
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
    """A compiler that keeps what it makes in a library of ours, and does only what kernels need."""

    def __init__(self, typing: Context, target: CPUContext, *rest: Any) -> None:
        super().__init__(Typing(typing), Target(target), *rest)

    def define_pipelines(self) -> list[PassManager]:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [p for p in pipeline.passes if p[0].name() not in _SPARED]
        return pipelines

    def _use(self, library: _Library) -> None:
        if self.state.flags.nrt:
            library._reload_init.add(_start_runtime)  # also by who links it and is loaded
        self.state.library = library


class _KernelCompiler(_LibraryCompiler):
    """What makes a kernel that Python calls."""

    def compile_extra(self, function: Function) -> CompileResult:
        library = _KernelLibrary(self.state.targetctx.codegen(), function.__qualname__)
        library.enable_object_caching()
        self._use(library)
        with _garbage_left():
            return super().compile_extra(function)


@contextmanager
def _garbage_left() -> Iterator[None]:
    """No look for garbage meanwhile: a compiler makes many objects, and a quarter longer so."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        _call_old()
        gc.enable()


def _call_old() -> None:
    """Leave all objects to the next full collection, for the next small one would look at them."""
    if not gc.get_freeze_count():  # else they would thaw that somebody froze
        gc.freeze()
        gc.unfreeze()


class _PartCompiler(_LibraryCompiler):
    """What makes a kernel that kernels call."""

    def compile_extra(self, function: Function) -> CompileResult:
        library = _PartLibrary(self.state.targetctx.codegen(), function.__qualname__)
        self._use(library)
        self.state.flags.no_compile = True
        result = super().compile_extra(function)
        library.finalize()
        # Callers find it by its entry point, which here is nothing that can be called.
        self.state.targetctx.insert_user_function(library, result.fndesc, [library])
        return result._replace(entry_point=library)


def _settled(kind: types.Type) -> types.Type:
    """One type for all integers, whatever their width and even where their value is known.

    Each combination of types would be compiled apart.
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
        """Without clocks, which would look at each other where parts call parts."""
        if args not in self.overloads:
            with self._compiling_counter:
                result = self._compiler.compile(args, None)
            self.overloads[tuple(result.signature.args)] = result
        return self.overloads[args].entry_point


class LinkedKernel(CPUDispatcher):
    """The side of a kernel that Python calls; kernels are handed on to another one."""

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

    Without Numba's run-time counting of references, which a call with a surface and a tree
    spends more time on than on its work: the caller holds all arrays, and only a kernel that
    makes one of its own needs the counting. Numba refuses to compile one that does without.
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
