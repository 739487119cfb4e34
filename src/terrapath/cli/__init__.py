"""The ``terrapath`` command: parse, call, print, exit code."""

try:
    from .main import main
except KeyboardInterrupt:  # Ctrl-C while it is still imported
    raise SystemExit(130) from None

__all__ = ["main"]
