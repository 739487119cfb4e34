"""The one decorator that every kernel carries: what is compiled, how, and where it is kept."""

from __future__ import annotations

import gc
import hashlib
import logging
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from llvmlite.binding import Linkage, parse_assembly
from numba import __version__ as numba_version
from numba import config, njit, types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.core.typing.context import Context

from .signatures import Target, Typing

Kernel = Callable[..., Any]

# Tells of each kernel that is compiled, for it was not found in the cache.
_LOG = logging.getLogger("terrapath.kernels")


def _package_stamp() -> str:
    """Hash of the source of every kernel module."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


_STAMP = _package_stamp()


class _CacheFile(IndexDataCacheFile):
    """Numba's, safe for several processes that compile at once.

    Numba numbers the files of a kernel's machine code, so that two processes that compile it
    for different types can write to the same one. Here a file is named after what it is of,
    and written before the index tells of it; at worst an entry is lost, and compiled again.
    """

    def save(self, key: Any, data: Any) -> None:
        digest = hashlib.sha256(self._dump((self._source_stamp, key))).hexdigest()[:16]
        name = f"{self._index_name.removesuffix('.nbi')}.{digest}.nbc"
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})


class _PackageCache:
    """Numba's on-disk cache, made stale by a change in *any* kernel module.

    Numba alone looks only at the file that defines a function, so an edited callee
    in another module would leave its callers running old code. The cache is looked for at the
    first call from Python, which most kernels never get.
    """

    def __init__(self, function: Kernel) -> None:
        self._function = function

    @cached_property
    def _cache(self) -> FunctionCache:
        found = FunctionCache(self._function)
        found._cache_file = _CacheFile(found.cache_path, found._impl.filename_base, _STAMP)
        return found

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Machine code from the disk, if it is there.

        Numba first imports all that it can compile, and SciPy's linear algebra with it. That
        takes as long as a plan, and what is compiled already needs none of it.
        """
        return self._cache._load_overload(signature, context)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)


# Kernels that other kernels call
#
# Numba makes machine code of every function that a compiled one calls, optimised together with
# all that it calls in turn: what lies at the bottom of six calls is optimised seven times, and
# nobody ever runs six of them. So a kernel has two sides here. Python calls the dispatcher,
# which makes machine code and keeps it on disk; kernels call its ``_Part``, which stops at
# LLVM's intermediate code. That is optimised once, in the machine code of who calls it.


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

    def compile_extra(self, function: Kernel) -> CompileResult:
        _LOG.info("compiling %s", function.__qualname__)
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

    def compile_extra(self, function: Kernel) -> CompileResult:
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


_kernels: list[Any] = []


def _compile(function: Kernel, *, inline: bool = False, allocates: bool = False) -> Kernel:
    if config.DISABLE_JIT:
        return function
    # Without Numba's run-time counting of references, which a call with a surface and a tree
    # spends more time on than on its work: the caller holds all arrays, and only a kernel that
    # makes one of its own needs the counting. Numba refuses to compile one that does without.
    dispatcher = njit(
        nogil=True,
        error_model="numpy",
        forceinline=inline,
        no_cfunc_wrapper=True,
        _nrt=allocates,
        pipeline_class=_KernelCompiler,
    )(function)
    dispatcher._cache = _PackageCache(function)

    @cache
    def part() -> _Part:
        options = {**dispatcher.targetoptions, "no_cpython_wrapper": True}
        return _Part(function, targetoptions=options, pipeline_class=_PartCompiler)

    dispatcher.get_call_template = lambda args, kws: part().get_call_template(args, kws)
    dispatcher.get_overload = lambda sig: part().get_overload(sig)
    dispatcher.part = part
    _kernels.append(dispatcher)
    return dispatcher


def kernel(function: Kernel) -> Kernel:
    """Compile ``function`` at its first call and keep the machine code on disk.

    No ``fastmath`` and no contraction: the same inputs give the same bits everywhere
    the compiler runs, which determinism rests on.
    """
    return _compile(function)


def allocating_kernel(function: Kernel) -> Kernel:
    """A kernel that makes arrays of its own."""
    return _compile(function, allocates=True)


def inner_kernel(function: Kernel) -> Kernel:
    """A kernel that is always inlined: for the innermost loops, where a call costs.

    A surface handed through a call is a structure of arrays; inlining the metric
    halves the time of an edge.
    """
    return _compile(function, inline=True)


def cache_statistics() -> dict[str, int]:
    """How many kernels this process loaded from the on-disk cache and how many it compiled."""
    hits = sum(sum(dispatcher.stats.cache_hits.values()) for dispatcher in _kernels)
    misses = sum(sum(dispatcher.stats.cache_misses.values()) for dispatcher in _kernels)
    return {"loaded": hits, "compiled": misses}


def cache_directory() -> Path | None:
    """Where compiled kernels are kept; None where none are compiled."""
    return Path(_kernels[0].stats.cache_path) if _kernels else None


def cached_files() -> list[str]:
    """Names of the files in the cache that hold these very kernels."""
    names = []
    for dispatcher in _kernels:
        file = dispatcher._cache._cache_file
        machine_code = file._load_index().values()
        names += [file._index_name, *machine_code] if machine_code else []
    return sorted(names)


def cache_key() -> str:
    """What machine code depends on: the kernels, the compiler, Python and the processor."""
    target = CPUDispatcher.targetdescr.target_context.codegen().magic_tuple()
    return "; ".join([_STAMP, numba_version, platform.python_version(), *map(str, target)])
