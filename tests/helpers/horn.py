"""Horn's slope as GIS tools compute it, cell by cell in plain Python; shares no code with it."""

import numpy as np


def horn_degrees(heights, dx, dy):
    """Slopes (ny, nx), degrees, of heights with NaN for no data; dx (ny,) and dy: sides of cells.

    As ``gdaldem slope -compute_edges``: beyond the edge by a straight line, and the middle's height
    for one that is missing.
    """
    ny, nx = heights.shape
    dx = np.broadcast_to(dx, (ny,))
    slopes = np.full((ny, nx), np.nan)

    def height(j, i, middle):
        def known(value):
            return middle if np.isnan(value) else value

        if 0 <= j < ny and 0 <= i < nx:
            return known(heights[j, i])
        jj, ii = min(max(j, 0), ny - 1), min(max(i, 0), nx - 1)
        j2, i2 = 2 * jj - j, 2 * ii - i
        if jj != j and ii != i:  # a corner of the map: both in turn
            near, far = (2 * heights[jj, k] - heights[j2, k] for k in (ii, i2))
            return known(2 * near - far)
        return known(2 * heights[jj, ii] - heights[j2, i2])

    for j in range(ny):
        for i in range(nx):
            z = heights[j, i]
            if np.isnan(z):
                continue
            (a, b, c), (d, _, f), (g, h, k) = (
                [height(j + dj, i + di, z) for di in (-1, 0, 1)] for dj in (-1, 0, 1)
            )
            across = (c + 2 * f + k - a - 2 * d - g) / (8 * dx[j])
            along = (g + 2 * h + k - a - 2 * b - c) / (8 * dy)
            slopes[j, i] = np.degrees(np.arctan(np.hypot(across, along)))
    return slopes
