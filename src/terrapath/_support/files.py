"""Writing files whole or not at all."""

from __future__ import annotations

import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import MapError

# The one output that is a folder: a ROS 2 bag, and the file that tells that a folder is one.
BAG_ENDING, BAG_MARK = ".bag2", "metadata.yaml"

# Short, for a name of the output's own length may leave no room for more.
TEMPORARY = ".terrapath-"


def is_there(path: Path) -> bool:
    """Is there a file or a folder? No name that none can have is there."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _require_bag(path: Path) -> None:
    """Raise OSError where something else than a bag, or than an empty folder, would be lost."""
    if not path.exists() and not path.is_symlink():
        return
    if path.is_symlink() or not path.is_dir():
        raise NotADirectoryError(f"{path} is there already and is no folder")
    if any(path.iterdir()) and not (path / BAG_MARK).is_file():
        raise FileExistsError(f"{path} is a folder that holds other things than a ROS 2 bag")


def require_writable(path: Path) -> None:
    """Raise MapError where a file cannot be written, without leaving anything there."""
    try:
        _require_name(path)
        if path.suffix.lower() == BAG_ENDING:
            _require_bag(path)
        elif path.is_dir():
            raise IsADirectoryError(f"{path} is a directory")
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError(f"{path} is write-protected")
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=TEMPORARY):
            pass
    except OSError as error:
        reason = error.strerror or str(error)
        raise MapError(
            f"output={str(path)!r} cannot be written: {reason}; "
            "name a file in a directory that exists and that you may write to"
        ) from None


def _require_name(path: Path) -> None:
    """Raise OSError for a name that no file can have, as one that is too long."""
    with suppress(FileNotFoundError):
        path.lstat()


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path``; it takes its place only when all went well."""
    try:
        temporary = path.parent / f"{TEMPORARY}{secrets.token_hex(8)}{path.suffix}"
        # A new file of nobody else's, which may be read by whom the process lets: one of
        # ``tempfile`` would be ours alone, and the process's mask cannot be read, only set.
        temporary.touch(exist_ok=False)
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise _unwritten(path, error) from None


@contextmanager
def folder_written_whole(path: Path) -> Iterator[Path]:
    """A path for a new folder of the same name; it takes its place only when all went well.

    It replaces an older bag, and nothing else: see ``require_writable``.
    """
    try:
        _require_bag(path)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=TEMPORARY) as aside:
            made, old, new = (Path(aside, name) for name in (path.name, "replaced", "new"))
            new.mkdir()
            yield made
            made.chmod(stat.S_IMODE(new.stat().st_mode))  # as the process makes folders
            if path.exists():
                path.rename(old)
            try:
                made.rename(path)
            except OSError:
                if old.exists():
                    old.rename(path)
                raise
    except OSError as error:
        raise _unwritten(path, error) from None


def _unwritten(path: Path, error: OSError) -> MapError:
    reason = error.strerror or str(error)
    return MapError(
        f"{path} could not be written: {reason}; "
        "name a file in a directory with room, that exists and that you may write to"
    )
