"""Distances on lattices and meshes: fast marching and Dijkstra beside other libraries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial
from terrapath.planners import Dijkstra
from terrapath.problem import Problem, scenes
from terrapath.space.lattice import Lattice
from terrapath.surface import metric
from terrapath.validation import Array

from .peers import POTPOURRI, PYGEODESIC, SCIKIT_IMAGE, Peer
from .processes import answer, run_fresh
from .settings import Scale, true_length
from .timing import Reading, Target, Timing, timed

# Nodes on a side of the lattice on which everything runs once before it is measured.
SMALL = 31


@dataclass(frozen=True, kw_only=True)
class GridRuns:
    """The settings of a trial."""

    method: str  # one of METHODS
    nodes: int  # on a side
    repeats: int
    version: str | None  # of the library

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return f"grid-{self.method}-{self.nodes}"


@dataclass(frozen=True)
class GridFound:
    """The measures of a fresh process."""

    timing: Timing
    distance: float  # from start to goal, map units


@dataclass(frozen=True)
class GridTrial(Trial[GridFound]):
    """One method on one lattice, in a process of its own."""

    planner: GridRuns

    def measure(self) -> GridFound:
        """Start the process and read its answer."""
        task = {"scene": self.scene, **asdict(self.planner)}
        what = f"{self.planner.method} on {self.planner.nodes:,} nodes a side"
        return self.decode(run_fresh("grids", task, what))


# Methods: each takes the problem and a lattice, and returns the distance. The time includes making
# a lattice or a mesh from the surface.


def _marching(problem: Problem, lattice: Lattice) -> float:
    from .fresh import Bench

    return Bench(problem, lattice.nx).distance()


def _dijkstra(neighbours: int) -> Callable[[Problem, Lattice], float]:
    def distance(problem: Problem, lattice: Lattice) -> float:
        found = Dijkstra(spacing=lattice.dx, neighbours=neighbours).solve(problem)
        assert found.cost is not None
        return found.cost

    return distance


def _node_points(lattice: Lattice) -> Array:
    """(ny, nx, 2), map units."""
    bounds = lattice.bounds
    x = np.linspace(bounds.x1_min, bounds.x1_max, lattice.nx)
    y = np.linspace(bounds.x2_min, bounds.x2_max, lattice.ny)
    return np.stack(np.meshgrid(x, y), axis=-1)


def _node_at(lattice: Lattice, point: tuple[float, float]) -> tuple[int, int]:
    """Row and column of the nearest node."""
    column = round((point[0] - lattice.bounds.x1_min) / lattice.dx)
    return round((point[1] - lattice.bounds.x2_min) / lattice.dy), column


def _least_cost(problem: Problem, lattice: Lattice) -> float:
    """MCP_Geometric has one cost for all directions: the geometric mean of how h stretches them."""
    from skimage.graph import MCP_Geometric

    costs = metric.determinant(problem.surface, _node_points(lattice)) ** 0.25
    start, goal = _node_at(lattice, problem.start), _node_at(lattice, problem.goal)
    found = MCP_Geometric(costs, sampling=(lattice.dy, lattice.dx))
    return float(found.find_costs([start], [goal])[0][goal])


def _mesh(problem: Problem, lattice: Lattice) -> tuple[Array, Any, int, int]:
    """Vertices (m, 3), triangles (k, 3), and the vertices of start and goal."""
    points = _node_points(lattice).reshape(-1, 2)
    vertices = np.ascontiguousarray(problem.surface.lift(points))
    first = np.arange(lattice.nx * lattice.ny).reshape(lattice.ny, lattice.nx)
    a, b, c, d = (
        part.ravel() for part in (first[:-1, :-1], first[:-1, 1:], first[1:, :-1], first[1:, 1:])
    )
    triangles = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    ends = (first[_node_at(lattice, point)] for point in (problem.start, problem.goal))
    start, goal = map(int, ends)
    return vertices, triangles, start, goal


def _heat(problem: Problem, lattice: Lattice) -> float:
    import potpourri3d

    vertices, triangles, start, goal = _mesh(problem, lattice)
    solver = potpourri3d.MeshHeatMethodDistanceSolver(vertices, triangles)
    return float(solver.compute_distance(start)[goal])


def _mesh_marching(problem: Problem, lattice: Lattice) -> float:
    import potpourri3d

    vertices, triangles, start, goal = _mesh(problem, lattice)
    solver = potpourri3d.MeshFastMarchingDistanceSolver(vertices, triangles)
    return float(solver.compute_distance([[(start, [])]])[goal])


def _edge_flips(problem: Problem, lattice: Lattice) -> float:
    import potpourri3d

    vertices, triangles, start, goal = _mesh(problem, lattice)
    path = potpourri3d.EdgeFlipGeodesicSolver(vertices, triangles).find_geodesic_path(start, goal)
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _exact(problem: Problem, lattice: Lattice) -> float:
    from pygeodesic.geodesic import PyGeodesicAlgorithmExact

    vertices, triangles, start, goal = _mesh(problem, lattice)
    return float(PyGeodesicAlgorithmExact(vertices, triangles).geodesicDistance(start, goal)[0])


@dataclass(frozen=True)
class Method:
    """A method that computes the distance."""

    label: str
    distance: Callable[[Problem, Lattice], float]  # map units
    peer: Peer | None = None  # None for Terrapath's own methods
    slow: bool = False  # run on coarse lattices only
    feature: str = ""  # a name in the peer's module; without it the version is too old

    @property
    def is_there(self) -> bool:
        """Is the peer installed, and new enough?"""
        module = None if self.peer is None else self.peer.load()
        return self.peer is None or (module is not None and hasattr(module, self.feature))


METHODS = {
    "fast-marching": Method("fast marching", _marching),
    "dijkstra-8": Method("Dijkstra, 8 neighbours", _dijkstra(8)),
    "dijkstra-32": Method("Dijkstra, 32 neighbours", _dijkstra(32)),
    "mcp": Method("scikit-image MCP_Geometric", _least_cost, SCIKIT_IMAGE, feature="MCP_Geometric"),
    "heat": Method(
        "potpourri3d, heat method", _heat, POTPOURRI, feature="MeshHeatMethodDistanceSolver"
    ),
    "mesh-marching": Method(
        "potpourri3d, fast marching",
        _mesh_marching,
        POTPOURRI,
        feature="MeshFastMarchingDistanceSolver",
    ),
    "edge-flips": Method(
        "potpourri3d, edge flips", _edge_flips, POTPOURRI, feature="EdgeFlipGeodesicSolver"
    ),
    "exact-mesh": Method(
        "pygeodesic, exact on the mesh",
        _exact,
        PYGEODESIC,
        slow=True,
        feature="PyGeodesicAlgorithmExact",
    ),
}


@dataclass(frozen=True)
class GridRow:
    """One method on one lattice."""

    scene: str
    method: str
    nodes: int  # on a side
    found: GridFound

    @property
    def error(self) -> float:
        """The relative error of the distance at the goal."""
        return self.found.distance / true_length(self.scene) - 1.0


@dataclass(frozen=True)
class GridsData:
    """All methods on all lattices."""

    rows: list[GridRow]
    missing: list[str]  # a sentence for each peer that is missing
    versions: dict[str, str]


def run_grids(scale: Scale, runner: Runner) -> GridsData:
    """Measure each method on each scene and each lattice."""
    peers = {method.peer.name: method.peer for method in METHODS.values() if method.peer}
    versions = {name: peer.version for name, peer in peers.items()}
    trials = []
    for scene in scale.grid_scenes:
        for name, method in METHODS.items():
            if method.is_there:
                version = None if method.peer is None else versions[method.peer.name]
                trials += [
                    GridTrial(
                        scene,
                        GridRuns(
                            method=name, nodes=nodes, repeats=scale.grid_repeats, version=version
                        ),
                    )
                    for nodes in (scale.mesh_nodes if method.slow else scale.grid_nodes)
                ]
    found = runner.run("grids", trials)
    rows = [
        GridRow(t.scene, t.planner.method, t.planner.nodes, f)
        for t, f in zip(trials, found, strict=True)
    ]
    missing = [peers[name].missing for name, version in versions.items() if version is None]
    return GridsData(rows, missing, {k: v for k, v in versions.items() if v is not None})


def grids_targets(data: GridsData) -> list[Target]:
    """None: there are no targets."""
    return []


def measure_grid(scene: str, runs: GridRuns) -> GridFound:
    """Run once on a small lattice, to load and compile everything; then measure."""
    problem, method = scenes.load(scene), METHODS[runs.method]
    method.distance(problem, Lattice(problem.bounds, SMALL, SMALL))
    lattice = Lattice(problem.bounds, runs.nodes, runs.nodes)
    laps: list[Reading] = []
    distance = 0.0
    for _ in range(runs.repeats):
        distance, lap = timed(lambda: method.distance(problem, lattice))
        laps.append(lap)
    return GridFound(Timing.of(laps), distance)


if __name__ == "__main__":
    answer(lambda scene, **runs: measure_grid(scene, GridRuns(**runs)))
