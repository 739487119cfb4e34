"""How kernels are compiled: linked from parts, or plainly, as Numba does by itself.

Linking (``linking.py``) is several times as fast, but it overrides internals of Numba, which may
change. So it is used only with the versions that it was tested with, and not where it fails.
Plain compilation needs nothing special of Numba and gives the same answers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from numba import __version__ as numba_version

from ..errors import KernelWarning, tell

# The first version of Numba that linking is tested with, and the first that it is not tested
# with any more. pyproject.toml declares the same, and a test compares the two.
TESTED_FROM, TESTED_BELOW = (0, 63), (0, 69)

# Why linking is not used; empty where it is.
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
            f"kernels are compiled more slowly, with the same answers: {reason}; install "
            f"'numba{wanted}'"
        )
    )


@contextmanager
def falling_back(error: Exception) -> Iterator[None]:
    """Compile plainly after an error; where that fails too, the kernel itself is wrong."""
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
    """Fall back where the installed Numba is not a tested version."""
    if not is_tested(numba_version):
        fall_back(f"numba {numba_version} is not a version they are tested with")
