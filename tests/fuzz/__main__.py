"""Random maps before the judges, for as long as asked: ``python -m tests.fuzz --minutes 60``.

Prints a line for each fault, with the seed that makes its map again, and a summary. The exit code
is 1 where faults were found. Each map is tried in a child process with limits on time and memory,
so a hang or a crash there is a fault as well, and not the end of the run.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter, defaultdict
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from fuzz_worker import Worker
from trials import FIELDS, KINDS, PLANNERS, compile_all, try_seed


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser("python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--maps", type=int, default=10**9, help="at most this many")
    parser.add_argument("--seed", type=int, default=0, help="of the first map; the next counts on")
    parser.add_argument("--kind", choices=list(KINDS), action="append")
    parser.add_argument(
        "--planner", choices=[*FIELDS, *PLANNERS], action="append", default=[], help="only these"
    )
    parser.add_argument("--extra", type=int, default=3, help="planners beside the main ones")
    parser.add_argument("--limit", type=float, default=10.0, help="seconds a planner may take")
    parser.add_argument("--verbose", action="store_true", help="print each map")
    asked = parser.parse_args()
    asked.kind = asked.kind or list(KINDS)
    return asked


def lines_of(faults) -> list[str]:
    """One for each planner and what is wrong with it."""
    alike = defaultdict(list)
    for what, who, details in faults:
        alike[what, who].append(details)
    return [
        f"{what} of {who}: {first}" + (f"; {len(more)} more" if more else "")
        for (what, who), (first, *more) in alike.items()
    ]


class Tally:
    """Faults by kind with their first seeds, and figures over all maps."""

    def __init__(self) -> None:
        self.maps, self.faulty = Counter(), Counter()
        self.seeds, self.figures = defaultdict(list), defaultdict(list)

    def add(self, kind, seed, faults, figures) -> None:
        self.maps[kind] += 1
        self.faulty[kind] += bool(faults)
        for what, who, _ in faults:
            if seed not in self.seeds[kind, what, who]:
                self.seeds[kind, what, who].append(seed)
        for name, value in figures.items():
            if np.isfinite(value):
                self.figures[kind, name].append(value)

    def report(self) -> None:
        for kind, count in self.maps.items():
            print(f"\n{kind}: {count} maps, {self.faulty[kind]} with faults")
            rows = [(len(s), what, who, s) for (k, what, who), s in self.seeds.items() if k == kind]
            for number, what, who, seeds in sorted(rows, reverse=True):
                print(f"  {number:5d}  {what} of {who}: seeds {', '.join(map(str, seeds[:5]))}")
            for (k, name), values in sorted(self.figures.items()):
                if k == kind:
                    low, middle, high = np.quantile(values, [0.0, 0.5, 0.95])
                    spread = f"{low:.4g} {middle:.4g} {high:.4g} {max(values):.4g}"
                    print(f"         {name}: least, median, 95 %, most {spread} ({len(values)})")


def main() -> int:
    asked = arguments()
    work = partial(try_seed, planners=asked.planner, extra=asked.extra, limit=asked.limit)
    # A planner has its limit; a stage of the judges, and of the field, has no limit of its own.
    worker, tally = Worker(work, compile_all, 6.0 * asked.limit + 60.0), Tally()
    ends = time.monotonic() + 60.0 * asked.minutes
    number = 0
    try:
        while time.monotonic() < ends and number < asked.maps:
            kind = asked.kind[number % len(asked.kind)]
            seed = asked.seed + number // len(asked.kind)
            answer, failure = worker.tried((kind, seed))
            words, faults, figures = answer or ("", [failure], {})
            tally.add(kind, seed, faults, figures)
            if asked.verbose:
                print(f"{kind} {seed}: {words}", flush=True)
            for line in lines_of(faults):
                print(f"FAULT {kind} {seed} {line}", flush=True)
            number += 1
    except KeyboardInterrupt:
        print("interrupted")
    finally:
        worker.stop()
    tally.report()
    return 1 if any(tally.faulty.values()) else 0


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
