"""The sizes and numbers of all measurements."""

from __future__ import annotations

from dataclasses import dataclass

from terrapath.problem import scenes

# The scenes of the paper: those whose true length is known.
SCENES = tuple(name for name, scene in scenes.SCENES.items() if scene.true_length is not None)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The sizes and numbers of all measurements. The defaults are a full run."""

    scenes: tuple[str, ...] = SCENES
    target_gap: float = 5e-4  # of the lower bound
    bound_repeats: int = 3
    march_scenes: tuple[str, ...] = ("six-peaks", "one-peak")
    # Nodes on a side of the lattice, and repetitions.
    lattices: tuple[tuple[int, int], ...] = (
        *((241, 9), (481, 9), (961, 7)),
        *((1001, 7), (2001, 5), (4001, 2)),
    )
    map_cells: tuple[int, ...] = (5_000, 10_000)  # on a side
    path_repeats: int = 9
    slow_repeats: int = 3  # of planners that take seconds, or use random numbers
    tree_samples: tuple[int, ...] = (3_000, 10_000, 30_000)
    most_samples: int = 100_000
    warm_starts: int = 9
    cold_starts: int = 3
    # Trees beside OMPL's.
    tree_scenes: tuple[str, ...] = ("six-peaks", "three-peaks", "three-peaks-discs", "jacksboro")
    tree_seeds: int = 20
    few_tree_seeds: int = 5  # of OMPL's other planners through Python
    sweep_seeds: int = 3  # of each choice of options
    final_seeds: int = 9  # of the best of them
    tree_looks: tuple[int, int] = (20, 50_000)  # samples: the first, the last
    cpp_looks: tuple[float, float] = (0.0002, 2.5)  # seconds
    python_looks: tuple[float, float] = (0.02, 4.0)
    optimum_gap: float = 1e-3  # to prove of the shortest paths that are not known
    optimum_seconds: float = 60.0
    # Lattices: nodes on a side of each.
    grid_scenes: tuple[str, ...] = ("one-peak", "three-peaks", "four-peaks")
    grid_nodes: tuple[int, ...] = (121, 241, 481, 961)
    mesh_nodes: tuple[int, ...] = (121, 241)  # of exact geodesics
    grid_repeats: int = 3
    growth_samples: tuple[int, int] = (100_000, 1_000_000)
    growth_repeats: int = 3
    edges: int = 200_000
    edge_repeats: int = 9


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
    tree_scenes=("six-peaks",),
    tree_seeds=5,
    few_tree_seeds=1,
    sweep_seeds=1,
    final_seeds=1,
    tree_looks=(100, 20_000),
    cpp_looks=(0.002, 2.0),
    python_looks=(0.02, 4.0),
    grid_scenes=("three-peaks",),
    grid_nodes=(121, 241),
    mesh_nodes=(121,),
    grid_repeats=1,
    growth_samples=(20_000, 200_000),
    growth_repeats=1,
    edges=50_000,
    edge_repeats=5,
)


def true_length(scene: str) -> float:
    """Length of a scene's shortest path, map units."""
    length = scenes.SCENES[scene].true_length
    assert length is not None
    return length
