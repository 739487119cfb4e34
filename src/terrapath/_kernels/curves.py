"""Banded systems of linear equations."""

from .compiler import kernel


@kernel
def solve_banded(rows, values):
    """Solve A x = values, of which values (n, 2) becomes the solution; rows are used up.

    rows (n, 2 k + 1) : entry (i, j) of A is rows[i, k + j - i]. No rows change places, which
    matrices that are totally positive do not need.
    """
    n, k = rows.shape[0], rows.shape[1] // 2
    for i in range(n):
        for r in range(i + 1, min(i + k + 1, n)):
            share = rows[r, k + i - r] / rows[i, k]
            for j in range(1, k + 1):
                rows[r, k + i - r + j] -= share * rows[i, k + j]
            values[r, 0] -= share * values[i, 0]
            values[r, 1] -= share * values[i, 1]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, min(i + k + 1, n)):
            values[i, 0] -= rows[i, k + j - i] * values[j, 0]
            values[i, 1] -= rows[i, k + j - i] * values[j, 1]
        values[i, 0] /= rows[i, k]
        values[i, 1] /= rows[i, k]
