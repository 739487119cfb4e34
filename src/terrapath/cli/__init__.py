"""Floor 8: the ``terrapath`` command."""
