"""Optimal paths on terrain, with proof.

The names below are the public face; each is imported at its first use, so that
``import terrapath`` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from . import geodesics, metric, scenes
    from .errors import FitError, InputError, MapError, OutsideSurfaceError, TerrapathError
    from .free_space import Circle, FreeSpace
    from .io import LayerSource, read_surface, write_route
    from .metric import chord, curve_length, line_r
    from .planners import RRT, GeodesicTraversal, Progress, RRTStar, plan
    from .plotting import plot_route
    from .problem import Path, Problem, Solution, Status
    from .surface import Layer, Mask, Surface

# Each name of the public face, and the module it lives in.
_HOMES = {
    "FitError": "errors",
    "InputError": "errors",
    "MapError": "errors",
    "OutsideSurfaceError": "errors",
    "TerrapathError": "errors",
    "Circle": "free_space",
    "FreeSpace": "free_space",
    "LayerSource": "io",
    "read_surface": "io",
    "write_route": "io",
    "chord": "metric",
    "curve_length": "metric",
    "line_r": "metric",
    "GeodesicTraversal": "planners",
    "RRT": "planners",
    "RRTStar": "planners",
    "Progress": "planners",
    "plan": "planners",
    "plot_route": "plotting",
    "Path": "problem",
    "Problem": "problem",
    "Solution": "problem",
    "Status": "problem",
    "Layer": "surface",
    "Mask": "surface",
    "Surface": "surface",
}

__all__ = [
    "RRT",
    "Circle",
    "FitError",
    "FreeSpace",
    "GeodesicTraversal",
    "InputError",
    "Layer",
    "LayerSource",
    "MapError",
    "Mask",
    "OutsideSurfaceError",
    "Path",
    "Problem",
    "Progress",
    "RRTStar",
    "Solution",
    "Status",
    "Surface",
    "TerrapathError",
    "__version__",
    "chord",
    "curve_length",
    "geodesics",
    "line_r",
    "metric",
    "plan",
    "plot_route",
    "read_surface",
    "scenes",
    "write_route",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    if name in __all__:
        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
