"""Writing files whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import MapError


def require_writable(path: Path) -> None:
    """Raise MapError where a file cannot be written, without leaving anything there."""
    try:
        if path.is_dir():
            raise IsADirectoryError(f"{path} is a directory")
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError(f"{path} is write-protected")
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".terrapath-"):
            pass
    except OSError as error:
        reason = error.strerror or str(error)
        raise MapError(
            f"output={str(path)!r} cannot be written: {reason}; "
            "name a file in a directory that exists and that you may write to"
        ) from None


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path``; it takes its place only when all went well."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        try:
            yield temporary
        except OSError as error:
            reason = error.strerror or str(error)
            raise MapError(f"{path} could not be written: {reason}") from None
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    """The process's file mode mask, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
