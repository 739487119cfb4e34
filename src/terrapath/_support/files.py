"""Writes files completely or not at all."""

from __future__ import annotations

import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import MapError

# A ROS 2 bag is the one output that is a folder; every bag contains this file.
BAG_ENDING, BAG_MARK = ".bag2", "metadata.yaml"

# The files that belong to a shapefile: those that are written, and those that would be out of date.
SHAPEFILE_ENDING, SHAPEFILE_PARTS = ".shp", (".shx", ".dbf", ".prj", ".cpg")
SHAPEFILE_INDICES = (".qix", ".sbn", ".sbx", ".idm", ".ind", ".qpj", ".shp.xml")

# The start of temporary names. Short, because a path may be almost as long as is allowed.
TEMPORARY = ".terrapath-"


def _require_bag(path: Path) -> None:
    """Raise OSError where writing a bag would replace anything but a bag or an empty folder."""
    if not path.exists() and not path.is_symlink():
        return
    if path.is_symlink() or not path.is_dir():
        raise NotADirectoryError(f"{path} exists already and is not a folder")
    if any(path.iterdir()) and not (path / BAG_MARK).is_file():
        raise FileExistsError(f"{path} is a folder that holds other things than a ROS 2 bag")


def _require_shapefile(path: Path) -> None:
    """Raise OSError where a part of a new shapefile would replace what belongs to another file."""
    if path.exists():
        return
    for part in parts_of(path):
        if part.exists():
            raise FileExistsError(f"it would replace {part}, which belongs to another file")


def require_writable(path: Path) -> None:
    """Raise MapError where a file cannot be written; the check leaves no file behind."""
    try:
        _require_name(path)
        if path.suffix.lower() == BAG_ENDING:
            _require_bag(path)
        elif path.suffix.lower() == SHAPEFILE_ENDING:
            _require_shapefile(path)
        if path.suffix.lower() != BAG_ENDING and path.is_dir():
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


def parts_of(path: Path) -> list[Path]:
    """All files that an output is made of: the one that is named, and those beside it."""
    if path.suffix.lower() != SHAPEFILE_ENDING:
        return [path]
    return [path, *(path.with_suffix(ending) for ending in SHAPEFILE_PARTS)]


def _require_name(path: Path) -> None:
    """Raise OSError for a name that no file can have, such as one that is too long."""
    with suppress(FileNotFoundError):
        path.lstat()


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``, which replaces ``path`` only without an error."""
    try:
        temporary = path.parent / f"{TEMPORARY}{secrets.token_hex(8)}{path.suffix}"
        # A new file with the usual permissions of this process. A file made by ``tempfile`` would
        # be readable by its owner only, and the umask cannot be read without setting it.
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
    """Give a path for a new folder, which is moved to ``path`` only without an error.

    It may replace an older bag or an empty folder, and nothing else: see ``require_writable``.
    """
    try:
        _require_bag(path)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=TEMPORARY) as aside:
            made, old, new = (Path(aside, name) for name in (path.name, "replaced", "new"))
            new.mkdir()
            yield made
            made.chmod(stat.S_IMODE(new.stat().st_mode))  # the usual permissions of this process
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


@contextmanager
def shapefile_written_whole(path: Path) -> Iterator[Path]:
    """Give a path for a new shapefile, whose parts replace those of ``path`` without an error."""
    try:
        _require_shapefile(path)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=TEMPORARY) as aside:
            made = Path(aside, f"route{SHAPEFILE_ENDING}")
            yield made
            for ending in SHAPEFILE_PARTS:
                part, old = made.with_suffix(ending), path.with_suffix(ending)
                part.replace(old) if part.exists() else old.unlink(missing_ok=True)
            for ending in SHAPEFILE_INDICES:
                path.with_suffix(ending).unlink(missing_ok=True)
            made.replace(path)
    except OSError as error:
        raise _unwritten(path, error) from None


def _unwritten(path: Path, error: OSError) -> MapError:
    reason = error.strerror or str(error)
    return MapError(
        f"{path} could not be written: {reason}; "
        "name a file in a directory with room, that exists and that you may write to"
    )
