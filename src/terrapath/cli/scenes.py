"""``terrapath scenes``: the built-in problems."""

from __future__ import annotations


def scenes_command() -> None:
    """List the built-in problems, with the true length of the shortest path where known."""
    from rich.console import Console
    from rich.table import Table

    from ..problem.scenes import SCENES

    table = Table("scene", "what it is", box=None, pad_edge=False)
    table.add_column("shortest length", justify="right")
    for scene in SCENES.values():
        known = "" if scene.true_length is None else f"{scene.true_length:.6f}"
        table.add_row(scene.name, scene.description, known)
    Console().print(table)
