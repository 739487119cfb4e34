"""Fast marching under h: seconds, memory and error by the number of nodes."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial

from .peers import SCIKIT_FMM
from .processes import run_fresh
from .settings import Scale, true_length
from .timing import Target, Timing

# The seconds over those of scikit-fmm, and the nodes on a side for that; the memory for a node,
# bytes; the memory in all, and the nodes on a side for that.
RATIO_TARGET, RATIO_NODES = 1.2, 1001
BYTES_TARGET = 100.0
GIGABYTES_TARGET, GIGABYTES_NODES = 8.0, 4001

# With fewer nodes, most of the memory is used by other things.
FEWEST_NODES = 500_000

# Relative error at the goal of HamiltonFastMarching (C++, github.com/Mirebeau/
# HamiltonFastMarching, model Riemann2, second order, two-point factoring), as measured once.
REFERENCE_ERRORS = {
    ("six-peaks", 241): 7e-5,
    ("one-peak", 241): -4e-4,
    ("six-peaks", 961): 3e-6,
    ("one-peak", 961): -1e-4,
}


@dataclass(frozen=True, kw_only=True)
class MarchRuns:
    """The settings of a trial."""

    nodes: int  # on a side
    repeats: int
    peer: str | None  # version of scikit-fmm

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return f"march-{self.nodes}"


@dataclass(frozen=True)
class Marched:
    """The measures of a fresh process."""

    edges: Timing
    march: Timing
    peer: Timing | None  # scikit-fmm, isotropic, second order
    distance: float  # from start to goal, map units
    memory_before: int | None  # the process's, bytes; None where the system gives none
    memory_peak: int | None

    @property
    def whole(self) -> Timing:
        """The time from the surface to the distance field."""
        return self.edges + self.march

    @property
    def ratio(self) -> float | None:
        """The seconds over those of scikit-fmm."""
        return None if self.peer is None else self.whole.seconds / self.peer.seconds


@dataclass(frozen=True)
class MarchTrial(Trial[Marched]):
    """One scene on one lattice, in a process of its own."""

    planner: MarchRuns

    def measure(self) -> Marched:
        """Start the process and read its answer."""
        task = {"scene": self.scene, **asdict(self.planner)}
        what = f"fast marching on {self.planner.nodes:,} nodes a side"
        return self.decode(run_fresh("fresh", task, what))


@dataclass(frozen=True)
class MarchRow:
    """One scene on one lattice."""

    scene: str
    nodes: int  # on a side
    found: Marched

    @property
    def error(self) -> float:
        """The relative error at the goal."""
        return self.found.distance / true_length(self.scene) - 1.0

    @property
    def bytes_per_node(self) -> float | None:
        """Peak memory above the memory before; None where there are too few nodes."""
        before, peak, count = self.found.memory_before, self.found.memory_peak, self.nodes**2
        if before is None or peak is None or count < FEWEST_NODES:
            return None
        return (peak - before) / count


@dataclass(frozen=True)
class MarchData:
    """All scenes on all lattices."""

    rows: list[MarchRow]
    peer: str | None  # version of scikit-fmm


def run_marching(scale: Scale, runner: Runner) -> MarchData:
    """Each scene on each lattice."""
    peer = SCIKIT_FMM.version
    trials = [
        MarchTrial(scene, MarchRuns(nodes=nodes, repeats=repeats, peer=peer))
        for scene in scale.march_scenes
        for nodes, repeats in scale.lattices
    ]
    found = runner.run("fast marching", trials)
    pairs = zip(trials, found, strict=True)
    return MarchData([MarchRow(t.scene, t.planner.nodes, f) for t, f in pairs], peer)


def marching_targets(data: MarchData) -> list[Target]:
    """Speed, memory and error."""
    targets = []
    for row in data.rows:
        where = f"{row.scene}, {row.nodes:,} x {row.nodes:,} nodes"
        if row.nodes == RATIO_NODES and row.found.ratio is not None:
            what = f"{where}: times scikit-fmm's seconds"
            targets.append(Target(what, RATIO_TARGET, "", row.found.ratio))
        if row.bytes_per_node is not None:
            what = f"{where}: memory a node"
            targets.append(Target(what, BYTES_TARGET, "bytes", row.bytes_per_node))
        if row.nodes == GIGABYTES_NODES and row.found.memory_peak is not None:
            peak = row.found.memory_peak / 1e9
            targets.append(Target(f"{where}: memory in all", GIGABYTES_TARGET, "GB", peak))
        reference = REFERENCE_ERRORS.get((row.scene, row.nodes))
        if reference is not None:
            what = f"{where}: error, against HamiltonFastMarching's"
            limit, error = 100.0 * abs(reference), 100.0 * abs(row.error)
            targets.append(Target(what, limit, "%", error))
    return targets
