"""The linear system of an interpolating cubic spline."""

from ..compiler import kernel


@kernel
def solve_curvatures(lines, pivots, ratios):
    """Solve m_(j-1) + 4 m_j + m_(j+1) = r_j for each line; m replaces r in lines[:, 2:-2].

    The matrix is L D L^T: ``pivots`` is the diagonal of D, ``ratios`` the one below that of L.
    """
    count = pivots.shape[0]
    for k in range(lines.shape[0]):
        for j in range(1, count):
            lines[k, j + 2] -= lines[k, j + 1] * ratios[j - 1]
        lines[k, count + 1] /= pivots[count - 1]
        for j in range(count - 2, -1, -1):
            lines[k, j + 2] = lines[k, j + 2] / pivots[j] - lines[k, j + 3] * ratios[j]
