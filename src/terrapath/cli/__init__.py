"""Floor 8: the ``terrapath`` command."""

from .main import main

__all__ = ["main"]
