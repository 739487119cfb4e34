"""Each case by turns with a loop that never changes. Nothing fails for being slow."""

import math
import time
from statistics import median

import pytest

from cases import CASES
from reference import TABLE, run_reference

# Of the processor, which leaves out waiting for other jobs.
CLOCK = time.process_time

# The work of a case is repeated for so long, seconds, within these numbers of rounds: other jobs
# come and go more slowly than rounds do.
LONG_ENOUGH = 1.0
FEWEST, MOST = 25, 300

STEPS = 100_000  # of the reference loop, to see how long they take


def seconds(function, *arguments):
    """How long a call takes."""
    begun = CLOCK()
    function(*arguments)
    return CLOCK() - begun


@pytest.mark.benchmark(timer=CLOCK, disable_gc=True)
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_kernel(benchmark, note, case):
    """Rounds of a kernel, each after a run of the reference loop that takes about as long."""
    work, loops = case.prepare(case.size), []
    run_reference(TABLE, STEPS)  # compiled, as the work is by its first run
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
    # Each round's own ratio: what slows the machine down lasts longer than a round.
    rounds = zip(benchmark.stats.stats.data, loops, strict=True)
    benchmark.extra_info.update(
        kernel=case.name,
        item=case.item,
        nanoseconds=1e9 * benchmark.stats.stats.median / work.items,
        reference_nanoseconds=1e9 * median(loops) / steps,
        ratio=median(run / loop for run, loop in rounds) * steps / work.items,
    )
    note(benchmark.extra_info)
