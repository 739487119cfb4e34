"""``python -m terrapath`` is the command."""

from .cli import main

main()
