"""CSV: the profile of a route."""

from __future__ import annotations

import csv
from pathlib import Path

from ...problem import Solution
from .profile import distinct, profile_columns


def write(solution: Solution, file: Path) -> None:
    """Write one row for each point; a layer's unit is in its heading, the rest in map units."""
    columns = profile_columns(solution)
    rows = zip(*(column.values.tolist() for column in columns), strict=True)
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(distinct([column.heading for column in columns]))
        writer.writerows(rows)
