"""Warnings of Terrapath's own on standard error, one line each."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, cast

from ..errors import TerrapathWarning


def remark(message: object) -> None:
    """One line on standard error, if anybody takes it."""
    with suppress(OSError):
        print("terrapath:", " ".join(str(message).split()), file=sys.stderr)


@contextmanager
def remarks() -> Iterator[None]:
    """Show the project's warnings as remarks, each once; others go their own way."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", TerrapathWarning)
        show_others, shown = warnings.showwarning, set[str]()

        def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if not issubclass(category, TerrapathWarning):
                show_others(message, category, *place)
            elif str(message) not in shown:
                shown.add(str(message))
                remark(message)

        warnings.showwarning = cast("Any", show)
        yield
