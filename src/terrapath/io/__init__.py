"""Floor 6: maps and obstacles in, routes and distance fields out.

Each name is imported at its first use: reading maps takes libraries that writing a route does not.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .fields import write_field
    from .maps import LayerSource, read_surface
    from .routes import route_record, write_route
    from .vectors import read_area, read_obstacles
    from .vectors.layers import RepairedWarning, VectorWarning

__all__ = [
    "LayerSource",
    "RepairedWarning",
    "VectorWarning",
    "read_area",
    "read_obstacles",
    "read_surface",
    "route_record",
    "write_field",
    "write_route",
]

# Each name, and the module it lives in.
_HOMES = {
    "LayerSource": "maps",
    "RepairedWarning": "vectors.layers",
    "VectorWarning": "vectors.layers",
    "read_area": "vectors",
    "read_obstacles": "vectors",
    "read_surface": "maps",
    "route_record": "routes",
    "write_field": "fields",
    "write_route": "routes",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
