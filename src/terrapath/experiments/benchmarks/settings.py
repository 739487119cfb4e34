"""How much is run."""

from __future__ import annotations

from dataclasses import dataclass

from ... import scenes

# The scenes of the paper: those whose true length is known.
SCENES = tuple(name for name, scene in scenes.SCENES.items() if scene.true_length is not None)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How much is run. The defaults are a full run."""

    scenes: tuple[str, ...] = SCENES
    target_gap: float = 5e-4  # of the bound
    bound_repeats: int = 3
    march_scenes: tuple[str, ...] = ("six-peaks", "one-peak")
    # Nodes on a side of the lattice, and repetitions.
    lattices: tuple[tuple[int, int], ...] = (
        *((241, 9), (481, 9), (961, 7)),
        *((1001, 7), (2001, 5), (4001, 2)),
    )
    map_cells: tuple[int, ...] = (5_000, 10_000)  # on a side
    path_repeats: int = 9
    slow_repeats: int = 3  # of planners that take seconds, or that chance has a part in
    tree_samples: tuple[int, ...] = (3_000, 10_000, 30_000)
    most_samples: int = 100_000
    warm_starts: int = 9
    cold_starts: int = 3


FULL = Scale()
QUICK = Scale(
    target_gap=1e-3,
    bound_repeats=1,
    lattices=((241, 3), (1001, 3)),
    map_cells=(2_500,),
    path_repeats=3,
    slow_repeats=1,
    tree_samples=(3_000, 10_000),
    warm_starts=3,
    cold_starts=1,
)


def true_length(scene: str) -> float:
    """Length of a scene's shortest path, map units."""
    length = scenes.SCENES[scene].true_length
    assert length is not None
    return length
