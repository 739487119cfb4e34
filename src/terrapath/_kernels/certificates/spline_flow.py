"""Steps of the search for the best bicubic potential u: its dual is the least costly flow.

The problem is to maximise u(goal) - u(start) where |S grad u| <= c at certain places, S being the
square root of h^-1 without the cost c, in steps of the lattice. Places are quarters of a cell apart
along both axes; the flow goes through every second one, and through others where the norm is too
large. All goes row by row: along x2 first, then along x1, for one place of all cells in a row.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import inner_kernel, kernel
from ..surface.bsplines import basis as basis_at, basis_slope
from ..surface.metric_rows import H11, H12, H22, fill_cost_row, fill_row
from ..surface.surfaces import metric_at

# Places of a cell along one axis.
QUARTERS = 4

ZERO, LEAST = np.float32(0.0), np.float32(1e-30)


class Places(NamedTuple):
    """What is to hold at place (q, p) of cell (j, i), for the cells from its node on."""

    roots: np.ndarray  # (4, 4, 3, ny, nx) float32: S, as its entries 11, 12 and 22
    limits: np.ndarray  # (4, 4, ny, nx) float32: c


class Basis(NamedTuple):
    """The four B-splines at the quarters of a cell, and their slopes per cell."""

    values: np.ndarray  # (4, 4)
    slopes: np.ndarray  # (4, 4)


class Rows(NamedTuple):
    """Workspace."""

    sums: np.ndarray  # (2, nx + 3): of coefficients along x2, by values and by slopes
    back: np.ndarray  # (2, nx + 3) float32: the same of a flow
    slopes: np.ndarray  # (2, nx) float32: of u, then of its flow
    norms: np.ndarray  # (4, 4, nx) float32


# The ground


@kernel
def fill_roots(h, costs, p, step_x, step_y, limits, roots):
    """S (3, nx) from a row (5, 4 nx - 3) of the metric; limits (nx,) are times the costs."""
    for i in range(limits.shape[0]):
        m = min(4 * i + p, h.shape[1] - 1)
        size = h[H11, m] * h[H22, m] - h[H12, m] * h[H12, m]
        a, b, d = h[H22, m] * step_x * step_x, -h[H12, m] * step_x * step_y, h[H11, m] * step_y**2
        root = math.sqrt(size) * step_x * step_y
        cost = costs[m]
        limits[i] *= np.float32(cost)
        per = cost / math.sqrt(max(size * (a + d + 2.0 * root), 1e-300))
        roots[0, i], roots[1, i], roots[2, i] = (a + root) * per, b * per, (d + root) * per


@kernel
def fill_places(surface, grid, columns, row, costs, steps, places):
    """S at all places; grid has their rows and columns, steps the lattice's unit per its steps.

    row (5, 4 nx - 3) and costs (4 nx - 3,) are workspace.
    """
    for n in range(grid.ny):
        fill_row(surface, grid, n, columns, row)
        fill_cost_row(surface, grid, n, columns, costs)
        j, q = n // QUARTERS, n % QUARTERS
        for p in range(QUARTERS):
            limits, roots = places.limits[q, p, j], places.roots[q, p, :, j]
            fill_roots(row, costs, p, steps[0], steps[1], limits, roots)


# Slopes of u, and the flow's sources


@kernel
def fill_sums(c, j, values, slopes, sums):
    """Sums over the four rows of coefficients from the j-th on."""
    for i in range(sums.shape[1]):
        sums[0, i] = (
            values[0] * c[j, i]
            + values[1] * c[j + 1, i]
            + values[2] * c[j + 2, i]
            + values[3] * c[j + 3, i]
        )
        sums[1, i] = (
            slopes[0] * c[j, i]
            + slopes[1] * c[j + 1, i]
            + slopes[2] * c[j + 2, i]
            + slopes[3] * c[j + 3, i]
        )


@kernel
def fill_slopes(sums, values, slopes, found):
    """The slopes (2, nx) of u at one place of all cells in a row."""
    for i in range(found.shape[1]):
        found[0, i] = (
            slopes[0] * sums[0, i]
            + slopes[1] * sums[0, i + 1]
            + slopes[2] * sums[0, i + 2]
            + slopes[3] * sums[0, i + 3]
        )
        found[1, i] = (
            values[0] * sums[1, i]
            + values[1] * sums[1, i + 1]
            + values[2] * sums[1, i + 2]
            + values[3] * sums[1, i + 3]
        )


@kernel
def step_row(slopes, roots, limits, sigma, flow):
    """A step of the flow (2, nx), whose sources S flow take the place of the slopes."""
    for i in range(limits.shape[0]):
        a, b, d = roots[0, i], roots[1, i], roots[2, i]
        x, y = slopes[0, i], slopes[1, i]
        u = flow[0, i] + sigma * (a * x + b * y)
        v = flow[1, i] + sigma * (b * x + d * y)
        size = math.sqrt(u * u + v * v)
        share = max(size - sigma * limits[i], ZERO) / max(size, LEAST)
        u, v = share * u, share * v
        flow[0, i], flow[1, i] = u, v
        slopes[0, i], slopes[1, i] = a * u + b * v, b * u + d * v


@kernel
def gather(found, values, slopes, back):
    """Add the adjoint of ``fill_slopes``."""
    for k in range(4):
        value, slope = np.float32(values[k]), np.float32(slopes[k])
        for i in range(found.shape[1]):
            back[0, i + k] += slope * found[0, i]
            back[1, i + k] += value * found[1, i]


@kernel
def spread_back(back, j, values, slopes, sources):
    """Add the adjoint of ``fill_sums``."""
    for k in range(4):
        value, slope = np.float32(values[k]), np.float32(slopes[k])
        for i in range(back.shape[1]):
            sources[j + k, i] += value * back[0, i] + slope * back[1, i]


@kernel
def step_flow(c, places, basis, sigma, rows, flow, sources):
    """A step of the flow (2, 2, ny, 2, nx) through the halves of cells; sources like c."""
    sources[:] = ZERO
    for j in range(flow.shape[2]):
        for q in range(2):
            values, slopes = basis.values[2 * q], basis.slopes[2 * q]
            fill_sums(c, j, values, slopes, rows.sums)
            rows.back[:] = ZERO
            for p in range(2):
                roots, limits = places.roots[2 * q, 2 * p, :, j], places.limits[2 * q, 2 * p, j]
                fill_slopes(rows.sums, basis.values[2 * p], basis.slopes[2 * p], rows.slopes)
                step_row(rows.slopes, roots, limits, sigma, flow[q, p, j])
                gather(rows.slopes, basis.values[2 * p], basis.slopes[2 * p], rows.back)
            spread_back(rows.back, j, values, slopes, sources)


# Single places


@inner_kernel
def slope_at(c, basis, j, i, q, p):
    x, y = 0.0, 0.0
    for k in range(4):
        value, slope = 0.0, 0.0
        for m in range(4):
            value += basis.values[p, m] * c[j + k, i + m]
            slope += basis.slopes[p, m] * c[j + k, i + m]
        x += basis.values[q, k] * slope
        y += basis.slopes[q, k] * value
    return x, y


@inner_kernel
def turned(places, j, i, q, p, x, y):
    """S (x, y)."""
    a, b, d = places.roots[q, p, 0, j, i], places.roots[q, p, 1, j, i], places.roots[q, p, 2, j, i]
    return a * x + b * y, b * x + d * y


@inner_kernel
def add_at(c, basis, j, i, q, p, x, y):
    """Add the adjoint of ``slope_at``."""
    for k in range(4):
        for m in range(4):
            rise = x * basis.values[q, k] * basis.slopes[p, m]
            c[j + k, i + m] += rise + y * basis.slopes[q, k] * basis.values[p, m]


@kernel
def step_others(c, places, basis, sigma, share, others, flow, sources):
    """A step of the flow (n, 2) through other places (n, 4), whose rows are times ``share``."""
    for n in range(others.shape[0]):
        j, i, q, p = others[n]
        x, y = slope_at(c, basis, j, i, q, p)
        x, y = turned(places, j, i, q, p, share * x, share * y)
        u, v = flow[n, 0] + sigma * x, flow[n, 1] + sigma * y
        size = math.sqrt(u * u + v * v)
        limit = sigma * share * places.limits[q, p, j, i]
        if size <= limit:
            flow[n, 0], flow[n, 1] = 0.0, 0.0
            continue
        u, v = (1.0 - limit / size) * u, (1.0 - limit / size) * v
        flow[n, 0], flow[n, 1] = u, v
        x, y = turned(places, j, i, q, p, share * u, share * v)
        add_at(sources, basis, j, i, q, p, x, y)


@kernel
def fill_norms(c, places, basis, j, rows):
    """The norms over c at all places of the cells of row j."""
    for q in range(QUARTERS):
        fill_sums(c, j, basis.values[q], basis.slopes[q], rows.sums)
        for p in range(QUARTERS):
            fill_slopes(rows.sums, basis.values[p], basis.slopes[p], rows.slopes)
            roots, limits, norms = (
                places.roots[q, p, :, j],
                places.limits[q, p, j],
                rows.norms[q, p],
            )
            for i in range(norms.shape[0]):
                x, y = rows.slopes[0, i], rows.slopes[1, i]
                u, v = roots[0, i] * x + roots[1, i] * y, roots[1, i] * x + roots[2, i] * y
                norms[i] = math.sqrt(u * u + v * v) / limits[i]


@inner_kernel
def largest_of_cell(norms, i):
    largest = ZERO
    for q in range(QUARTERS):
        for p in range(QUARTERS):
            largest = max(largest, norms[q, p, i])
    return largest


@kernel
def find_steep(c, places, basis, above, least, is_dirty, rows, found):
    """List the places (n, 4) whose norm is above ``above``, in the rows with dirty cells.

    Of a cell only those count whose excess is at least the share ``least`` of its largest. Returns
    how many there are, and the largest norm met; no more than there is room for are listed.
    """
    count, top = 0, ZERO
    for j in range(places.limits.shape[2]):
        if not is_dirty[j].any():
            continue
        fill_norms(c, places, basis, j, rows)
        for i in range(places.limits.shape[3]):
            largest = largest_of_cell(rows.norms, i)
            top = max(top, largest)
            if largest <= above or count + QUARTERS * QUARTERS > found.shape[0]:
                continue
            enough = max(above, 1.0 + least * (largest - 1.0))
            for q in range(QUARTERS):
                for p in range(QUARTERS):
                    if rows.norms[q, p, i] >= enough:
                        found[count, 0], found[count, 1] = j, i
                        found[count, 2], found[count, 3] = q, p
                        count += 1
    return count, top


@inner_kernel
def mark_around(is_dirty, j, i):
    """Mark the cells in which u changes with the coefficients of cell (j, i)."""
    for k in range(max(j - 3, 0), min(j + 4, is_dirty.shape[0])):
        for m in range(max(i - 3, 0), min(i + 4, is_dirty.shape[1])):
            is_dirty[k, m] = True


@kernel
def project(c, places, basis, target, reach, steep, is_dirty):
    """Change u least so that the norm at each place, one after another, is ``target``.

    reach : the share of the way that is gone. is_dirty (ny, nx) : set for the cells that change.
    """
    for n in range(steep.shape[0]):
        j, i, q, p = steep[n]
        x, y = slope_at(c, basis, j, i, q, p)
        x, y = turned(places, j, i, q, p, x, y)
        norm, limit = math.sqrt(x * x + y * y), target * places.limits[q, p, j, i]
        if not norm > limit:
            continue
        x, y = turned(places, j, i, q, p, x / norm, y / norm)
        squared = 0.0
        for k in range(4):
            for m in range(4):
                rise = x * basis.values[q, k] * basis.slopes[p, m]
                squared += (rise + y * basis.slopes[q, k] * basis.values[p, m]) ** 2
        step = -reach * (norm - limit) / squared
        add_at(c, basis, j, i, q, p, step * x, step * y)
        mark_around(is_dirty, j, i)


# Places anywhere in a cell


@inner_kernel
def slope_beside(c, j, i, vx, sx, vy, sy):
    """The slope of u at a place with the given values and slopes of B-splines."""
    x, y = 0.0, 0.0
    for k in range(4):
        for m in range(4):
            x += vy[k] * sx[m] * c[j + k, i + m]
            y += sy[k] * vx[m] * c[j + k, i + m]
    return x, y


@inner_kernel
def push(c, j, i, vx, sx, vy, sy, x, y, way):
    """Change u least so that (x, y) times its slope at a place falls by ``way``."""
    squared = 0.0
    for k in range(4):
        for m in range(4):
            squared += (x * vy[k] * sx[m] + y * sy[k] * vx[m]) ** 2
    for k in range(4):
        for m in range(4):
            c[j + k, i + m] -= way / squared * (x * vy[k] * sx[m] + y * sy[k] * vx[m])


@kernel
def project_cell(surface, grid, c, j, i, parts, target, tolerance, reach, unit):
    """As ``project``, at (parts + 1)^2 places of a cell; were any norms too large?"""
    changed = False
    for n in range((parts + 1) ** 2):
        s, t = n % (parts + 1) / parts, n // (parts + 1) / parts
        h = metric_at(surface, grid.x0 + (i + s) * grid.dx, grid.y0 + (j + t) * grid.dy)
        vx, sx, vy, sy = basis_at(s), basis_slope(s), basis_at(t), basis_slope(t)
        x, y = slope_beside(c, j, i, vx, sx, vy, sy)
        x, y = x * unit / grid.dx, y * unit / grid.dy
        size = h.h11 * h.h22 - h.h12 * h.h12
        a, b = (h.h22 * x - h.h12 * y) / size, (h.h11 * y - h.h12 * x) / size
        norm = math.sqrt(max(a * x + b * y, 0.0))
        if norm > target + tolerance:
            a, b = a * unit / (norm * grid.dx), b * unit / (norm * grid.dy)
            push(c, j, i, vx, sx, vy, sy, a, b, reach * (norm - target))
            changed = True
    return changed


@kernel
def project_cells(surface, grid, c, cells, was_dirty, how, is_dirty):
    """Change u least in those of some cells (n, 2) that were dirty, one after another.

    how : parts, target, tolerance, reach and unit of ``project_cell``.
    """
    for n in range(cells.shape[0]):
        j, i = cells[n]
        if was_dirty[j, i] and project_cell(surface, grid, c, j, i, *how):
            mark_around(is_dirty, j, i)
