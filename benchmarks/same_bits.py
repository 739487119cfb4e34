"""Digests of the planners' answers, to see whether a change of the code altered any bit of them.

    python -m benchmarks.same_bits --store     # before the change
    python -m benchmarks.same_bits             # after it: names what differs, exit code 1

The problems are the six scenes of the paper, the Jacksboro fault and ten random ones with
obstacles. Bits depend on the machine and on libraries, so ``same_bits.json`` names both. On
another machine, first store the digests of the code before the change.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely

import terrapath as tp

STORED = Path(__file__).with_suffix(".json")
SCENES = ("one-peak", "three-peaks", "six-peaks", "four-peaks", "repeat-3d", "repeat-4d")
RANDOM = 10
SIDE = 10.0
SAMPLES = 1_500


def digest(*arrays: Any) -> str:
    """A digest of the bytes of arrays and numbers, 16 hexadecimal digits."""
    made = hashlib.sha256()
    for array in arrays:
        made.update(np.ascontiguousarray(array).tobytes())
    return made.hexdigest()[:16]


def random_problem(seed: int) -> tp.Problem:
    """Peaks (even seeds) or a grid (odd seeds), with a box, a disc and blocked cells."""
    rng = np.random.default_rng(seed)
    axis = np.linspace(0.0, SIDE, 21)
    if seed % 2:
        surface = tp.Surface.from_grid(rng.normal(0.0, 0.4, (2, 21, 21)), axis, axis)
    else:
        peaks = rng.uniform((-3.0, 0.2, 1.0, 1.0), (4.0, 1.0, 9.0, 9.0), (2, 3, 4))
        surface = tp.Surface.from_peaks(peaks.tolist())
    x, y = rng.uniform(3.0, 6.0, 2)
    box = shapely.box(x, y, x + rng.uniform(0.5, 1.5), y + rng.uniform(0.5, 1.5))
    disc = tp.Circle(rng.uniform(2.5, 7.5), rng.uniform(2.5, 7.5), rng.uniform(0.3, 0.8))
    blocked = np.zeros((21, 21), bool)
    blocked[tuple(rng.integers(5, 15, (2, 6)))] = True
    obstacles = [box, disc, tp.Mask(blocked, axis, axis)]
    return tp.Problem(surface, (0.5, 0.5), (9.5, 9.5), (0.0, 0.0, SIDE, SIDE), obstacles)


def problems() -> Iterator[tuple[str, tp.Problem]]:
    """All problems by name."""
    for name in (*SCENES, "jacksboro"):
        yield name, tp.scenes.load(name)
    for seed in range(RANDOM):
        yield f"random-{seed}", random_problem(seed)


def of_solution(solution: tp.Solution) -> str:
    """A digest of path, lengths, lower bound and tree."""
    parts: list[Any] = [solution.samples]
    if solution.path is not None:
        parts += [solution.path.points, solution.length, solution.cost]
    if solution.lower_bound is not None:
        parts.append(solution.lower_bound)
    if solution.tree is not None:
        parts += [solution.tree.points, solution.tree.parents, solution.tree.costs]
    parts += [path.points for path in solution.alternatives]
    return digest(*parts)


def planned(name: str, **options: Any) -> Callable[[tp.Problem], str]:
    """A measure: the digest of a planner's answer."""
    return lambda problem: of_solution(tp.plan(problem, name, **options))


def field(problem: tp.Problem) -> str:
    """A digest of the distance field and a path through it."""
    surface, bounds = problem.surface, problem.bounds
    made = tp.distance_field(surface, problem.start, bounds=bounds, spacing=bounds.side / 120)
    path = made.path_to(problem.goal)
    return digest(made.values, *([] if path is None else [path.points]))


MEASURES: dict[str, Callable[[tp.Problem], str]] = {
    "rrt-star-r": planned("rrt-star-r", samples=SAMPLES, refine=True, bound=True),
    "rrt-star-r, uniform": planned("rrt-star-r", samples=SAMPLES, informed=False),
    "rrt-star": planned("rrt-star", samples=SAMPLES),
    "rrt": planned("rrt", samples=SAMPLES),
    "dijkstra": planned("dijkstra"),
    "a-star": planned("a-star", refine=True),
    "fast-marching": planned("fast-marching", refine=True, bound=True),
    "optimal": planned("optimal", target_gap=0.02),
    "geodesic-traversal": planned("geodesic-traversal", directions=40),
    "distance field": field,
}


def measured(name: str, problem: tp.Problem) -> Iterator[tuple[str, str]]:
    """Every digest of one problem; rays on a map are left out, because they take minutes."""
    for what, measure in MEASURES.items():
        if what == "geodesic-traversal" and name not in SCENES:
            continue
        yield f"{name}: {what}", measure(problem)


def machine() -> str:
    """The machine and the libraries, which bits depend on besides the code."""
    import numba
    import scipy

    versions = f"numba {numba.__version__}, numpy {np.__version__}, scipy {scipy.__version__}"
    return (
        f"{platform.machine()} {platform.system()}, Python {platform.python_version()}, {versions}"
    )


def main() -> int:
    """Store the digests, or compare them with the stored ones; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", action="store_true", help="keep the digests of this code")
    store = parser.parse_args().store
    found: dict[str, str] = {}
    for name, problem in problems():
        found.update(measured(name, problem))
        print(name, file=sys.stderr)
    if store:
        record = {"machine": machine(), "digests": found}
        STORED.write_text(json.dumps(record, indent=1) + "\n")
        return 0
    record = json.loads(STORED.read_text())
    if record["machine"] != machine():
        print(f"stored on another machine: {record['machine']}; this is {machine()}")
    differing = [
        key for key in record["digests"] | found if record["digests"].get(key) != found.get(key)
    ]
    print(
        "\n".join(
            ["different:", *differing] if differing else [f"{len(found)} digests, all the same"]
        )
    )
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
