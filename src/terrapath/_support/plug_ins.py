"""What installed packages announce by entry points: planners and travel models of their own."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from ..errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@cache
def announced(group: str) -> tuple[EntryPoint, ...]:
    """What is announced in a group of entry points."""
    from importlib.metadata import entry_points

    return tuple(entry_points(group=group))


def loaded(entry: EntryPoint, what: str, use: Callable[[Any], object] | None = None) -> Any:
    """What an entry point names. what : it is called so in errors. use : is tried on it.

    Raises InputError where either fails.
    """
    try:
        found = entry.load()
        if use is not None:
            use(found)
    except Exception as error:  # another package may raise anything while it is imported
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(
            f"{what} of {entry.value} cannot be loaded: {reason:.200}; repair or uninstall its "
            "package"
        ) from None
    return found
