"""What tests of several subjects share: numbers and points to draw, messages to look at."""

import numpy as np
from hypothesis import strategies as st


def numbers(low, high):
    return st.floats(low, high, allow_subnormal=False)


def points_in(bounds, count, seed=0):
    """(count, 2): places in a box, the same for the same seed."""
    return np.random.default_rng(seed).uniform(bounds[:2], bounds[2:], (count, 2))


def one_line(caught):
    """The message of an error, which is one line."""
    text = str(caught.value)
    assert text
    assert "\n" not in text
    return text
