"""How fast the proven gap falls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from terrapath.certificates.certificate import Certificate
from terrapath.certificates.search import lower_bound
from terrapath.paper.runner import Runner
from terrapath.paper.trials import Trial

from .settings import Scale, true_length
from .timing import Reading, Stopwatch, Target, Timing, percent, timed

# The length that the search is given is the true length, times this: it must not be less.
KNOWN = 1.0 + 1e-9

# Gaps, and the seconds in which they are to be proven.
GAP_TARGETS = ((1e-2, 0.2), (1e-3, 2.0))


@dataclass(frozen=True, kw_only=True)
class BoundRuns:
    """The settings of a trial."""

    target_gap: float
    repeats: int

    @property
    def name(self) -> str:
        """The beginning of the names of the trials' files."""
        return "bound"


@dataclass(frozen=True)
class ProvenStep:
    """The best certificate after one more lattice, and the time until then."""

    nodes: int  # of the certificate's lattice
    gap: float
    timing: Timing  # since the search began
    check: Timing  # of the certificate's proof, once more


@dataclass(frozen=True)
class BoundFound:
    """The result of the search for a lower bound."""

    steps: tuple[ProvenStep, ...]

    def first_within(self, gap: float) -> ProvenStep | None:
        """The first certificate whose gap is small enough."""
        return next((step for step in self.steps if step.gap <= gap), None)


@dataclass(frozen=True)
class BoundTrial(Trial[BoundFound]):
    """The search for a lower bound on one scene."""

    planner: BoundRuns

    def measure(self) -> BoundFound:
        """Search as often as the settings say. The certificates are the same each time."""
        lower_bound(self.problem, length=self._length).check(self.problem)
        runs = [self._search() for _ in range(self.planner.repeats)]
        return BoundFound(tuple(map(self._step, zip(*runs, strict=True))))

    @property
    def _length(self) -> float:
        return true_length(self.scene) * KNOWN

    def _search(self) -> list[tuple[Certificate, Reading]]:
        """Each certificate, with the time at which it was found."""
        problem, found = self.problem, []

        def see(certificate: Certificate) -> None:
            found.append((certificate, watch.read()))

        watch = Stopwatch()
        gap = self.planner.target_gap
        last = lower_bound(problem, length=self._length, target_gap=gap, watch=see)
        reading = watch.read()
        # The last certificate is returned, but not passed to ``see``.
        if not found or last.value > found[-1][0].value:
            found.append((last, reading))
        return found

    def _step(self, repeated: tuple[tuple[Certificate, Reading], ...]) -> ProvenStep:
        certificate, problem = repeated[0][0], self.problem
        checks = [timed(partial(again.check, problem))[1] for again, _ in repeated]
        lattice = certificate.lattice
        return ProvenStep(
            lattice.nx * lattice.ny,
            self._length / certificate.value - 1.0,
            Timing.of(reading for _, reading in repeated),
            Timing.of(checks),
        )


BoundData = dict[str, BoundFound]


def run_bound(scale: Scale, runner: Runner) -> BoundData:
    """For each scene, the certificates of ever finer lattices."""
    runs = BoundRuns(target_gap=scale.target_gap, repeats=scale.bound_repeats)
    found = runner.run("bound", [BoundTrial(scene, runs) for scene in scale.scenes])
    return dict(zip(scale.scenes, found, strict=True))


def bound_targets(data: BoundData) -> list[Target]:
    """The seconds until two gaps, on every scene."""
    targets = []
    for scene, found in data.items():
        for gap, limit in GAP_TARGETS:
            step = found.first_within(gap)
            seconds = None if step is None else step.timing.seconds
            best = f"the gap stays at {percent(min(s.gap for s in found.steps))}"
            targets.append(Target(f"{scene}: gap of {percent(gap)}", limit, "s", seconds, best))
    return targets
