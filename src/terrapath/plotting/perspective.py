"""The surface in three dimensions, with the path on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.collections import QuadMesh
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import proj3d

from ..problem import Solution
from ..validation import Array
from .labels import label_axes
from .map_view import MARGIN_COLOUR, OBSTACLE_COLOUR, PATH_COLOUR, STEEP_COLOUR
from .terrain import LAYER_COLOURS, Terrain, height_colours

SAMPLES = 180
ELEVATION, AZIMUTH = 42.0, -115.0  # degrees: where the viewer stands
RELIEF = 0.26  # height of the drawn box, as a share of its longer side
SIGHT_STEPS = 240
PATH_POINTS = 1500


class Ground(QuadMesh):
    """Quadrilaterals of a height map in a 3-D view, painted from the farthest to the nearest.

    Rows and columns of a height map that start at the far corner have this order already. So
    nothing is sorted, and matplotlib draws the mesh in one call.
    """

    def __init__(self, terrain: Terrain, colours: Array) -> None:
        x, y = np.meshgrid(terrain.x, terrain.y)
        # x1, x2 and height of the corners (ny, nx), the viewer at the low end of both axes.
        self._corners = np.array([x, y, terrain.values[0]])[:, ::-1, ::-1]
        facecolors = colours[:-1, :-1][::-1, ::-1].reshape(-1, 3)
        style: dict[str, Any] = {"facecolors": facecolors, "antialiased": False, "zorder": 1}
        super().__init__(np.moveaxis(self._corners[:2], 0, -1), **style)

    def do_3d_projection(self) -> float:
        """Compute where the corners are in the picture; the axes call this before they draw."""
        axes: Any = self.axes
        flat = self._corners.reshape(3, -1)
        screen_x, screen_y, depth = proj3d.proj_transform(*flat, axes.get_proj())
        shape = (*self._corners.shape[1:], 2)
        self._coordinates: Array = np.stack([screen_x, screen_y], axis=-1).reshape(shape)
        return float(depth.min())


def _view_direction(box: Array, spread: Array) -> Array:
    """Direction from the surface to the viewer, in data units."""
    elevation, azimuth = np.radians([ELEVATION, AZIMUTH])
    unit = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    return np.asarray(unit * spread / box)


def _is_hidden(
    terrain: Terrain, lifted: Array, towards: Array, lift: float
) -> npt.NDArray[np.bool_]:
    """Which points (m, 3) the surface hides; tested in steps from each point to the viewer."""
    reach = (terrain.values[0].max() - lifted[:, 2].min()) / towards[2]
    steps = np.linspace(0.0, reach, SIGHT_STEPS)[1:, None, None]
    sight = lifted + steps * towards
    over_ground = terrain.problem.bounds.contains(sight[..., :2])
    behind = terrain.drawn_heights(sight[..., 0], sight[..., 1]) > sight[..., 2] + lift
    return np.asarray((over_ground & behind).any(axis=0))


def _draw_path(axes: Any, solution: Solution, terrain: Terrain, box: Array, spread: Array) -> None:
    """Draw the path: a strong line where it is visible, a faint dotted one where it is hidden."""
    if solution.path is None:
        return
    profile = solution.path.profile
    lift = 0.008 * float(spread[2])
    lifted = np.column_stack([profile.points, profile.values[:, 0] + lift])
    # More points would not be visible, and each point is tested for whether it is hidden.
    lifted = lifted[np.linspace(0, len(lifted) - 1, min(len(lifted), PATH_POINTS)).astype(int)]
    hidden = _is_hidden(terrain, lifted, _view_direction(box, spread), lift)
    shown, behind = lifted.copy(), lifted.copy()
    shown[hidden] = np.nan
    behind[~hidden] = np.nan
    axes.plot(*behind.T, color=PATH_COLOUR, lw=1.2, ls=":", zorder=10)
    axes.plot(*shown.T, color="white", lw=4.0, zorder=11)
    axes.plot(*shown.T, color=PATH_COLOUR, lw=2.2, zorder=12)
    for end, marker, colour, size in ((0, "o", "#0b6e4f", 8), (-1, "*", "#ffb000", 14)):
        style = {"markeredgecolor": "white", "zorder": 13}
        axes.plot(*lifted[end][:, None], marker, color=colour, ms=size, **style)


def draw_perspective(axes: Any, solution: Solution) -> None:
    """Draw the surface on 3-D axes, coloured by the second layer where there is one.

    Flat ground with cost layers is coloured by its costs.
    """
    problem = solution.problem
    terrain = Terrain.sample(problem, SAMPLES)
    layer = 1 if len(terrain.values) > 1 else 0
    is_flat = layer == 0 and not np.ptp(terrain.values[0])
    by_cost = is_flat and terrain.costs is not None
    colours = terrain.shaded_costs() if by_cost else terrain.shaded(layer)
    _tint(colours, terrain.blocked, MARGIN_COLOUR)
    _tint(colours, terrain.steep, STEEP_COLOUR)
    _tint(colours, terrain.solid, OBSTACLE_COLOUR)
    axes.set_proj_type("ortho")
    axes.computed_zorder = False
    axes.add_collection(Ground(terrain, colours), autolim=False)
    bounds = problem.bounds
    longer = max(bounds.width, bounds.height)
    box = np.array([bounds.width / longer, bounds.height / longer, RELIEF])
    low, high = float(terrain.values[0].min()), float(terrain.values[0].max())
    high = high if high > low else low + 1.0
    axes.set(xlim=(bounds.x1_min, bounds.x1_max), ylim=(bounds.x2_min, bounds.x2_max))
    axes.set_zlim(low, high)
    axes.margins(0.0)
    axes.set_box_aspect(box, zoom=1.15)
    axes.view_init(elev=ELEVATION, azim=AZIMUTH)
    _draw_path(axes, solution, terrain, box, np.array([bounds.width, bounds.height, high - low]))
    label_axes(axes, problem)
    # The label is above the corner of its axis: beside it are the numbers and the picture's edge.
    above = high + 0.25 * (high - low)
    axes.text(bounds.x1_min, bounds.x2_max, above, terrain.label(0), ha="center", va="bottom")
    axes.zaxis.set_major_locator(MaxNLocator(4))
    cmap = height_colours() if layer == 0 else colormaps[LAYER_COLOURS]
    if layer == 1:
        scale = ScalarMappable(terrain.norm(layer), cmap)
        axes.figure.colorbar(scale, ax=axes, label=terrain.label(layer), shrink=0.6, pad=0.08)
    exaggeration = RELIEF * longer / (high - low)
    if problem.surface.unit == problem.surface.layers[0].unit and exaggeration > 1.05:
        axes.text2D(
            0.02,
            0.95,
            f"heights exaggerated {exaggeration:.1f} times",
            transform=axes.transAxes,
            size=8,
        )


def _tint(colours: Array, cells: npt.NDArray[np.bool_], tone: tuple[float, ...]) -> None:
    """Put a translucent colour over some cells of the ground."""
    *tint, opacity = tone
    colours[cells] = (1.0 - opacity) * colours[cells] + opacity * np.array(tint)
