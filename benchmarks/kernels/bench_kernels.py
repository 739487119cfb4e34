"""Each case takes turns with a loop that never changes. Nothing fails because it is slow."""

import math
import time
from statistics import median

import pytest

from cases import CASES
from reference import TABLE, run_reference

# Processor time, which leaves out waiting for other jobs.
CLOCK = time.process_time

# The work of a case is repeated for this long, seconds, within these numbers of rounds. A round is
# short against the time for which other jobs run.
LONG_ENOUGH = 1.0
FEWEST, MOST = 25, 300

STEPS = 100_000  # of the reference loop, to measure how long a step takes


def seconds(function, *arguments):
    """The seconds that a call takes."""
    begun = CLOCK()
    function(*arguments)
    return CLOCK() - begun


@pytest.mark.benchmark(timer=CLOCK, disable_gc=True)
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_kernel(benchmark, note, case):
    """Measure rounds of a kernel, each after a run of the reference loop that takes as long."""
    work, loops = case.prepare(case.size), []
    run_reference(TABLE, STEPS)  # compiles it; the first run of the work compiles the kernel
    work.run()
    long = seconds(work.run)
    steps = math.ceil(STEPS * long / seconds(run_reference, TABLE, STEPS))
    benchmark.pedantic(
        work.run,
        setup=lambda: loops.append(seconds(run_reference, TABLE, steps)),
        rounds=round(min(max(LONG_ENOUGH / long, FEWEST), MOST)),
    )
    if benchmark.disabled:
        return
    # The ratio is of one round, because other jobs slow the machine down for longer than that.
    rounds = zip(benchmark.stats.stats.data, loops, strict=True)
    benchmark.extra_info.update(
        kernel=case.name,
        item=case.item,
        nanoseconds=1e9 * benchmark.stats.stats.median / work.items,
        reference_nanoseconds=1e9 * median(loops) / steps,
        ratio=median(run / loop for run, loop in rounds) * steps / work.items,
    )
    note(benchmark.extra_info)
