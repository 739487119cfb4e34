"""Which corners are seen from a place: a sweep over the cells of an index, away from the eye.

Each quadrant around the eye is swept by itself, row by row, and each row away from the eye. So each
ray meets its cells in this order, and what a wall hides is known before the cells behind it are
looked at. The direction to a place that is u and w away along the two axes is the number
w / (u + w), from 0 to 1, which grows with the angle.

Light is an interval of directions in which nothing was met yet. Walls cut it; it ends where none is
left. What is found is tested exactly afterwards, so rounding here cannot let a path through a wall.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler import kernel
from ..space.free_space import Grid, Space

# Columns of ``Scene.corners``.
X, Y = 0, 1
BEFORE_X, BEFORE_Y, ALONG_X, ALONG_Y = 2, 3, 4, 5
CLEARANCE = 6

# Light narrower than this is put out.
NARROW = 1e-13
# A corner counts as lit where its direction is at most this far from the light.
BESIDE = 1e-12


class Scene(NamedTuple):
    """Obstacles, and the corners that a path may bend round.

    The walls of cell c = j * nx + i of the grid are ``wall_ids[wall_first[c]:wall_first[c + 1]]``,
    and likewise the corners. Of a corner, free ground is to the right of the walls that meet there.
    """

    space: Space  # the obstacles themselves, for the exact test
    grid: Grid
    walls: np.ndarray  # (e, 4) float64: x1, y1, x2, y2
    wall_first: np.ndarray  # (cells + 1,) int64
    wall_ids: np.ndarray  # int64
    corners: np.ndarray  # (n, 7) float64: place, unit vectors of both walls, clearance
    corner_first: np.ndarray
    corner_ids: np.ndarray
    metric: np.ndarray  # (3,) float64: h11, h12, h22


class View(NamedTuple):
    """What is seen, and the light that is still to be followed. All arrays are filled in place."""

    found: np.ndarray  # (n,) int64: the corners seen
    seen_by: np.ndarray  # (n,) int64: the eye that saw each corner last
    low: np.ndarray  # (k,) float64: intervals of directions
    high: np.ndarray
    row: np.ndarray  # (k,) int64: the row of the grid that each is about to enter


class Eye(NamedTuple):
    """A place, its cell, and a quadrant around it: the signs of both axes."""

    name: int
    x: float
    y: float
    column: int
    line: int
    sx: int
    sy: int


class Strip(NamedTuple):
    """Distances from the eye along one axis."""

    near: float
    far: float


class Shadow(NamedTuple):
    """Directions that a piece of a wall hides; none where low > high."""

    low: float
    high: float


class State(NamedTuple):
    """How much of ``View`` is used: intervals of light, and corners found."""

    top: int
    noted: int


@kernel
def strip(origin, size, index, centre, sign):
    """The distances between which a row or column lies; ``far`` is not above 0 if it is behind."""
    a = sign * (origin + index * size - centre)
    b = sign * (origin + (index + 1) * size - centre)
    return Strip(max(min(a, b), 0.0), max(a, b))


@kernel
def direction(u, w):
    u, w = max(u, 0.0), max(w, 0.0)
    return w / (u + w) if u + w > 0.0 else 0.5


@kernel
def shadow(scene, wall, eye, columns, rows):
    """The directions hidden by the part of a wall in one cell of the quadrant."""
    au, aw = eye.sx * (scene.walls[wall, 0] - eye.x), eye.sy * (scene.walls[wall, 1] - eye.y)
    bu, bw = eye.sx * (scene.walls[wall, 2] - eye.x), eye.sy * (scene.walls[wall, 3] - eye.y)
    first, last = 0.0, 1.0
    for a, b, within in ((au, bu, columns), (aw, bw, rows)):
        if a == b:
            if a < within.near or a > within.far:
                return Shadow(1.0, 0.0)
        else:
            s, t = (within.near - a) / (b - a), (within.far - a) / (b - a)
            first, last = max(first, min(s, t)), min(last, max(s, t))
    if first > last:
        return Shadow(1.0, 0.0)
    # The very ends, so that walls that meet there leave no gap.
    s = (
        direction(au + first * (bu - au), aw + first * (bw - aw))
        if first > 0.0
        else direction(au, aw)
    )
    t = direction(au + last * (bu - au), aw + last * (bw - aw)) if last < 1.0 else direction(bu, bw)
    return Shadow(min(s, t), max(s, t))


@kernel
def darken(view, base, top, dark):
    """Cut a shadow out of the light [base, top); returns the new top."""
    for k in range(top - 1, base - 1, -1):
        low, high = view.low[k], view.high[k]
        if dark.high <= low or dark.low >= high:
            continue
        is_left, is_right = dark.low - low > NARROW, high - dark.high > NARROW
        if is_left and is_right:
            view.high[k] = dark.low
            view.low[top], view.high[top] = dark.high, high
            top += 1
        elif is_left:
            view.high[k] = dark.low
        elif is_right:
            view.low[k] = dark.high
        else:
            top -= 1
            view.low[k], view.high[k] = view.low[top], view.high[top]
    return top


@kernel
def cast_shadows(scene, view, eye, cell, columns, rows, base, top):
    """Cut the shadows of all walls of a cell out of the light; returns the new top."""
    for k in range(scene.wall_first[cell], scene.wall_first[cell + 1]):
        dark = shadow(scene, scene.wall_ids[k], eye, columns, rows)
        if dark.high > dark.low:
            top = darken(view, base, top, dark)
    return top


@kernel
def is_lit(view, base, top, place, slack):
    """Is a direction in the light, or at its very edge?"""
    lit = False
    for k in range(base, top):
        lit = lit or view.low[k] - slack <= place <= view.high[k] + slack
    return lit


@kernel
def note_corners(scene, view, eye, cell, base, top, count):
    """Note the corners of a cell that are in the light; returns how many are noted by now."""
    rounding = 2.0**-51 * (abs(eye.x) + abs(eye.y))
    for k in range(scene.corner_first[cell], scene.corner_first[cell + 1]):
        corner = scene.corner_ids[k]
        u = eye.sx * (scene.corners[corner, X] - eye.x)
        w = eye.sy * (scene.corners[corner, Y] - eye.y)
        if view.seen_by[corner] == eye.name or u < 0.0 or w < 0.0 or u + w == 0.0:
            continue
        if is_lit(view, base, top, w / (u + w), BESIDE + rounding / (u + w)):
            view.seen_by[corner] = eye.name
            view.found[count] = corner
            count += 1
    return count


@kernel
def first_column(grid, eye, near, high):
    """The column in which the steepest ray enters a row, or the one before it."""
    ahead = near * (1.0 - high) / high
    own = strip(grid.x0, grid.dx, eye.column, eye.x, eye.sx)
    skipped = min(max(math.floor((ahead - own.far) / grid.dx), 0.0), float(grid.nx))
    return eye.column + eye.sx * int(skipped)


@kernel
def sweep_row(scene, view, eye, line, rows, base, count):
    """Follow one interval of light, at ``base``, through a row of cells."""
    grid, top = scene.grid, base + 1
    column = first_column(grid, eye, rows.near, view.high[base])
    while 0 <= column < grid.nx and top > base:
        columns = strip(grid.x0, grid.dx, column, eye.x, eye.sx)
        if columns.far > 0.0:
            steepest = rows.far / (columns.near + rows.far)
            flattest = rows.near / (columns.far + rows.near)
            is_ahead, is_entered = False, False
            for k in range(base, top):
                is_ahead = is_ahead or view.low[k] <= steepest
                is_entered = is_entered or (view.low[k] <= steepest and view.high[k] >= flattest)
            if not is_ahead:
                break
            if is_entered:
                cell = line * grid.nx + column
                count = note_corners(scene, view, eye, cell, base, top, count)
                top = cast_shadows(scene, view, eye, cell, columns, rows, base, top)
        column += eye.sx
    return State(top, count)


@kernel
def look_in_quadrant(scene, view, eye, low, high, count):
    """Note the corners seen between two directions; returns how many are noted by now."""
    grid, top = scene.grid, 1
    view.low[0], view.high[0], view.row[0] = low, high, eye.line
    while top > 0:
        base = top - 1
        line = view.row[base]
        if not 0 <= line < grid.ny or view.high[base] - view.low[base] <= NARROW:
            top = base
            continue
        rows = strip(grid.y0, grid.dy, line, eye.y, eye.sy)
        if rows.far > 0.0:
            state = sweep_row(scene, view, eye, line, rows, base, count)
            top, count = state.top, state.noted
        for k in range(base, top):
            view.row[k] = line + eye.sy
    return count


@kernel
def look(scene, view, name, x, y, angle, width):
    """Note the corners seen from a place between an angle and that plus a width, radians.

    name : of the eye, a number. Returns how many corners are in ``view.found``. Some of them may
    be hidden after all, within rounding.
    """
    grid, count, quarter = scene.grid, 0, 0.5 * math.pi
    column = min(max(int((x - grid.x0) / grid.dx), 0), grid.nx - 1)
    line = min(max(int((y - grid.y0) / grid.dy), 0), grid.ny - 1)
    for q in range(math.floor(angle / quarter), math.floor((angle + width) / quarter) + 1):
        sx = 1 if q % 4 in (0, 3) else -1
        sy = 1 if q % 4 in (0, 1) else -1
        eye = Eye(name, x, y, column, line, sx, sy)
        low, high = max(angle, q * quarter), min(angle + width, (q + 1) * quarter)
        s = direction(abs(math.cos(low)), abs(math.sin(low)))
        t = direction(abs(math.cos(high)), abs(math.sin(high)))
        count = look_in_quadrant(scene, view, eye, min(s, t), max(s, t), count)
    return count
