"""Splines through points: B-splines on any knots, and their banded systems of equations."""

from ..compiler import kernel


@kernel
def fill_basis(knots, degree, shares, first, weights):
    """The B-splines that are not 0 at parameters (m,) between the outermost knots.

    first (m,) : the number of the first of them. weights (m, degree + 1) : their values.
    """
    for m in range(shares.shape[0]):
        t, low, high = shares[m], degree, knots.shape[0] - degree - 1
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if t < knots[middle] else (middle, high)
        first[m], weights[m, 0] = low - degree, 1.0
        # Cox and de Boor: each B-spline adds to two of the next degree.
        for d in range(1, degree + 1):
            carried = 0.0
            for k in range(d):
                left, right = knots[low - d + 1 + k], knots[low + 1 + k]
                share = weights[m, k] / (right - left)
                weights[m, k] = carried + (right - t) * share
                carried = (t - left) * share
            weights[m, d] = carried


@kernel
def solve_banded(rows, values):
    """Solve A x = values in place: values (n, 2) becomes x, and rows is overwritten.

    rows (n, 2 k + 1) : entry (i, j) of A is rows[i, k + j - i]. Without pivoting, which totally
    positive matrices do not need.
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
