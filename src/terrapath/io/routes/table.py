"""CSV: the profile of a route."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from .profile import distinct, profile_columns
from .route import Route

# What a spreadsheet would take for a formula, also in a cell that it makes of a part of the text.
FORMULA = re.compile(r"(^|[;,\t|])(\s*)(?=[=+\-@\uff1d\uff0b\uff0d\uff20])")


def defused(text: str) -> str:
    """A text for a cell, with an apostrophe before each formula, so that none is run."""
    return FORMULA.sub(r"\1\2'", text)


def write(route: Route, file: Path) -> None:
    """Write one row for each point; units are in the headings, places are in map units."""
    columns = profile_columns(route)
    names = distinct([defused(column.heading.strip()) for column in columns])
    rows = zip(*(column.values.tolist() for column in columns), strict=True)
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(names)
        writer.writerows(rows)
