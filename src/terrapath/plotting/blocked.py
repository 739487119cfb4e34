"""Why no path was found: what can be reached from the start and the goal, and what is between."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..problem import Problem
from ..validation import Array, Point
from .terrain import Cells, Terrain

# Steps from each sample to its neighbours, (columns, rows); the others are these backwards.
STEPS = ((1, 0), (0, 1), (1, 1), (1, -1))
# The start and the goal are joined to samples up to so many away.
NEAR = 2
# Reasons that make less than this share of a wall are not named.
LEAST_SHARE = 0.05
START_COLOUR, GOAL_COLOUR, WALL_COLOUR = "#00d0ff", "#ff5a00", "#e4002b"
OPACITY = 0.5

Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Blockage:
    """The free ground of a region in parts, as samples and straight steps between them show it.

    A step that touches an obstacle joins nothing, so no part leaks through a thin wall; a gap that
    is narrower than the samples may not be seen.
    """

    terrain: Terrain

    @property
    def _problem(self) -> Problem:
        return self.terrain.problem

    @cached_property
    def _parts(self) -> Numbers:
        """(samples + 2,): the part that each sample, the start and the goal belong to."""
        count = self.terrain.blocked.size
        ends = [np.concatenate(both) for both in zip(*self._joined(), strict=True)]
        graph = coo_array((np.ones(len(ends[0]), bool), tuple(ends)), (count + 2, count + 2))
        return np.asarray(connected_components(graph, directed=False)[1], np.int64)

    def _joined(self) -> Iterator[tuple[Numbers, Numbers]]:
        """Pairs of samples, the start and the goal that a free step joins, by their numbers."""
        rows, columns = self.terrain.blocked.shape
        number = np.arange(rows * columns).reshape(rows, columns)
        for i, j in STEPS:
            low, high = (slice(0, rows - 1), slice(1, rows)) if j else (slice(0, rows),) * 2
            if j < 0:
                low, high = high, low
            a = number[low, : columns - i].ravel()
            b = number[high, i:].ravel()
            yield self._free(a, b, self._places[a])
        for k, end in enumerate((self._problem.start, self._problem.goal)):
            near = number[self._window(end)].ravel()
            a = np.full(len(near), rows * columns + k)
            yield self._free(a, near, np.broadcast_to(end, (len(near), 2)))

    @cached_property
    def _places(self) -> Array:
        """(samples, 2): where the samples are, map units."""
        return np.stack(np.meshgrid(self.terrain.x, self.terrain.y), axis=-1).reshape(-1, 2)

    def _window(self, end: Point) -> tuple[slice, slice]:
        """The samples around the start or the goal, rows and columns."""
        at = (np.searchsorted(axis, c) for axis, c in zip(self._axes, end[::-1], strict=True))
        rows, columns = (slice(max(k - NEAR, 0), k + NEAR) for k in map(int, at))
        return rows, columns

    @property
    def _axes(self) -> tuple[Array, Array]:
        return self.terrain.y, self.terrain.x

    def _free(self, a: Numbers, b: Numbers, starts: Array) -> tuple[Numbers, Numbers]:
        """Those pairs whose step touches nothing."""
        blocked = np.append(self.terrain.blocked.ravel(), [False, False])
        open_ = ~(blocked[a] | blocked[b])
        a, b, starts = a[open_], b[open_], starts[open_]
        free = self._problem.free_space.segments_are_free(starts, self._places[b])
        return a[free], b[free]

    def _part_of(self, end: int) -> Cells:
        shape = self.terrain.blocked.shape
        return np.asarray((self._parts[:-2] == self._parts[end]).reshape(shape))

    @cached_property
    def from_start(self) -> Cells:
        """(ny, nx): samples that can be reached from the start."""
        return self._part_of(-2)

    @cached_property
    def from_goal(self) -> Cells:
        """(ny, nx): samples that can be reached from the goal."""
        return self._part_of(-1)

    @property
    def is_joined(self) -> bool:
        """Is there a way from the start to the goal, as far as the samples show?"""
        return bool(self._parts[-2] == self._parts[-1])

    @property
    def reached(self) -> Iterator[tuple[Cells, str, str]]:
        """What can be reached from the start, and from the goal: samples, a colour, a name."""
        parts = [("start", self.from_start, START_COLOUR), ("goal", self.from_goal, GOAL_COLOUR)]
        for name, cells, colour in parts[:1] if self.is_joined else parts:
            share = f"{100.0 * cells.mean():.2g} % of the map"
            yield cells, colour, f"can be reached from the {name}, {share}"

    @cached_property
    def shut_in(self) -> Cells:
        """(ny, nx): the ground on the start's side of what is between the start and the goal."""
        # A goal that no sample is joined to is at the nearest one.
        goal = self.from_goal if self.from_goal.any() else self._nearest(self._problem.goal)
        beyond, _ = ndimage.label(~self.from_start | goal)
        return np.asarray(beyond != beyond[goal].max())

    def _nearest(self, end: Point) -> Cells:
        """(ny, nx): the one sample that is nearest to a point."""
        found = np.zeros(self.terrain.blocked.shape, bool)
        found[
            tuple(
                int(np.abs(axis - c).argmin())
                for axis, c in zip(self._axes, end[::-1], strict=True)
            )
        ] = True
        return found

    @cached_property
    def reasons(self) -> dict[str, float]:
        """Of what the wall is made: shares by their names, the largest first."""
        terrain = self.terrain
        wall = ndimage.binary_dilation(self.shut_in, np.ones((3, 3))) & ~self.shut_in
        inside = np.zeros_like(wall)
        inside[1:-1, 1:-1] = True  # the map's edge is no wall
        wall = wall & inside if (wall & inside).any() else wall
        steep = terrain.steep & wall
        solid = terrain.solid & wall & ~steep
        other = terrain.blocked & wall & ~steep & ~solid
        thin = wall & ~terrain.blocked
        counted = {
            f"ground steeper than {self._problem.max_slope or 0.0:g}°": steep,
            "obstacles or no data": solid,
            self._margin_in_words: other,
            "thin obstacles": thin,
        }
        whole = max(int(wall.sum()), 1)
        shares = {name: float(cells.sum()) / whole for name, cells in counted.items()}
        named = {name: share for name, share in shares.items() if share >= LEAST_SHARE}
        return dict(sorted(named.items(), key=lambda item: -item[1]))

    @property
    def _margin_in_words(self) -> str:
        """Why ground is blocked that is neither too steep nor in an obstacle."""
        radius = "the vehicle's radius around what blocks"
        area = "the edge of the keep-in area"
        if self._problem.keep_in is None:
            return radius
        return f"{radius}, or {area}" if self._problem.radius else area

    @property
    def in_words(self) -> str:
        """What is between the start and the goal."""
        if self.is_joined:
            return (
                "free ground joins start and goal: more samples or a longer limit may find a path"
            )
        made = ", ".join(
            f"{name} ({100.0 * share:.0f}\u00a0%)" for name, share in self.reasons.items()
        )
        return f"between start and goal: {made}"


def draw_blockage(axes: Any, blockage: Blockage, extent: tuple[float, float, float, float]) -> None:
    """Tint what can be reached from the start and the goal, and draw the wall around the start."""
    from matplotlib.colors import to_rgba

    for cells, colour, label in blockage.reached:
        shown = np.where(cells[..., None], to_rgba(colour, OPACITY), 0.0)
        axes.imshow(shown, extent=extent, origin="lower", zorder=2.7)
        axes.plot([], [], "s", color=colour, alpha=OPACITY, ms=9, label=label)
    terrain, wall = blockage.terrain, blockage.shut_in
    if not blockage.is_joined and wall.any() and not wall.all():
        style = {"levels": [0.5], "colors": WALL_COLOUR, "linewidths": 2.4, "zorder": 3.5}
        axes.contour(terrain.x, terrain.y, wall.astype(np.float64), **style)
        axes.plot([], [], color=WALL_COLOUR, lw=2.4, label="what blocks")
