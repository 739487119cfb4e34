"""Machine code on disk, for the next process: one file for each kernel and types of arguments.

Numba's own cache is not used. It notices an edit only in the file that defines a function, so a
kernel would go on with old code of those it calls; it trusts what it reads, and machine code
with one wrong bit ends the process; and where it cannot write, the call fails. Here a file is
named after all that its machine code depends on, and begins with a checksum. Whatever is wrong
with a file, a folder or a disk costs the time to compile and nothing else.
"""

from __future__ import annotations

import hashlib
import logging
import pickle
import platform
import re
import uuid
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import __version__ as numba_version, config

from ..errors import KernelWarning, tell
from .fallback import is_plain

# Logs each kernel that is compiled because the cache does not hold it.
_LOG = logging.getLogger("terrapath.kernels")

# Called with the name of each such kernel before it is compiled.
listeners: list[Callable[[str], object]] = []

# What this process did.
statistics = {"loaded": 0, "compiled": 0}

_ENDING, _CHECKSUM = ".nbc", hashlib.sha256().digest_size  # bytes

_KERNELS = Path(__file__).parent


def package_stamp(folder: Path = _KERNELS) -> str:
    """Hash of the names and the source of every kernel module, in sub-folders as well.

    A kernel calls others in any module, so an edit in one of them makes all kernels stale.
    """
    digest = hashlib.sha256()
    # Editors leave links that lead nowhere, as .#name.py, beside the files that they change.
    for source in sorted(path for path in folder.rglob("*.py") if path.is_file()):
        digest.update(f"{source.relative_to(folder).as_posix()}\n".encode())
        digest.update(hashlib.sha256(source.read_bytes()).digest())
    return digest.hexdigest()


STAMP = package_stamp()


@cache
def _own_stamp(source: Path) -> str:
    """Hash of a file outside the package, as tests have with kernels of their own."""
    if source.is_relative_to(_KERNELS):
        return ""
    return hashlib.sha256(source.read_bytes()).hexdigest()


def environment() -> str:
    """What machine code depends on: the kernels, the compiler, Python and the processor."""
    return _environment("plain" if is_plain() else "linked")


@cache
def _environment(compilation: str) -> str:
    from numba.core.registry import cpu_target

    target = cpu_target.target_context.codegen().magic_tuple()
    parts = [STAMP, compilation, numba_version, platform.python_version(), *map(str, target)]
    return "; ".join(parts)


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def directory() -> Path:
    """Where machine code is kept: in NUMBA_CACHE_DIR, or where Numba would keep it."""
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR) / "terrapath"
    try:
        from numba.core.caching import FunctionCache

        return Path(FunctionCache(package_stamp).cache_path)
    except Exception:  # Numba finds no folder that it can write to, or has changed
        return _KERNELS / "__pycache__"


# Files


def _checksum(path: Path, content: bytes) -> bytes:
    """Of name and content: a file under another file's name is as wrong as a damaged one."""
    return hashlib.sha256(path.name.encode() + b"\n" + content).digest()


def read_sound(path: Path) -> bytes | None:
    """What was written to a file; None where it is missing, damaged or cannot be read."""
    try:
        if not path.is_file():  # to read a pipe is to wait for it
            return None
        whole = path.read_bytes()
    except (OSError, MemoryError):
        return None
    content = whole[_CHECKSUM:]
    return content if whole[:_CHECKSUM] == _checksum(path, content) else None


def _write(path: Path, content: bytes) -> None:
    """Write a file whole, in place of whatever is there: several processes may do it at once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(OSError):
        path.rmdir()  # a folder in its place
    temporary = path.with_name(f".terrapath-{uuid.uuid4().hex}")
    try:
        temporary.write_bytes(_checksum(path, content) + content)
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def kept_files() -> list[str]:
    """Names of the sound files in the cache that hold these very kernels."""
    found = directory().glob(f"*.{_short(environment())}.*{_ENDING}")
    return sorted(path.name for path in found if read_sound(path) is not None)


# Failures

# Why machine code could not be written, if it could not.
_failures: list[str] = []


def unkept() -> str | None:
    """Why kernels cannot be kept, and what helps; None where they can."""
    return _failures[0] if _failures else None


def _failed(error: Exception) -> None:
    """Say once that kernels cannot be kept."""
    reason = getattr(error, "strerror", None) or " ".join(f"{type(error).__name__} {error}".split())
    message = (
        f"kernels cannot be kept in {directory()}: {reason}; until NUMBA_CACHE_DIR names a folder "
        "with room that you may write to, each run compiles them anew"
    )
    _failures.append(message)
    if len(_failures) == 1:
        tell(KernelWarning(message))


class KernelCache:
    """The machine code of one kernel, in place of the cache of Numba's dispatcher."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @property
    def cache_path(self) -> str:
        """The folder; Numba asks for it by this name."""
        return str(directory())

    def _path(self, types: tuple[Any, ...]) -> Path | None:
        """The file for these types of arguments; None for a function that is in no file."""
        function, code = self._function, self._function.__code__
        source = Path(code.co_filename)
        if not source.is_file():
            return None
        key = [*map(str, types), _own_stamp(source), code.co_firstlineno, code.co_code.hex()]
        if function.__closure__:
            from numba.core.serialize import dumps

            key.append(dumps([cell.cell_contents for cell in function.__closure__]).hex())
        name = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")[-120:]
        unique = f"{_short(environment())}.{_short('; '.join(map(str, key)))}"
        return directory() / f"{name}.{unique}{_ENDING}"

    def load_overload(self, signature: Any, context: Any) -> Any:
        """What Numba compiled; None where the cache does not hold it."""
        try:
            found = self._load(_types(signature), context)
        except Exception:  # its content is not what its name says
            found = None
        if found is not None:
            statistics["loaded"] += 1
            return found
        statistics["compiled"] += 1
        _LOG.info("compiling %s", self._function.__qualname__)
        for listener in tuple(listeners):
            listener(self._function.__qualname__)
        return None

    def _load(self, types: tuple[Any, ...], context: Any) -> Any:
        """Machine code from the disk.

        Numba would first import all that it can compile, and SciPy's linear algebra with it.
        That takes as long as a plan. Finished machine code needs none of it.
        """
        from numba.core.compiler import CompileResult

        path = self._path(types)
        content = None if path is None else read_sound(path)
        if content is None:
            return None
        if is_plain():
            context.refresh()
        kept_types, reduced = pickle.loads(content)
        return CompileResult._rebuild(context, *reduced) if kept_types == types else None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep what Numba compiled."""
        try:
            self._save(_types(signature), result)
        except Exception as error:
            _failed(error)

    def _save(self, types: tuple[Any, ...], result: Any) -> None:
        from numba.core.serialize import dumps

        path = self._path(types)
        # Code that holds an address of this process is of no use to another.
        if path is not None and not result.library.has_dynamic_globals:
            _write(path, dumps((types, result._reduce())))


def _types(signature: Any) -> tuple[Any, ...]:
    """Types of the arguments, whether given a whole signature or only them."""
    return tuple(getattr(signature, "args", signature))
