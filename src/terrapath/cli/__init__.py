"""The ``terrapath`` command: parse, call, print, exit code."""

from .main import main

__all__ = ["main"]
