"""Banded systems of linear equations."""

from .compiler import kernel


@kernel
def solve_banded(rows, values):
    """Solve A x = values, of which values (n, m) becomes the solution; rows are used up.

    rows (n, 2 k + 1) : entry (i, j) of A is rows[i, k + j - i]. No rows change places, which
    matrices that are totally positive do not need.
    """
    n, k = rows.shape[0], rows.shape[1] // 2
    for i in range(n):
        last = min(i + k + 1, n)
        for r in range(i + 1, last):
            share = rows[r, k + i - r] / rows[i, k]
            if share != 0.0:
                for j in range(i + 1, last):
                    rows[r, k + j - r] -= share * rows[i, k + j - i]
                for c in range(values.shape[1]):
                    values[r, c] -= share * values[i, c]
    for i in range(n - 1, -1, -1):
        for c in range(values.shape[1]):
            for j in range(i + 1, min(i + k + 1, n)):
                values[i, c] -= rows[i, k + j - i] * values[j, c]
            values[i, c] /= rows[i, k]
