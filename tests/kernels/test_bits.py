"""Sets in the bits of an integer, against loops over their numbers."""

import numpy as np
import pytest

from terrapath._kernels.bits import count_bits, lowest_bit, steps_after, steps_before
from terrapath._kernels.compiler import kernel


@kernel
def ask(bits, k, answers):
    answers[0], answers[1] = count_bits(bits), lowest_bit(bits)
    answers[2], answers[3] = steps_after(bits, k), steps_before(bits, k)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.95])
def test_sets_of_numbers(share):
    random = np.random.default_rng([8, int(100 * share)])
    for k in range(64):
        numbers = np.flatnonzero(random.random(64) < share)
        numbers = numbers if len(numbers) else np.array([k])
        bits = np.array([sum(1 << int(n) for n in numbers)], np.uint64).view(np.int64)[0]
        answers = np.zeros(4, np.int64)
        ask(bits, k, answers)
        after = min((n - k - 1) % 64 + 1 for n in numbers)
        before = min((k - n - 1) % 64 + 1 for n in numbers)
        assert answers.tolist() == [len(numbers), numbers.min(), after, before]
        in_python = (
            count_bits(bits),
            lowest_bit(bits),
            steps_after(bits, k),
            steps_before(bits, k),
        )
        assert in_python == tuple(answers)
