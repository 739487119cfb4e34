"""Problems of the MovingAI benchmarks: a line of a ``.scen`` file names a map, start and goal."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import InputError
from ..validation import is_there, require_no_pipe
from .scenario import MapSection, Scenario
from .sections import RouteSection

MOST_BYTES = 100_000_000
NAME = re.compile(r"(.+\.scen)(?::(\d+))?", re.IGNORECASE | re.DOTALL)


def is_scen(where: str) -> bool:
    """Does a name mean a file of problems, or one of its lines?"""
    return NAME.fullmatch(where) is not None


def read_scen(where: str) -> Scenario:
    """The scenario of ``FILE.scen:K``, its K-th problem, from 1 [default: the first].

    The map is the one that the line names, beside the file. Raises InputError.
    """
    match = NAME.fullmatch(where)
    assert match is not None
    file, number = Path(match[1]), int(match[2] or 1)
    lines = _lines(file)
    if not 1 <= number <= len(lines):
        raise InputError(f"{file} holds {len(lines)} problems; name one of them as {file}:1")
    words = (
        lines[number - 1].split("\t") if "\t" in lines[number - 1] else lines[number - 1].split()
    )
    try:
        _, name, _, _, *ends = words[:8]
        x1, y1, x2, y2 = map(float, ends)
    except ValueError:
        raise InputError(
            f"{file}: problem {number} is not of the form of MovingAI's files"
        ) from None
    places = [file.parent / Path(name).name, file.with_suffix("")]
    path = next((place for place in places if is_there(place)), places[0])
    return Scenario(
        map=MapSection(path=str(path), crs="none"),
        route=RouteSection(start=(x1, y1), goal=(x2, y2)),
    )


def _lines(file: Path) -> list[str]:
    require_no_pipe(file)
    try:
        with file.open(encoding="ascii", errors="replace") as stream:
            text = stream.read(MOST_BYTES)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{file} cannot be read: {reason}; check the path") from None
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[1:] if lines and lines[0].startswith("version") else lines
