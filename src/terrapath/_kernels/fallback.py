"""Which of two ways kernels are compiled in: linked from parts, or plainly as Numba does.

Linking (``linking.py``) is several times as fast, but it overrides what Numba keeps to itself
and may change. So it is taken with the versions it was tested with, and left where it fails.
The plain way asks Numba for nothing special and gives the same answers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from numba import __version__ as numba_version

from ..errors import KernelWarning, tell

# The first version of Numba that linking is tested with, and the first that it is not tested
# with any more. pyproject.toml declares the same, and a test holds them together.
TESTED_FROM, TESTED_BELOW = (0, 63), (0, 69)

# Why linking was left, if it was.
_reasons: list[str] = []


def is_plain() -> bool:
    """Are kernels compiled as Numba does by itself?"""
    return bool(_reasons)


def fall_back(reason: object) -> None:
    """Compile plainly from now on, and say so once."""
    _reasons.append(str(reason))
    _warn(reason)


def _warn(reason: object) -> None:
    wanted = ",".join(
        f"{sign}{major}.{minor}"
        for sign, (major, minor) in ((">=", TESTED_FROM), ("<", TESTED_BELOW))
    )
    tell(
        KernelWarning(
            f"kernels are compiled in a slower way, with the same answers: {reason}; install "
            f"'numba{wanted}'"
        )
    )


@contextmanager
def falling_back(error: Exception) -> Iterator[None]:
    """Try the plain way after an error; where that fails too, the kernel itself is wrong."""
    _reasons.append(describe(error))
    try:
        yield
    except Exception:
        _reasons.clear()
        raise error from None
    _warn(_reasons[0])


def describe(error: Exception) -> str:
    """The error in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]


def is_tested(version: str) -> bool:
    """Is it one of the versions of Numba that linking is tested with?"""
    numbers = re.match(r"(\d+)\.(\d+)", version)
    found = tuple(map(int, numbers.groups())) if numbers else (0, 0)
    return TESTED_FROM <= found < TESTED_BELOW


def require_tested_version() -> None:
    """Fall back where the installed Numba is none of them."""
    if not is_tested(numba_version):
        fall_back(f"numba {numba_version} is not a version they are tested with")
