"""The loop that kernels are compared with. It must never change, or ratios could not be compared.

Other jobs on a machine slow down most the code that keeps all units of a core busy, as kernels
do. So this loop does, too: it has four chains of integers and a polynomial, which wait only for
one another. Loops that wait for divisions or for memory were tried; their times follow those of
the kernels less closely.
"""

import numpy as np
from numba import njit, uint64

TABLE = np.random.default_rng(0).random(1024)


@njit(cache=True, error_model="numpy")
def run_reference(table, steps):
    """Run this many steps, which take one or two nanoseconds each."""
    a, b, c, d, total = uint64(1), uint64(2), uint64(3), uint64(4), 0.0
    for k in range(steps):
        x = table[k & 1023]
        a = (a ^ (a << uint64(13))) + b
        b = (b ^ (b >> uint64(7))) + uint64(k)
        c = (c ^ (c << uint64(17))) + d
        d = (d ^ (d >> uint64(9))) + uint64(k)
        total += (1.0 + 0.5 * x) + (x * x) * (0.25 + 0.125 * x)
    return total + (a ^ b ^ c ^ d)
