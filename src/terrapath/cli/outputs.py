"""Files that a command will write: found out beforehand whether it can."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import MapError


def require_outputs(paths: Sequence[Path]) -> None:
    """Raise MapError where a file cannot be written, or is named twice."""
    from ..files import require_writable

    for path in paths:
        require_writable(path)
    if len({path.absolute() for path in paths}) < len(paths):
        raise MapError("the same file is named twice among the outputs; name each once")


def require_ending(path: Path, option: str, ending: str) -> None:
    """Raise MapError for another ending than the one there is."""
    if path.suffix.lower() != ending:
        raise MapError(f"{option}={str(path)!r} has no known format; end it in {ending}")
