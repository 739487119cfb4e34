"""Steps of the search for the best piecewise linear potential: its dual is the least costly flow.

The problem is to maximise u(goal) - u(start) where |A grad u| <= c in every triangle, with
A = h^-1/2 without the cost c. The steps are those of Chambolle and Pock (2011). Cells are cut in
two as in ``potentials.py``; here slopes are per side of a lattice cell.
"""

import math

from ..compiler import inner_kernel, kernel
from .potentials import slope_of


@inner_kernel
def turned(roots, i, j, x, y):
    """A (x, y) in cell (i, j)."""
    a, b, d = roots[j, i, 0], roots[j, i, 1], roots[j, i, 2]
    return a * x + b * y, b * x + d * y


@inner_kernel
def norm_in(u, roots, i, j, right, upper):
    x, y = slope_of(u, i, j, right, upper)
    x, y = turned(roots, i, j, x, y)
    return math.sqrt(x * x + y * y)


@kernel
def choose_diagonals(u, ratio, rising):
    """Which cells are cut from their lower left corner: where that makes slopes less.

    ratio : of a cell's height to its width, squared. rising (ny, nx) is filled in.
    """
    for j in range(rising.shape[0]):
        for i in range(rising.shape[1]):
            most = (0.0, 0.0)
            for k in range(4):
                x, y = slope_of(u, i, j, k % 2, k // 2)
                steep = ratio * x * x + y * y
                if k in (1, 2):
                    most = (max(most[0], steep), most[1])
                else:
                    most = (most[0], max(most[1], steep))
            rising[j, i] = most[0] < most[1]


@kernel
def fill_norms(u, roots, costs, rising, norms):
    """The larger of the norms in both triangles of each cell (ny, nx), over the cell's cost."""
    for j in range(norms.shape[0]):
        for i in range(norms.shape[1]):
            right = 1 if rising[j, i] else 0
            lower = norm_in(u, roots, i, j, right, 0)
            norms[j, i] = max(lower, norm_in(u, roots, i, j, 1 - right, 1)) / costs[j, i]


@kernel
def step_flow(u, roots, costs, rising, sigma, flow):
    """A step of the flow (ny, nx, 2, 2) through both triangles of each cell; sigma is (ny, nx)."""
    for j in range(costs.shape[0]):
        for i in range(costs.shape[1]):
            for upper in range(2):
                right = 1 - upper if rising[j, i] else upper
                x, y = slope_of(u, i, j, right, upper)
                x, y = turned(roots, i, j, x, y)
                step = sigma[j, i]
                x, y = flow[j, i, upper, 0] + step * x, flow[j, i, upper, 1] + step * y
                size = math.sqrt(x * x + y * y)
                share = max(1.0 - step * costs[j, i] / size, 0.0) if size > 0.0 else 0.0
                flow[j, i, upper, 0], flow[j, i, upper, 1] = share * x, share * y


@kernel
def fill_sources(flow, roots, rising, sources):
    """What a flow takes away at each node (ny + 1, nx + 1): the adjoint of the slopes."""
    sources[:] = 0.0
    for j in range(rising.shape[0]):
        for i in range(rising.shape[1]):
            for upper in range(2):
                right = 1 - upper if rising[j, i] else upper
                x, y = turned(roots, i, j, flow[j, i, upper, 0], flow[j, i, upper, 1])
                sources[j + upper, i + 1] += x
                sources[j + upper, i] -= x
                sources[j + 1, i + right] += y
                sources[j, i + right] -= y


@kernel
def refine(u, flow, rising, finer_u, finer_flow):
    """The same u and flow on the lattice whose cells are these cut in four."""
    for j in range(rising.shape[0]):
        for i in range(rising.shape[1]):
            for q in range(2):
                for p in range(2):
                    # Of the four, two are on the diagonal, and two within one triangle.
                    on_diagonal = (q == p) == rising[j, i]
                    for upper in range(2):
                        k = upper if on_diagonal else q
                        x, y = 0.5 * flow[j, i, k, 0], 0.5 * flow[j, i, k, 1]
                        finer_flow[2 * j + q, 2 * i + p, upper, 0] = x
                        finer_flow[2 * j + q, 2 * i + p, upper, 1] = y
    for j in range(finer_u.shape[0]):
        for i in range(finer_u.shape[1]):
            a, b = j // 2, i // 2
            down, east = j % 2, i % 2
            if down and east and not rising[a, b]:
                finer_u[j, i] = 0.5 * (u[a, b + 1] + u[a + 1, b])
            else:
                finer_u[j, i] = 0.5 * (u[a, b] + u[a + down, b + east])
