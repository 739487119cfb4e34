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
    from .bounding import lower_bound
    from .certificate import Certificate
    from .distinct_routes import alternatives
    from .eikonal import DistanceField, distance_field
    from .errors import (
        CertificateError,
        FitError,
        InputError,
        MapError,
        MissingExtraError,
        OutsideSurfaceError,
        TerrapathError,
    )
    from .free_space import Circle, FreeSpace
    from .io import (
        LayerSource,
        RepairedWarning,
        VectorWarning,
        read_area,
        read_obstacles,
        read_surface,
        write_field,
        write_route,
    )
    from .lattice import Lattice
    from .metric import chord, curve_length, line_r
    from .planners import (
        RRT,
        AStar,
        Dijkstra,
        FastMarching,
        GeodesicTraversal,
        Optimal,
        Progress,
        RRTStar,
        plan,
    )
    from .plotting import plot_field, plot_page, plot_profile, plot_route
    from .problem import Path, Problem, Solution, Status
    from .refinement import refine
    from .surface import Layer, Mask, Surface

# Each name of the public face, and the module it lives in.
_HOMES = {
    "alternatives": "distinct_routes",
    "lower_bound": "bounding",
    "Certificate": "certificate",
    "DistanceField": "eikonal",
    "distance_field": "eikonal",
    "CertificateError": "errors",
    "FitError": "errors",
    "InputError": "errors",
    "MapError": "errors",
    "MissingExtraError": "errors",
    "OutsideSurfaceError": "errors",
    "TerrapathError": "errors",
    "Circle": "free_space",
    "FreeSpace": "free_space",
    "LayerSource": "io",
    "RepairedWarning": "io",
    "VectorWarning": "io",
    "read_area": "io",
    "read_obstacles": "io",
    "read_surface": "io",
    "write_field": "io",
    "write_route": "io",
    "Lattice": "lattice",
    "chord": "metric",
    "curve_length": "metric",
    "line_r": "metric",
    "AStar": "planners",
    "Dijkstra": "planners",
    "FastMarching": "planners",
    "GeodesicTraversal": "planners",
    "Optimal": "planners",
    "RRT": "planners",
    "RRTStar": "planners",
    "Progress": "planners",
    "plan": "planners",
    "plot_field": "plotting",
    "plot_page": "plotting",
    "plot_profile": "plotting",
    "plot_route": "plotting",
    "Path": "problem",
    "Problem": "problem",
    "Solution": "problem",
    "Status": "problem",
    "refine": "refinement",
    "Layer": "surface",
    "Mask": "surface",
    "Surface": "surface",
}

__all__ = [
    "RRT",
    "AStar",
    "Certificate",
    "CertificateError",
    "Circle",
    "Dijkstra",
    "DistanceField",
    "FastMarching",
    "FitError",
    "FreeSpace",
    "GeodesicTraversal",
    "InputError",
    "Lattice",
    "Layer",
    "LayerSource",
    "MapError",
    "Mask",
    "MissingExtraError",
    "Optimal",
    "OutsideSurfaceError",
    "Path",
    "Problem",
    "Progress",
    "RRTStar",
    "RepairedWarning",
    "Solution",
    "Status",
    "Surface",
    "TerrapathError",
    "VectorWarning",
    "__version__",
    "alternatives",
    "chord",
    "curve_length",
    "distance_field",
    "geodesics",
    "line_r",
    "lower_bound",
    "metric",
    "plan",
    "plot_field",
    "plot_page",
    "plot_profile",
    "plot_route",
    "read_area",
    "read_obstacles",
    "read_surface",
    "refine",
    "scenes",
    "write_field",
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
