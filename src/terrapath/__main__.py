"""``python -m terrapath`` is the command."""

try:
    from .cli import main
except KeyboardInterrupt:
    raise SystemExit(130) from None

main()
